"""Feet that stay where they land and hips that settle on a seat: detection, whole takes, frame by frame."""

from __future__ import annotations

import numpy as np

from ..conventions import FPS
from ..limbs import leg_reach, place_limbs
from ..rotations import Array, direction_to_heading, heading_quat, quat_mul, quat_rotate
from ..skeleton import ANKLE_HEIGHT, FEET, OFFSETS, TOE_HEIGHT, forward_kinematics

ANKLES, TOES = [foot[2] for foot in FEET], [foot[3] for foot in FEET]
# The toe joint is never lower than this over the floor, metres (the reference code's clamp).
TOE_CLEARANCE = 0.02
MAX_PELVIS_DROP = 0.08
_LEGS = (FEET[0][:3], FEET[1][:3])
_TOE_OFFSET = OFFSETS[TOES[0]].astype(np.float64)
# Underside of the heel in the foot's rest frame, from the ankle joint, and seen from the toe joint.
HEEL_FROM_ANKLE = np.array((0, 0.05, -ANKLE_HEIGHT))
_HEEL_FROM_TOE = HEEL_FROM_ANKLE - _TOE_OFFSET


def detect_foot_contacts(positions: Array, height: float = 0.045, speed: float = 0.3, window: int = 5, fps: float = FPS) -> Array:
    """Tell which feet stand: (T, 2) bool, right and left, from world joint positions (T, 23, 3), metres.

    A foot stands where its toe joint is lower than ``height`` metres and horizontally slower than ``speed`` metres a second,
    after a majority vote over ``window`` frames that removes flicker.
    """
    toes = positions[:, TOES]
    velocity = np.zeros(toes.shape[:2] + (2,), dtype=np.float64)
    if len(toes) > 1:
        velocity = np.gradient(toes[..., :2].astype(np.float64), axis=0) * fps
    on = (toes[..., 2] < height) & (np.linalg.norm(velocity, axis=-1) < speed)
    half = window // 2
    padded = np.pad(on.astype(np.int32), ((half, half), (0, 0)), mode="edge")
    votes = np.stack([padded[i : i + len(on)] for i in range(2 * half + 1)]).sum(0)
    return votes > half


def lock_feet(
    hips_position: Array, local_rotations: Array, contacts: Array, blend: float = 0.25, place: str = "median", fps: float = FPS
) -> tuple[Array, Array]:
    """Hold the feet of a whole take where they stand; return new (T, 3) hips positions and (T, 23, 4) local rotations.

    In every interval of contact the toe joint keeps one place on the floor and the foot one heading (unless it plainly pivots);
    before and after, the correction fades over ``blend`` seconds.  The legs are solved again and the pelvis comes down, by at
    most 8 cm, where a place is out of reach.  Feet are lifted out of the floor in all frames.

    Args:
        hips_position: (T, 3) world, metres; local_rotations: (T, 23, 4).
        contacts: (T, 2) right and left foot, bool or 0..1.
        place: "median" of the toe's places in the interval, or its "first" or "last".
    """
    dtype = local_rotations.dtype
    hips, local = hips_position.astype(np.float64), local_rotations.astype(np.float64)
    positions, rotations = forward_kinematics(hips, local)
    on = np.asarray(contacts, dtype=np.float64) > 0.5
    fade = max(1, round(blend * fps))
    toes, feet = positions[:, TOES], rotations[:, ANKLES]
    shift, turn = np.zeros_like(toes), np.zeros(toes.shape[:2])
    for side in (0, 1):
        shift[:, side], turn[:, side] = _corrections(toes[:, side], _foot_heading(feet[:, side]), positions[:, ANKLES[side], 2], on[:, side], place, fade)
    feet = quat_mul(heading_quat(turn), feet)
    toes = toes + shift
    toes[..., 2] += sole_depth(toes, feet)
    targets = toes - quat_rotate(feet, np.broadcast_to(_TOE_OFFSET, toes.shape))
    hips = hips - np.array((0, 0, 1.0)) * _pelvis_drop(positions, targets, on, fade)[:, None]
    return hips.astype(hips_position.dtype), place_limbs(hips, local, _LEGS, targets, feet).astype(dtype)


