"""Performances of picking and placing: walk up, reach, hold, come back; between them steps aside, turns and
squats.  No free captures show them, so they are laid of captured walks and reaches (papers/002 section 7 has
its own captures).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.inertialization import soften_seam
from nsm_core.body.skeleton import ARMS, INDEX
from nsm_core.conventions import FPS
from nsm_core.data.matching.segment import LaidSegment
from nsm_core.data.matching.source import Source
from nsm_core.data.scenarios.composer import plant, played
from nsm_core.data.scenarios.gaze import look_ahead
from nsm_core.data.scenarios.landing import hold
from nsm_core.data.scenarios.motion import Motion
from nsm_core.data.scenarios.session import Session
from nsm_core.model.handling.tasks import APPROACHES, HOLDS, LEAVES
from nsm_core.rotations import Array
from nsm_core.signals import intervals

from .reaching import ReachMove, fit_reach


@dataclass(frozen=True)
class HandlingDraws:
    """Shares tell how often something is so, pairs are the ends of an even draw; metres, seconds."""

    parts: tuple[int, int] = (3, 6)
    reaches: float = 0.75  # share of the parts; of the others
    steps: float = 0.4  # share of steps aside, else one walks off or turns on the spot
    stays: float = 0.25  # share of reaches from where one stands
    place: tuple[float, float] = (0.8, 3.2)  # metres to where one walks
    near: tuple[float, float] = (0.05, 0.4)  # metres to where one steps and turns
    height: tuple[float, float] = (0.2, 2.0)  # of the wrist's goal
    like: float = 0.12  # metres of height by which a reach is taken for another, about
    squats: float = 0.35  # share of reaches under
    low: float = 0.75  # metres of height for which one squats
    aside: float = 0.1  # spread of goals about where the captured wrist was, over the floor
    before: float = 0.45  # metres before one who squats
    stands: tuple[float, float] = (0.1, 0.6)
    holds: tuple[float, float] = (0.2, 0.9)


DRAWS = HandlingDraws()
WALKING = 0.25  # m/s of the root from which on hips are said to walk
_SETTLES = 5  # frames over which that is averaged
_WRISTS = [arm[2] for arm in ARMS]
_ARMS = [
    INDEX[f"{side}{joint}"]
    for side in ("Right", "Left")
    for joint in ("Collar", "Shoulder", "Elbow", "Wrist")
]
SOON = 8  # frames from a key frame of a hand within which hips have none


@dataclass(frozen=True)
class Performance:
    """T frames: ``hips`` (T, 3), local ``rotations`` (T, J, 4), ``feet`` (T, 2) that stand, whether hips
    ``walk`` (T,), ``tasks`` (T, 2) of the right and the left hand by ``model.handling.tasks``, and ``keys``
    (T,), true at key frames: where a label changes (section 5.1).
    """

    hips: Array
    rotations: Array
    feet: Array
    walk: Array
    tasks: Array
    keys: Array


def perform(source: Source, seed: int) -> Performance | None:
    """The performance of ``seed``; None where the draw did not work out."""
    rng = np.random.default_rng((7, seed))
    session = Session(source, rng)
    tape = session.tape
    tape.lay([int(rng.choice(source.still))], [np.zeros(2)], [float(rng.uniform(-np.pi, np.pi))])
    tape.stand(rng.uniform(*DRAWS.stands))
    reaches: list[ReachMove] = []
    squats: list[int] = []
    for _ in range(int(rng.integers(*DRAWS.parts))):
        saved = session.save()
        if rng.random() < DRAWS.reaches:
            reach = _reach(session, squats)
            if reach is not None:
                reaches.append(reach)
                continue
        elif _move(session):
            continue
        session.restore(saved)
    if not reaches:
        return None
    tape.stand(rng.uniform(*DRAWS.stands))
    return _finished(session, reaches, squats)


def _move(session: Session) -> bool:
    """A step aside as captured, else a walk or a turn on the spot."""
    rng, tape = session.rng, session.tape
    if rng.random() < DRAWS.steps:
        pieces = session.source.segments["step"]
        if pieces:
            piece = pieces[int(rng.integers(len(pieces)))]
            tape.run_on(np.arange(piece.first, piece.last - 1), seam=True)
            return True
    return _go(session, DRAWS.near if rng.random() < 0.5 else DRAWS.place)


def _go(session: Session, away: tuple[float, float]) -> bool:
    target = session.free_place(*away, 0.0)
    if target is None:
        return False
    turned = session.tape.headings[-1] + session.rng.uniform(-np.pi, np.pi)
    if not session.go(target, float(turned)):
        return False
    session.tape.stand(session.rng.uniform(*DRAWS.stands))
    return True


def _reach(session: Session, squatted: list[int]) -> ReachMove | None:
    """Walk to a place, or stay, and reach; the first frame of a squat is added to ``squatted``."""
    rng, tape, lib = session.rng, session.tape, session.lib
    if rng.random() > DRAWS.stays and not _go(session, DRAWS.place):
        return None
    height = float(rng.uniform(*DRAWS.height))
    squats = session.source.segments["squat"]
    squat = bool(height < DRAWS.low and squats and rng.random() < DRAWS.squats)
    if squat:
        piece = squats[int(rng.integers(len(squats)))]
        side = int(rng.integers(2))
        goal = np.array((rng.normal(0, DRAWS.aside) + (-0.18, 0.18)[side], -DRAWS.before, height))
    else:
        piece, side = _like(session, height)
        goal = np.append(lib.pose[piece.marks["there"], _WRISTS[side], :2], height)
    goal[:2] += rng.normal(0, DRAWS.aside, 2)
    there, start = piece.marks["there"], len(tape)
    tape.run_on(np.arange(piece.first, there + 1), seam=True)
    at = len(tape) - 1
    tape.stay(rng.uniform(*DRAWS.holds))
    leaves = len(tape) - 1
    tape.run_on(np.arange(there, piece.last - 1), seam=False)
    if squat:
        squatted.append(start)
    return ReachMove(side, start, at, leaves, len(tape) - 1, goal)


def _like(session: Session, height: float) -> tuple[LaidSegment, int]:
    """A captured reach about as high, and its hand."""
    lib, pieces = session.lib, session.source.segments["reach"]
    there = np.array([p.marks["there"] for p in pieces])
    first = np.array([p.first for p in pieces])
    away = np.linalg.norm(lib.pose[there][:, _WRISTS] - lib.pose[first][:, _WRISTS], axis=-1)
    sides = np.argmax(away, axis=1)
    off = np.abs(lib.pose[there, np.array(_WRISTS)[sides], 2] - height)
    cost = off / DRAWS.like + session.rng.exponential(1.0, len(off))
    best = int(np.argmin(cost))
    return pieces[best], int(sides[best])


def _finished(session: Session, reaches: list[ReachMove], squats: list[int]) -> Performance | None:
    tape = session.tape
    hips, rotations, feet, _ = played(session)
    for squat in squats:
        _let_hang(rotations, squat, tape.seams)
    for seam in tape.seams:
        soften_seam(hips, rotations, seam)
    motion = Motion(hips, rotations, np.array(tape.roots), np.array(tape.headings), feet, [], session.rng)
    hold(motion, tape.seams)
    look_ahead(motion)
    plant(motion)
    hips, rotations = motion.hips, motion.rotations
    for reach in reaches:
        hips, rotations = fit_reach(hips, rotations, motion.roots, motion.headings, reach)
    if not (np.isfinite(hips).all() and np.isfinite(rotations).all()):
        return None
    tasks = np.zeros((len(hips), 2), np.int8)
    for r in reaches:
        tasks[r.start : r.there, r.side] = APPROACHES
        tasks[r.there : r.leaves + 1, r.side] = HOLDS
        tasks[r.leaves + 1 : r.end, r.side] = LEAVES
    walk = _walks(motion.roots)
    keys = _keys(walk, tasks)
    return Performance(
        hips.astype(np.float32), rotations.astype(np.float32), motion.feet.copy(), walk, tasks, keys
    )


def _let_hang(rotations: Array, start: int, seams: list[int]) -> None:
    """Let both arms hang in a squat that begins at ``start``, as before it, until another piece begins: who
    squatted held them up by protocol.
    """
    end = min((s for s in seams if s > start), default=len(rotations))
    rotations[start:end, _ARMS] = rotations[max(start - 1, 0), _ARMS]


def _keys(walk: Array, tasks: Array) -> Array:
    """Key frames (T,): a label of a hand changes, or that of the hips, and none of a hand is near."""
    hands = np.zeros(len(walk), bool)
    hands[1:] = (np.diff(tasks, axis=0) != 0).any(1)
    near = np.convolve(hands, np.ones(2 * SOON + 1), mode="same") > 0.5
    hips = np.zeros(len(walk), bool)
    hips[1:] = np.diff(walk) != 0
    keys = hands | (hips & ~near)
    keys[-1] = True
    return keys


def _walks(roots: Array) -> Array:
    """Where hips walk (T,): the root is fast for a while; what is shorter than half a second is none."""
    speed = np.linalg.norm(np.gradient(roots, axis=0), axis=-1) * FPS
    window = np.ones(2 * _SETTLES + 1) / (2 * _SETTLES + 1)
    on = np.convolve(np.pad(speed, _SETTLES, mode="edge"), window, mode="valid") > WALKING
    return _without_short(~_without_short(~on))


def _without_short(on: Array) -> Array:
    """Flags (T,) without runs of less than half a second."""
    out = on.copy()
    for a, b in intervals(on):
        if b - a < FPS // 2:
            out[a:b] = False
    return out


__all__ = ["DRAWS", "Performance", "perform"]
