"""Ways without an object: walks, runs, steps and turns on the spot."""

from __future__ import annotations

import numpy as np

from nsm_core.data.scenarios.session import Session
from nsm_core.rotations import Array

from .draws import RUNS, WALKS


def walk(session: Session) -> bool:
    """Walk to a free place: half of the time led along (dynamic goal), else sent there (static goal).

    Some are a step or a turn on the spot; some of those led along are interrupted by what is asked next.
    """
    rng = session.rng
    near = rng.random() < WALKS.near
    target = session.free_place(*WALKS.near_place, 0.05) if near else session.free_place(*WALKS.place, 0.3)
    if target is None:
        return False
    heading = _towards(session, target, WALKS.off_the_way)
    if near:
        heading = float(session.tape.headings[-1] + rng.uniform(-np.pi, np.pi))
    led = rng.random() < WALKS.led
    mark, before = session.command("walk" if led else "idle", session.lead()), len(session.tape)
    if not session.go(target, heading):
        return False
    if not led:
        session.stand_here(mark)
    elif len(session.tape) - before > WALKS.long and rng.random() < WALKS.interrupted:
        session.tape.trim(int(rng.integers(before + WALKS.earliest, len(session.tape) - WALKS.latest)))
        return True
    session.tape.stand(rng.uniform(*WALKS.stands))
    return True


def run(session: Session) -> bool:
    """Run to a free place some way off, led along; now and then interrupted."""
    rng = session.rng
    target = session.free_place(*RUNS.place, 0.3)
    if target is None:
        return False
    course = session.course(
        target, _towards(session, target, RUNS.off_the_way), speed=float(rng.uniform(*RUNS.speed))
    )
    course.acceleration, course.deceleration = (
        float(rng.uniform(*RUNS.acceleration)),
        float(rng.uniform(*RUNS.deceleration)),
    )
    course.turn_distance = RUNS.turn_distance
    session.command("run", session.lead())
    before = len(session.tape)
    if not session.follow(course, runs=True):
        return False
    if len(session.tape) - before > RUNS.long and rng.random() < RUNS.interrupted:
        session.tape.trim(int(rng.integers(before + RUNS.earliest, len(session.tape) - RUNS.latest)))
        return True
    session.tape.stand(rng.uniform(*RUNS.stands))
    return True


def _towards(session: Session, target: Array, spread: float) -> float:
    straight = target - session.tape.roots[-1]
    return float(np.arctan2(straight[0], -straight[1]) + session.rng.normal(0, spread))