def sole_depth(toes: Array, feet: Array) -> Array:
    """How far (...) feet reach under the floor, metres, at least 0: toe joints (..., 3) world, ankle rotations (..., 4) world."""
    heel = quat_rotate(feet, np.broadcast_to(_HEEL_FROM_TOE, toes.shape))[..., 2]
    return np.maximum(0, np.maximum(TOE_CLEARANCE - toes[..., 2], -(toes[..., 2] + heel)))


def _corrections(toe: Array, heading: Array, ankle_height: Array, on: Array, place: str, fade: int) -> tuple[Array, Array]:
    """Shift (T, 3) of one toe and turn (T,) of its foot that pin it in every interval of ``on`` and fade between them."""
    count = len(toe)
    shift, turn, runs = np.zeros((count, 3)), np.zeros(count), intervals(on)
    for first, last in runs:
        inside = toe[first:last]
        pin = {"median": np.median(inside, axis=0), "first": inside[0], "last": inside[-1]}[place]
        shift[first:last, :2] = pin[:2] - inside[:, :2]
        shift[first:last, 2] = np.clip(TOE_HEIGHT - np.median(inside[:, 2]), -0.02, 0.02)
        # A foot that turns far while it stands pivots on its ball: that is a way to move, not a fault.
        flat = ankle_height[first:last] < ANKLE_HEIGHT + 0.025
        h = np.unwrap(heading[first:last])
        if flat.any():
            spread = np.ptp(h[flat])
            firm = np.clip((np.radians(40) - spread) / np.radians(20), 0, 1)
            turn[first:last] = firm * np.clip(np.median(h[flat]) - h, -spread, spread)
    # Between intervals the corrections at their ends fade out, or into one another where the gap is short.
    for (_, end), (start, _) in zip([(0, 0), *runs], [*runs, (count, count)], strict=True):
        gap = start - end
        if gap <= 0:
            continue
        steps = np.arange(1, gap + 1)
        n = min(fade, gap + 1)
        leave, arrive = _smooth(1 - steps / n), _smooth(1 - (gap + 1 - steps) / n)
        for values in (shift, turn):
            before = values[end - 1] if end > 0 else np.zeros_like(values[0])
            after = values[start] if start < count else np.zeros_like(values[0])
            values[end:start] = np.multiply.outer(leave, before) + np.multiply.outer(arrive, after)
    return shift, turn


def _pelvis_drop(positions: Array, targets: Array, on: Array, fade: int) -> Array:
    """Metres (T,) by which the hips come down, smoothly, so that standing feet meet their targets."""
    hip = positions[:, [leg[0] for leg in _LEGS]]
    was = np.linalg.norm(positions[:, ANKLES] - hip, axis=-1)
    reach = np.maximum(was, leg_reach())
    away = hip - targets
    down = away[..., 2] - np.sqrt(np.maximum(reach**2 - (away[..., :2] ** 2).sum(-1), 0))
    need = np.clip(np.where(on, down, 0), 0, MAX_PELVIS_DROP).max(-1)
    if not need.any():
        return need
    half = max(1, fade // 2)
    window = np.hanning(2 * half + 3)[1:-1]
    widest = np.lib.stride_tricks.sliding_window_view(np.pad(need, half, mode="edge"), 2 * half + 1).max(-1)
    return np.convolve(np.pad(widest, half, mode="edge"), window / window.sum(), mode="valid")


def intervals(on: Array) -> list[tuple[int, int]]:
    """Half-open intervals in which (T,) flags are set."""
    edges = np.flatnonzero(np.diff(np.concatenate(((False,), np.asarray(on, bool), (False,))).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _foot_heading(feet: Array) -> Array:
    """Heading (...) of feet from their ankles' world rotations (..., 4)."""
    return direction_to_heading(quat_rotate(feet, np.broadcast_to(np.array((0.0, -1.0, 0.0)), feet.shape[:-1] + (3,))))


def _smooth(t: Array) -> Array:
    t = np.clip(t, 0, 1)
    return t * t * (3 - 2 * t)
