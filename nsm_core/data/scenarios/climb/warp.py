"""Raise a level walk onto a block or over it: swings clear its edges, hips rise and sink with the feet, backs
lean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.contacts import ANKLES, HEEL_FROM_TOE, LEGS, TOE_OFFSET, TOES
from nsm_core.body.ik.two_bone import leg_reach, place_limbs
from nsm_core.body.skeleton import END_SITES, HIPS, INDEX, TOE_HEIGHT, forward_kinematics
from nsm_core.rotations import (
    Array,
    quat_conjugate,
    quat_from_axis_angle,
    quat_mul,
    quat_rotate,
    rotate_planar,
)
from nsm_core.signals import smooth_step

from .clearance import crosses, shin_depth, splayed
from .footholds import Block, Foothold

CLEARANCE = 0.035  # metres between a swinging sole and the block
MAX_FLEXION = np.radians(32)  # how far a shin leans forward over its flat foot
SHRINKS = 2  # rounds in which the hips give way to a knee in the block
HIGHEST_LIFT = 0.5  # metres that a swing is raised at most
STUTTERS = 8.0  # how much worse a metre is by which a foot on its way up comes back than a metre of height
# When in a swing the level changes, shares of its duration.
CHANGES = (
    (0.0, 1.0),
    (0.0, 0.6),
    (0.0, 0.8),
    (0.1, 0.7),
    (0.2, 0.8),
    (0.3, 0.9),
    (0.4, 1.0),
    (0.2, 1.0),
    (0.5, 1.0),
    (0.0, 0.5),
)
_TIP = np.array(END_SITES["RightToe"])


@dataclass(frozen=True)
class Ascent:
    """What happens to the height of the hips: from frame ``first`` to ``last`` it changes by ``by``
    metres.
    """

    first: float
    last: float
    by: float


def climb(
    hips: Array,
    rotations: Array,
    on: Array,
    block: Block,
    holds: list[Foothold],
    on_top: Array,
    shifts: Array,
    span: tuple[int, int],
    ascents: list[Ascent],
    lean: Array,
    sway: Array | None = None,
    splay: float = 0.0,
) -> tuple[Array, Array]:
    """Fit a level motion (T, ...) with locked feet to a block; return new hips and local rotations.

    ``on`` (T, 2) contacts; ``holds`` all holds of the motion, whether each is ``on_top``, and ``shifts`` (N,
    2) of those that begin within the frames ``span``.  ``lean`` (T,) radians bends the spine forward;
    ``sway`` (T, 2), metres, moves the hips aside; ``splay`` radians turns the knees outward in swings over
    the block.  """  # fmt: skip
    within = np.array([span[0] <= h.first < span[1] for h in holds])
    shifts = np.where(within[:, None], shifts, 0)
    first = min((h.first for h, w in zip(holds, within, strict=True) if w), default=span[0])
    last = span[1]
    rotations = leaned(rotations, lean)
    positions, world = forward_kinematics(hips.astype(np.float64), rotations.astype(np.float64))
    feet, toes = world[:, ANKLES], positions[:, TOES].copy()
    moved, gaps = np.zeros_like(toes), []
    for side in (0, 1):
        mine = [k for k, h in enumerate(holds) if h.side == side]
        offsets = {k: np.append(shifts[k], block.height * on_top[k]) for k in mine}
        for k in mine:
            moved[holds[k].first : holds[k].last, side] = offsets[k]
        for a, b in zip(mine[:-1], mine[1:], strict=True):
            begin, end = holds[a].last, holds[b].first
            if end > begin and (within[b] or within[a] or offsets[a].any() or offsets[b].any()):
                weight = smooth_step(np.arange(1, end - begin + 1) / (end - begin + 1))[:, None]
                moved[begin:end, side] = offsets[a] + weight * (offsets[b] - offsets[a])
                gaps.append((side, begin, end, offsets[a], offsets[b]))
                last = max(last, end)
    out = hips.astype(np.float64)
    out[:, :2] += _smooth(moved[..., :2].mean(1), 4) + (0 if sway is None else sway)
    t = np.arange(len(hips))
    for rise in ascents:
        x = np.clip((t - rise.first) / max(rise.last - rise.first, 1), 0, 1)
        out[:, 2] += rise.by * x**3 * (10 - 15 * x + 6 * x * x)
    changed = slice(max(first - 30, 0), min(last + 15, len(hips)))
    outward = np.zeros((len(t), 2))
    if splay:
        crossing = [g for g in gaps if crosses(toes, g, block)]
        rotations, feet, outward = splayed(positions, rotations, world, feet, crossing, splay)
    flat, result = feet, rotations
    # Astride a wall, hips that give way to one leg only bend the other.
    rounds = SHRINKS * on_top.any()
    for attempt in range(1 + rounds):
        stood = out.copy()
        stood[:, 2] -= _lowering(out, positions, toes + moved - quat_rotate(flat, TOE_OFFSET), on)
        hip = positions[:, [leg[0] for leg in LEGS]] + (stood - positions[:, HIPS])[:, None]
        across = hip[:, 1] - hip[:, 0]
        ahead = np.stack((across[:, 1], -across[:, 0], np.zeros(len(t))), axis=-1)
        for side, begin, end, before, after in gaps:
            gap = slice(begin, end)
            path = toes[begin - 1 : end + 1, side]
            bends = ahead[gap].copy()
            bends[:, :2] = rotate_planar(bends[:, :2], -outward[gap, side])
            moved[gap, side] = _swing(path, flat[gap, side], before, after, block, hip[gap, side], bends)
        raised, feet, result = toes + moved, flat.copy(), rotations.astype(np.float64)
        for _ in range(2):
            targets = raised - quat_rotate(feet, TOE_OFFSET)
            result[changed] = place_limbs(
                stood[changed], result[changed], LEGS, targets[changed], feet[changed]
            )
            up = heels_up(result[changed])
            feet[changed] = quat_mul(feet[changed], up)
            # Toes stay flat where the heel comes up.
            result[changed, TOES[0] : TOES[0] + 1] = quat_mul(
                quat_conjugate(up[:, :1]), result[changed, TOES[0] : TOES[0] + 1]
            )
            result[changed, TOES[1] : TOES[1] + 1] = quat_mul(
                quat_conjugate(up[:, 1:]), result[changed, TOES[1] : TOES[1] + 1]
            )
        back = _shrink_back(stood[changed], result[changed], block)
        if attempt == rounds or np.abs(back).max() < 0.01:
            break
        out[changed, :2] += back
    return stood.astype(hips.dtype), result.astype(rotations.dtype)


def _shrink_back(hips: Array, rotations: Array, block: Block) -> Array:
    """How far (T, 2) hips go back, smoothly, so that knees and shins keep out of the sides of the block."""
    positions, _ = forward_kinematics(hips, rotations)
    need, t = np.zeros((len(hips), 2)), np.arange(len(hips))
    for start, knee, ankle in LEGS:
        for a, b, share in ((knee, start, 0.3), (knee, start, 0.0), (ankle, knee, 0.7), (ankle, knee, 0.4)):
            point = positions[:, a] + share * (positions[:, b] - positions[:, a])
            local, foot = block.local(point[:, :2]), block.local(positions[:, ankle, :2])
            # Back to the side on which the foot is; a foot on top has none.
            off = np.abs(foot) - block.half
            beside = (
                block.half
                + 0.05
                - np.where(off.max(1, keepdims=True) > 0, np.sign(foot) * local, np.abs(local))
            )
            axis = np.where(off.max(1) > 0, off.argmax(1), beside.argmin(1))
            inside = (np.abs(local) < block.half + 0.05).all(1) | (off.max(1) > 0) & (beside > 0).all(1)
            depth = (
                np.minimum(beside[t, axis], 2 * (block.height + 0.02 - point[:, 2])).clip(0, 0.15) * inside
            )
            out = np.zeros_like(local)
            out[t, axis] = (
                1.4 * depth * np.where(off.max(1) > 0, np.sign(foot[t, axis]), np.sign(local[t, axis]))
            )
            need = np.where(np.abs(out) > np.abs(need), out, need)
    return rotate_planar(
        _smooth(widest(need.clip(0), 6) - widest((-need).clip(0), 6), 8), np.full(len(need), block.heading)
    )


def widest(values: Array, half: int) -> Array:
    """Greatest of (T, n) within ``half`` frames to each side."""
    return np.lib.stride_tricks.sliding_window_view(
        np.pad(values, ((half, half), (0, 0)), mode="edge"), 2 * half + 1, axis=0
    ).max(-1)


def _swing(
    toe: Array, feet: Array, before: Array, after: Array, block: Block, hip: Array, ahead: Array
) -> Array:
    """Offsets (n, 3) of a swing of n frames between the offsets of two holds, high enough over the block.

    ``toe`` (n + 2, 3) as it swung over the level floor, with the last frame of the hold before and the first
    of that after; ``feet`` (n, 4) its rotations; ``hip`` (n, 3) the joint of the leg and ``ahead`` (n, 3)
    where the body faces.  Of a family of paths the lowest and calmest is taken that keeps sole and shin off
    the block.
    """
    n = len(feet)
    u = (np.arange(n) + 1) / (n + 1)
    drop = before[2] - after[2]
    way = np.linspace(toe[0, :2] + before[:2], toe[-1, :2] + after[:2], 20)
    crossing = drop or before[2] or block.holds(way, 0.0).any()
    chord = (toe[-1] - toe[0])[:2]
    p = np.clip((toe[1:-1, :2] - toe[0, :2]) @ chord / max(float(chord @ chord), 1e-6), 0, 1)
    delay = np.array((1.0, 1.4, 2.0, 3.0) if crossing and np.linalg.norm(chord) > 0.15 else (1.0,))[:, None]
    # Later (up) or earlier (down) along the way than it was walked.
    q = p**delay if drop <= 0 else 1 - (1 - p) ** delay
    flat = before[:2] + smooth_step(u)[:, None] * (after - before)[:2] + (q - p)[..., None] * chord
    change = np.array(CHANGES if drop else CHANGES[:1])[..., None]
    level = before[2] - drop * smooth_step((u - change[:, 0]) / (change[:, 1] - change[:, 0]))
    skew = np.array((0.5, 0.7, 1.0, 1.4))[:, None]
    bump = np.sin(np.pi * u**skew) ** 1.5
    # Axes: delay, change, skew, extra height, frame.  A step beside the block only keeps out of it.
    margin, lack = 0.02 if crossing else -0.01, np.zeros((len(delay), len(change), n))
    heel, tip = quat_rotate(feet, HEEL_FROM_TOE), quat_rotate(feet, _TIP)
    for point, thick in ((heel, 0.0), (0 * heel, TOE_HEIGHT), (tip, TOE_HEIGHT), (heel / 2, 0.03)):
        over = block.holds(toe[1:-1, :2] + flat + point[:, :2], margin)[:, None]
        low = block.height + CLEARANCE - (toe[1:-1, 2] + level + point[:, 2] - thick)
        lack = np.maximum(lack, np.where(over, low, 0))
    # The frames next to a hold are the hold's affair.
    edge = max(1, n // 8)
    lack[..., :edge] = lack[..., -edge:] = 0.0
    apex = np.max(lack[:, :, None] / np.maximum(bump, 0.15), axis=-1, initial=0.0)
    extra = np.array((0.0, 0.05, 0.12) if crossing else (0.0,))
    height = np.minimum(apex[..., None] + extra, HIGHEST_LIFT)
    z = level[:, None, None] + height[..., None] * bump[:, None]
    hurry = np.abs(np.diff(z, axis=-1, prepend=before[2], append=after[2])).max(-1)
    cost = z.mean(-1) + 2 * np.maximum(hurry - 0.04, 0) + np.maximum(apex - HIGHEST_LIFT, 0)[..., None]
    if drop < 0:
        cost = cost + STUTTERS * _dip(toe[1:-1, 2] + z)
    cost = cost + 0.03 * (delay - 1)[..., None, None] + 0.01 * np.abs(skew - 1)
    if crossing:
        at = toe[1:-1] - quat_rotate(feet, TOE_OFFSET)
        ankle = np.concatenate(
            (
                np.broadcast_to(block.local(at[:, :2] + flat)[:, None, None, None], z.shape + (2,)),
                (at[:, 2] + z)[..., None],
            ),
            -1,
        )
        hip, ahead = hip.copy(), ahead.copy()
        hip[:, :2], ahead[:, :2] = (
            block.local(hip[:, :2]),
            rotate_planar(ahead[:, :2], np.full(n, -block.heading)),
        )
        cost = cost + 4 * shin_depth(hip, ankle, ahead, block).max(-1)
    d, c, s, e = np.unravel_index(int(cost.argmin()), cost.shape)
    return np.concatenate((flat[d], z[d, c, s, e][:, None]), axis=1)


def _dip(heights: Array) -> Array:
    """How far (...) a foot comes back down, metres, before it goes on up, of its heights (..., n)."""
    risen = np.maximum.accumulate(heights, axis=-1)
    rises = np.maximum.accumulate(heights[..., ::-1], axis=-1)[..., ::-1]
    return (np.minimum(risen, rises) - heights).max(-1)


def _lowering(hips: Array, before: Array, targets: Array, on: Array) -> Array:
    """Metres (T,) by which the hips come down so that standing feet are within reach of the legs."""
    offset = before[:, [leg[0] for leg in LEGS]] - before[:, [HIPS]]
    hip = hips[:, None] + offset
    was = np.linalg.norm(before[:, ANKLES] - before[:, [leg[0] for leg in LEGS]], axis=-1)
    reach = np.maximum(was, leg_reach())
    away = hip - targets
    down = away[..., 2] - np.sqrt(np.maximum(reach**2 - (away[..., :2] ** 2).sum(-1), 0.01))
    need = np.clip(np.where(on > 0.5, down, 0), 0, None).max(-1)
    if not need.any():
        return need
    return _smooth(widest(need[:, None], 5), 5)[:, 0]


def heels_up(rotations: Array) -> Array:
    """Turns (T, 2, 4) of the feet, in their frames, that raise heels where a shin leans further over its foot
    than ankles bend.
    """
    ankle = rotations[:, ANKLES]
    # The ankle's own bend about the foot's side axis: toes up is positive.
    bend = 2 * np.arctan2(ankle[..., 1], np.abs(ankle[..., 0])) * np.sign(ankle[..., 0] + 1e-12)
    excess = _smooth(np.clip(-bend - MAX_FLEXION, 0, np.radians(60)), 4)
    return quat_from_axis_angle(np.array((1.0, 0.0, 0.0)), excess)


def _smooth(values: Array, half: int) -> Array:
    """Average (T, n) over time with a Hann window of ``half`` frames to each side."""
    window = np.hanning(2 * half + 3)[1:-1]
    padded = np.pad(values, ((half, half), (0, 0)), mode="edge")
    return np.stack(
        [np.convolve(padded[:, k], window / window.sum(), mode="valid") for k in range(values.shape[1])],
        axis=-1,
    )


def leaned(rotations: Array, lean: Array) -> Array:
    """Bend the spine forward by ``lean`` (T,) radians, spread over its joints; the head takes half of it
    back.
    """
    rotations = rotations.astype(np.float64)
    where = np.flatnonzero(np.abs(lean) > 1e-4)
    for name, share in (("Chest", 0.4), ("Chest2", 0.3), ("Chest3", 0.3), ("Neck", -0.25), ("Head", -0.25)):
        bend = quat_from_axis_angle(np.array((1.0, 0.0, 0.0)), share * lean[where])
        rotations[where, INDEX[name]] = quat_mul(rotations[where, INDEX[name]], bend)
    return rotations
