"""Feet of whole takes: where they stand, and how to hold them there."""

from __future__ import annotations

import numpy as np

from nsm_core.body.contacts import ANKLES, LEGS, TOE_OFFSET, TOES, foot_heading, sole_depth
from nsm_core.body.skeleton import ANKLE_HEIGHT, TOE_HEIGHT, forward_kinematics
from nsm_core.conventions import FPS
from nsm_core.rotations import Array, heading_quat, quat_from_axis_angle, quat_mul, quat_rotate
from nsm_core.signals import intervals, smooth_step

from .two_bone import leg_reach, place_limbs

MAX_PELVIS_DROP = 0.08
# A correction changes by no more than this a frame between two places, metres, if the intervals of contact
# leave the time.
MAX_SHIFT_STEP = 0.03


def lock_feet(
    hips_position: Array,
    local_rotations: Array,
    contacts: Array,
    blend: float = 0.25,
    place: str = "median",
    ball_height: float | None = 0.032,
    fps: float = FPS,
) -> tuple[Array, Array]:
    """Hold the feet of a whole take where they stand; return new (T, 3) hips positions and (T, 23, 4) local
    rotations.

    In every interval of contact the toe joint keeps one place on the floor and the foot one heading (unless
    it plainly pivots);
    before and after, the correction fades over ``blend`` seconds.  The legs are solved again and the pelvis
    comes down, by at most 8 cm, where a place is out of reach.  Feet are lifted out of the floor in all
    frames.

    Args:
        hips_position: (T, 3) world, metres; local_rotations: (T, 23, 4).
        contacts: (T, 2) right and left foot, bool or 0..1.
        place: "median" of the toe's places in the interval, or its "first" or "last".
        ball_height: metres over the floor to which the toe joint of a standing foot is brought down, by
        turning the foot at
            the ankle by at most 25 degrees, as in a push-off from the ball; None leaves its height.
    """
    dtype = local_rotations.dtype
    hips, local = hips_position.astype(np.float64), local_rotations.astype(np.float64)
    positions, rotations = forward_kinematics(hips, local)
    on = np.asarray(contacts, dtype=np.float64) > 0.5
    fade = max(1, round(blend * fps))
    feet = rotations[:, ANKLES]
    if ball_height is not None:
        feet = _press_down(positions[:, TOES, 2], feet, on, ball_height, fade)
    toes = positions[:, ANKLES] + quat_rotate(feet, TOE_OFFSET)
    shift, turn = np.zeros_like(toes), np.zeros(toes.shape[:2])
    for side in (0, 1):
        heights = positions[:, ANKLES[side], 2]
        shift[:, side], turn[:, side] = _corrections(
            toes[:, side], foot_heading(feet[:, side]), heights, on[:, side], place, fade
        )
    feet = quat_mul(heading_quat(turn), feet)
    toes = toes + shift
    toes[..., 2] += sole_depth(toes, feet)
    targets: Array = toes - quat_rotate(feet, TOE_OFFSET)
    hips = hips - np.array((0, 0, 1.0)) * _pelvis_drop(positions, targets, on, fade)[:, None]
    return hips.astype(hips_position.dtype), place_limbs(hips, local, LEGS, targets, feet).astype(dtype)


def _press_down(toe_height: Array, feet: Array, on: Array, height: float, fade: int) -> Array:
    """Pitch feet (T, 2, 4) down until the toe joints of those that stand are at ``height``; smooth in
    time.
    """
    lever = float(np.linalg.norm(TOE_OFFSET))
    slope = np.arcsin(np.clip(quat_rotate(feet, TOE_OFFSET / lever)[..., 2], -1, 1))
    down = np.clip(toe_height - height, 0, None) * on
    wanted = np.arcsin(np.clip(np.sin(slope) - down / lever, -0.99, 0.99)) - slope
    half = max(1, fade // 3)
    window = np.hanning(2 * half + 3)[1:-1]
    padded = np.pad(np.clip(wanted, -np.radians(25), 0), ((half, half), (0, 0)), mode="edge")
    pitch = np.stack(
        [np.convolve(padded[:, side], window / window.sum(), mode="valid") for side in (0, 1)], axis=-1
    )
    return quat_mul(feet, quat_from_axis_angle(np.array((1.0, 0.0, 0.0)), -pitch))


def _corrections(
    toe: Array, heading: Array, ankle_height: Array, on: Array, place: str, fade: int
) -> tuple[Array, Array]:
    """Shift (T, 3) of one toe and turn (T,) of its foot that pin it in every interval of ``on`` and fade
    between them.
    """
    count = len(toe)
    shift, turn, runs = np.zeros((count, 3)), np.zeros(count), intervals(on)
    pins = [
        {"median": np.median(toe[a:b], axis=0), "first": toe[a], "last": toe[b - 1]}[place] for a, b in runs
    ]
    runs = _make_room(toe, runs, pins)
    for (first, last), pin in zip(runs, pins, strict=True):
        inside = toe[first:last]
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
        leave, arrive = smooth_step(1 - steps / n), smooth_step(1 - (gap + 1 - steps) / n)
        for values in (shift, turn):
            before = values[end - 1] if end > 0 else np.zeros_like(values[0])
            after = values[start] if start < count else np.zeros_like(values[0])
            values[end:start] = np.multiply.outer(leave, before) + np.multiply.outer(arrive, after)
    return shift, turn


def _make_room(toe: Array, runs: list[tuple[int, int]], pins: list[Array]) -> list[tuple[int, int]]:
    """Shorten intervals, each by less than half, where a foot would have to jump from one pin to the next."""
    firsts, lasts = [a for a, _ in runs], [b for _, b in runs]
    for k in range(len(runs) - 1):
        end, start = lasts[k], firsts[k + 1]
        change = (pins[k + 1] - toe[start]) - (pins[k] - toe[end - 1])
        lack = int(np.ceil(np.linalg.norm(change[:2]) / MAX_SHIFT_STEP)) - (start - end)
        if lack > 0:
            lasts[k] -= min(-(-lack // 2), (runs[k][1] - runs[k][0] - 1) // 2)
            firsts[k + 1] += min(-(-lack // 2), (runs[k + 1][1] - runs[k + 1][0] - 1) // 2)
    return list(zip(firsts, lasts, strict=True))


def _pelvis_drop(positions: Array, targets: Array, on: Array, fade: int) -> Array:
    """Metres (T,) by which the hips come down, smoothly, so that standing feet meet their targets."""
    hip = positions[:, [leg[0] for leg in LEGS]]
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
