"""Random goals for hours: does anything break down, throw, or stand for ever?"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from nsm_core.control.take import TakeRequest, TakeResult, TakeRunner
from nsm_core.conventions import FPS
from nsm_core.evaluation.measures.motion import jumps
from nsm_core.evaluation.measures.objects import all_depths, deep_frames
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array, quat_conjugate, quat_mul, quat_to_rotvec
from nsm_core.world.actions import BY_KEY, Aim
from nsm_core.world.assets.pool import Pool

from .rollout import SEED, props_of
from .rooms import OFFERS, make_room, random_goals, random_place, reachable
from .together import Trying

GOALS = 6  # a take
LONGEST = 240.0  # seconds of a take
TIME_LIMIT = 25.0  # seconds per part of a goal: longer than a character must stand to count as frozen
FROZEN, STILL, RIGID = 20.0, 0.05, np.radians(1.0)  # seconds; metres and radians within which all of it stays


@dataclass
class Outcome:
    """What one take of random goals came to.

    ``tally`` counts (asked, reached) by action; ``error`` is a message or "", ``given_up`` why goals were
    passed over.
    """

    seed: int
    seconds: float = 0.0
    error: str = ""
    not_finite: bool = False
    frozen: list[str] = field(default_factory=list)
    tally: dict[str, list[int]] = field(default_factory=dict)
    frames: float = 0.0
    deep: float = 0.0
    turn: float = 0.0
    jolt: float = 0.0
    given_up: list[str] = field(default_factory=list)


def run_seed(model: Model, seed: int, pool: Pool | None = None) -> Trying[Outcome]:
    """Furnish a room, draw a chain of goals, roll it out; whatever goes wrong is part of the outcome."""
    outcome, runner = Outcome(seed), None

    def make(rng: np.random.Generator) -> TakeRequest:
        room = make_room(rng, pool)
        start = random_place(room, rng, room.query)
        goals = random_goals(room, rng, GOALS)
        return TakeRequest(
            start, float(rng.uniform(-np.pi, np.pi)), goals, room.query, seed=seed, time_limit=TIME_LIMIT
        )

    try:
        asked = reachable(make, (SEED, 12, seed))
        runner = TakeRunner(model, asked)
        while runner.frames < LONGEST * FPS and (yield runner):
            pass
    except Exception as error:  # any: to count them is what this is for
        outcome.error = message_of(error)
    if runner is None:
        return outcome
    take = runner.result()
    outcome.seconds = len(take.root) / FPS
    outcome.not_finite = not all(
        np.isfinite(a).all() for a in (take.hips_position, take.local_rotations, take.root)
    )
    for result in take.goals:
        if result.reason:
            outcome.given_up.append(_without_numbers(result.reason))
        if result.seconds > 0 or result.reached or result.reason:
            counts = outcome.tally.setdefault(result.action, [0, 0])
            counts[0], counts[1] = counts[0] + 1, counts[1] + int(result.reached)
    outcome.frozen = frozen_goals(take)
    if not outcome.not_finite:
        depths = all_depths(
            take.hips_position, take.local_rotations, asked.environment, props_of(asked), take.props
        )
        outcome.frames, outcome.deep = deep_frames(depths).values()
        changes = jumps(take.hips_position, take.local_rotations)
        outcome.turn, outcome.jolt = changes["turn_per_frame_deg"], changes["jolt_cm"]
    return outcome


def message_of(error: BaseException) -> str:
    """Kind and message of an error with its numbers taken out, so that alike ones count together."""
    return f"{type(error).__name__}: {_without_numbers(str(error))}"


def _without_numbers(message: str) -> str:
    return re.sub(r"-?[0-9]+(?:[.][0-9]+)?", "N", message)


def frozen_goals(take: TakeResult) -> list[str]:
    """Actions of the goals in which a character stood frozen for 20 s: no idle, not reached."""
    found = []
    for k, goal in enumerate(take.goals):
        if BY_KEY[goal.action].aim is Aim.HERE or goal.reached or (k and not goal.start_frame):
            continue
        end = goal.end_frame or len(take.root)
        if stands_frozen(take.root[goal.start_frame : end], take.local_rotations[goal.start_frame : end]):
            found.append(goal.action)
    return found


def stands_frozen(root: Array, local_rotations: Array, seconds: float = FROZEN) -> bool:
    """Whether for ``seconds`` roots (T, 3) stay within 5 cm and joints (T, 23, 4) within 1 degree of where
    they were.
    """
    length = round(seconds * FPS)
    for a in range(0, len(root) - length + 1, FPS):
        way = root[a : a + length, :2]
        if np.linalg.norm(way.max(0) - way.min(0)) >= STILL:
            continue
        local = local_rotations[a : a + length].astype(np.float64)
        turned = np.linalg.norm(quat_to_rotvec(quat_mul(quat_conjugate(local[:1]), local)), axis=-1)
        if turned.max() < RIGID:
            return True
    return False


def summarise(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Counts over all takes."""
    messages = Counter(o.error for o in outcomes if o.error)
    given_up = Counter(reason for o in outcomes for reason in o.given_up)
    tally = {
        a: np.sum([o.tally[a] for o in outcomes if a in o.tally], axis=0).tolist()
        for a in OFFERS
        if any(a in o.tally for o in outcomes)
    }
    frames = sum(o.frames for o in outcomes)
    return {
        "takes": len(outcomes),
        "seconds": sum(o.seconds for o in outcomes),
        "not_finite": sum(o.not_finite for o in outcomes),
        "frozen": sum(len(o.frozen) for o in outcomes),
        "frozen_seeds": [o.seed for o in outcomes if o.frozen],
        "errors": dict(messages),
        "given_up": dict(given_up),
        "error_seeds": [o.seed for o in outcomes if o.error],
        "asked_reached": tally,
        "deep_share": sum(o.deep for o in outcomes) / frames if frames else float("nan"),
        "turn_per_frame_deg_worst": max((o.turn for o in outcomes), default=float("nan")),
        "jolt_cm_worst": max((o.jolt for o in outcomes), default=float("nan")),
    }


def stress_table(s: dict[str, Any]) -> str:
    """The counts as text."""
    rows = [
        ("takes with values that are not numbers", f"{s['not_finite']}", "0"),
        ("goals in which the character stood frozen for 20 s", f"{s['frozen']}", "0"),
        ("takes that broke off with an error", f"{sum(s['errors'].values())}", "0"),
        *(
            (f"of these: {message}", str(count), "")
            for message, count in sorted(s["errors"].items(), key=lambda e: -e[1])
        ),
        *(
            (f"goals passed over: {reason}", str(count), "")
            for reason, count in sorted(s["given_up"].items(), key=lambda e: -e[1])
        ),
        *(
            (f"{action}: goals reached", f"{done} of {asked} ({done / asked:.0%})", "")
            for action, (asked, done) in s["asked_reached"].items()
        ),
        ("share of frames deeper than 3 cm in something", f"{s['deep_share']:.1%}", "4 %"),
        ("largest turn of a joint per frame deg", f"{s['turn_per_frame_deg_worst']:.0f}", ""),
        ("largest change of a joint's step cm", f"{s['jolt_cm_worst']:.1f}", ""),
    ]
    lines = [f"| {s['seconds']:.0f} s of random goals in {s['takes']} takes | ours | aim |", "|---|---|---|"]
    return "\n".join(lines + ["| " + " | ".join(r) + " |" for r in rows])
