"""Climbing: a walk whose footholds are moved off the edges of a step or a low wall and raised to its top, and the way down."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..conventions import CLIMB, FPS
from ..furniture import Furniture
from ..rotations import Array, heading_to_direction, rotate_planar
from ..skeleton import FEET, forward_kinematics
from .footholds import (
    HEEL,
    OFF_EDGE,
    OVER_EDGE,
    TIPS,
    Block,
    Crossing,
    Hold,
    crossing_at,
    draw_near,
    find_holds,
    place_feet,
    pose_holds,
    shift_off_edges,
    short_of_edge,
)
from .library import gaussian_smooth
from .motion import Motion
from .raising import Ascent, climb
from .session import Segment, Session
from .take import Command, Thing

NAME = "climb"
WALLS = 0.25  # share of low walls
FARTHEST_SHIFT = 0.14  # metres that a foothold is moved at most
BEHIND = (0.2, 0.95)  # metres behind a low wall where one stands
SLACK = 0.12  # metres that the stride over a low wall is longer than it need be
MARGIN = 90  # frames before and after an episode in which feet still come back to their own places
LEAVES = 6  # ways down that are tried
TOP_SPEED = 0.5  # m/s: mean speed at which hips rise or sink at most


def segments(folder: str | Path) -> list[Segment]:
    """No captured pieces: climbs are fitted walks."""
    return []


@dataclass
class Climb:
    """One climb: its object, the command that asks for it, and its crossings of edges (up and down, or one over a wall)."""

    piece: Furniture
    block: Block
    mark: int
    start: int
    up: Crossing
    down: Crossing | None = None
    stand: int = 0  # a frame of standing on top or behind
    end: int = 0
    places: list[tuple[Array, float]] = field(default_factory=list)

    def clear(self, session: Session) -> bool:
        """Whether the way walked keeps off the block but for the climb itself."""
        roots = np.array(session.tape.roots)
        inside = self.block.holds(roots, 0.25)
        inside[self.start : self.end] = False
        # On the way there and away one comes near only where one climbs; a wall is stepped over, not walked around.
        on_way = self.block.holds(roots[self.start : self.up.lift], 0.0).any()
        return not inside.any() and not on_way

    def fit(self, motion: Motion) -> None:
        """Label the climb."""
        for crossing in (self.up, self.down):
            if crossing is not None:
                _ramp(motion, crossing)

    def finish(self, motion: Motion) -> None:
        """Move the feet off the edges, raise them and the hips, and say where the climb ends."""
        first, last = max(self.start - MARGIN, 0), min(self.end + MARGIN, len(motion))
        span = slice(first, last)
        positions, world = forward_kinematics(motion.hips[span], motion.rotations[span])
        holds = pose_holds(positions, world, motion.feet[span])
        h, a, b = self.block.height, self.up.less(first), self.down and self.down.less(first)
        top = np.zeros(len(holds), bool)
        if b is None:
            ascents = [Ascent(a.lift, a.landing, 0.12 * h), Ascent(a.follows + 2, a.both + 6, -0.12 * h)]
        else:
            top = np.array([a.landing - 2 <= x.first < b.landing - 2 for x in holds])
            ascents = [Ascent(a.landing - 2, a.both + 4, h), Ascent(b.lift + 0.2 * (b.landing - b.lift), b.landing + 4, -h)]
        most = np.radians(np.interp(h, (0.15, 0.3, 0.6), (0, 5, 17)))
        away = (np.arange(last - first) - (a.landing + a.follows) / 2) / (0.3 * max(a.both - a.lift, 16))
        lean = most * np.exp(-0.5 * away**2)
        shifts = place_feet(holds, top, self.block)
        if b is None:
            # With the feet close to the wall the hips stay high, and the knees before it.
            lead = next((k for k, x in enumerate(holds) if x.first >= a.landing - 2), len(holds) - 1)
            other = [k for k in range(lead) if holds[k].side != holds[lead].side]
            draw_near(holds, shifts, [*other[-1:], lead], self.block)
        within = (self.start - first, self.end - first)
        motion.hips[span], motion.rotations[span] = climb(
            motion.hips[span], motion.rotations[span], motion.feet[span], self.block, holds, top, shifts, within, ascents, lean
        )
        at = slice(self.stand, self.stand + 8)
        place = np.append(motion.hips[at, :2].mean(0), 0.0 if self.down is None else self.block.height).astype(np.float32)
        frame, heading = motion.commands[self.mark].frame, float(np.mean(motion.headings[at]))
        motion.commands[self.mark] = Command(frame, "idle+walk", place, heading, len(motion.things))
        motion.things.append(Thing.standing(self.piece, self.block.position, self.block.heading))


def _ramp(motion: Motion, c: Crossing) -> None:
    motion.ramp(CLIMB, c.lift - 6, c.lift + 3, max(c.both - 2, c.lift + 4), c.both + 6)


def lay(session: Session) -> Climb | None:
    """Walk up to and onto a step, stand and walk off it, or step over a low wall; the object is put where the feet allow it."""
    rng, tape = session.rng, session.tape
    over = rng.random() < WALLS
    piece = session.draw("low_wall" if over else "step")
    if piece.size[2] > (0.4 if over else 0.45) and rng.random() < 0.6:
        piece = session.draw("low_wall" if over else "step")
    place = session.free_place(1.5, 3.6, 0.5 + 0.5 * float(piece.size[1]))
    if place is None:
        return None
    way = place - tape.roots[-1]
    heading = float(np.arctan2(way[0], -way[1]) + rng.normal(0, 0.6))
    start, mark = len(tape), session.command("idle+walk", session.lead())
    straight = min(rng.uniform(0.9, 1.5), 0.8 * float(np.linalg.norm(way)))
    if not session.go(place, heading, straight_end=straight, speed=float(rng.uniform(0.7, 1.2))):
        return None
    holds = _holds(session, start)
    # One climbs the way one comes over the last step or two.
    roots = np.array(tape.roots[start:])
    far = np.flatnonzero(np.linalg.norm(roots - roots[-1], axis=1) > 0.7)
    if not len(far):
        return None
    way = roots[-1] - roots[far[-1]]
    facing = float(np.arctan2(way[0], -way[1]) + rng.normal(0, 0.05))
    found = _put(session, piece, holds, facing, over)
    if found is None:
        return None
    block, lead = found
    up = crossing_at(holds, lead)
    if up is None:
        return None
    up = _slow(session, up, block.height, start)
    radius = 0.5 * float(np.linalg.norm(piece.size[:2])) + 0.5
    result = Climb(piece, block, mark, start, up, places=[(block.position, radius)])
    tape.stand(rng.uniform(0.3, 2.0))
    result.stand = result.end = max(len(tape) - 9, up.both)
    if over:
        result.end = len(tape)
        return result
    return result if _leave(session, result) else None


def _leave(session: Session, climb: Climb) -> bool:
    """Walk off the top to a place on the floor; half the time led along."""
    rng, tape, block = session.rng, session.tape, climb.block
    saved = session.save()
    for _ in range(LEAVES):
        led = rng.random() < 0.5
        mark, before = session.command("walk" if led else "idle", session.lead()), len(tape)
        spread = 0.35 if min(block.half) < 0.35 else 1.3
        angle = tape.headings[-1] + rng.normal(0, spread)
        out = float(np.abs(rotate_planar(heading_to_direction(np.array(angle)), np.float64(-block.heading))) @ block.half)
        target = tape.roots[-1] + (out + rng.uniform(0.6, 1.8)) * heading_to_direction(np.array(angle))
        if session.go(target, float(angle + rng.normal(0, 0.5)), speed=float(rng.uniform(0.7, 1.2))):
            down = _way_down(session, climb, before)
            if down is not None:
                climb.down = _slow(session, down, block.height, before, up=False)
                if not led:
                    session.stand_here(mark)
                tape.stand(rng.uniform(0.3, 1.2))
                climb.end = len(tape)
                return True
        session.restore(saved)
    return False


def _way_down(session: Session, climb: Climb, before: int) -> Crossing | None:
    """The crossing that leaves the top in the way laid since ``before``; None where feet cannot keep off the edges."""
    holds = _holds(session, climb.start)
    block = climb.block
    new = [k for k, h in enumerate(holds) if h.first >= before]
    if not new:
        return None
    middles = np.array([h.place - 0.055 * heading_to_direction(np.array(h.heading)) for h in holds])
    inside = block.holds(middles, 0.0)
    off = [k for k in new if not inside[k]]
    if not off or inside[off[0] :].any():
        return None
    on_top = np.array([climb.up.landing - 2 <= h.first < holds[off[0]].first for h in holds])
    shifts = np.linalg.norm(shift_off_edges(holds, on_top, block), axis=1)
    # From a high top one steps down from its edge.
    short = float(np.interp(block.height, (0.15, 0.3, 0.5), (0.3, 0.12, 0.03)))
    if shifts.max() > FARTHEST_SHIFT or short_of_edge(holds, on_top, block) > short:
        return None
    return crossing_at(holds, off[0])


def _holds(session: Session, start: int) -> list[Hold]:
    """Footholds of the tape from the hold that lasts at frame ``start`` on."""
    lib, tape = session.lib, session.tape
    first = max(start - 20, 0)
    i = np.array(tape.frames[first:]).astype(int)
    turn = np.array(tape.headings[first:])
    joints = rotate_planar(lib.pose[i][:, [leg[k] for leg in FEET for k in (2, 3)]], np.repeat(turn[:, None], 4, 1))
    joints = joints[..., :2] + np.array(tape.roots[first:])[:, None]
    ankles, toes = joints[:, [0, 2]], joints[:, [1, 3]]
    ahead = toes - ankles
    holds = find_holds(toes, np.arctan2(ahead[..., 0], -ahead[..., 1]), lib.contacts[i])
    return [Hold(h.side, h.first + first, h.last + first, h.place, h.heading) for h in holds]


def _put(session: Session, piece: Furniture, holds: list[Hold], facing: float, over: bool) -> tuple[Block, int] | None:
    """Where the block stands so that the feet need to be moved least, and which hold is the first beyond its edge."""
    rng, tape = session.rng, session.tape
    depth, half = float(piece.size[1]), piece.size[:2].astype(np.float64) / 2
    ahead, heading = heading_to_direction(np.array(facing)), facing + np.pi
    at = np.array([(h.place - tape.roots[-1]) @ ahead for h in holds])
    side = max(0.0, half[0] - 0.3)
    lateral = rng.uniform(-side, side)
    across = np.array((-ahead[1], ahead[0]))
    # The stance at the end is over the middle of the width, give or take.
    centre = np.mean([max((h for h in holds if h.side == s), key=lambda h: h.last).place for s in (0, 1)], axis=0)
    best: tuple[float, Block, int] | None = None
    for k in range(2, len(holds)):
        crossing = crossing_at(holds, k)
        if crossing is None:
            continue
        before = np.arange(len(holds)) < k
        floor, beyond = at[before].max() + TIPS, at[~before].min() - HEEL
        if over:
            low, high = floor + OFF_EDGE, beyond - OFF_EDGE - depth
            if not BEHIND[0] < -(low + high) / 2 - depth < BEHIND[1]:
                continue
        else:
            # Edge between the feet; and the last of them short of the far edge.
            low, high = max(floor + OFF_EDGE, at.max() + TIPS - depth - OVER_EDGE), beyond + 0.01
        # The foot on the floor is the nearer one: its leg follows over the edge.
        edge = (low + high) / 2 if low > high else low + (high - low) * rng.uniform(0.0, 0.5)
        middle = tape.roots[-1] + ahead * (edge + depth / 2) + across * (float((centre - tape.roots[-1]) @ across) + lateral)
        block = Block(middle, heading, half, float(piece.size[2]))
        shifts = np.linalg.norm(shift_off_edges(holds, ~before & (not over), block), axis=1)
        cost = float(shifts.max()) + 0.02 * rng.random()
        if over:
            # A long stride brings the hips down, and the knee behind into the wall.
            cost += 0.5 * max(high - low - SLACK, 0.0)
            if high - low > SLACK + float(np.interp(block.height, (0.2, 0.5), (0.4, 0.05))):
                continue
        if shifts.max() < FARTHEST_SHIFT and (best is None or cost < best[0]):
            best = cost, block, k
    return None if best is None else best[1:]


def _slow(session: Session, c: Crossing, height: float, first: int, up: bool = True) -> Crossing:
    """Stretch the tape's frames from ``first`` on in time about a crossing, more for higher steps."""
    rng, tape, lib = session.rng, session.tape, session.lib
    count = len(tape) - first
    slowest = float(np.interp(height, (0.15, 0.35, 0.6), (0.8, 0.62, 0.45)) * rng.uniform(0.9, 1.15))
    rise = (c.both - c.landing + 6 if up else 0.8 * (c.landing - c.lift) + 4) / FPS
    slowest = float(np.clip(min(slowest, rise * TOP_SPEED / max(height, 0.05)), 0.3, 0.95))
    t = np.arange(first, first + count)
    rate = np.where((t > c.lift - 4) & (t < c.both + 3), slowest, 1.0)
    rate = gaussian_smooth(rate, 3.0).clip(0.25, 1)
    when = np.concatenate(([0.0], np.cumsum(1 / rate[:-1])))  # new time of each old frame, from ``first``
    y = np.interp(np.arange(int(when[-1]) + 1), when, np.arange(count))
    i = np.minimum(y.astype(int), count - 1)
    w = y - i
    frames = np.array(tape.frames[first:])
    roots, headings = np.array(tape.roots[first:]), np.array(tape.headings[first:])
    seams = np.array([s - first for s in tape.seams if s >= first], dtype=int)
    j = np.minimum(i + 1, count - 1)
    step = np.where(np.isin(j, seams), 1.0, frames[j] - frames[i])
    step[frames[i] + 2 > lib.end[frames[i].astype(int)]] = 0.0
    tape.trim(first)
    moved = tuple(int(np.searchsorted(y, s)) for s in seams)
    tape.lay(
        frames[i] + w * step,
        roots[i] + w[:, None] * (roots[j] - roots[i]),
        headings[i] + w * (headings[j] - headings[i]),
        seams=moved,
        seam=False,
    )
    new = [first + int(np.ceil(when[min(max(f - first, 0), count - 1)])) for f in (c.lift, c.landing, c.follows, c.both)]
    return Crossing(*new)
