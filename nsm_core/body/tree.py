"""A skeleton as the solver sees it: parents and offsets, of any proportions and any number of joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nsm_core.body.skeleton import OFFSETS, PARENTS
from nsm_core.rotations import Array, quat_mul, quat_rotate


@dataclass(frozen=True, eq=False)
class Tree:
    """``parents`` of J joints, each before its children, the first -1; ``offsets`` (J, 3) from them, metres,
    rest pose.
    """

    parents: tuple[int, ...]
    offsets: Array

    def __post_init__(self) -> None:
        """ValueError where a joint stands before its parent or has no offset."""
        if self.parents[0] != -1 or any(not 0 <= p < j for j, p in enumerate(self.parents) if j):
            raise ValueError("the first joint has no parent, and each other one comes after its own")
        if np.shape(self.offsets) != (len(self.parents), 3):
            raise ValueError(f"{len(self.parents)} joints need as many offsets of 3 numbers")

    @cached_property
    def above(self) -> Array:
        """Which joints move a joint: (J, J), 1 where the second is the first or an ancestor of it."""
        moved = np.eye(len(self.parents))
        for joint, parent in enumerate(self.parents[1:], 1):
            moved[joint] += moved[parent]
        return moved

    @cached_property
    def levels(self) -> list[tuple[Array, Array]]:
        """Joints as many steps from the first as each other, and their parents: computed together."""
        depth = self.above.sum(1).astype(int) - 1
        joints = [np.flatnonzero(depth == d) for d in range(1, depth.max() + 1)]
        return [(j, np.array(self.parents)[j]) for j in joints]

    def forward(self, hips: Array, local: Array) -> tuple[Array, Array]:
        """World positions (T, J, 3) and rotations (T, J, 4) of poses: hips (T, 3), local rotations
        (T, J, 4).
        """
        positions, world = np.empty((*local.shape[:-1], 3)), local.astype(np.float64)
        positions[..., 0, :] = hips
        for joints, parents in self.levels:
            world[..., joints, :] = quat_mul(world[..., parents, :], world[..., joints, :])
        bones = quat_rotate(world[..., np.array(self.parents[1:]), :], self.offsets[1:].astype(np.float64))
        for joints, parents in self.levels:
            positions[..., joints, :] = positions[..., parents, :] + bones[..., joints - 1, :]
        return positions, world


HUMAN = Tree(PARENTS, OFFSETS.astype(np.float64))
