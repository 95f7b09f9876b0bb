"""How each action is performed, by its key (see ``nsm_core.world.actions``), and whether a way leads to all
of a queue's goals.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.errors import GoalError
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import LightThing
from nsm_core.world.scene.solids import Scene

from . import carry, climb, open, place, sit, touch, walk
from .approach import Ground
from .base import Grasp, Performer, Stage, StageStart, Way
from .in_parts import InParts
from .rise import TurnBack
from .unload import held_by, with_load

PERFORMERS: dict[str, Performer] = {
    "idle": walk.STAY,
    "walk": walk.WALK,
    "run": walk.RUN,
    "sit": sit.PERFORMER,
    "carry": carry.PERFORMER,
    "open": open.PERFORMER,
    "climb": climb.PERFORMER,
    "touch": touch.PERFORMER,
    "place": place.PERFORMER,
}


def begin(
    goal: Goal,
    ground: Ground,
    moment: Moment,
    grasps: Sequence[Grasp],
    scene: Scene,
    ik: bool = True,
    before: Stage | None = None,
) -> Stage:
    """Make the stage of a goal for a character as it is now; see ``StageStart``.  ``before`` is the stage
    that it leaves.
    """
    back = before.leave(goal) if before is not None else None
    if back is not None:
        return TurnBack(goal, back, lambda then: begin(goal, ground, then, grasps, scene, ik))
    start = StageStart(ground, moment, grasps, scene, ik)
    hands = held_by(start)
    if hands is not None and hands.prop is not goal.prop:
        # Hands that have set it down by then are still on the list, and hold nothing.
        stage = with_load(goal, start, hands, lambda then: begin(goal, ground, then, grasps, scene, ik))
        if stage is not None:
            return stage
        hands.let_go()
    if goal.first or goal.then:
        return InParts(goal, lambda one, then: begin(one, ground, then, grasps, scene, ik, before))
    return PERFORMERS[goal.action].begin(goal, start)


def standing_places(
    goal: Goal,
    here: Array,
    plan: FloorPlan | None,
    poses: dict[str, Array],
    solids: DistanceQuery | None = None,
    fronts: dict[str, Front] | None = None,
    things: Sequence[LightThing] = (),
) -> list[Array | None]:
    """Floor places (2,) between which ways must lead to perform a goal from ``here`` (2,), in order.

    An empty list: it is done on the spot.  After a None no way is asked for, as through a door or up a step.
    ``poses`` (4,) of what earlier goals have moved, and ``fronts`` of furniture, by name, are read and kept
    up to date; ``solids`` are what stands still, ``things`` the light ones that goals move.
    """
    found: list[Array | None] = []
    fronts = {} if fronts is None else fronts
    for one in goal.parts:
        found += PERFORMERS[one.action].places(one, Way(here, plan, poses, solids, fronts, things))
        here = next((place for place in reversed(found) if place is not None), here)
    return found


def check_reachable(
    goals: list[Goal], plan: FloorPlan, start: Array, solids: DistanceQuery | None = None
) -> None:
    """Raise GoalError that names the first goal to which no way leads, or no hand, from the place before it;
    ``start`` (2,).

    ``solids`` are what stands still.
    """
    here = np.asarray(start, dtype=np.float64)
    props = [one.prop for goal in goals for one in goal.parts]
    things = list({p.name: p for p in props if isinstance(p, LightThing)}.values())
    poses = {thing.name: thing.pose.copy() for thing in things}
    fronts = {p.name: p for p in props if isinstance(p, Front)}
    for goal in goals:
        try:
            asked = True
            for place in standing_places(goal, here, plan, poses, solids, fronts, things):
                if place is not None and asked and np.linalg.norm(place - here) > 0.3:
                    plan.require_way(here, place)
                asked = place is not None
                here = here if place is None else place
        except GoalError as error:
            raise GoalError(f"'{goal.name}' cannot be reached. {error}") from error


__all__ = ["PERFORMERS", "Grasp", "begin", "check_reachable", "standing_places"]
