"""The report of a take: one dict for the sidebar, for batch jobs and for tests."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from nsm_core.body.skeleton import ARMS, forward_kinematics, root_of
from nsm_core.control.goals import GoalResult
from nsm_core.control.judging import goal_errors, line_errors
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.evaluation.measures.motion import depth_report, travel_report
from nsm_core.evaluation.measures.objects import all_depths
from nsm_core.world.actions import BY_KEY
from nsm_core.world.geometry.distance import Union
from nsm_core.world.scene.props import Prop
from nsm_core.world.scene.terrain import merged

from .keyed import KeyedTake
from .shown import ShownTake

STAGES = ("goals", "sensors", "network", "blending", "ik")
_ERRORS = (
    "position_error_cm",
    "rotation_error_deg",
    "network_position_error_cm",
    "network_rotation_error_deg",
)
_WRISTS = [arm[2] for arm in ARMS]
_HAND_ERRORS = ("hand_error_cm", "hand_rotation_deg", "network_hand_error_cm", "network_hand_rotation_deg")


def build_report(
    name: str, result: TakeResult, shown: ShownTake, keyed: KeyedTake, asked: TakeRequest, keying_ms: float
) -> dict[str, Any]:
    """Gather a take's figures, in the units their names end in, as plain values for JSON.

    They are measured on the bones and objects that the scene shows (``shown``); what the network alone did is
    told beside.
    ``frames`` and ``fps`` are those of the keys; ``ms_per_frame`` is per frame of the 30 Hz network clock,
    its ``keying`` being ``keying_ms``.  Lengths are in metres of the character: a scaled one is measured at
    its own size.  ``warnings`` are sentences on what is seen and is not what was made.  It touches none of
    Blender's data, so that a thread may do it.
    """
    ground = asked.ground
    walked = merged((ground, asked.stairs.terrain))
    heights = walked.height if walked else None
    travel = travel_report(shown.hips, shown.local, result.action, ground=heights, figure=asked.figure)
    solids = Union((asked.environment, ground)) if ground else asked.environment
    props = {one.prop.name: one.prop for goal in asked.goals for one in goal.parts if one.prop is not None}
    travel |= depth_report(all_depths(shown.hips, shown.local, solids, props, shown.poses, asked.figure))
    ms = {stage: float(result.stage_ms.get(stage, 0.0)) for stage in STAGES} | {"keying": keying_ms}
    ms["total"] = sum(ms.values())
    return {
        "name": name,
        "frames": keyed.count,
        "fps": round(keyed.fps, 4),
        "goals": [_goal_report(goal, shown, asked.goals[i].prop) for i, goal in enumerate(result.goals)],
        "warnings": _warnings(shown),
        "frames_looked_at": shown.looked_at,
        "shown_off_cm": _number(100 * shown.off),
        "keys": _keys(keyed, shown),
        "kept": keyed.kept.sentence(),
        **{key: _number(value) for key, value in travel.items()},
        "ms_per_frame": {key: _number(value) for key, value in ms.items()},
    }


def _goal_report(goal: GoalResult, shown: ShownTake, prop: Prop | None) -> dict[str, Any]:
    """One goal, judged by what is seen at the frame at which it was judged; hands, at the one at which they
    take its prop.
    """
    values = {
        key: getattr(goal, key) for key in (*_ERRORS, *(_HAND_ERRORS if BY_KEY[goal.action].hands else ()))
    }
    reached, reason = bool(goal.reached), goal.reason
    if math.isfinite(goal.position_error_cm) and goal.place is not None:
        frame = min(goal.end_frame, len(shown.hips) - 1)
        if prop is not None and BY_KEY[goal.action].needs_destination:
            position, heading = shown.poses[prop.name][frame, :3], float(shown.poses[prop.name][frame, 3])
        else:
            position = shown.hips[frame]
            joints, _ = forward_kinematics(position, shown.local[frame], shown.offsets.astype(np.float64))
            heading = float(root_of(joints)[1])
        values["position_error_cm"], values["rotation_error_deg"] = goal_errors(goal, position, heading)
        if reached and values["position_error_cm"] > goal.position_error_cm + 100 * shown.allowed:
            reached = False
            reason = f"On screen it is {values['position_error_cm']:.1f} cm off: {_what_is_off(shown)}"
    if goal.taken is not None and prop is not None and 0 <= goal.taken.frame < len(shown.hips):
        frame = goal.taken.frame
        offsets = shown.offsets.astype(np.float64)
        joints, _ = forward_kinematics(shown.hips[frame], shown.local[frame], offsets)
        values["hand_error_cm"], values["hand_rotation_deg"] = goal.taken.errors(
            joints[_WRISTS], shown.poses[prop.name][frame]
        )
    if goal.line is not None and math.isfinite(goal.line_cm[0]):
        part = slice(goal.start_frame, goal.end_frame + 1)
        joints, _ = forward_kinematics(shown.hips[part], shown.local[part], shown.offsets.astype(np.float64))
        values["line_mean_cm"], values["line_max_cm"] = line_errors(goal.line, joints)
    return {
        "object": goal.object,
        "action": goal.action,
        "reached": reached,
        "seconds": round(float(goal.seconds), 3),
        "reason": reason,
        **({"remarks": list(goal.remarks)} if goal.remarks else {}),
        **({"late_seconds": round(float(goal.late), 3)} if goal.late else {}),
        **{key: _number(value) for key, value in values.items()},
    }


def _keys(keyed: KeyedTake, shown: ShownTake) -> dict[str, Any] | None:
    """How many keys of bones and objects are left of how many, and the largest deviations that this brought,
    measured on the evaluated bones in the frames looked at; None where every frame has its key.
    """
    if keyed.reduced is None:
        return None
    each = [keyed.reduced, *(thing.reduced for thing in keyed.things if thing.reduced is not None)]
    return {
        "before": sum(one.before for one in each),
        "after": sum(one.after for one in each),
        "deviation_mm": _number(1000 * shown.off),
        "deviation_deg": _number(math.degrees(shown.turned)),
    }


def _what_is_off(shown: ShownTake) -> str:
    return (
        f"{shown.off_name} is {100 * shown.off:.1f} cm from its keys at frame {shown.off_frame}, so that "
        "something else moves it."
    )


def _warnings(shown: ShownTake) -> list[str]:
    """What an animator would see and no other figure tells."""
    if shown.off > shown.allowed:
        return [f"On screen {_what_is_off(shown)} Mute what moves it and generate again."]
    return []


def _number(value: float) -> float | None:
    """A rounded number as JSON can hold it; None where there is none."""
    return round(float(value), 4) if math.isfinite(value) else None


def goal_line(goal: dict[str, Any]) -> str:
    """One sentence about one goal of a report."""
    distance, turn = goal["position_error_cm"], goal["rotation_error_deg"]
    errors = "never near it" if distance is None or turn is None else f"{distance:.1f} cm and {turn:.1f}° off"
    if goal["reached"] and "line_mean_cm" in goal:
        told = "".join(f" {remark}." for remark in goal.get("remarks", ()))
        return (
            f"{goal['object']}: gone along in {goal['seconds']:.1f} s, {goal['line_mean_cm']:.1f} cm off it "
            f"on average and {goal['line_max_cm']:.1f} cm at most.{told}"
        )
    remarks = goal.get("remarks", ())
    sentences = [remark for remark in remarks if remark.endswith(".")]
    if goal["reached"] and remarks and not sentences:
        return f"{goal['object']}: {', '.join(remarks)}."
    if goal["reached"]:
        late = goal.get("late_seconds", 0.0)
        told = (
            ""
            if not late
            else (
                f" That is {abs(late):.1f} s {'later' if late > 0 else 'earlier'} than asked for: "
                f"{'it cannot be there sooner' if late > 0 else 'it did not wait so long'}."
            )
        )
        done = f"{BY_KEY[goal['action']].done} after {goal['seconds']:.1f} s, {errors}.{told}"
        return " ".join((f"{goal['object']}: {done}", *sentences))
    if goal.get("reason"):
        return f"{goal['object']}: not reached. {goal['reason']}"
    return (
        f"{goal['object']}: not reached in {goal['seconds']:.1f} s, {errors}; clear its way, start nearer, "
        "or try another seed."
    )


def result_lines(
    report: dict[str, Any], first: int = 1, scene_end: int | None = None
) -> list[tuple[str, bool]]:
    """Lines about a take for the sidebar, each with whether it is good news.

    ``first`` is the frame of its first key; ``scene_end``, the scene's last frame, is told where it cuts the
    take off.
    """
    lines = [(goal_line(goal), bool(goal["reached"])) for goal in report["goals"]]
    lines += [(warning, False) for warning in report.get("warnings", ())]
    last = first + report["frames"] - 1
    short = (
        ""
        if scene_end is None or last <= scene_end
        else f"; the scene ends at {scene_end}, so set its End to {last} to play all"
    )
    if report.get("kept"):
        lines.append((report["kept"], True))
    if report.get("keys"):
        keys = report["keys"]
        off = f"{keys['deviation_mm']:.1f} mm and {keys['deviation_deg']:.1f}\u00b0"
        lines.append((f"{keys['after']} keys of {keys['before']} are left, bones at most {off} off.", True))
    lines.append((f"Keys on frames {first} to {last}{short}.", True))
    return lines
