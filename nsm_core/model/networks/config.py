"""Sizes of any network, readable without torch: widths of features from the layout, memory and arrays from
the network.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import Any, ClassVar, Self

import numpy as np

from nsm_core.model.features.layout import GATING, INPUT, OUTPUT, Inputs
from nsm_core.rotations import Array

STATISTICS = ("input_mean", "input_std", "gating_mean", "gating_std", "output_mean", "output_std")
COUNTS = ("experts",)  # fields that count parts and are no widths
Memory = dict[str, Array]  # what a network remembers, by name, (B, size) each; a row is a character


@dataclass(frozen=True)
class NetworkConfig:
    """Widths that every network has; what one network has of its own are fields of a subclass.

    Whole numbers are widths, fractions shares (0..1), as the check of weights files takes them.
    """

    network: ClassVar[str]  # its name in the registry and in weights files
    # Share of a roll-out's frames in training at which it is put back onto the data (teacher forcing).
    teacher: ClassVar[float] = 0.0

    frame: int = INPUT.width("frame")
    goal: int = INPUT.width("goal")
    environment: int = INPUT.width("environment")
    interaction: int = INPUT.width("interaction")
    gating: int = GATING.size
    outputs: int = OUTPUT.size

    @property
    def parts(self) -> tuple[int, int, int, int]:
        """Widths of the input's four parts, in order: frame, goal, environment, interaction."""
        return self.frame, self.goal, self.environment, self.interaction

    @property
    def inputs(self) -> int:
        """Width of the input vector X."""
        return sum(self.parts)

    @property
    def widths(self) -> tuple[int, ...]:
        """Widths that the feature layout settles: the input's parts, gating and outputs."""
        return (*self.parts, self.gating, self.outputs)

    @property
    def memory_sizes(self) -> dict[str, int]:
        """Numbers a character that the network remembers from frame to frame, by name; nothing without
        memory.
        """
        return {}

    @property
    def info_sizes(self) -> dict[str, int]:
        """Numbers a character that a step tells of itself, by name; "experts" are coefficients that add up to
        one.
        """
        return {}

    def narrowed(self, share: float) -> Self:
        """The same network with hidden layers and encodings of this share (0 to 1) of their widths; what it
        reads and tells, and how many experts it blends, stay.
        """
        layout = {f.name for f in fields(NetworkConfig)}
        own = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in layout}
        widths = {
            name: max(1, round(share * value))
            for name, value in own.items()
            if isinstance(value, int) and name not in COUNTS
        }
        return replace(self, **widths)

    def parameter_shapes(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of all parameters, as in the module's state and in weights files."""
        raise NotImplementedError

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of all parameters and statistics."""
        sizes = {"input": self.inputs, "gating": self.gating, "output": self.outputs}
        return self.parameter_shapes() | {name: (sizes[name.partition("_")[0]],) for name in STATISTICS}

    def start(self, batch: int) -> Memory:
        """Memory of ``batch`` characters before their first frame: zeros."""
        return {name: np.zeros((batch, size), np.float32) for name, size in self.memory_sizes.items()}

    def checked(self, inputs: Inputs[Array], memory: Memory) -> Inputs[Array]:
        """Inputs as contiguous float32; ValueError where they or the memory are of other shapes than the
        network's.
        """
        x, gating = (np.ascontiguousarray(v, dtype=np.float32) for v in inputs)
        if x.ndim != 2 or x.shape[1] != self.inputs or gating.shape != (len(x), self.gating):
            raise ValueError(
                f"step needs features (B, {self.inputs}) and gating (B, {self.gating}), got {x.shape} and "
                f"{gating.shape}"
            )
        needed, given = (
            {n: (len(x), s) for n, s in self.memory_sizes.items()},
            {n: v.shape for n, v in memory.items()},
        )
        if given != needed:
            raise ValueError(f"step needs the memory {needed} that start or the last step gave, got {given}")
        return Inputs(x, gating)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> NetworkConfig:
        """Read back what ``to_dict`` wrote; unknown keys are ignored."""
        known = {f.name for f in fields(cls)}
        return cls(**{k: v for k, v in values.items() if k in known})
