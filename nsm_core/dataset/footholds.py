"""Where feet stand on a step or beside it: holds found in a level walk, moved off the edges, and the body raised to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..control.foot_lock import ANKLES, HEEL_FROM_ANKLE, LEGS, TOE_OFFSET, TOES, foot_heading, intervals, smooth_step
from ..limbs import leg_reach, mul, place_limbs, rotate
from ..rotations import Array, heading_to_direction, quat_from_axis_angle, rotate_planar
from ..skeleton import END_SITES, HIPS, INDEX, TOE_HEIGHT, forward_kinematics

# The sole from the toe joint, metres: back to the heel, ahead to the tips, and half its width.
HEEL, TIPS, HALF_WIDTH = 0.18, 0.07, 0.045
OFF_EDGE = 0.04  # metres that a foot on the floor keeps from the sides of the block
OVER_EDGE = 0.03  # metres by which a foot on top may stick out
MAX_FLEXION = np.radians(32)  # how far a shin leans forward over its flat foot
CLEARANCE = 0.035  # metres between a swinging sole and the block
# When in a swing the level changes, shares of its duration.
CHANGES = ((0.0, 1.0), (0.0, 0.6), (0.0, 0.8), (0.1, 0.7), (0.2, 0.8), (0.3, 0.9), (0.4, 1.0), (0.2, 1.0), (0.5, 1.0), (0.0, 0.5))
_TIP = np.array(END_SITES["RightToe"])
_HEEL_FROM_TOE = HEEL_FROM_ANKLE - TOE_OFFSET


@dataclass(frozen=True)
class Hold:
    """One stay of a foot: ``side`` 0 right, 1 left; ``first`` and one past the ``last`` frame; toe joint (2,) and heading."""

    side: int
    first: int
    last: int
    place: Array
    heading: float


@dataclass(frozen=True)
class Block:
    """A block to climb on or over: centre (2,), metres, ``heading`` of its frame, ``half`` (2,) its sides, ``height``."""

    position: Array
    heading: float
    half: Array
    height: float

    def local(self, points: Array) -> Array:
        """Floor points (..., 2) in the block's frame."""
        return rotate_planar(points - self.position, np.full(points.shape[:-1], -self.heading))

    def holds(self, points: Array, margin: float) -> Array:
        """Whether floor points (..., 2) lie in the footprint grown by ``margin`` metres."""
        return (np.abs(self.local(points)) < self.half + margin).all(-1)


