"""From where one sits down: before the seat, or from its side where something stands before it."""

from __future__ import annotations

import numpy as np

from nsm_core.control.goals import STAND_AHEAD, Goal
from nsm_core.rotations import Array, heading_to_direction
from nsm_core.world.planning.floor_plan import FloorPlan

BLOCKED = 0.14  # metres of room: an open front has 0.17, and a thin board between two looked at heights seems this far off
BESIDE = 0.1  # metres of room that standing beside a seat needs
SIDES = (np.pi / 2, -np.pi / 2)
_ARM = (0.0, 0.25)  # metres over the seated hips between which an arm rest stands in the way
_LANE, _SOLID = 0.12, 0.6  # half the width of the way from the side to the seat, metres; occupancy that counts as solid


def before_seat(goal: Goal, plan: FloorPlan | None = None, here: Array | None = None) -> tuple[Array, float]:
    """Where on the floor (2,) one stands before sitting down, and the heading there.

    Before the seat, as a rule.  Where a desk stands there and a side of the seat is open and free of an arm rest, at that
    side, with the back to the seat: the body turns on the seat then.  ``here`` (2,): from where one comes.
    """
    seat = goal.position[:2].astype(np.float64)
    front = seat + STAND_AHEAD * heading_to_direction(np.array(goal.heading))
    if plan is None or float(plan.clearance(front[None])[0]) > BLOCKED:
        return front, goal.heading
    open_sides = []
    for turn in SIDES:
        heading = goal.heading + turn
        stand = seat + STAND_AHEAD * heading_to_direction(np.array(heading))
        if float(plan.clearance(stand[None])[0]) > BESIDE and not _arm_between(goal, seat, stand):
            open_sides.append((0.0 if here is None else float(np.linalg.norm(stand - here)), stand, heading))
    if not open_sides:
        return front, goal.heading
    _, stand, heading = min(open_sides, key=lambda s: s[0])
    return stand, float(heading)


def _arm_between(goal: Goal, seat: Array, stand: Array) -> bool:
    """Whether the sensed seat has something solid beside the hips, on the way from ``stand`` to ``seat`` (2,)."""
    if goal.interaction is None:
        return False
    cells = goal.interaction.cells_world().astype(np.float64)
    way = (stand - seat) / np.linalg.norm(stand - seat)
    offset = cells[:, :2] - seat
    along, across = offset @ way, np.abs(offset @ np.array((-way[1], way[0])))
    height = cells[:, 2] - float(goal.position[2])
    between = (along > 0.1) & (along < STAND_AHEAD) & (across < _LANE) & (height > _ARM[0]) & (height < _ARM[1])
    return bool((goal.interaction.occupancy[between] > _SOLID).any())
