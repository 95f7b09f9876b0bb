"""The one place that names every slice of the network's input, gating and output vectors."""

from __future__ import annotations

from typing import Generic, NamedTuple, TypeVar

import numpy as np

from nsm_core.body.skeleton import J
from nsm_core.conventions import CONTACTS, GOAL_ACTIONS, STYLES
from nsm_core.rotations import Array

from .state import FUTURE, KEYS

ENVIRONMENT = 1408
CELLS = 512
_S, _A = len(STYLES), len(GOAL_ACTIONS)
T = TypeVar("T")


class Inputs(NamedTuple, Generic[T]):
    """What a network is given of a frame, as arrays or tensors: ``INPUT`` (B, 4018), and ``GATING`` (B, 650)
    for networks that gate.
    """

    features: T
    gating: T


class Layout:
    """Named consecutive blocks of one vector."""

    def __init__(self, **shapes: tuple[int, ...]) -> None:
        self.shapes = shapes
        self.slices: dict[str, slice] = {}
        start = 0
        for name, shape in shapes.items():
            size = int(np.prod(shape))
            self.slices[name] = slice(start, start + size)
            start += size
        self.size = start

    def width(self, name: str) -> int:
        """Numbers that block ``name`` has in the vector."""
        return self.slices[name].stop - self.slices[name].start

    def pack(self, **blocks: Array) -> Array:
        """Put blocks (B, *shape) into one vector (B, size), float32."""
        batch = len(next(iter(blocks.values())))
        out = np.empty((batch, self.size), dtype=np.float32)
        for name in self.shapes:
            out[:, self.slices[name]] = blocks[name].reshape(batch, -1)
        return out

    def get(self, vector: Array, name: str) -> Array:
        """View of block ``name`` (B, *shape) of a vector (B, size)."""
        return vector[:, self.slices[name]].reshape((len(vector), *self.shapes[name]))


_POSE = {"joint_position": (J, 3), "joint_forward": (J, 3), "joint_up": (J, 3), "joint_velocity": (J, 3)}
_GOAL = {"goal_position": (KEYS, 3), "goal_direction": (KEYS, 2), "goal_action": (KEYS, _A)}
_AHEAD = FUTURE + 1  # the pivot and the six keys ahead
FRAME = Layout(
    **_POSE, trajectory_position=(KEYS, 2), trajectory_direction=(KEYS, 2), trajectory_style=(KEYS, _S)
)
GOAL = Layout(**_GOAL)
INTERACTION = Layout(cell_position=(CELLS, 3), cell_occupancy=(CELLS,))
INPUT = Layout(
    frame=(FRAME.size,), goal=(GOAL.size,), environment=(ENVIRONMENT,), interaction=(INTERACTION.size,)
)
GATING = Layout(per_key=(KEYS, 2 * _S + 6 * _A))
OUTPUT = Layout(
    **_POSE,
    future_joint_position=(J, 3),
    trajectory_position=(_AHEAD, 2),
    trajectory_direction=(_AHEAD, 2),
    trajectory_style=(_AHEAD, _S),
    goalward_position=(_AHEAD, 2),
    goalward_direction=(_AHEAD, 2),
    **_GOAL,
    contact=(len(CONTACTS),),
    phase_update=(_AHEAD,),
)


def layout_description() -> dict[str, dict[str, list[int]]]:
    """Names and shapes of all blocks, for the metadata of weights."""
    named = {
        "frame": FRAME,
        "goal": GOAL,
        "interaction": INTERACTION,
        "input": INPUT,
        "gating": GATING,
        "output": OUTPUT,
    }
    return {k: {n: list(s) for n, s in v.shapes.items()} for k, v in named.items()}
