"""The parts of an evaluation, and what every part's table ends with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from . import carry, carry_far, climb, interrupt, locomotion, rollout, sit
from . import open as doors
from .rollout import Report

Row = tuple[str, str, str, str]


class Figures(dict[str, Any]):
    """A summary in which a figure that no trial gave is not a number."""

    def __missing__(self, key: str) -> float:
        return float("nan")


@dataclass(frozen=True)
class TrialPart:
    """One part: its trials (starts, pool), one trial's take and figures, the summary over trials and the lines of its table."""

    title: str
    trials: Callable[[int, Any], list[Any]]
    run: Callable[..., tuple[Any, Report]]
    summarise: Callable[[Sequence[Report]], Report]
    rows: Callable[[Report], list[Row]]
    request: Callable[..., Any] | None = None
    ablations: tuple[str, ...] = ()
    travels: bool = True
    done: str = "reached"  # the figure that tells whether a trial went well


# What is left out at run time: the switches of the stepper, and sensors that read nothing.  Nothing is trained again.
ABLATIONS = {
    "no bi-directional control": "goal-centric trajectory and future pose not used at run time",
    "interaction sensor zeroed": "reads nothing at run time; the network was trained with it",
    "environment sensor zeroed": "reads nothing at run time; the network was trained with it",
}
_ALL = tuple(ABLATIONS)

PARTS: dict[str, TrialPart] = {
    "sit": TrialPart(
        "sit, on seats not seen in training",
        lambda starts, pool: sit.trials(starts, pool=pool), sit.run_trial, sit.summarise, sit.rows, sit.request, _ALL,
    ),
    "table": TrialPart(
        "sit, on seats partly under a table",
        lambda starts, pool: sit.trials_at_tables(starts, pool=pool), sit.run_trial, sit.summarise, sit.rows,
        sit.request,
    ),
    "carry": TrialPart(
        "carry",
        lambda starts, pool: carry.trials(starts, pool=pool), carry.run_trial, carry.summarise, carry.rows,
        carry.request, _ALL, done="placed",
    ),
    "far": TrialPart(
        "carry, boxes far from edges, onto shelves, and large ones",
        lambda starts, pool: carry_far.trials(starts), carry_far.run_trial, carry_far.summarise, carry_far.rows, carry.request,
        done="sound",
    ),
    "open": TrialPart(
        "open",
        lambda starts, pool: doors.trials(starts, pool=pool), doors.run_trial, doors.summarise, doors.rows, doors.request, done="passed",
    ),
    "climb": TrialPart(
        "climb",
        lambda starts, pool: climb.trials(starts, pool=pool), climb.run_trial, climb.summarise, climb.rows,
        climb.request, done="stands",
    ),
    "travel": TrialPart(
        "walks between furniture and through holes, runs",
        locomotion.trials, locomotion.run_trial, locomotion.summarise, locomotion.rows, locomotion.request,
    ),
    "response": TrialPart(
        "seconds from an order until its label passes 0.9",
        locomotion.orders, locomotion.run_order, rollout.summarise, locomotion.order_rows, travels=False,
    ),
    "interrupt": TrialPart(
        "a new goal at a random frame of an action",
        interrupt.trials, interrupt.run_trial, interrupt.summarise, interrupt.rows, interrupt.request,
    ),
}  # fmt: skip


def travel_rows(s: Report, data: float | None = None) -> list[Row]:
    """Lines of the table that every kind of trial has; ``data`` is the training data's own foot slide in cm/s."""
    aim = "data + 2" if data is None else f"{data + 2:.1f} (data {data:.1f} + 2)"
    return [
        ("share of all frames deeper than 3 cm in something", f"{s['deep_share']:.1%}", "8.1 % (NSM in SAMP)", "4 %"),
        ("deepest penetration cm (median / worst)", f"{s['penetration_cm_median']:.1f} / {s['penetration_cm_worst']:.1f}", "", ""),
        ("foot sliding cm/s (all frames of all trials)", f"{s['slide_all']:.1f}", "Fig. 10", aim),
        ("slide while moving cm/s (median / worst)", f"{s['slide_moving_cm_s_median']:.1f} / {s['slide_moving_cm_s_worst']:.1f}", "", "15"),
        ("slide while moving cm/s, network alone (median)", f"{s['network_slide_moving_cm_s_median']:.1f}", "", ""),
        ("planted share (median / worst)", f"{s['planted_share_median']:.2f} / {s['planted_share_worst']:.2f}", "", "0.6"),
        ("top speed of the hips m/s (worst)", f"{s['top_speed_m_s_worst']:.2f}", "", ""),
        ("largest turn of a joint per frame deg (median / worst)",
         f"{s['turn_per_frame_deg_median']:.0f} / {s['turn_per_frame_deg_worst']:.0f}", "", ""),
        ("knee / elbow bent backward deg (worst)", f"{s['knee_backward_deg_worst']:.1f} / {s['elbow_backward_deg_worst']:.1f}", "", "0"),
        ("ms per frame, one thread (median)", f"{s['ms_per_frame_median']:.1f}", "", "33.3"),
    ]  # fmt: skip


__all__ = ["ABLATIONS", "PARTS", "Figures", "TrialPart", "travel_rows"]
