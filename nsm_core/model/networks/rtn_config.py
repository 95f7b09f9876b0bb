"""Sizes and parts of transition networks: the Recurrent Transition Network (papers/001 section 4), its rivals
and what is left of it without a part.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import Any, ClassVar, Self

import numpy as np

from nsm_core.errors import WeightsError
from nsm_core.model.transitions.layout import OFFSET, PATCH, POSE, TARGET
from nsm_core.rotations import Array
from nsm_core.validate import shown

INITIAL = ("first_frame", "common", "zero")  # what the recurrent layer begins with
Shapes = dict[str, tuple[int, ...]]
# Frames to the target up to which nothing is left open, and from which on all of it is (scheduled noise).
CERTAIN, OPEN = 5, 30
NOISE = 0.5  # deviation of that noise, in units of the target's encoding
LONGEST = 100  # frames to the target from which on its embedding stays as it is


@dataclass(frozen=True)
class TransitionConfig:
    """The whole network by default.

    ``encoder`` units of both layers of the frame encoder, 0 for none; ``future`` of those of the target's and
    the offset's, 0 for no future context; ``hidden`` of the recurrent layer; ``decoder`` and
    ``decoder_second`` of the decoder's two, 0 for none.  ``residual``: it tells what is added to the frame
    (equation 13).  ``terrain``: it sees the ground.  ``arrival``: it is told how many frames are left, and
    trained with noise on what it knows of its target, less and less towards it.  ``homing``: what it tells is
    added to the frame on the straight way from here to the target, not to the last one (beyond the paper; it
    must know when it arrives).  ``faced``: gaps are turned
    so that the character faces as it stands in the rest pose, where the paper turns each by chance.
    """

    network: ClassVar[str] = "rtn"

    encoder: int = 512
    future: int = 128
    hidden: int = 512
    decoder: int = 256
    decoder_second: int = 128
    residual: bool = True
    initial: str = "first_frame"
    terrain: bool = True
    arrival: bool = True
    homing: bool = True
    faced: bool = True

    @property
    def seen(self) -> int:
        """Numbers that it is given of a frame: pose and ground."""
        return POSE.size + (PATCH.size if self.terrain else 0)

    @property
    def context(self) -> int:
        """Numbers of the encoded future f_t."""
        return 2 * self.future

    def of_units(self, units: int) -> Self:
        """The same network with so many units in its recurrent layer, the others going along."""
        return replace(
            self,
            encoder=units if self.encoder else 0,
            future=units // 4 if self.future else 0,
            hidden=units,
            decoder=units // 2 if self.decoder else 0,
            decoder_second=units // 4 if self.decoder else 0,
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

    def shapes(self) -> Shapes:
        """Names and shapes of all parameters and statistics."""
        sizes = {"pose": POSE.size, "velocity": TARGET.width("velocity"), "offset": OFFSET.size}
        sizes["patch"] = PATCH.size
        return self.parameter_shapes() | {
            f"{name}_{kind}": (size,) for name, size in sizes.items() for kind in ("mean", "std")
        }

    def to_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> TransitionConfig:
        """Read back what ``to_dict`` wrote; WeightsError on values that no network has."""
        known = {}
        for field in fields(cls):
            value = values.get(field.name, field.default)
            sound = type(value) is type(field.default)
            if field.name == "initial":
                sound = sound and value in INITIAL
            elif isinstance(field.default, int) and not isinstance(field.default, bool):
                sound = sound and 0 <= value <= 100_000
            if not sound:
                raise WeightsError(
                    f"The weights file says {shown(value)} of '{field.name}', which no network has; copy or "
                    "train it again."
                )
            known[field.name] = value
        return cls(**known)


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


TRANSITIONS = {kind.network: kind for kind in (TransitionConfig, ResLstmConfig, ErdConfig)}


def transition_config(name: Any, holder: object = "The weights file") -> type[TransitionConfig]:
    """Sizes of the network of that name; WeightsError on a name that is none."""
    if not isinstance(name, str) or name not in TRANSITIONS:
        raise WeightsError(
            f"{holder} holds a network called {shown(name)}, and transitions are filled by "
            f"{', '.join(TRANSITIONS)}; update the program or choose other weights."
        )
    return TRANSITIONS[name]


def arrival_embedding(left: Array, size: int) -> Array:
    """Embedding (..., size) float32 of how many frames (...) are left: sines and cosines of frequencies from
    one a frame to next to none.
    """
    rates = 10000.0 ** (-np.arange(0, size, 2) / size)
    angle = np.minimum(left, LONGEST)[..., None] * rates
    return np.concatenate((np.sin(angle), np.cos(angle)), axis=-1).astype(np.float32)


def openness(left: Array) -> Array:
    """Share (...) of the noise that is on the target so many frames before it."""
    return np.clip((left - CERTAIN) / (OPEN - CERTAIN), 0.0, 1.0).astype(np.float32)


def _chain(name: str, widths: tuple[int, ...]) -> Shapes:
    out: Shapes = {}
    for n, (before, after) in enumerate(zip(widths[:-1], widths[1:], strict=True)):
        out |= {f"{name}.{n}.weight": (after, before), f"{name}.{n}.bias": (after,)}
    return out


__all__ = ["INITIAL", "TRANSITIONS", "ErdConfig", "ResLstmConfig", "TransitionConfig", "arrival_embedding",
           "openness", "transition_config"]  # fmt: skip
