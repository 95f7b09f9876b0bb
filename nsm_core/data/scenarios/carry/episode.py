"""Carrying: walk to a box, bend and grasp it, lift it, take it somewhere and put it down."""

from __future__ import annotations

import numpy as np

from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.matching.search import ON_THE_MOVE
from nsm_core.data.matching.segment import Segment
from nsm_core.data.matching.selection import load_bends
from nsm_core.data.scenarios.session import Session
from nsm_core.distances import CRATE_SIDE
from nsm_core.rotations import Array, heading_to_direction, rotate_planar, wrap_angle
from nsm_core.world.planning.path import Course
from nsm_core.world.scene.furniture import Furniture, box_mesh, carried_box
from nsm_core.world.scene.props import Box

from .carried import CarryEpisode, Spot
from .draws import CARRIES
from .pick_up import choose_bend, lay_bend
from .supports import Support, draw_support

NAME = "carry"


def segments(folder: CaptureFolder) -> list[Segment]:
    """Captured bends from upright (frame 0) to low; none where the folder has no pick-ups, and then nothing
    is carried.
    """
    return load_bends(folder)


def lay(session: Session) -> CarryEpisode | None:
    """Fetch a box from a free place and bring it to another; some are put back, some sent elsewhere on the
    way.
    """
    rng = session.rng
    if not session.source.segments.get(NAME):
        return None
    box, piece = draw_box(session)
    face = float(rng.integers(4) * np.pi / 2)
    support = draw_support(session, box.across(face))
    fetch = _approach(session, support, box.stand_off(face))
    if fetch is None:
        return None
    taken = bend_to(session, box, face, support)
    if taken is None:
        return None
    if rng.random() < CARRIES.put_back:
        put, bring = _put_back(session, box, face, taken)
    else:
        put, bring = _bring(session, box, face, taken)
    if put is None or not _apart(session, box, taken, put):
        return None
    carry = CarryEpisode(box, piece, face, taken, put, fetch, bring)
    for spot in (taken, put):
        carry.places.append((spot.centre[:2], 0.9))
        if spot.support is not None:
            carry.places.append((spot.position, spot.support.radius + 0.8))
    _leave(session, put)
    return carry


def draw_box(session: Session) -> tuple[Box, Furniture]:
    """A box of sides that one carries, from the pool, and its shape about its centre."""
    piece = session.draw("crate")
    scale = np.clip(piece.size, *CRATE_SIDE) / piece.size
    mins, maxs = ((m - piece.centre) * scale for m in (piece.mins, piece.maxs))
    centred = Furniture("crate", *box_mesh(mins, maxs), mins, maxs, None)
    return carried_box(centred), centred


def _way(
    session: Session, target: Array, heading: float, support: Support | None, box_ahead: float, speed: float
) -> Course:
    """A path to ``target`` before a box that lies ``box_ahead`` metres ahead of it; around it where it is in
    the way.
    """
    rng, start = session.rng, session.tape.roots[-1]
    ahead = heading_to_direction(np.array(heading))
    beyond = float((start - target) @ ahead)
    if beyond > 0.1:
        # A way around a thing behind somebody who faces the other way is a way around a thing before one.
        size = (0.5, box_ahead + 0.2) if support is None else support.extent(box_ahead)
        course = session.course(target, heading + np.pi, size, speed=speed)
        course.final_heading = heading
        return course
    straight = float(rng.uniform(*CARRIES.straight_end)) if rng.random() < CARRIES.straight else 0.0
    return session.course(target, heading, speed=speed, straight_end=straight)


