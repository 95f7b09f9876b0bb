"""What each goal action makes of a goal: stages that command the network and judge how far it has come."""

from __future__ import annotations

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, wrap_angle
from nsm_core.world.affordances.standing import choose_side, further_off, require_room, standing_place
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.props import Box
from nsm_core.world.scene.solids import Scene

from .approach import Command, Ground
from .base import EXECUTED, Stage
from .box_grasp import Carrying
from .carry import Carry
from .climb import Climb, foot_of
from .door_grasp import Opening
from .open import Pass, beyond
from .rise import TurnBack
from .sit import Sit, before_seat
from .walk import Go, Stay

Grasp = Carrying | Opening


def begin(
    goal: Goal, ground: Ground, moment: Moment, grasps: list[Grasp], scene: Scene, ik: bool = True, before: Stage | None = None
) -> Stage:
    """Make the stage of a goal for a character as it is now.

    ``grasps`` are those still at work; ``scene`` what a box may rest on and a leaf may meet; ``ik`` see ``Carrying``;
    ``before`` the stage that it leaves.
    """
    back = before.leave(goal) if before is not None else None
    if back is not None:
        return TurnBack(goal, back, lambda then: begin(goal, ground, then, grasps, scene, ik))
    if goal.action == "idle":
        return Stay(goal, moment)
    if goal.action == "sit":
        return Sit(goal, ground, moment)
    if goal.action == "carry":
        held = next((g for g in grasps if isinstance(g, Carrying) and g.prop is goal.prop and g.state == "held"), None)
        return Carry(goal, ground, moment, scene.but(goal.prop), held, ik)
    if goal.action == "open":
        return Pass(goal, ground, moment, scene.environment, ik)
    return Climb(goal, ground) if goal.action == "climb" else Go(goal, ground)


def standing_places(
    goal: Goal, here: Array, plan: FloorPlan | None, poses: dict[str, Array], solids: DistanceQuery | None = None
) -> list[Array]:
    """Floor places (2,) between which ways must lead to perform a goal from ``here`` (2,), in order.

    An empty list: it is done on the spot.  After a None no way is asked for, as through a door or up a step.  ``poses`` (4,)
    of boxes that earlier goals have moved, by name, are read and kept up to date; ``solids`` are what stands still.
    """
    if goal.action == "idle":
        return []
    if goal.action == "sit":
        return [before_seat(goal, plan, here)[0]]
    if goal.action == "climb":
        return [foot_of(goal), None, goal.position[:2].astype(np.float64)]  # type: ignore[list-item]
    if goal.action == "open":
        reach, end = beyond(goal, here)
        return [reach, None, end]  # type: ignore[list-item]
    if goal.action == "carry":
        box = goal.prop
        assert isinstance(box, Box)
        facing, stand, _ = choose_side(box, plan, here, poses.get(box.name, box.pose), solids)
        where = f"The place of {box.name}"
        require_room(box, np.append(goal.position, goal.heading - facing), solids, where)
        further = further_off(box, facing, goal.position, goal.heading, solids, where)
        poses[box.name] = np.append(goal.position, wrap_angle(goal.heading - facing))
        return [stand, standing_place(box, facing, goal.position, goal.heading, further)]
    return [goal.position[:2].astype(np.float64)]


def check_reachable(goals: list[Goal], plan: FloorPlan, start: Array, solids: DistanceQuery | None = None) -> None:
    """Raise GoalError that names the first goal to which no way leads, or no hand, from the place before it; ``start`` (2,).

    ``solids`` are what stands still.
    """
    here, poses = np.asarray(start, dtype=np.float64), {}
    for goal in goals:
        try:
            asked = True
            for place in standing_places(goal, here, plan, poses, solids):
                if place is not None and asked and np.linalg.norm(place - here) > 0.3:
                    plan.require_way(here, place)
                asked = place is not None
                here = here if place is None else place
        except GoalError as error:
            raise GoalError(f"'{goal.name}' cannot be reached. {error}") from error


__all__ = ["EXECUTED", "Command", "Grasp", "Ground", "Stage", "begin", "check_reachable", "standing_places"]
