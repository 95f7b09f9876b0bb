"""Where feet stand on a step or beside it: holds found in a level walk, and moved off the edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.contacts import ANKLES, HEEL_FROM_TOE, TOES, foot_heading
from nsm_core.body.skeleton import END_SITES, JOINTS
from nsm_core.distances import FOOT_OVER_EDGE
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.signals import intervals

# The sole from the toe joint, metres: back to the heel, ahead to the tips, and half its width.
HEEL, TIPS, HALF_WIDTH = round(float(HEEL_FROM_TOE[1]), 6), -END_SITES[JOINTS[TOES[0]]][1], 0.045
OFF_EDGE = 0.04  # metres that a foot on the floor keeps from the sides of the block
TO_THE_EDGE = 0.12  # metres that the last foot on top comes nearer to the edge at most


@dataclass(frozen=True)
class Foothold:
    """One stay of a foot: ``side`` 0 right, 1 left; ``first`` and one past the ``last`` frame; toe joint (2,)
    and heading.
    """

    side: int
    first: int
    last: int
    place: Array
    heading: float


@dataclass(frozen=True)
class Block:
    """A block to climb on or over: centre (2,), metres, ``heading`` of its frame, ``half`` (2,) its sides,
    ``height``.
    """

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


def find_holds(toes: Array, headings: Array, on: Array) -> list[Foothold]:
    """Holds in order of their landing, of toe joints (T, 2, 2 or more), foot headings (T, 2) and contacts (T,
    2).
    """
    found = []
    for side in (0, 1):
        for a, b in intervals(on[:, side]):
            middle = headings[(a + b) // 2, side]
            found.append(Foothold(side, a, b, np.median(toes[a:b, side, :2], axis=0), float(middle)))
    return sorted(found, key=lambda h: (h.first, h.side))


def shift_off_edges(holds: list[Foothold], on_top: Array, block: Block) -> Array:
    """Least shifts (N, 2), metres, that put the soles of ``on_top`` (N,) holds on the block and keep the
    others off it.
    """
    place, heading = np.array([h.place for h in holds]), np.array([h.heading for h in holds])
    at, ahead = block.local(place), heading_to_direction(heading - block.heading)
    ends = np.stack((at - HEEL * ahead, at + TIPS * ahead), axis=1)
    across = HALF_WIDTH * np.abs(ahead[:, ::-1])
    low, high = ends.min(1) - across, ends.max(1) + across
    # On top: into the footprint; where the sole is longer than the block, over its middle.
    room = block.half + FOOT_OVER_EDGE
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


def place_feet(holds: list[Foothold], on_top: Array, block: Block) -> Array:
    """Shifts (N, 2) of ``shift_off_edges``; the foot that is the last on top comes nearer to the edge it
    steps down from.
    """
    shifts = shift_off_edges(holds, on_top, block)
    k, toward, gap = _short_of_edge(holds, on_top, shifts, block)
    if k >= 0:
        shifts[k] += rotate_planar(np.clip(gap, 0, TO_THE_EDGE) * toward, np.float64(block.heading))
    return shifts


def draw_near(holds: list[Foothold], shifts: Array, chosen: list[int], block: Block) -> None:
    """Let ``chosen`` holds beside the block come as near to it as feet stand, in place; their legs then need
    to reach less far.
    """
    for k in chosen:
        toward, gap = _gap(holds[k], shifts[k], block)
        shifts[k] += np.clip(gap - OFF_EDGE, 0, TO_THE_EDGE) * toward


def set_off(holds: list[Foothold], shifts: Array, k: int, block: Block, gap: float) -> None:
    """Keep hold ``k`` beside the block at least ``gap`` metres off it, in place: its knee has room to come
    forward.
    """
    toward, now = _gap(holds[k], shifts[k], block)
    shifts[k] -= max(gap - now, 0.0) * toward


def _gap(hold: Foothold, shift: Array, block: Block) -> tuple[Array, float]:
    """Which way (2,) a shifted hold beside the block has to go to it, and how far, metres."""
    at = block.local(hold.place + shift)
    ahead = heading_to_direction(np.array(hold.heading - block.heading))
    ends = np.stack((at - HEEL * ahead, at + TIPS * ahead))
    gaps = np.maximum(ends.min(0) - block.half, -ends.max(0) - block.half) - HALF_WIDTH * np.abs(ahead[::-1])
    toward = np.zeros(2)
    toward[gaps.argmax()] = -np.sign(at[gaps.argmax()])
    return rotate_planar(toward, np.float64(block.heading)), float(gaps.max())


def short_of_edge(holds: list[Foothold], on_top: Array, block: Block) -> float:
    """Metres by which the last foot on top falls short of the edge it steps down from, at best."""
    return _short_of_edge(holds, on_top, shift_off_edges(holds, on_top, block), block)[2] - TO_THE_EDGE


def _short_of_edge(
    holds: list[Foothold], on_top: Array, shifts: Array, block: Block
) -> tuple[int, Array, float]:
    last = np.flatnonzero(on_top)[-1:]
    if len(last) and last[0] + 1 < len(holds):
        k = int(last[0])
        here, there = (block.local(holds[j].place + shifts[j]) for j in (k, k + 1))
        axis = int((np.abs(there) - block.half).argmax())
        toward = np.zeros(2)
        toward[axis] = np.sign(there[axis])
        ahead = heading_to_direction(np.array(holds[k].heading - block.heading))
        reach = max(TIPS * ahead @ toward, -HEEL * ahead @ toward) + HALF_WIDTH * abs(ahead[1 - axis])
        gap = block.half[axis] + FOOT_OVER_EDGE - (here @ toward + reach)
        return k, toward, float(gap)
    return -1, np.zeros(2), 0.0


def pose_holds(positions: Array, world: Array, on: Array) -> list[Foothold]:
    """Holds of world joints (T, J, 3) and rotations (T, J, 4)."""
    return find_holds(positions[:, TOES], foot_heading(world[:, ANKLES]), on)


@dataclass(frozen=True)
class Crossing:
    """A change of level in frames: the leading foot's lift-off and landing, the other foot's lift-off and
    landing.
    """

    lift: int
    landing: int
    follows: int
    both: int

    def less(self, frames: int) -> Crossing:
        """The same, counted from another frame."""
        return Crossing(self.lift - frames, self.landing - frames, self.follows - frames, self.both - frames)


def crossing_at(holds: list[Foothold], lead: int) -> Crossing | None:
    """The crossing in which hold ``lead`` is the first beyond the edge; None where the feet do not take turns
    there.
    """
    h = holds[lead]
    own = [x for x in holds[:lead] if x.side == h.side]
    other = [x for x in holds if x.side != h.side]
    standing = [x for x in other if x.first < h.first]
    following = [x for x in other if x.first >= h.first]
    if not own or not standing or not following:
        return None
    if standing[-1].last <= own[-1].last or own[-1].last >= h.first:
        return None
    return Crossing(own[-1].last, h.first, standing[-1].last, following[0].first)