def find_holds(toes: Array, headings: Array, on: Array) -> list[Hold]:
    """Holds in order of their landing, of toe joints (T, 2, 2 or more), foot headings (T, 2) and contacts (T, 2)."""
    found = []
    for side in (0, 1):
        for a, b in intervals(on[:, side]):
            middle = headings[(a + b) // 2, side]
            found.append(Hold(side, a, b, np.median(toes[a:b, side, :2], axis=0), float(middle)))
    return sorted(found, key=lambda h: (h.first, h.side))


def shift_off_edges(holds: list[Hold], on_top: Array, block: Block) -> Array:
    """Least shifts (N, 2), metres, that put the soles of ``on_top`` (N,) holds on the block and keep the others off it."""
    place, heading = np.array([h.place for h in holds]), np.array([h.heading for h in holds])
    at, ahead = block.local(place), heading_to_direction(heading - block.heading)
    ends = np.stack((at - HEEL * ahead, at + TIPS * ahead), axis=1)
    across = HALF_WIDTH * np.abs(ahead[:, ::-1])
    low, high = ends.min(1) - across, ends.max(1) + across
    # On top: into the footprint; where the sole is longer than the block, over its middle.
    room = block.half + OVER_EDGE
    inward = np.maximum(-room - low, 0) - np.maximum(high - room, 0)
    inward = np.where(high - low > 2 * room, -(high + low) / 2, inward)
    # Beside: out by the nearest side.
    keep = block.half + OFF_EDGE
    ways = np.stack((-keep - high, keep - low), axis=-1)  # (N, axis, towards -, towards +)
    clear = ((ways[..., 0] >= 0) | (ways[..., 1] <= 0)).any(-1)
    flat = ways.reshape(-1, 4)
    best = np.abs(flat).argmin(1)
    outward = np.zeros((len(holds), 2, 2))
    outward.reshape(-1, 4)[np.arange(len(holds)), best] = flat[np.arange(len(holds)), best]
    local = np.where(on_top[:, None], inward, np.where(clear[:, None], 0, outward.sum(-1)))
    return rotate_planar(local, np.full(len(holds), block.heading))


@dataclass(frozen=True)
class Ascent:
    """What happens to the height of the hips: from frame ``first`` to ``last`` it changes by ``by`` metres."""

    first: float
    last: float
    by: float


def climb(
    hips: Array, rotations: Array, on: Array, block: Block, holds: list[Hold], on_top: Array, span: tuple[int, int],
    ascents: list[Ascent], lean: Array,
) -> tuple[Array, Array]:
    """Fit a level motion (T, ...) with locked feet to a block; return new hips and local rotations.

    ``on`` (T, 2) contacts; ``holds`` all holds of the motion and whether each is ``on_top``; holds that begin within the frames
    ``span`` are moved off the block's edges.  ``lean`` (T,) radians bends the spine forward.
    """  # fmt: skip
    within = np.array([span[0] <= h.first < span[1] for h in holds])
    shifts = np.where(within[:, None], shift_off_edges(holds, on_top, block), 0)
    first = min(h.first for h, w in zip(holds, within, strict=True) if w)
    last = span[1]
    rotations = _leaned(rotations, lean)
    positions, world = forward_kinematics(hips.astype(np.float64), rotations.astype(np.float64))
    feet, toes = world[:, ANKLES], positions[:, TOES].copy()
    moved = np.zeros_like(toes)
    for side in (0, 1):
        mine = [k for k, h in enumerate(holds) if h.side == side]
        for k in mine:
            h = holds[k]
            moved[h.first : h.last, side, :2] = shifts[k]
            moved[h.first : h.last, side, 2] = block.height * on_top[k]
        for a, b in zip(mine[:-1], mine[1:], strict=True):
            ha, hb = holds[a], holds[b]
            gap = slice(ha.last, hb.first)
            before, after = np.append(shifts[a], block.height * on_top[a]), np.append(shifts[b], block.height * on_top[b])
            if within[b] or within[a] or before.any() or after.any():
                moved[gap, side] = _swing(toes[ha.last - 1 : hb.first + 1, side], feet[gap, side], before, after, block)
                last = max(last, hb.first)
    span_ = slice(max(first - 30, 0), min(last + 15, len(hips)))
    toes += moved
    targets = toes - rotate(feet, TOE_OFFSET)
    out = hips.astype(np.float64)
    out[:, :2] += _smooth(moved[..., :2].mean(1), 4)
    t = np.arange(len(hips))
    for a in ascents:
        x = np.clip((t - a.first) / max(a.last - a.first, 1), 0, 1)
        out[:, 2] += a.by * x**3 * (10 - 15 * x + 6 * x * x)
    ground = np.sort(moved[..., 2], axis=1)
    out[:, 2] -= _lowering(out, positions, targets, on, ground.min(1))
    result = rotations.astype(np.float64)
    result[span_] = place_limbs(out[span_], result[span_], LEGS, targets[span_], feet[span_])
    feet[span_] = mul(feet[span_], _heels_up(out[span_], result[span_]))
    targets = toes - rotate(feet, TOE_OFFSET)
    result[span_] = place_limbs(out[span_], result[span_], LEGS, targets[span_], feet[span_])
    return out.astype(hips.dtype), result.astype(rotations.dtype)


def _swing(toe: Array, feet: Array, before: Array, after: Array, block: Block) -> Array:
    """Offsets (n, 3) of a swing of n frames between the offsets of two holds, high enough over the block.

    ``toe`` (n + 2, 3) as it swung over the level floor, with the last frame of the hold before and the first of that after;
    ``feet`` (n, 4) its rotations.  The lowest and plainest of a family of paths is taken.
    """
    n = len(feet)
    if n == 0:
        return np.zeros((0, 3))
    u = (np.arange(n) + 1) / (n + 1)
    chord = (toe[-1] - toe[0])[:2]
    p = np.clip((toe[1:-1, :2] - toe[0, :2]) @ chord / max(float(chord @ chord), 1e-6), 0, 1)
    heel, tip = rotate(feet, _HEEL_FROM_TOE), rotate(feet, _TIP)
    drop = before[2] - after[2]
    way = np.linspace(toe[0, :2] + before[:2], toe[-1, :2] + after[:2], 20)
    # A step beside the block only keeps out of it.
    margin = 0.02 if drop or before[2] or block.holds(way, 0.0).any() else -0.01
    best, found = np.inf, None
    delays = (1.0, 1.5, 2.2) if np.linalg.norm(chord) > 0.15 else (1.0,)
    for delay in delays:
        # Later (up) or earlier (down) along the way than it was walked.
        q = p**delay if drop <= 0 else 1 - (1 - p) ** delay
        flat = before + smooth_step(u)[:, None] * (after - before)
        flat[:, :2] += (q - p)[:, None] * chord
        for start, end in CHANGES if drop else CHANGES[:1]:
            for skew in (0.5, 0.7, 1.0, 1.4):
                bump = np.sin(np.pi * u**skew) ** 1.5
                offset = flat.copy()
                offset[:, 2] = before[2] - drop * smooth_step((u - start) / (end - start))
                at = toe[1:-1] + offset
                lack = np.zeros(n)
                for point, thick in ((at + heel, 0.0), (at, TOE_HEIGHT), (at + tip, TOE_HEIGHT), (at + heel / 2, 0.03)):
                    over = block.holds(point[:, :2], margin)
                    lack = np.maximum(lack, np.where(over, block.height + CLEARANCE - (point[:, 2] - thick), 0))
                # The frames next to a hold are the hold's affair.
                lack[: max(1, n // 8)] = lack[-max(1, n // 8) :] = 0.0
                apex = float(np.max(lack / np.maximum(bump, 0.15), initial=0.0))
                offset[:, 2] += min(apex, 0.45) * bump
                hurry = np.abs(np.diff(offset[:, 2], prepend=before[2], append=after[2])).max()
                cost = offset[:, 2].mean() + 2 * max(hurry - 0.04, 0.0) + max(apex - 0.45, 0.0) + 0.03 * (delay - 1) + 0.01 * abs(skew - 1)
                if cost < best:
                    best, found = cost, offset
    return found


def _lowering(hips: Array, before: Array, targets: Array, on: Array, ground: Array) -> Array:
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
    half = 5
    widest = np.lib.stride_tricks.sliding_window_view(np.pad(need, half, mode="edge"), 2 * half + 1).max(-1)
    return _smooth(widest[:, None], half)[:, 0]


def _heels_up(hips: Array, rotations: Array) -> Array:
    """Turns (T, 2, 4) of the feet, in their frames, that raise heels where a shin leans further over its foot than ankles bend."""
    ankle = rotations[:, ANKLES]
    # The ankle's own bend about the foot's side axis: toes up is positive.
    bend = 2 * np.arctan2(ankle[..., 1], np.abs(ankle[..., 0])) * np.sign(ankle[..., 0] + 1e-12)
    excess = _smooth(np.clip(-bend - MAX_FLEXION, 0, np.radians(60)), 4)
    return quat_from_axis_angle(np.array((1.0, 0.0, 0.0)), excess)


def _smooth(values: Array, half: int) -> Array:
    """Average (T, n) over time with a Hann window of ``half`` frames to each side."""
    window = np.hanning(2 * half + 3)[1:-1]
    padded = np.pad(values, ((half, half), (0, 0)), mode="edge")
    return np.stack([np.convolve(padded[:, k], window / window.sum(), mode="valid") for k in range(values.shape[1])], axis=-1)


def _leaned(rotations: Array, lean: Array) -> Array:
    """Bend the spine forward by ``lean`` (T,) radians, spread over its joints; the head takes half of it back."""
    rotations = rotations.astype(np.float64)
    where = np.flatnonzero(np.abs(lean) > 1e-4)
    for name, share in (("Chest", 0.4), ("Chest2", 0.3), ("Chest3", 0.3), ("Neck", -0.25), ("Head", -0.25)):
        bend = quat_from_axis_angle(np.array((1.0, 0.0, 0.0)), share * lean[where])
        rotations[where, INDEX[name]] = mul(rotations[where, INDEX[name]], bend)
    return rotations


def pose_holds(positions: Array, world: Array, on: Array) -> list[Hold]:
    """Holds of world joints (T, J, 3) and rotations (T, J, 4)."""
    return find_holds(positions[:, TOES], foot_heading(world[:, ANKLES]), on)
