"""Ways without an object: walks, runs, steps and turns on the spot."""

from __future__ import annotations

import numpy as np

from nsm_core.data.scenarios.session import Session


def walk(session: Session) -> bool:
    """Walk to a free place: half of the time led along (dynamic goal), else sent there (static goal).

    Some are a step or a turn on the spot; some of those led along are interrupted by what is asked next.
    """
    rng = session.rng
    near = rng.random() < 0.3
    target = session.free_place(0.1, 0.9, 0.05) if near else session.free_place(0.9, 4.0, 0.3)
    if target is None:
        return False
    heading = _towards(session, target, 0.8)
    if near:
        heading = float(session.tape.headings[-1] + rng.uniform(-np.pi, np.pi))
    led = rng.random() < 0.5
    mark, before = session.command("walk" if led else "idle", session.lead()), len(session.tape)
    if not session.go(target, heading):
        return False
    if not led:
        session.stand_here(mark)
    elif len(session.tape) - before > 60 and rng.random() < 0.6:
        session.tape.trim(int(rng.integers(before + 25, len(session.tape) - 15)))
        return True
    session.tape.stand(rng.uniform(0.3, 1.5))
    return True


def run(session: Session) -> bool:
    """Run to a free place some way off, led along; now and then interrupted."""
    rng = session.rng
    target = session.free_place(4.0, 10.0, 0.3)
    if target is None:
        return False
    course = session.course(target, _towards(session, target, 0.5), speed=float(rng.uniform(2.4, 3.6)))
    course.acceleration, course.deceleration, course.turn_distance = float(rng.uniform(1.8, 2.8)), float(rng.uniform(1.4, 2.4)), 1.0
    session.command("run", session.lead())
    before = len(session.tape)
    if not session.follow(course, runs=True):
        return False
    if len(session.tape) - before > 70 and rng.random() < 0.35:
        session.tape.trim(int(rng.integers(before + 30, len(session.tape) - 15)))
        return True
    session.tape.stand(rng.uniform(0.3, 1.2))
    return True


def _towards(session: Session, target: np.ndarray, spread: float) -> float:
    straight = target - session.tape.roots[-1]
    return float(np.arctan2(straight[0], -straight[1]) + session.rng.normal(0, spread))
