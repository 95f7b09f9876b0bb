"""What a motion may be asked for: points at places, joints turned as told, places within a limb's reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.rotations import Array, quat_conjugate, quat_mul, quat_rotate, quat_to_rotvec

from .solver import Pose, Rows

_WAYS = np.eye(3)


@dataclass
class PointTask:
    """Hold a point of a joint, ``offset`` (3,) in its frame, at ``target`` (T, 3), world.

    ``deviation`` (T,) or (T, 3) metres that may be left; infinite where nothing is asked.
    """

    joint: int
    target: Array
    deviation: Array
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def rows(self, pose: Pose, span: slice) -> Rows:
        point = pose.positions[:, self.joint]
        if any(self.offset):
            point = point + quat_rotate(pose.world[:, self.joint], np.broadcast_to(self.offset, point.shape))
        count = len(point)
        points, ways = np.repeat(point[:, None], 3, 1), np.broadcast_to(_WAYS, (count, 3, 3))
        moved = pose.tree.above[self.joint]
        deviation = np.broadcast_to(self.deviation[span].reshape(count, -1), (count, 3))
        error = np.where(np.isfinite(deviation), self.target[span] - point, 0.0)
        return Rows(error, deviation, pose.of_points(points, moved, ways))


@dataclass
class TurnTask:
    """Hold the world rotation of a joint at ``target`` (T, 4); ``deviation`` (T,) radians."""

    joint: int
    target: Array
    deviation: Array

    def rows(self, pose: Pose, span: slice) -> Rows:
        count, joints = len(pose.hips), len(pose.tree.parents)
        gap = quat_to_rotvec(quat_mul(self.target[span], quat_conjugate(pose.world[:, self.joint])))
        deviation = np.broadcast_to(self.deviation[span, None], (count, 3))
        jacobian = np.zeros((3, 1 + joints, 3))
        jacobian[:, 1:] = pose.tree.above[self.joint][None, :, None] * _WAYS[:, None]
        jacobian = np.broadcast_to(jacobian.reshape(3, -1), (count, 3, 3 + 3 * joints))
        return Rows(np.where(np.isfinite(deviation), gap, 0.0), deviation, jacobian)


@dataclass
class ReachTask:
    """Bring ``joints`` (L,) no further than ``reach`` (T, L) metres from ``targets`` (T, L, 3), world.

    What is near enough is left as it is; ``deviation`` metres may be left of what is not.
    """

    joints: list[int]
    targets: Array
    reach: Array
    deviation: float = 0.001

    def rows(self, pose: Pose, span: slice) -> Rows:
        points = pose.positions[:, self.joints]
        ways = self.targets[span] - points
        away = np.linalg.norm(ways, axis=-1)
        over = np.maximum(away - self.reach[span], 0.0)
        ways /= np.maximum(away, 1e-9)[..., None]
        deviation = np.where(over > 0, self.deviation, np.inf)
        return Rows(over, deviation, pose.of_points(points, pose.tree.above[self.joints], ways))


__all__ = ["PointTask", "ReachTask", "TurnTask"]
