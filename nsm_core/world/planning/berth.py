"""The way of a carried box out of its place and into another: over edges from above, between boards from the
front.
"""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array, rotate_planar
from nsm_core.signals import smooth_step
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.props import Box

LIFT = 0.06  # metres by which a box passes over what it is set on
# From things at which it has the height to pass; metres of height per metre further off; seen from.
GAP, SLOPE, SIGHT = 0.08, 0.8, 0.7
SINK = 0.12  # metres from over its place within which it comes down
NEAR = 1.3  # metres from its place from which on it takes the height
ROOFED = 0.45  # metres over a box below which it is moved in from the front
OUT, AWAY = 0.04, 0.9  # metres over its place, or beside it at most, from which on it has left it
# Metres that a box stays behind the hands at most rather than go into something, and catches up in a frame.
LAG, CATCH_UP = 0.2, 0.015
INSIDE = 0.003  # metres that count as inside
_GRID = 0.06  # metres between places on the sides of a box


class Berth:
    """A place of a box, the room over it, and how high the box may be on the way to it."""

    def __init__(self, box: Box, pose: Array, solids: DistanceQuery) -> None:
        """``pose`` (4,) of the box where it rests."""
        self.pose = np.array(pose, dtype=np.float64)
        room = room_over(box, self.pose, solids)
        self.roofed = room < ROOFED
        self.lift = min(LIFT, room / 2)

    def bounds(self, pose: Array, free: float) -> tuple[float, float]:
        """Least and greatest height of the centre of a box at ``pose`` (4,) that has ``free`` metres to
        things on its way.
        """
        aside = float(np.hypot(*(pose[:2] - self.pose[:2])))
        play = SLOPE * max(0.0, free - GAP) + max(0.0, aside - NEAR)
        low = self.pose[2] + self.lift * float(smooth_step(np.clip(aside / SINK, 0, 1)))
        return low - play, self.pose[2] + self.lift + play if self.roofed else np.inf

    def left(self, box: Box, pose: Array, solids: DistanceQuery) -> bool:
        """Whether a box at ``pose`` (4,) has come free of this place: lifted off it, or out from under what
        is over it.
        """
        if float(np.hypot(*(pose[:2] - self.pose[:2]))) > AWAY:
            return True
        return room_over(box, pose, solids) >= ROOFED if self.roofed else bool(pose[2] > self.pose[2] + OUT)

    def free(self, box: Box, pose: Array, solids: DistanceQuery) -> float:
        """Metres (at most ``SIGHT``) to things from a box at ``pose`` (4,) and from where it passes at this
        berth's height.
        """
        half, other = float(box.size[2]) / 2, float(self.pose[2]) + self.lift
        low, high = min(float(pose[2]), other) - half, max(float(pose[2]), other) + half
        middle, around = (
            np.append(pose[:2], (low + high) / 2),
            float(np.hypot(np.hypot(*box.size[:2]) / 2, (high - low) / 2)),
        )
        if (
            float(solids.signed_distance(middle[None].astype(np.float32), around + SIGHT)[0])
            >= around + SIGHT
        ):
            return SIGHT
        ring = outline(box, pose)
        heights = np.linspace(low + 0.005, high, 2 + int((high - low) / (2 * _GRID)))
        swept = np.concatenate([np.insert(ring, 2, z, axis=1) for z in heights])
        return float(solids.signed_distance(swept.astype(np.float32), SIGHT).min())


def outline(box: Box, pose: Array) -> Array:
    """Floor points (N, 2) around a box at ``pose`` (4,), world."""
    half = np.asarray(box.size[:2], dtype=np.float64) / 2
    x, y = (np.linspace(-h, h, 2 + int(2 * h / (2 * _GRID))) for h in half)
    ring = np.concatenate([np.stack((x, np.full_like(x, s * half[1])), -1) for s in (-1, 1)])
    ring = np.concatenate([ring, *[np.stack((np.full_like(y, s * half[0]), y), -1)[1:-1] for s in (-1, 1)]])
    return rotate_planar(ring, np.float64(pose[3])) + pose[:2]


def surface(box: Box, pose: Array) -> Array:
    """Points (N, 3) on the sides and over the top and bottom of a box at ``pose`` (4,), world."""
    half = np.asarray(box.size, dtype=np.float64) / 2
    axes = [np.linspace(-h, h, 2 + int(2 * h / _GRID)) for h in half]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    points = points[(np.abs(points) > half - 1e-6).any(1)]
    return rotate_planar(points, np.float64(pose[3])) + pose[:3]


def kept_out(box: Box, before: Array, pose: Array, late: Array, solids: DistanceQuery) -> Array:
    """Pose (4,) of a box that the hands would move from ``before`` to ``pose``, (4,), and that is ``late``
    (4,) behind them by now.

    It stops before what it would go into, for as long as it does not stay behind too far, and then catches
    up, no faster than a hand would.
    """
    far = float(np.hypot(late[0], late[1]))
    now = pose + late * (1, 1, 0, 1) * max(0.0, 1 - CATCH_UP / max(far, 2 * abs(float(late[3])) * LAG, 1e-9))
    deep = depth(box, now, solids)
    if deep <= INSIDE:
        return now
    stays = np.array((*before[:2], pose[2], before[3]))
    if float(np.hypot(*(stays - pose)[:2])) > LAG or depth(box, stays, solids) >= deep:
        return now
    return stays


def depth(box: Box, pose: Array, solids: DistanceQuery) -> float:
    """Metres that the deepest of a box's own points at ``pose`` (4,) is in solids, 0 where none is."""
    around = float(np.linalg.norm(box.size)) / 2
    if float(solids.signed_distance(np.asarray(pose[None, :3], dtype=np.float32), around)[0]) >= around:
        return 0.0
    points = surface(box, pose)
    return max(0.0, -float(solids.signed_distance(points.astype(np.float32), 0.02).min()))


def room_over(box: Box, pose: Array, solids: DistanceQuery) -> float:
    """Metres (at most ``ROOFED``) straight up from the top of a box at ``pose`` (4,) to the first thing."""
    points = surface(box, pose)
    points = points[points[:, 2] >= points[:, 2].max() - 1e-6] + (0, 0, 0.005)
    z, going = np.zeros(len(points)), np.arange(len(points))
    while len(going):
        step = solids.signed_distance(
            (points[going] + z[going, None] * (0, 0, 1)).astype(np.float32), ROOFED
        ).astype(np.float64)
        going, step = going[step > 0.003], step[step > 0.003]
        z[going] += np.maximum(step, 0.02)  # along a wall steps are small; no board is thinner
        going = going[z[going] < ROOFED]
    return float(min(z.min(), ROOFED))


__all__ = ["LIFT", "Berth", "depth", "kept_out", "room_over", "surface"]
