"""How a leaf turns while a body passes: led by a hand that stays within reach, clear of the body, then left
to swing on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.skeleton import ARMS, INDEX
from nsm_core.rotations import Array, heading_to_direction
from nsm_core.signals import gaussian_smooth
from nsm_core.world.affordances.passage import Passage
from nsm_core.world.scene.props import Leaf

from .draws import OPENS

ANGLES = np.radians(np.arange(0, 111.0, 2))  # angles of the leaf that are weighed against one another
# Metres from the shoulder to the handle, off which the wrist stays by ``distances.WRIST_OFF_HANDLE``: of an
# arm alone, and of one that the trunk's lean helps.
REACH, FURTHEST = 0.62, 0.7
HASTES = (1.0, 1.35, 1.8)  # how much of a shove a leaf is given so that it keeps ahead of the body
FOLDED = 0.33  # metres from shoulder to handle under which an arm gets in its own way
CLEAR = 0.02  # metres that the body keeps off the leaf
# The body as joints with radii, metres; the arm that holds the handle is left out.
_BODY = {"Hips": 0.11, "Chest2": 0.11, "Chest4": 0.11, "Head": 0.11} | {
    side + joint: radius
    for side in ("Right", "Left")
    for joint, radius in (
        ("Shoulder", 0.065),
        ("Elbow", 0.055),
        ("Wrist", 0.05),
        ("Hip", 0.07),
        ("Knee", 0.065),
        ("Ankle", 0.055),
        ("Toe", 0.1),
    )
}


@dataclass(frozen=True)
class Turning:
    """A leaf's turn in frames (T,): ``angles``, radians, and the frame in which the hand ``released`` it."""

    angles: Array
    released: int


class Doorway:
    """A door seen by who passes it: u from the hinge along the closed leaf, v the way to go, z up, metres."""

    def __init__(self, leaf: Leaf, way: Passage) -> None:
        self.leaf, self.way = leaf, way
        self.hinge = np.asarray(leaf.pose[:2], dtype=np.float64)
        self.along = heading_to_direction(np.array(leaf.closed + np.pi / 2))
        self.go = heading_to_direction(np.array(way.heading))

    def local(self, points: Array) -> Array:
        """World points (..., 2 or 3) as u, v (and z)."""
        d = np.asarray(points, dtype=np.float64)[..., :2] - self.hinge
        return np.concatenate((np.stack((d @ self.along, d @ self.go), axis=-1), points[..., 2:]), axis=-1)

    def handles(self, angles: Array) -> Array:
        """Where the handle is (..., 3), u, v, z, on the side of who takes it, when the leaf is open by
        ``angles`` (...).
        """
        out, (x, _, z) = self.leaf.thickness / 2, self.leaf.handle
        c, s = np.cos(angles), np.sin(angles) * (1 if self.way.push else -1)
        return np.stack((x * c + out * s, x * s - out * c, np.broadcast_to(z, np.shape(angles))), axis=-1)

    def clearance(self, joints: Array, panel: float) -> Array:
        """Metres (T, K) between the body's joints (T, J, 3), world, and the leaf, ``panel`` metres thick, at
        each of ``ANGLES``.
        """
        held = {ARMS[self.way.hand][1], ARMS[self.way.hand][2]}
        parts = [(INDEX[name], radius) for name, radius in _BODY.items() if INDEX[name] not in held]
        radii = np.array([radius for _, radius in parts], np.float32)[None, :, None] + np.float32(panel / 2)
        p = self.local(joints[:, [k for k, _ in parts], :2]).astype(np.float32)
        result = np.full((len(p), len(ANGLES)), 9.0, np.float32)
        near = np.flatnonzero((np.abs(p[:, 0]).max(axis=1) < 1.6) & (p[:, 0, 1] < 1.2))
        u, v = p[near, :, 0, None], p[near, :, 1, None]
        c, s = (
            np.cos(ANGLES, dtype=np.float32),
            np.sin(ANGLES, dtype=np.float32) * np.float32(1 if self.way.push else -1),
        )
        beside, on = np.abs(v * c - u * s), u * c + v * s
        over = np.maximum(on - np.float32(self.leaf.width), 0) + np.minimum(on, 0)
        result[near] = (np.sqrt(beside * beside + over * over) - radii).min(axis=1)
        return result


