"""What all networks that fill gaps have: what they are shown, how far away their target is, how their sizes
are kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np

from nsm_core.model.transitions.layout import OFFSET, PATCH, POSE, TARGET
from nsm_core.rotations import Array

from .sizes import LARGEST, no_network_has

Shapes = dict[str, tuple[int, ...]]
# Frames to the target up to which nothing is left open, and from which on all of it is (scheduled noise).
CERTAIN, OPEN = 5, 30
NOISE = 0.5  # deviation of that noise, in units of the target's encoding
LONGEST = 100  # frames from which on an embedding of so many stays as it is


@dataclass(frozen=True)
class GapConfig:
    """``terrain``: it sees the ground.  ``faced``: gaps are turned so that the character faces as it stands
    in the rest pose, where the paper turns each by chance.
    """

    network: ClassVar[str]
    choices: ClassVar[Mapping[str, tuple[str, ...]]] = {}  # of fields that are words

    terrain: bool = True
    faced: bool = True

    @property
    def varied(self) -> int:
        """Numbers that noise is added to, in training a little, and where a variation is asked for; 0 of a
        network that has none.
        """
        raise NotImplementedError

    def of_units(self, units: int) -> Self:
        """The same network about as large as a recurrent one with so many units."""
        raise NotImplementedError

    def parameter_shapes(self) -> Shapes:
        """Names and shapes of all parameters."""
        raise NotImplementedError

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
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """Read back what ``to_dict`` wrote; WeightsError on values that no network has."""
        known = {}
        for field in fields(cls):
            value = values.get(field.name, field.default)
            sound = type(value) is type(field.default)
            if field.name in cls.choices:
                sound = sound and value in cls.choices[field.name]
            elif isinstance(field.default, int) and not isinstance(field.default, bool):
                sound = sound and 0 <= value <= LARGEST
            if not sound:
                raise no_network_has(field.name, value)
            known[field.name] = value
        return cls(**known)


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


__all__ = ["LONGEST", "NOISE", "GapConfig", "Shapes", "arrival_embedding", "openness"]
