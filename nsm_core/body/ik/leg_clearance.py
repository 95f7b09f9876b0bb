"""Keep the legs of a climber out of edges: hips give way and rise, knees go round, swinging feet are raised.

A network that climbs bends the knee of the foot that follows a little too early or too far; its flesh then
passes the edge. What a body would do about it is small: it pushes off, waits, or turns the knee outward.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.contacts import LEGS, TOE_OFFSET
from nsm_core.body.skeleton import OFFSETS
from nsm_core.rotations import Array, quat_conjugate, quat_from_axis_angle, quat_mul, quat_rotate
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.terrain import Terrain

from .two_bone import leg_reach, limb_frames, place_limbs, solve_two_bone

CLIMBING = 0.25  # label from which on somebody climbs
MARGIN = 0.02  # metres off the flesh from which on legs give way
# Changes, in this order: hips x, y, z, metres; splay of the right and left knee, in SPLAY radians per metre;
# lift of the feet.
SPLAY = 8.0
_SPLAYED = SPLAY * np.array((1.0, -1.0))
LEAST = np.array((-0.1, -0.1, -0.03, 0.0, 0.0, 0.0, 0.0))
MOST = np.array((0.1, 0.1, 0.1, 0.11, 0.11, 0.2, 0.2))
STIFF = np.array(
    (0.25, 0.25, 0.25, 0.15, 0.15, 0.15, 0.15)
)  # how dear a metre of each is, as against a metre in the solid
SPEED = np.array((0.5, 0.5, 0.5, 0.6, 0.6, 1.5, 1.5)) / 30  # metres by which each changes in a frame
EASE, GATHER = 0.5, 0.25  # share of the way that is gone in a frame; share of SPEED by which that grows
STRETCH = 3.0  # how much a metre out of a leg's reach counts
AHEAD = 3.0  # frames that legs look ahead
_OVER = 0.25  # metres under a top from which on legs go over it
_PROBE = 0.01  # metres between the samples of the slope
_KNEES = [leg[1] for leg in LEGS]
_HIP_OFFSETS = OFFSETS[[leg[0] for leg in LEGS]].astype(np.float64)
# Places along thigh and shin and how thick the leg is there, metres.
_THIGH, _SHIN = np.array((0.5, 0.75, 1.0)), np.array((0.2, 0.4, 0.6, 0.8, 1.0))
_RADII = np.concatenate((0.04 + 0.015 * _THIGH, 0.05 - 0.01 * _SHIN))
# Places of the foot from its ankle, and how thick it is there: ball and tip.
_FOOT = TOE_OFFSET + np.array(((0.0, 0.0, 0.0), (0.0, -0.035, 0.0), (0.0, -0.07, 0.0)))
_FOOT_RADII = np.array((0.025, 0.02, 0.02))


class LegClearance:
    """Corrects the legs of one character who climbs, smoothly; stateful, one call a frame."""

    def __init__(
        self, query: DistanceQuery, terrain: Terrain | None = None, margin: float = MARGIN, feet: bool = False
    ) -> None:
        """``query`` is what legs, and ``feet`` with them, keep ``margin`` metres off, ``terrain`` the tops
        that they go over.
        """
        self.query, self.terrain = query, terrain or Terrain()
        self._margin, self._feet = margin, feet
        self.change, self._pace = np.zeros(7), np.zeros(7)
        self._came: Array | None = None  # the joints (3, 2, 3) that came in with the last frame

    def apply(
        self, hips_position: Array, local_rotations: Array, climbing: float, locked: tuple[bool, bool]
    ) -> tuple[Array, Array]:
        """Return new hips (3,) and local rotations (23, 4).

        ``hips_position`` (3,) world metres; ``climbing`` the climb label 0..1; ``locked`` feet stay where
        they are, as all feet keep their turn.
        """
        if climbing < CLIMBING and np.abs(self.change).max() < 1e-4:
            self.change[:], self._pace[:], self._came = 0, 0, None
            return hips_position, local_rotations
        pose = LegPose(hips_position.astype(np.float64), local_rotations.astype(np.float64))
        wanted = self._wanted(pose, locked) if climbing >= CLIMBING else np.zeros(7)
        self._came = pose.joints
        step = np.clip(EASE * (wanted - self.change), -SPEED, SPEED)
        self._pace = np.clip(step, self._pace - GATHER * SPEED, self._pace + GATHER * SPEED)
        self.change = np.clip(self.change + self._pace, LEAST, MOST)
        hips, local = pose.changed(self.change[None])
        return hips[0].astype(hips_position.dtype), local[0].astype(local_rotations.dtype)

    def _wanted(self, pose: LegPose, locked: tuple[bool, bool]) -> Array:
        """The change (7,) that costs least and leaves the legs clear: one step of Gauss and Newton from the
        present one.
        """
        miss, slope = self.misses_and_slope(pose, self.change)
        slope[:, 5:] *= ~np.array(locked)
        stiff = STIFF**2 + 1e3 * np.concatenate((np.zeros(5), locked))
        left = slope.T @ miss + stiff * self.change
        return np.clip(self.change - np.linalg.solve(slope.T @ slope + np.diag(stiff), left), LEAST, MOST)

    def depth(self, pose: LegPose) -> float:
        """How far any point of the legs is in the margin, metres."""
        return float(self._misses(pose, np.zeros((1, 7)))[0, :-2].max())

    def misses_and_slope(self, pose: LegPose, change: Array) -> tuple[Array, Array]:
        """``_misses`` (P,) by one ``change`` (7,), and how they change with it (P, 7)."""
        miss = self._misses(pose, np.concatenate((change[None], change + _PROBE * np.eye(7))))
        return miss[0], (miss[1:] - miss[0]).T / _PROBE

    def _misses(self, pose: LegPose, changes: Array) -> Array:
        """How far (N, P) points of the legs are in the margin, and legs out of reach (the last two), metres,
        by ``changes`` (N, 7).
        """
        joints = pose.joints_by(changes)
        far = np.linalg.norm(pose.targets(changes) - joints[:, 0], axis=-1)
        if self._came is not None:  # where legs are now, and where they will be if they go on as they came
            joints = np.concatenate((joints, joints + AHEAD * (pose.joints - self._came)))
        start, knee, ankle = joints[:, 0, :, None], joints[:, 1, :, None], joints[:, 2, :, None]
        points = np.concatenate(
            (start + _THIGH[:, None] * (knee - start), knee + _SHIN[:, None] * (ankle - knee)), axis=2
        )
        radii = _RADII
        if self._feet:
            places = quat_rotate(pose.feet[:, None], _FOOT) + pose.targets(changes)[:, :, None]
            points, radii = np.concatenate((points, places), axis=2), np.concatenate((_RADII, _FOOT_RADII))
        distance = self.query.signed_distance(points.reshape(-1, 3).astype(np.float32), 0.15).reshape(
            points.shape[:3]
        )
        # From within a thin wall the nearest way out is through it, for each part of a leg another one; the
        # way is over it.
        top = self.terrain.height(points.reshape(-1, 3)[:, :2]).reshape(points.shape[:3])
        over = top - points[..., 2]
        distance = np.where((distance < 0) & (over < _OVER), np.minimum(distance, -over), distance)
        deep = np.maximum(0, radii + self._margin - distance)
        deep = deep.reshape(-1, len(changes), 2 * len(radii)).max(0)
        return np.concatenate(
            (deep, STRETCH * np.maximum(0, far - np.maximum(leg_reach(), pose.length))), axis=1
        )


class LegPose:
    """A pose as it came in, hips (3,) and local rotations (23, 4), and what changes make of it."""

    def __init__(self, hips: Array, local: Array) -> None:
        self.hips, self.local = hips, local
        joints, rotations, self.parents = limb_frames(hips, local, LEGS)
        self.joints, self.ankles = np.swapaxes(joints, 0, 1), joints[:, 2]
        self.upper, self.feet = rotations[:, 0], rotations[:, 2]
        self.hinge = quat_rotate(self.upper, np.array((1.0, 0.0, 0.0)))
        way = self.ankles - joints[:, 0]
        self.length = np.linalg.norm(way, axis=-1)
        self.down = way / self.length[:, None]

    def targets(self, changes: Array) -> Array:
        """Where the ankles (N, 2, 3) shall be."""
        out = np.repeat(self.ankles[None], len(changes), axis=0)
        out[..., 2] += changes[:, 5:]
        return out

    def joints_by(self, changes: Array) -> Array:
        """Hip joints, knees and ankles (N, 3, 2, 3) as ``changed`` puts them."""
        start, knee, ankle = (joint + changes[:, None, :3] for joint in self.joints)
        turn = quat_from_axis_angle(np.broadcast_to(self.down, start.shape), _SPLAYED * changes[:, 3:5])
        bent, hinge = (
            quat_rotate(turn, knee - start),
            quat_rotate(turn, self.hinge),
        )  # the ankle lies on the axis
        knee, ankle, _ = solve_two_bone(start, start + bent, ankle, self.targets(changes), hinge)
        return np.stack((start, knee, ankle), axis=1)

    def changed(self, changes: Array) -> tuple[Array, Array]:
        """Hips (N, 3) and local rotations (N, 23, 4) by ``changes`` (N, 7)."""
        hips = self.hips + changes[:, :3]
        local = np.repeat(self.local[None], len(changes), axis=0)
        turn = quat_from_axis_angle(
            np.broadcast_to(self.down, (len(changes), 2, 3)), _SPLAYED * changes[:, 3:5]
        )
        upper = quat_mul(turn, np.broadcast_to(self.upper, turn.shape))
        local[:, [leg[0] for leg in LEGS]] = quat_mul(
            quat_conjugate(np.broadcast_to(self.parents, turn.shape)), upper
        )
        feet = np.broadcast_to(self.feet, turn.shape)
        return hips, place_limbs(hips, local, LEGS, self.targets(changes), feet)


__all__ = ["LegClearance", "LegPose"]
