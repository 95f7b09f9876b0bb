"""Whole-body inverse kinematics of whole takes: tasks are met and limits kept by the least change of the
motion.

A damped Gauss-Newton in the dual form, batched over frames.  In every round all frames are linearised, each
takes the least step (by the joints' stiffness) that meets its tasks, and the steps are smoothed over time
before they are taken: so what a task or a limit asks of one frame its neighbours come and go with, and no
correction appears within a frame.  Each round smooths less; what smoothing has taken from a step the next
round asks for again.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from nsm_core.body.tree import Tree
from nsm_core.rotations import Array, quat_conjugate, quat_from_rotvec, quat_mul, quat_rotate
from nsm_core.signals import gaussian_smooth

ROUNDS = (4.0, 3.0, 3.0, 2.0, 1.5, 1.0)  # frames by which steps are smoothed, round by round
MOST_TURN, MOST_SHIFT = 0.35, 0.12  # radians and metres of one step
AT_ONCE = 48  # frames that are worked on at a time: their numbers stay near the processor
MOST_AWAY = 0.18  # metres that hips leave the motion by
_OFF = 1e4  # deviation of rows that ask for nothing


@dataclass
class Rows:
    """R wishes of every frame, linear in its pose: ``error`` (T, R) that a step is to take away,
    ``deviation`` (T, R) that may be left of it (standard deviation, the same unit), ``jacobian`` (T, R, 3 + 3
    J).
    """

    error: Array
    deviation: Array
    jacobian: Array


@dataclass
class Pose:
    """A motion while it is solved: hips (T, 3), local rotations (T, J, 4), and what follows from them."""

    tree: Tree
    hips: Array
    local: Array
    positions: Array = field(init=False)
    world: Array = field(init=False)

    def __post_init__(self) -> None:
        self.positions, self.world = self.tree.forward(self.hips, self.local)

    def part(self, span: slice | Array) -> Pose:
        """Some of its frames."""
        part = Pose.__new__(Pose)
        part.tree, part.hips, part.local = self.tree, self.hips[span], self.local[span]
        part.positions, part.world = self.positions[span], self.world[span]
        return part

    @property
    def above(self) -> Array:
        """World rotations (T, J, 4) of the joints' parents."""
        out = np.empty_like(self.world)
        out[:, 0] = (1, 0, 0, 0)
        out[:, 1:] = self.world[:, np.array(self.tree.parents[1:])]
        return out

    def moved(self, step: Array) -> Pose:
        """The motion after a step (T, 3 + 3 J): of the hips, metres, and of each joint, world
        rotation vectors.
        """
        turns = quat_from_rotvec(step[:, 3:].reshape(len(step), -1, 3))
        above = self.above
        local = quat_mul(quat_mul(quat_conjugate(above), quat_mul(turns, above)), self.local)
        local /= np.linalg.norm(local, axis=-1, keepdims=True)
        return Pose(self.tree, self.hips + step[:, :3], local)

    def of_points(self, points: Array, moved: Array, ways: Array) -> Array:
        """Jacobian (T, R, 3 + 3 J) of how far ``points`` (T, R, 3) move along unit ``ways`` (T, R, 3).

        ``moved`` (R, J) or (T, R, J) tells the share of each joint's turn that moves a point.
        """
        arms = points[:, :, None] - self.positions[:, None]  # (T, R, J, 3)
        x, y, z = arms[..., 0], arms[..., 1], arms[..., 2]
        a, b, c = ways[..., 0, None], ways[..., 1, None], ways[..., 2, None]
        out = np.empty((*points.shape[:2], 1 + len(self.tree.parents), 3))
        out[..., 0, :] = ways
        out[..., 1:, 0] = moved * (y * c - z * b)
        out[..., 1:, 1] = moved * (z * a - x * c)
        out[..., 1:, 2] = moved * (x * b - y * a)
        return out.reshape(*points.shape[:2], -1)


class Task(Protocol):
    """Anything that wishes something of every frame of a motion."""

    def rows(self, pose: Pose, span: slice) -> Rows:
        """Its wishes of the frames ``span``, linearised at ``pose``, which holds those frames alone."""
        ...


