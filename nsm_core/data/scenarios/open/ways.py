"""Ways about a door that is not there yet: a step back from its handle, a walk through its opening."""

from __future__ import annotations

from typing import Any

import numpy as np

from nsm_core.data.scenarios.session import Session
from nsm_core.distances import HANDLE_STAND, PASS_BEYOND, PULL_BACK
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.signals import gaussian_smooth
from nsm_core.world.planning.path import Course

from .draws import OPENS


def step_back(session: Session, heading: float) -> bool:
    """Step straight back with the face to the door at ``heading``; False where that failed."""
    rng, here = session.rng, session.tape.roots[-1]
    way = np.linspace(0, PULL_BACK + rng.uniform(*OPENS.further_back), 24)[:, None] * -heading_to_direction(
        np.array(heading)
    )
    course = Course(here + way, heading, float(rng.uniform(*OPENS.back_speed)), 100.0, 1.0, 0.8)
    return session.follow(course)


def straight_on(session: Session, root: Array, heading: float) -> bool:
    """Walk straight on to the far side of a door, at the pace of one who opens it, and stand there; False
    where that failed.

    ``root`` (2,) is where one stands to take its handle.
    """
    rng, tape = session.rng, session.tape
    before = len(tape)
    target = root + (HANDLE_STAND + PASS_BEYOND) * heading_to_direction(np.array(heading))
    course = session.course(target, heading, speed=float(rng.uniform(*OPENS.through_speed)), straight_end=1.0)
    course.turn_distance = 2.5
    if not session.follow(course):
        return False
    _slow_down(session, before, rng.uniform(*OPENS.slowed))
    tape.stand(rng.uniform(*OPENS.stands_beyond))
    return True


def _slow_down(session: Session, before: int, rate: float) -> None:
    """Play the tape from frame ``before`` on more slowly; seams move with their frames."""
    tape = session.tape
    frames, roots, headings = (np.array(x[before:]) for x in (tape.frames, tape.roots, tape.headings))
    count = len(frames)
    seams = [s - before for s in tape.seams if s >= before]
    when: Any = []
    new: list[Any] = []
    for a, b in zip([0, *(s for s in seams if s > 0)], [*(s for s in seams if s > 0), count], strict=True):
        new.append(len(when))
        when += list(np.arange(a, b - 1 + 1e-9, rate))
    when = np.array(when)
    tape.trim(before)
    tape.lay(
        np.interp(when, np.arange(count), frames),
        np.stack([np.interp(when, np.arange(count), roots[:, k]) for k in (0, 1)], axis=1),
        np.interp(when, np.arange(count), headings),
        tuple(n for n in new if n or 0 in seams),
        seam=False,
    )


def joints_from(session: Session, first: int) -> Array:
    """Joints (T, 23, 3), world, of the tape from frame ``first`` on, before anything is fitted."""
    lib, tape = session.lib, session.tape
    frames, headings = np.array(tape.frames[first:]).astype(int), np.array(tape.headings[first:])
    joints = rotate_planar(lib.pose[frames], np.repeat(headings[:, None], lib.pose.shape[1], axis=1))
    joints[..., :2] += np.array(tape.roots[first:])[:, None]
    return gaussian_smooth(joints, 2.0)
