"""Captured bends: halves of pick-ups from upright to low, and which of them, how deep, brings the hands to a
box.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.skeleton import ARMS, FEET, HIPS
from nsm_core.conventions import FPS
from nsm_core.data.matching.segment import LaidSegment
from nsm_core.data.scenarios.hands import COMFORT
from nsm_core.data.scenarios.session import Session
from nsm_core.rotations import Array, quat_rotate, rotate_planar

from .draws import CARRIES

_LEGS = [joint for leg in FEET for joint in leg]
_STEP = 4.0  # cost of a metre by which legs are elsewhere as a half begins: feet would glide there
_SHOULDERS, _KNEES = [arm[0] for arm in ARMS], [leg[1] for leg in FEET]
# About how much further a body bends over than a captured half, see ``fit.bend_into_reach``: radians of the
# trunk, metres of the hips (of them none for who is nearly sitting on the heels), and shares of both.
_LEAN, _SHIFT, _AMOUNTS = np.radians(50), np.array((0.0, -0.04, -0.16)), np.linspace(0, 1, 6)


@dataclass
class Bend:
    """A bend on the tape: frames at which it ``start``s, hands meet or leave the box (``touch``), rising
    begins, and it ``end``s.
    """

    start: int
    touch: int
    rise: int
    end: int


def choose_bend(session: Session, grasps: Array, low: Array, high: Array) -> tuple[LaidSegment, int] | None:
    """Choose a half and the frame of it at which the hands reach ``grasps`` (2, 3); None where none reaches.

    ``low`` and ``high`` (3,) bound the box and what is under it, which the knees keep out of; all are seen
    from the root (heading 0) that the bend starts from.  Chance decides among what is about as good.
    """
    best, least = None, np.inf
    legs = session.lib.pose[round(session.tape.frames[-1])][_LEGS]
    for half in session.source.segments["carry"]:
        joints = _from_start(session, half)
        shoulders, hips = joints[:, :2], joints[:, 4:5]
        # How far the hands are away for every frame (n,) and amount of extra lean (k,).
        arm = shoulders - hips
        sunk = _SHIFT * np.clip((hips[..., 2:] - 0.32) / 0.3, 0, 1) ** (0, 0, 1)
        leant = np.stack([_pitched(arm, a * _LEAN) + hips + a * sunk for a in _AMOUNTS], axis=1)
        away = np.linalg.norm(leant - grasps, axis=-1).max(-1)
        within = away[:, 0] <= COMFORT
        if within.any():
            depth, amount = int(within.argmax()), 0.0
        else:
            reached = away <= COMFORT
            if not reached.any():
                continue
            k = int(reached.any(0).argmax())
            depth, amount = int(away[:, k].argmin()), float(_AMOUNTS[k])
        knees = joints[max(depth, 1), 2:4]
        inside = np.minimum(knees - low, high - knees).min(-1).max() + 0.05
        stepped = float(np.linalg.norm(session.lib.pose[half.first][_LEGS] - legs, axis=-1).mean())
        cost = 0.4 * amount + 6 * max(inside, 0.0) + _STEP * stepped + session.rng.exponential(CARRIES.choice)
        if inside < 0.12 and cost < least:
            best, least = (half, max(depth, 3)), cost
    return best


def _from_start(session: Session, half: LaidSegment) -> Array:
    """Shoulders, knees and hips (n, 5, 3) of a half seen from its first frame's root."""
    lib, n = session.lib, slice(half.first, half.last - 1)
    local = lib.pose[n][:, [*_SHOULDERS, *_KNEES, HIPS]]
    turn, first = lib.heading[n] - lib.heading[half.first], half.first
    moved = rotate_planar(lib.root[n] - lib.root[first], np.full(len(turn), -lib.heading[first]))
    joints = rotate_planar(local, turn[:, None])
    joints[..., :2] += moved[:, None]
    return joints


def _pitched(vectors: Array, angle: float) -> Array:
    q = np.array((np.cos(angle / 2), np.sin(angle / 2), 0, 0))
    return quat_rotate(np.broadcast_to(q, (*vectors.shape[:-1], 4)), vectors)


def lay_bend(session: Session, half: LaidSegment, depth: int) -> Bend:
    """Lay a bend down to ``depth`` frames into a half, a pause and the way back up."""
    rng, tape = session.rng, session.tape
    start = len(tape)
    least = rng.uniform(*CARRIES.least_bend) * FPS
    down = max(int(depth / rng.uniform(*CARRIES.down_rate)), int(least))
    tape.run_on(half.first + depth * _ease_in(np.arange(1, down + 1) / down), seam=True)
    pause = int(rng.integers(*CARRIES.grasp_frames))
    tape.run_on(np.full(pause, half.first + depth), seam=False)
    rise = len(tape)
    up = max(int(depth / rng.uniform(*CARRIES.up_rate)), int(least))
    tape.run_on(half.first + depth * _ease_in(1 - np.arange(1, up + 1) / up), seam=False)
    return Bend(start, rise - pause // 2, rise, len(tape))


def _ease_in(t: Array) -> Array:
    """Time over a half: at the captured pace when upright, coming to rest when low."""
    return t + t * t - t**3
