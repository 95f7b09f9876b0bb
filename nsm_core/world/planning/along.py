"""A line that is to be gone, around what stands in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.errors import GoalError
from nsm_core.rotations import Array

from .clearance_map import body_at
from .floor_plan import FloorPlan, path_length, resample_path

_STEP = 0.05  # metres between points of a line
_BRUSH = 0.04  # metres by which a line may come nearer to things than ways are planned
_AWAY = 0.45  # metres before and behind a thing where one leaves the line and comes back to it
# A way around something, against what it spares of the line: longer ones lead elsewhere.
_LONGEST, _AT_LEAST = 4.0, 4.0


@dataclass(frozen=True)
class Detour:
    """A part of a line that is left to go around a thing: its middle (2,), metres, and what stands there."""

    middle: Array
    thing: str

    def __str__(self) -> str:
        return f"went around {self.thing} at {told(self.middle)}"


def around_things(name: str, line: Array, plan: FloorPlan) -> tuple[Array, list[Detour]]:
    """The line (N, 2) that ``name`` asks to be gone, around what stands in it, as points (M, 2); and where
    it leaves the line.

    Raises GoalError that names the spot where there is no way around, or where an end of the line lies in
    something.
    """
    points = resample_path(np.asarray(line, dtype=np.float64), _STEP)
    free = plan.clearance(points) >= plan.radius - _BRUSH
    blocked = np.flatnonzero(~free)
    if not len(blocked):
        return points, []
    for end, which in ((0, "start"), (len(points) - 1, "end")):
        if not free[end]:
            raise GoalError(
                f"The {which} of {name} at {told(points[end])} lies in {_thing(plan, points[end])}, or too "
                f"near to it to stand; move {name}, or what stands there."
            )
    reach = round(_AWAY / _STEP)
    parts: list[Array] = []
    detours, here = [], 0
    # What lies closer together is gone around at once.
    for run in np.split(blocked, np.flatnonzero(np.diff(blocked) > 2 * reach) + 1):
        first, last = _free_before(free, run[0] - reach, -1), _free_before(free, run[-1] + reach, 1)
        middle = points[(run[0] + run[-1]) // 2]
        thing = _thing(plan, points[run])
        try:
            way = plan.find(points[first], points[last])
        except GoalError as error:
            raise GoalError(
                f"{name} is cut at {told(middle)} by {thing}, and no way leads around it; move {name}, or "
                "what stands there."
            ) from error
        if path_length(way) > _LONGEST * path_length(points[first : last + 1]) + _AT_LEAST:
            raise GoalError(
                f"{name} is cut at {told(middle)} by {thing}, and the way around it is "
                f"{path_length(way):.0f} m long; move {name}, or what stands there."
            )
        parts += [points[here:first], way]
        detours.append(Detour(middle, thing))
        here = last + 1
    return np.concatenate((*parts, points[here:])), detours


def _free_before(free: Array, index: int, step: int) -> int:
    """The nearest free point from ``index`` on, in steps; ends of the line are free."""
    index = min(max(index, 0), len(free) - 1)
    while not free[index]:
        index += step
    return index


def _thing(plan: FloorPlan, places: Array) -> str:
    """The name of what stands at places (N, 2) or (2,), where the plan's solids have names."""
    query = plan.solids
    if hasattr(query, "nearest"):
        names = [n for n in query.nearest(body_at(np.atleast_2d(places)), plan.radius) if n is not None]
        if names:
            return f"'{max(set(names), key=names.count)}'"
    return "something"


def told(place: Array) -> str:
    return f"({place[0]:.2f}, {place[1]:.2f}) m"


__all__ = ["Detour", "around_things"]
