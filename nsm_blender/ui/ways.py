"""The settings of a goal that say how its way is gone."""

from __future__ import annotations

from typing import Any

from .properties import goes_along


def draw_way(layout: Any, goal: Any) -> None:
    """Draw what there is to set of the way of a goal to walk or run; nothing of others."""
    from nsm_core.control.goals import SPEEDS

    if goal.action not in SPEEDS:
        return
    if goal.object is not None and goal.object.type == "CURVE":
        layout.prop(goal, "follow")
        if goes_along(goal) and any(spline.use_cyclic_u for spline in goal.object.data.splines):
            layout.prop(goal, "rounds")
    row = layout.row(align=True, heading="Speed")
    row.prop(goal, "own_speed", text="")
    value = row.row()
    value.enabled = goal.own_speed
    value.prop(goal, "speed", text="")
