"""The parts of an evaluation, and what every part's table ends with."""

from __future__ import annotations

from typing import Any

from . import (
    blocked,
    both,
    carry,
    carry_far,
    climb,
    interrupt,
    locomotion,
    open,
    place,
    shut,
    sit,
    stairs,
    touch,
)
from .part import ABLATIONS, Row, TrialPart
from .rollout import Report


class Figures(dict[str, Any]):
    """A summary in which a figure that no trial gave is not a number."""

    def __missing__(self, key: str) -> float:
        return float("nan")


PARTS: dict[str, TrialPart] = {
    "sit": sit.PART,
    "table": sit.AT_TABLES,
    "carry": carry.PART,
    "far": carry_far.PART,
    "open": open.PART,
    "climb": climb.PART,
    "stairs": stairs.PART,
    "travel": locomotion.PART,
    "response": locomotion.RESPONSE,
    "interrupt": interrupt.PART,
    "touch": touch.PART,
    "place": place.PART,
    "shut": shut.PART,
    "blocked": blocked.PART,
    "both": both.PART,
}


def parts_named(name: str) -> list[str]:
    """Names of the parts that ``name`` stands for: the part of that name and its other conditions, else all
    that judge the action of that name.
    """
    if name in PARTS:
        return [name, *(key for key, part in PARTS.items() if part.beside == name)]
    return [key for key, part in PARTS.items() if name in part.judges]


def travel_rows(s: Report, data: float | None = None) -> list[Row]:
    """Lines of the table that every kind of trial has; ``data`` is the training data's own foot slide in
    cm/s.
    """
    aim = "data + 2" if data is None else f"{data + 2:.1f} (data {data:.1f} + 2)"

    def pair(one: str, other: str, digits: int = 1) -> str:
        return f"{s[one]:.{digits}f} / {s[other]:.{digits}f}"

    def spread(key: str, digits: int = 1) -> str:
        return pair(f"{key}_median", f"{key}_worst", digits)

    alone = f"{s['network_slide_moving_cm_s_median']:.1f}"
    bent = pair("knee_backward_deg_worst", "elbow_backward_deg_worst")
    deep = f"{s['deep_share']:.1%}"
    ms = f"{s['ms_per_frame_median']:.1f}"
    turned = spread("turn_per_frame_deg", 0)
    return [
        ("share of all frames deeper than 3 cm in something", deep, "8.1 % (NSM in SAMP)", "4 %"),
        ("deepest penetration cm (median / worst)", spread("penetration_cm"), "", ""),
        ("foot sliding cm/s (all frames of all trials)", f"{s['slide_all']:.1f}", "Fig. 10", aim),
        ("slide while moving cm/s (median / worst)", spread("slide_moving_cm_s"), "", "15"),
        ("slide while moving cm/s, network alone (median)", alone, "", ""),
        ("planted share (median / worst)", spread("planted_share", 2), "", "0.6"),
        ("top speed of the hips m/s (worst)", f"{s['top_speed_m_s_worst']:.2f}", "", ""),
        ("largest turn of a joint per frame deg (median / worst)", turned, "", ""),
        ("knee / elbow bent backward deg (worst)", bent, "", "0"),
        ("ms per frame, one thread, takes together (median)", ms, "", "33.3"),
    ]


__all__ = ["ABLATIONS", "PARTS", "Figures", "Row", "TrialPart", "parts_named", "travel_rows"]