@dataclass(frozen=True)
class Stiffness:
    """How unwillingly a pose changes: standard deviations of a step.

    ``hips`` (3,) metres along x, y and z; ``turns`` (J,) radians of each joint; ``hinges`` by joint: the axis
    (3,), in the joint's own frame, about which it turns at that, and the radians by which it turns about
    others.
    """

    hips: Array
    turns: Array
    hinges: dict[int, tuple[Array, float]]

    def apply(self, pose: Pose, jacobian: Array) -> Array:
        """Jacobian (T, R, 3 + 3 J) times the covariance of a step."""
        out = jacobian * np.concatenate((self.hips**2, np.repeat(self.turns**2, 3)))
        for joint, (axis, other) in self.hinges.items():
            span = slice(3 + 3 * joint, 6 + 3 * joint)
            hinge = quat_rotate(pose.world[:, joint], np.broadcast_to(axis, pose.hips.shape))[:, None]
            along = (jacobian[..., span] * hinge).sum(-1, keepdims=True) * hinge
            out[..., span] = other**2 * (jacobian[..., span] - along) + self.turns[joint] ** 2 * along
        return out


def solve(
    pose: Pose,
    tasks: Sequence[Task],
    stiffness: Stiffness,
    rounds: Sequence[float] = ROUNDS,
    most_away: float = MOST_AWAY,
) -> Generator[None, None, Pose]:
    """Return the motion that meets ``tasks`` with the least change; yields often.

    ``rounds`` are the frames by which each smooths its steps; hips go no more than ``most_away`` metres.
    """
    start, count = pose.hips, len(pose.hips)
    for smooth in rounds:
        steps = []
        for first in range(0, count, AT_ONCE):
            span = slice(first, min(first + AT_ONCE, count))
            part = pose.part(span)
            steps.append(least_step(part, [task.rows(part, span) for task in tasks], stiffness))
            yield
        step = np.concatenate(steps)
        if smooth:
            step = gaussian_smooth(step, smooth)
        # What a limb cannot do the hips do, but not without end.
        away = pose.hips + step[:, :3] - start
        size = np.linalg.norm(away, axis=1, keepdims=True)
        step[:, :3] -= away * (1 - np.minimum(1, most_away / np.maximum(size, 1e-9)))
        pose = pose.moved(step)
        yield
    return pose


def least_step(pose: Pose, rows: Sequence[Rows], stiffness: Stiffness) -> Array:
    """The least step (T, 3 + 3 J) by ``stiffness`` that takes the rows' errors away: C J' (J C J' +
    R)^-1 e.
    """
    jacobian = np.concatenate([r.jacobian for r in rows], axis=1)
    error = np.concatenate([r.error for r in rows], axis=1)
    deviation = np.concatenate([r.deviation for r in rows], axis=1)
    weighed = stiffness.apply(pose, jacobian)
    square = weighed @ np.swapaxes(jacobian, 1, 2)
    index = np.arange(square.shape[1])
    square[:, index, index] += np.minimum(deviation, _OFF) ** 2
    step = (np.swapaxes(weighed, 1, 2) @ np.linalg.solve(square, error[..., None]))[..., 0]
    turns = step[:, 3:].reshape(len(step), -1, 3)
    turns *= np.minimum(1, MOST_TURN / np.maximum(np.linalg.norm(turns, axis=-1, keepdims=True), 1e-9))
    shift = step[:, :3]
    shift *= np.minimum(1, MOST_SHIFT / np.maximum(np.linalg.norm(shift, axis=-1, keepdims=True), 1e-9))
    return step


def solved(
    pose: Pose,
    tasks: Sequence[Task],
    stiffness: Stiffness,
    rounds: Sequence[float] = ROUNDS,
    most_away: float = MOST_AWAY,
) -> Pose:
    """``solve`` in one go."""
    work = solve(pose, tasks, stiffness, rounds, most_away)
    while True:
        try:
            next(work)
        except StopIteration as done:
            return done.value


__all__ = ["ROUNDS", "Pose", "Rows", "Stiffness", "Task", "least_step", "solve", "solved"]
