"""Captured bends: halves of pick-ups from upright to low, and which of them, how deep, brings the hands to a box."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.body.ik.leaning import COMFORT, LEAN, shift_of
from nsm_core.body.ik.two_bone import place_wrists
from nsm_core.body.skeleton import ARMS, FEET, HIPS, INDEX, forward_kinematics
from nsm_core.conventions import FPS
from nsm_core.data.captures.folder import labelled, read_capture, unlabelled
from nsm_core.data.matching.database import _ARM_JOINTS, gaussian_smooth, neutral
from nsm_core.data.matching.labelled import grasps
from nsm_core.data.scenarios.session import LaidSegment, Segment, Session
from nsm_core.rotations import Array, quat_rotate, rotate_planar

_WORDS = ("pickupbox", "pick_up_box", "lift_box", "putdownbox", "put_down_box")
_LEVEL, _LEAST, _DRIFT = 0.02, 0.25, 0.07  # metres: upright again, least drop of the chest, most drift of a standing foot
_SHOULDERS, _KNEES = [arm[0] for arm in ARMS], [leg[1] for leg in FEET]
_CHEST = INDEX["Chest4"]
_AMOUNTS = np.linspace(0, 1, 6)  # of the extra lean, see ``leaning.lean_into_reach``


def load_bends(folder: str | Path) -> list[Segment]:
    """Cut pick-ups and put-downs into halves that lead from upright (frame 0) to low; the arms hang.  May be empty.

    By the hands' contacts where there are sidecars, else by names.
    """
    paths = [p for p in unlabelled(folder) if any(w in p.stem for w in _WORDS) and "run" not in p.stem]
    found = [(read_capture(p, folder), None) for p in paths]
    found += [(piece.clip, frame) for piece in labelled(folder) for frame in grasps(piece)]
    halves: dict[str, Segment] = {}
    if not found:
        return []
    arms = neutral(folder)
    for clip, grasp in found:
        height = gaussian_smooth(clip.world()[0][:, _CHEST, 2], 2.0)
        near = 0 if grasp is None else max(grasp - FPS, 0)
        low = near + int(height[near : None if grasp is None else grasp + FPS].argmin())
        upright = float(np.percentile(height, 97)) - _LEVEL
        bottom = np.flatnonzero(height < height[low] + 0.02)
        before, after = np.flatnonzero(height[:low] > upright), np.flatnonzero(height[low:] > upright)
        spans = []
        if len(before):
            spans.append((int(before[-1]), int(bottom[bottom > before[-1]][0]), 1))
        if len(after):
            end = low + int(after[0])
            spans.append((int(bottom[bottom < end][-1]), end, -1))
        for first, last, way in spans:
            half = Clip(f"{clip.name}@{first}", clip.hips_position[first : last + 1][::way], clip.local_rotations[first : last + 1][::way])
            if len(half) >= 20 and np.ptp(height[first : last + 1]) > _LEAST and _stands(half) and half.name not in halves:
                halves[half.name] = Segment(hang_arms(half, arms), {})
    return list(halves.values())


def _stands(clip: Clip) -> bool:
    toes = clip.world()[0][:, [leg[3] for leg in FEET], :2]
    return bool(np.linalg.norm(toes - np.median(toes, axis=0), axis=-1).max() < _DRIFT)


def hang_arms(clip: Clip, neutral: Clip) -> Clip:
    """Give a bend the arms of a quiet stand (one frame) that hang straight down from wherever the shoulders go."""
    still, _ = neutral.world()
    offset = rotate_planar(still[0, [a[2] for a in ARMS]] - still[0, _SHOULDERS], -neutral.root()[1][0])
    rotations = clip.local_rotations.copy()
    rotations[:, _ARM_JOINTS] = neutral.local_rotations[0, _ARM_JOINTS]
    positions, world = forward_kinematics(clip.hips_position, rotations)
    heading = clip.root()[1][0]
    for side, arm in enumerate(ARMS):
        wrist = (positions[:, arm[0]] + rotate_planar(offset[side], heading)).astype(np.float32)
        hand = np.repeat(world[:1, arm[2]], len(clip), axis=0)
        rotations = place_wrists(clip.hips_position, rotations, side, wrist, hand)
    return Clip(clip.name, clip.hips_position, rotations.astype(np.float32))


@dataclass
class Bend:
    """A bend on the tape: frames at which it ``start``s, hands meet or leave the box (``touch``), rising begins, and it ``end``s."""

    start: int
    touch: int
    rise: int
    end: int


def choose(session: Session, grasps: Array, low: Array, high: Array) -> tuple[LaidSegment, int] | None:
    """Choose a half and the frame of it at which the hands reach ``grasps`` (2, 3); None where none reaches.

    ``low`` and ``high`` (3,) bound the box and what is under it, which the knees keep out of; all are seen from the root
    (heading 0) that the bend starts from.  Chance decides among what is about as good.
    """
    best, least = None, np.inf
    for half in session.source.segments["carry"]:
        joints = _from_start(session, half)
        shoulders, hips = joints[:, :2], joints[:, 4:5]
        # How far the hands are away for every frame (n,) and amount of extra lean (k,).
        arm = shoulders - hips
        leant = np.stack([_pitched(arm, a * LEAN) + hips + a * shift_of(hips[..., 2]) for a in _AMOUNTS], axis=1)
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
        cost = 0.4 * amount + 6 * max(inside, 0.0) + session.rng.exponential(0.12)
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
    least = rng.uniform(0.55, 0.8) * FPS
    down = max(int(depth / rng.uniform(0.72, 1.15)), int(least))
    tape.run_on(half.first + depth * _ease_in(np.arange(1, down + 1) / down), seam=True)
    pause = int(rng.integers(4, 10))
    tape.run_on(np.full(pause, half.first + depth), seam=False)
    rise = len(tape)
    up = max(int(depth / rng.uniform(0.75, 1.15)), int(least))
    tape.run_on(half.first + depth * _ease_in(1 - np.arange(1, up + 1) / up), seam=False)
    return Bend(start, rise - pause // 2, rise, len(tape))


def _ease_in(t: Array) -> Array:
    """Time over a half: at the captured pace when upright, coming to rest when low."""
    return t + t * t - t**3