def swing_on(angle: float, speed: float, end: float, count: int, haste: float = 1.0) -> Array:
    """Angles (count,) of a leaf let go at ``angle`` with ``speed`` (radians per frame) that comes to rest at
    ``end``.

    ``haste`` over 1 is the shove it is given: it swings faster before it slows down.
    """
    way = max(end - angle, 6 * speed)
    n = float(min(1.9 * way / max(speed, 0.01), 50)) / haste
    x = np.clip(np.arange(1, count + 1) / n, 0, 1)
    return angle + way * (10 * x**3 - 15 * x**4 + 6 * x**5) + speed * n * (x - 6 * x**3 + 8 * x**4 - 3 * x**5)


def turn(
    door: Doorway, joints: Array, start: int, panel: float, backed: int, rng: np.random.Generator
) -> Turning | None:
    """Let a hand open the leaf while the body moves as ``joints`` (T, 23, 3), world; None where arm or body
    forbid it.

    The leaf rests up to frame ``start``.  A push keeps it as far ahead as the arm reaches; a pull keeps the
    arm stretched and draws the leaf past when the body has stepped back, at frame ``backed``.
    """
    shoulder = door.local(joints[:, ARMS[door.way.hand][0]])
    spans = np.linalg.norm(shoulder[:, None] - door.handles(ANGLES)[None], axis=-1)
    clear = door.clearance(joints, panel)
    count, push = len(joints), door.way.push
    t = np.arange(count)
    # The trunk leans for the handle at first and comes up while the body moves.
    reach = np.maximum(REACH, np.interp(t, (start, start + 25), (min(spans[start, 0], FURTHEST), REACH)))
    within = spans <= reach[:, None]
    last = len(ANGLES) - 1
    least, most = within.argmax(axis=1), last - within[:, ::-1].argmax(axis=1)
    nearest = spans.argmin(axis=1)
    some = within.any(axis=1)
    least, most = np.where(some, least, nearest), np.where(some, most, nearest)
    if spans[start, 0] > FURTHEST:
        return None
    if push:
        tight = clear < CLEAR
        free = np.where(tight.any(axis=1), last + 1 - tight[:, ::-1].argmax(axis=1), 0)
        wanted = np.maximum(most, free)
    else:
        x = np.clip((t - backed + 14) / 20, 0, 1)
        wanted = least + x**3 * (10 - 15 * x + 6 * x * x) * np.maximum(most - least, 0)
    x = np.clip((t - start) / 14, 0, 1)
    wanted = np.maximum.accumulate(np.minimum(wanted, last) * (x * x * (3 - 2 * x)))
    angles = np.maximum.accumulate(gaussian_smooth(wanted * ANGLES[1], 3.0)).clip(0, None)
    angles[: start + 1] = 0
    let_go = np.radians(rng.uniform(*(OPENS.let_go_pushed if push else OPENS.let_go_pulled)))
    own = np.linalg.norm(shoulder - door.handles(angles), axis=-1)
    done = np.flatnonzero(
        (t > start + 5)
        & ((angles >= let_go) | (own > FURTHEST) | (own < FOLDED) & (t > start + 15) | (t > count - 25))
    )
    # A hand lets go once the leaf hardly moves any more.
    released = int(done[0]) - 1 if len(done) else count - 25
    slow = np.flatnonzero(
        (t > start + 15) & (t <= released) & (angles > np.radians(35)) & (np.gradient(angles) < 0.004)
    )
    if len(slow):
        released = int(slow[0])
    if angles[released] < np.radians(35):
        return None
    end = np.radians(rng.uniform(*OPENS.comes_to_rest))
    speed = max(angles[released] - angles[released - 1], 0.008)
    for haste in HASTES:
        angles[released + 1 :] = swing_on(angles[released], speed, end, count - released - 1, haste)
        at = np.clip(np.round(angles / ANGLES[1]).astype(int), 0, last)
        if clear[t, at].min() > 0 and (np.diff(angles) > -1e-6).all():
            return Turning(angles, released)
    return None
