"""The report of a take: one dict for the sidebar, for batch jobs and for tests."""

from __future__ import annotations

import math
from typing import Any

from nsm_core.control.take import TakeResult
from nsm_core.control.terrain import Terrain
from nsm_core.evaluation.metrics import travel_report
from nsm_core.sensors.query import DistanceQuery, Union

from .keying import KeyedTake

STAGES = ("goals", "sensors", "network", "blending", "ik")
_DONE = {
    "sit": "sat down", "walk": "arrived", "run": "arrived", "idle": "stands",
    "carry": "set down", "open": "passed", "climb": "climbed",
}  # fmt: skip
_ERRORS = ("position_error_cm", "rotation_error_deg", "network_position_error_cm", "network_rotation_error_deg")
_HAND_ERRORS = ("hand_error_cm", "hand_rotation_deg", "network_hand_error_cm", "network_hand_rotation_deg")


def build_report(
    name: str, result: TakeResult, keyed: KeyedTake, environment: DistanceQuery, ground: Terrain, keying_ms: float
) -> dict[str, Any]:
    """Gather a take's figures, in the units their names end in, as plain values for JSON.

    ``frames`` and ``fps`` are those of the keys; ``ms_per_frame`` is per frame of the 30 Hz network clock, its
    ``keying`` being ``keying_ms``.  Lengths are in metres of the character: a scaled one is measured at its own size.
    """
    solids = Union((environment, ground)) if ground else environment
    heights = ground.height if ground else None
    travel = travel_report(result.hips_position, result.local_rotations, result.action, solids, ground=heights)
    ms = {stage: float(result.stage_ms.get(stage, 0.0)) for stage in STAGES} | {"keying": keying_ms}
    ms["total"] = sum(ms.values())
    goals = [
        {
            "object": goal.object,
            "action": goal.action,
            "reached": bool(goal.reached),
            "seconds": round(float(goal.seconds), 3),
            "reason": goal.reason,
            **{key: _number(getattr(goal, key)) for key in (*_ERRORS, *(_HAND_ERRORS if goal.action in ("carry", "open") else ()))},
        }
        for goal in result.goals
    ]
    return {
        "name": name,
        "frames": keyed.frame_end - keyed.frame_start + 1,
        "fps": round(keyed.fps, 4),
        "goals": goals,
        **{key: _number(value) for key, value in travel.items()},
        "ms_per_frame": {key: _number(value) for key, value in ms.items()},
    }


def _number(value: float) -> float | None:
    """A rounded number as JSON can hold it; None where there is none."""
    return round(float(value), 4) if math.isfinite(value) else None


def goal_line(goal: dict[str, Any]) -> str:
    """One sentence about one goal of a report."""
    distance, turn = goal["position_error_cm"], goal["rotation_error_deg"]
    errors = "never near it" if distance is None or turn is None else f"{distance:.1f} cm and {turn:.1f}° off"
    if goal["reached"]:
        return f"{goal['object']}: {_DONE.get(goal['action'], 'done')} after {goal['seconds']:.1f} s, {errors}."
    if goal.get("reason"):
        return f"{goal['object']}: not reached. {goal['reason']}"
    return f"{goal['object']}: not reached in {goal['seconds']:.1f} s, {errors}; clear its way, start nearer, or try another seed."


def result_lines(report: dict[str, Any], first: int = 1, scene_end: int | None = None) -> list[tuple[str, bool]]:
    """Lines about a take for the sidebar, each with whether it is good news.

    ``first`` is the frame of its first key; ``scene_end``, the scene's last frame, is told where it cuts the take off.
    """
    lines = [(goal_line(goal), bool(goal["reached"])) for goal in report["goals"]]
    last = first + report["frames"] - 1
    short = "" if scene_end is None or last <= scene_end else f"; the scene ends at {scene_end}, so set its End to {last} to play all"
    lines.append((f"Keys on frames {first} to {last}{short}.", True))
    return lines