def _walk(
    session: Session,
    away: tuple[float, float],
    support: Support | None,
    box_ahead: float,
    avoid: Spot | None,
    speed: float,
) -> bool:
    """Walk to a free place so many metres ``away`` from here where a box, and what is under it, has room
    ahead.
    """
    rng = session.rng
    size = 0.3 if support is None else 0.25 + support.radius
    for _ in range(8):
        target = session.free_place(*away, 0.3)
        if target is None:
            return False
        way = target - session.tape.roots[-1]
        along = float(np.arctan2(way[0], -way[1]))
        if avoid is not None:
            # Not through what the box was taken from.
            if avoid.support is not None and abs(wrap_angle(along - avoid.facing)) < 1.1:
                continue
        heading = along + float(
            rng.uniform(-np.pi, np.pi)
            if rng.random() < CARRIES.any_heading
            else rng.normal(0, CARRIES.off_the_way)
        )
        centre = target + (
            box_ahead + (0 if support is None else support.radius * 0.6)
        ) * heading_to_direction(np.array(heading))
        walked = np.array(session.tape.roots)
        if np.linalg.norm(walked - centre, axis=1).min() < size or any(
            np.linalg.norm(p - centre) < r + size for p, r in _taken(session)
        ):
            continue
        if avoid is not None and np.linalg.norm(centre - avoid.centre[:2]) < size + 0.6 + (
            avoid.support.radius if avoid.support else 0
        ):
            continue
        course = _way(session, target, heading, support, box_ahead, speed)
        return session.follow(course, arrival=ON_THE_MOVE)
    return False


def _taken(session: Session) -> list[tuple[Array, float]]:
    return [(p, min(r, 0.9)) for e in session.episodes for p, r in e.places]


def _approach(session: Session, support: Support | None, box_ahead: float) -> int | None:
    """Walk to where a box will stand, and say which command fetches it; from far off one is led there
    first.
    """
    rng, tape = session.rng, session.tape
    mark, before = session.command("carry", session.lead()), len(tape)
    here = tape.roots[-1]
    if not _walk(session, CARRIES.fetch, support, box_ahead, None, float(rng.uniform(*CARRIES.fetch_speed))):
        return None
    if np.linalg.norm(tape.roots[-1] - here) > CARRIES.led_first:
        session.commands[mark] = type(session.commands[mark])(session.commands[mark].frame, "walk")
        mark = _from(session, "carry", before, float(rng.uniform(*CARRIES.fetch_asked)))
    return mark


def _from(session: Session, action: str, since: int, distance: float) -> int:
    """Command ``action`` from the frame after ``since`` on at which the tape's end is ``distance`` metres
    away.
    """
    tape = session.tape
    away = np.linalg.norm(np.array(tape.roots[since:]) - tape.roots[-1], axis=1)
    far = np.flatnonzero(away > distance)
    frame = since + (int(far[-1]) + 1 if len(far) else 0)
    return session.command(action, len(tape) - frame)


def bend_to(
    session: Session, box: Box, face: float, support: Support | None, centre: Array | None = None
) -> Spot | None:
    """Bend to a box before the tape's end, or to its ``centre`` (3,) and back up; None where no captured bend
    reaches it.
    """
    rng, tape = session.rng, session.tape
    root, facing = tape.roots[-1], tape.headings[-1] + float(rng.normal(0, CARRIES.off_square))
    width, depth = box.across(face)
    height = float(box.size[2])
    under = 0.0 if support is None else support.top
    if centre is None:
        ahead = np.array((rng.normal(0, CARRIES.aside), -box.stand_off(face) - rng.uniform(*CARRIES.nearer)))
        centre = np.append(root + rotate_planar(ahead, np.float64(facing)), under + height / 2)
    local = rotate_planar(np.append(centre[:2] - root, centre[2]), np.float64(-tape.headings[-1]))
    grasps = local + rotate_planar(box.learned_grasps(face), np.float64(-face + facing - tape.headings[-1]))
    low, high = local - (width / 2, depth / 2, height / 2), local + (width / 2, depth / 2, height / 2)
    if support is not None:
        low, high = low - (0.5, 0, 0), high + (0.5, support.edge, 0)
    low[2] = -1.0
    chosen = choose_bend(session, grasps, low, high)
    if chosen is None:
        return None
    spot = Spot(centre, facing, lay_bend(session, *chosen), support)
    if support is not None:
        spot.position, spot.heading = support.place(centre[:2], facing, depth)
    return spot


