"""Climbing: a walk whose footholds are moved off the edges of a step or a low wall and raised to its top, and
the way down.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import FEET
from nsm_core.conventions import FPS
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.matching.segment import Segment
from nsm_core.data.scenarios.session import Session
from nsm_core.distances import FOOT_OVER_EDGE
from nsm_core.rotations import heading_to_direction, rotate_planar
from nsm_core.signals import gaussian_smooth
from nsm_core.world.scene.furniture import Furniture

from .draws import CLIMBS
from .fit import ClimbEpisode
from .footholds import (
    HEEL,
    OFF_EDGE,
    TIPS,
    Block,
    Crossing,
    Foothold,
    crossing_at,
    find_holds,
    shift_off_edges,
    short_of_edge,
)

NAME = "climb"
FARTHEST_SHIFT = 0.14  # metres that a foothold is moved at most
SLACK = 0.12  # metres that the stride over a low wall is longer than it need be
SHORTEST_SWING = 6  # frames of a swing over an edge, as it was walked
PUSHING = 0.6  # share of its pace at which a high step is pushed off from
TOP_SPEED = 0.5  # m/s: mean speed at which hips rise or sink at most


def segments(folder: CaptureFolder) -> list[Segment]:
    """No captured pieces: climbs are fitted walks."""
    return []


def lay(session: Session) -> ClimbEpisode | None:
    """Walk up to and onto a step, stand and walk off it, or step over a low wall; the object is put where the
    feet allow it.
    """
    rng, tape = session.rng, session.tape
    over = rng.random() < CLIMBS.walls
    piece = session.draw("low_wall" if over else "step")
    if piece.size[2] < CLIMBS.low and rng.random() < CLIMBS.fewer_low:
        piece = session.draw("low_wall" if over else "step")
    place = session.free_place(*CLIMBS.place, 0.5 + 0.5 * float(piece.size[1]))
    if place is None:
        return None
    way = place - tape.roots[-1]
    heading = float(np.arctan2(way[0], -way[1]) + rng.normal(0, CLIMBS.off_the_way))
    start, mark = len(tape), session.command("idle+walk", session.lead())
    straight = min(rng.uniform(*CLIMBS.straight_end), 0.8 * float(np.linalg.norm(way)))
    if not session.go(place, heading, straight_end=straight, speed=float(rng.uniform(*CLIMBS.speed))):
        return None
    holds = holds_of(session, start)
    # One climbs the way one comes over the last step or two.
    roots = np.array(tape.roots[start:])
    far = np.flatnonzero(np.linalg.norm(roots - roots[-1], axis=1) > 0.7)
    if not len(far):
        return None
    way = roots[-1] - roots[far[-1]]
    facing = float(np.arctan2(way[0], -way[1]) + rng.normal(0, CLIMBS.off_square))
    found = _put(session, piece, holds, facing, over)
    if found is None:
        return None
    block, lead = found
    up = crossing_at(holds, lead)
    if up is None or up.landing - up.lift < SHORTEST_SWING:
        return None
    up = _slow(session, up, block.height, start)
    radius = 0.5 * float(np.linalg.norm(piece.size[:2])) + 0.5
    result = ClimbEpisode(piece, block, mark, start, up, places=[(block.position, radius)])
    tape.stand(rng.uniform(*CLIMBS.stands))
    result.stand = result.end = max(len(tape) - 9, up.both)
    if over:
        result.end = len(tape)
        return result
    return result if _leave(session, result) else None


def _leave(session: Session, climb: ClimbEpisode) -> bool:
    """Walk off the top to a place on the floor; half the time led along."""
    rng, tape, block = session.rng, session.tape, climb.block
    saved = session.save()
    for _ in range(CLIMBS.leaves):
        led = rng.random() < CLIMBS.led
        mark, before = session.command("walk" if led else "idle", session.lead()), len(tape)
        spread = CLIMBS.off_ahead[int(min(block.half) >= CLIMBS.narrow)]
        angle = tape.headings[-1] + rng.normal(0, spread)
        out = float(
            np.abs(rotate_planar(heading_to_direction(np.array(angle)), np.float64(-block.heading)))
            @ block.half
        )
        target = tape.roots[-1] + (out + rng.uniform(*CLIMBS.beyond)) * heading_to_direction(np.array(angle))
        if session.go(
            target,
            float(angle + rng.normal(0, CLIMBS.off_the_way_down)),
            speed=float(rng.uniform(*CLIMBS.speed)),
        ):
            down = _way_down(session, climb, before)
            if down is not None:
                climb.down = _slow(session, down, block.height, before, up=False)
                if not led:
                    session.stand_here(mark)
                tape.stand(rng.uniform(*CLIMBS.stands_below))
                climb.end = len(tape)
                return True
        session.restore(saved)
    return False


def _way_down(session: Session, climb: ClimbEpisode, before: int) -> Crossing | None:
    """The crossing that leaves the top in the way laid since ``before``; None where feet cannot keep off the
    edges.
    """
    holds = holds_of(session, climb.start)
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
    down = crossing_at(holds, off[0])
    if down is None or down.landing - down.lift < SHORTEST_SWING:
        return None
    # Who stands long with a foot on either level folds the upper leg into the edge.
    return down if down.follows - down.landing <= np.interp(block.height, (0.2, 0.35), (9, 4)) else None


def holds_of(session: Session, start: int) -> list[Foothold]:
    """Footholds of the tape from the hold that lasts at frame ``start`` on."""
    lib, tape = session.lib, session.tape
    first = max(start - 20, 0)
    i = np.array(tape.frames[first:]).astype(int)
    turn = np.array(tape.headings[first:])
    joints = rotate_planar(
        lib.pose[i][:, [leg[k] for leg in FEET for k in (2, 3)]], np.repeat(turn[:, None], 4, 1)
    )
    joints = joints[..., :2] + np.array(tape.roots[first:])[:, None]
    ankles, toes = joints[:, [0, 2]], joints[:, [1, 3]]
    ahead = toes - ankles
    holds = find_holds(toes, np.arctan2(ahead[..., 0], -ahead[..., 1]), lib.contacts[i])
    return [Foothold(h.side, h.first + first, h.last + first, h.place, h.heading) for h in holds]


def _put(
    session: Session, piece: Furniture, holds: list[Foothold], facing: float, over: bool
) -> tuple[Block, int] | None:
    """Where the block stands so that the feet need to be moved least, and which hold is the first beyond its
    edge.
    """
    rng, tape = session.rng, session.tape
    depth, half = float(piece.size[1]), piece.size[:2].astype(np.float64) / 2
    ahead, heading = heading_to_direction(np.array(facing)), facing + np.pi
    at = np.array([(h.place - tape.roots[-1]) @ ahead for h in holds])
    side = max(0.0, half[0] - CLIMBS.from_sides)
    lateral = rng.uniform(-side, side)
    across = np.array((-ahead[1], ahead[0]))
    # The stance at the end is over the middle of the width, give or take.
    centre = np.mean(
        [max((h for h in holds if h.side == s), key=lambda h: h.last).place for s in (0, 1)], axis=0
    )
    best: tuple[float, Block, int] | None = None
    for k in range(2, len(holds)):
        crossing = crossing_at(holds, k)
        if crossing is None:
            continue
        before = np.arange(len(holds)) < k
        floor, beyond = at[before].max() + TIPS, at[~before].min() - HEEL
        if over:
            low, high = floor + OFF_EDGE, beyond - OFF_EDGE - depth
            if not CLIMBS.behind_wall[0] < -(low + high) / 2 - depth < CLIMBS.behind_wall[1]:
                continue
        else:
            # Edge between the feet; and the last of them short of the far edge.
            low, high = max(floor + OFF_EDGE, at.max() + TIPS - depth - FOOT_OVER_EDGE), beyond + 0.01
        # The foot on the floor is the nearer one: its leg follows over the edge.
        edge = (low + high) / 2 if low > high else low + (high - low) * rng.uniform(*CLIMBS.into_stride)
        middle = (
            tape.roots[-1]
            + ahead * (edge + depth / 2)
            + across * (float((centre - tape.roots[-1]) @ across) + lateral)
        )
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
    rng, tape = session.rng, session.tape
    count = len(tape) - first
    slowest = float(np.interp(height, (0.15, 0.35, 0.6), (0.8, 0.62, 0.45)) * rng.uniform(*CLIMBS.slowness))
    rise = (c.both - c.landing + 6 if up else 0.8 * (c.landing - c.lift) + 4) / FPS
    slowest = float(np.clip(min(slowest, rise * TOP_SPEED / max(height, 0.05)), 0.3, 0.95))
    t = np.arange(first, first + count)
    rate = np.where((t > c.lift - 4) & (t < c.both + 3), slowest, 1.0)
    if up:  # who climbs high pushes off for as long as the body takes to come over the foot on top
        pushes = (t >= c.landing - 1) & (t <= c.follows)
        rate = np.where(pushes, np.interp(height, (0.2, 0.45), (1.0, PUSHING)) * rate, rate)
    when = tape.stretch(first, gaussian_smooth(rate, 3.0).clip(0.25, 1))
    new = [
        first + int(np.ceil(when[min(max(f - first, 0), count - 1)]))
        for f in (c.lift, c.landing, c.follows, c.both)
    ]
    return Crossing(*new)
