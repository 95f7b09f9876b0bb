"""Sizes of a transformer that tells all missing frames at once, as what is added to interpolation: a rival of
the recurrent networks, after the delta-interpolator of Oreshkin and others (2022).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

from nsm_core.model.transitions.layout import FRAME, PATCH, POSE

from .gap_config import LONGEST, GapConfig, Shapes
from .sizes import no_network_has


@dataclass(frozen=True)
class DeltaConfig(GapConfig):
    """``width`` numbers for each frame, ``layers`` of attention by ``heads``, each with ``feed`` times as
    many numbers in its feed-forward part.
    """

    network: ClassVar[str] = "delta"

    width: int = 384
    layers: int = 3
    heads: int = 6
    feed: int = 2

    @property
    def seen(self) -> int:
        """Numbers that it is given of a frame: how it is and moves, where, and its ground."""
        return FRAME.size + (PATCH.size if self.terrain else 0)

    @property
    def varied(self) -> int:
        """Numbers of a frame, as it is read."""
        return self.width

    def of_units(self, units: int) -> Self:
        """Three quarters as wide as a recurrent layer; a multiple of what all heads share evenly."""
        step = 4 * self.heads
        return replace(self, width=max(step, 3 * units // 4 // step * step))

    def parameter_shapes(self) -> Shapes:
        """Names and shapes of all parameters: of layer n ``ask`` (queries, keys, values), ``near`` (what is
        added to attention by the frames from one to the other), ``answer``, and the feed-forward part's
        ``widen`` and ``narrow``, ``before`` and ``after`` standing before attention and before that.
        """
        w, wide = self.width, self.feed * self.width
        shapes = _dense("read", self.seen, w)
        for n in range(self.layers):
            layer = f"layers.{n}"
            shapes |= _scaled(f"{layer}.before", w) | _dense(f"{layer}.ask", w, 3 * w)
            shapes |= {f"{layer}.near": (self.heads, 2 * LONGEST + 1)} | _dense(f"{layer}.answer", w, w)
            shapes |= _scaled(f"{layer}.after", w)
            shapes |= _dense(f"{layer}.widen", w, wide) | _dense(f"{layer}.narrow", wide, w)
        return shapes | _scaled("last", w) | _dense("tell", w, POSE.size)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """As ``GapConfig.from_dict``; WeightsError also on widths that heads do not share evenly."""
        config = super().from_dict(values)
        for name in ("width", "layers", "heads", "feed"):
            if getattr(config, name) < 1:
                raise no_network_has(name, getattr(config, name))
        if config.width % (4 * config.heads):
            raise no_network_has("width", config.width)
        return config


def _dense(name: str, before: int, after: int) -> Shapes:
    return {f"{name}.weight": (after, before), f"{name}.bias": (after,)}


def _scaled(name: str, width: int) -> Shapes:
    return {f"{name}.weight": (width,), f"{name}.bias": (width,)}


__all__ = ["DeltaConfig"]