def _bring(session: Session, box: Box, face: float, taken: Spot) -> tuple[Spot | None, list[int]]:
    """Walk off with the box and put it down: near ways are asked for by their end, far ones are led
    at first.
    """
    rng, tape = session.rng, session.tape
    support = draw_support(session, box.across(face))
    frame = taken.bend.touch + int(rng.integers(*CARRIES.answer))
    mark, before = session.command("idle+carry", len(tape) - frame), len(tape)
    bring = [mark]
    speed = float(rng.uniform(*CARRIES.speed))
    stand_off = box.stand_off(face)
    if rng.random() < CARRIES.redirected:
        # Sent elsewhere on the way: only the beginning of the first way is walked.
        if not _walk(session, CARRIES.first_way, None, stand_off, taken, speed):
            return None, bring
        cut = int(rng.integers(before + 22, max(len(tape) - 25, before + 23)))
        if cut >= len(tape):
            return None, bring
        session.commands[mark] = type(session.commands[mark])(session.commands[mark].frame, "walk+carry")
        tape.trim(cut)
        mark = session.command("idle+carry", session.lead())
        bring, before = [mark], len(tape)
    if not _walk(session, CARRIES.bring, support, stand_off, taken, speed):
        return None, bring
    if np.linalg.norm(tape.roots[-1] - tape.roots[before]) > CARRIES.bring_led:
        session.commands[mark] = type(session.commands[mark])(session.commands[mark].frame, "walk+carry")
        bring = [_from(session, "idle+carry", before, float(rng.uniform(*CARRIES.bring_asked)))]
    if rng.random() < CARRIES.pauses:
        tape.stand(rng.uniform(*CARRIES.pauses_for))
    return bend_to(session, box, face, support), bring


def _put_back(session: Session, box: Box, face: float, taken: Spot) -> tuple[Spot | None, list[int]]:
    """Hold the box for a while and put it back where it was."""
    rng, tape = session.rng, session.tape
    session.command("walk+carry", len(tape) - taken.bend.touch - int(rng.integers(*CARRIES.answer)))
    tape.stay(rng.uniform(*CARRIES.held_for))
    bring = [session.command("idle+carry", session.lead())]
    return bend_to(session, box, face, taken.support, taken.centre), bring


def _apart(session: Session, box: Box, taken: Spot, put: Spot) -> bool:
    """Whether what is under the box at one place keeps off the other place and off other episodes."""
    spots = [(s.position, s.support.radius) for s in (taken, put) if s.support is not None]
    if taken.support is not None and put.support is taken.support:
        spots = spots[:1]
    others = _taken(session)
    ok = all(np.linalg.norm(p - q) > r + 0.35 for p, r in spots for q, s in others if s < 3)
    if len(spots) == 2:
        ok &= bool(np.linalg.norm(spots[0][0] - spots[1][0]) > spots[0][1] + spots[1][1] + 0.02)
    elif len(spots) == 1 and put.support is not taken.support:
        other = put if taken.support is not None else taken
        ok &= bool(np.linalg.norm(spots[0][0] - other.centre[:2]) > spots[0][1] + 0.35)
    return ok


def _leave(session: Session, put: Spot) -> None:
    """Ask to stand where the bend ends, once hands are off the box; or go on with what is asked next."""
    rng, tape = session.rng, session.tape
    mark = session.command("idle", len(tape) - put.bend.touch - int(rng.integers(*CARRIES.answer)))
    if rng.random() < CARRIES.stands:
        session.stand_here(mark)
        tape.stay(rng.uniform(*CARRIES.stands_for))
    else:
        session.leave_early(mark)
