"""Sizes and parts of transition networks: the Recurrent Transition Network (papers/001 section 4), its rivals
and what is left of it without a part.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from nsm_core.model.transitions.layout import OFFSET, PATCH, POSE, TARGET

from .gap_config import GapConfig, Shapes

INITIAL = ("first_frame", "common", "zero")  # what the recurrent layer begins with


@dataclass(frozen=True)
class TransitionConfig(GapConfig):
    """The whole network by default.

    ``encoder`` units of both layers of the frame encoder, 0 for none; ``future`` of those of the target's and
    the offset's, 0 for no future context; ``hidden`` of the recurrent layer; ``decoder`` and
    ``decoder_second`` of the decoder's two, 0 for none.  ``residual``: it tells what is added to the frame
    (equation 13).  ``arrival``: it is told how many frames are left, and trained with noise on what it knows
    of its target, less and less towards it.  ``homing``: what it tells is added to the frame on the straight
    way from here to the target, not to the last one (beyond the paper; it must know when it arrives).
    """

    network: ClassVar[str] = "rtn"
    choices: ClassVar[Mapping[str, tuple[str, ...]]] = {"initial": INITIAL}

    encoder: int = 512
    future: int = 128
    hidden: int = 512
    decoder: int = 256
    decoder_second: int = 128
    residual: bool = True
    initial: str = "first_frame"
    arrival: bool = True
    homing: bool = True

    @property
    def varied(self) -> int:
        """Numbers of the future context, of which a network that is told when it arrives is left unsure."""
        return self.context if self.arrival else 0

    @property
    def seen(self) -> int:
        """Numbers that it is given of a frame: pose and ground."""
        return POSE.size + (PATCH.size if self.terrain else 0)

    @property
    def context(self) -> int:
        """Numbers of the encoded future f_t."""
        return 2 * self.future

    def of_units(self, units: int) -> Self:
        """The same network with so many units in its recurrent layer, the encoders going along; the decoder
        stays as it is: poses that are told through fewer numbers than they have are learnt worse.
        """
        return replace(
            self,
            encoder=units if self.encoder else 0,
            future=units // 4 if self.future else 0,
            hidden=units,
        )

    def parameter_shapes(self) -> Shapes:
        """Names and shapes of all parameters: ``feed``, ``recur`` and ``condition`` are W, U and C of
        equations 5 to 8, the gates in the order in, forget, new, out.
        """
        h = self.hidden
        shapes = _chain("encode", (self.seen, self.encoder, self.encoder)) if self.encoder else {}
        if self.future:
            shapes |= _chain("target", (TARGET.size, self.future, self.future))
            shapes |= _chain("offset", (OFFSET.size, self.future, self.future))
            shapes |= {"condition.weight": (4 * h, self.context)}
        shapes |= {"feed.weight": (4 * h, self.encoder or self.seen), "feed.bias": (4 * h,)}
        shapes |= {"recur.weight": (4 * h, h)}
        between = (self.decoder, self.decoder_second) if self.decoder else ()
        shapes |= _chain("decode", (h, *between, POSE.size))
        if self.initial == "first_frame":
            shapes |= _chain("initial", (POSE.size, h, 2 * h))
        elif self.initial == "common":
            shapes |= {"common": (2 * h,)}
        return shapes


@dataclass(frozen=True)
class ResLstmConfig(TransitionConfig):
    """F-ResLSTM: one residual recurrent layer, conditioned on the future, without encoder and decoder
    (section 7.1).
    """

    network: ClassVar[str] = "f_reslstm"

    encoder: int = 0
    decoder: int = 0
    initial: str = "zero"


@dataclass(frozen=True)
class ErdConfig(TransitionConfig):
    """F-ERD: encoder, recurrent layer conditioned on the future, decoder; it tells the frame itself
    (section 7.1).
    """

    network: ClassVar[str] = "f_erd"

    residual: bool = False
    homing: bool = False
    initial: str = "zero"


def _chain(name: str, widths: tuple[int, ...]) -> Shapes:
    out: Shapes = {}
    for n, (before, after) in enumerate(zip(widths[:-1], widths[1:], strict=True)):
        out |= {f"{name}.{n}.weight": (after, before), f"{name}.{n}.bias": (after,)}
    return out


__all__ = ["INITIAL", "ErdConfig", "ResLstmConfig", "TransitionConfig"]
