"""Interruption trials: a new goal at a random frame of an action, and how much the body jumps there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from nsm_core.control.take import TakeRequest, TakeResult, TakeRunner
from nsm_core.conventions import FPS
from nsm_core.evaluation.measures.motion import jumps
from nsm_core.model.inference.model import Model
from nsm_core.world.assets.pool import Pool

from . import rollout
from .part import TrialPart
from .rollout import SEED, Report
from .rooms import goal_of, make_room, random_place, reachable
from .together import Trying

PAIRS = (
    ("walk", "sit"), ("sit", "walk"), ("run", "idle"), ("carry", "walk"), ("carry", "sit"),
    ("open", "walk"), ("climb", "walk"), ("sit", "carry"), ("walk", "carry"), ("idle", "run"),
)  # fmt: skip
EARLIEST, LATEST = 20, 240  # frames of the take between which the new goal comes
WINDOW = 30  # frames after it in which a jump is its fault
POP = 1.5  # times the largest change of the rest of the take from which on one speaks of a pop
LIMIT = 60.0  # seconds of a take


@dataclass(frozen=True)
class InterruptTrial:
    """One room (by ``seed``), one pair of actions and the frame at which the second takes over."""

    setting: int
    name: str
    frame: int
    seed: int


def trials(starts: int = 10, pool: Pool | None = None) -> list[InterruptTrial]:
    """The same ``starts`` trials of each of ``PAIRS`` at every call; the rooms are made, never drawn from a
    ``pool``.
    """
    result = []
    for n, (first, second) in enumerate(PAIRS):
        rng = np.random.default_rng((SEED, 10, n))
        result += [
            InterruptTrial(n, f"{first} to {second}", int(rng.integers(EARLIEST, LATEST)), k)
            for k in range(starts)
        ]
    return result


def request(trial: InterruptTrial, **more: Any) -> TakeRequest:
    """Set up the take with both goals, the second after the first; in a room in which both can be reached."""
    first, second = trial.name.split(" to ")

    def make(rng: np.random.Generator) -> TakeRequest:
        room = make_room(rng)
        start = random_place(room, rng, room.query, 2.0)
        goals = [goal_of(room, first, rng, hold=LATEST / FPS), goal_of(room, second, rng)]
        return TakeRequest(start, float(rng.uniform(-np.pi, np.pi)), goals, room.query, **more)

    return reachable(make, (SEED, 11, trial.setting, trial.seed))


def run_trial(model: Model, trial: InterruptTrial, **more: Any) -> Trying[tuple[TakeResult, Report]]:
    """Roll one trial out; without a way to interrupt a take, the goals follow one another and ``no_hook``
    says so.
    """
    asked = request(trial, **more)
    before, after = asked.goals
    hook = hasattr(TakeRunner, "interrupt")
    runner = TakeRunner(model, replace(asked, goals=[before]) if hook else asked)
    while runner.frames < trial.frame and (yield runner):
        pass
    if hook:
        runner.interrupt([after])
    while runner.frames < LIMIT * FPS and (yield runner):
        pass
    take = runner.result()
    report, _ = rollout.judge(asked, take, goal=-1)
    report |= jump_report(take, trial.frame) | {"pair": float(trial.setting), "no_hook": float(not hook)}
    return take, report


def jump_report(take: TakeResult, frame: int, window: int = WINDOW) -> Report:
    """Largest changes per frame from ``frame`` on for ``window`` frames, those of the rest of the take, and
    whether it popped.
    """
    inside = slice(max(0, frame - 1), frame + window)
    there = jumps(take.hips_position[inside], take.local_rotations[inside])
    rest = [
        jumps(take.hips_position[s], take.local_rotations[s])
        for s in (slice(0, inside.start), slice(inside.stop, None))
    ]
    usual = {k: max(r[k] for r in rest) for k in there}
    out = {f"there_{k}": v for k, v in there.items()} | {f"rest_{k}": v for k, v in usual.items()}
    out["popped"] = float(
        any(there[k] > POP * max(usual[k], 1e-3) for k in ("turn_per_frame_deg", "jolt_cm"))
    )
    return out


def summarise(reports: Sequence[Report]) -> Report:
    """Figures over trials; see ``rollout.summarise``."""
    return rollout.summarise(reports) | {"popped": rollout.share(reports, lambda r: r["popped"] > 0)}


def rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    lines = [
        ("the new goal reached", f"{s['reached']:.0%}", "", ""),
        ("takes with a change 1.5 times the largest of their rest", f"{s['popped']:.0%}", "", "0 %"),
    ]
    for what, unit in (
        ("turn_per_frame_deg", "turn of a joint deg"),
        ("jolt_cm", "change of a joint's step cm"),
    ):
        for where, name in (("there", "within 1 s of the new goal"), ("rest", "elsewhere")):
            value = f"{s[f'{where}_{what}_median']:.1f} / {s[f'{where}_{what}_worst']:.1f}"
            lines.append((f"largest {unit} per frame {name} (median / worst)", value, "", ""))
    if s["no_hook_worst"] > 0:
        lines.append(("takes cannot be interrupted: the goals only followed one another", "", "", ""))
    return lines


PART = TrialPart(
    "a new goal at a random frame of an action", trials, run_trial, summarise, rows, request,
    tuple(dict.fromkeys(action for pair in PAIRS for action in pair)),
)  # fmt: skip
