"""What becomes of a box in the hands when another goal begins: it is set down, or carried along."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, heading_to_direction
from nsm_core.world.actions import BY_KEY, Aim
from nsm_core.world.affordances.standing import further_off, require_room, standing_place

from .approach import CARRYING, Command
from .base import Stage, StageStart
from .before import Before
from .box_grasp import Carrying
from .carry import BRING, Carry
from .walk import Go, Stay

# Where a box is set down, in the order in which it is tried: turns from how one stands, metres further.
TURNS = np.radians((0, 30, -30, 60, -60, 90, -90, 135, -135, 180))
AWAY = (0.0, 0.4, 0.8, 1.4)
ROOM = 0.25  # metres of room that standing there needs
HELD_AT = 0.95  # metres over the floor of the middle of a box that one stands with, at least


def held_by(start: StageStart) -> Carrying | None:
    """The hands that hold a box now, if any do."""
    hands = (g for g in start.grasps if isinstance(g, Carrying))
    return next((g for g in hands if g.state == "held"), None)


def with_load(
    goal: Goal, start: StageStart, hands: Carrying, following: Callable[[Moment], Stage]
) -> Stage | None:
    """The stage of a goal that begins with a box in ``hands``: as the goal says, it is carried along, or set
    down first and ``following`` then makes the goal's own stage; None where there is no room to set it down.
    """
    if (
        goal.load == "along"
        and not BY_KEY[goal.action].needs_object
        and goal.way is None
        and goal.steering is None
    ):
        return Along(goal, start, hands)
    place = place_before(hands, start)
    return None if place is None else Unloading(goal, Carry.of_held(place, start, hands), following)


def place_before(hands: Carrying, start: StageStart) -> Goal | None:
    """Where on the floor a box that is held is set down, near where one is; None where there is no room."""
    box, root, ground = hands.prop, start.moment.root.astype(np.float64), start.ground
    solids, floor = start.scene.but(box), ground.floor(box)
    for away in AWAY:
        for turn in TURNS:
            heading = float(start.moment.heading + turn)
            ahead = heading_to_direction(np.array(heading))
            centre = np.append(
                root[:2] + (box.stand_off(hands.facing) + away) * ahead, box.size[2] / 2
            ).astype(np.float64)
            stand = standing_place(box, hands.facing, centre, heading)
            if floor is not None and float(floor.clearance(stand[None])[0]) < ROOM:
                continue
            try:
                require_room(box, np.append(centre, heading - hands.facing), solids, box.name)
                further_off(box, hands.facing, centre, heading, solids)
                ground.way(root[:2], stand, box)
            except GoalError:
                continue
            return Goal("carry", box.name, centre, heading, 0.0, prop=box)
    return None


class Unloading(Before):
    """Set down what is in the hands, and then do what ``following`` makes of the goal."""

    def __init__(self, goal: Goal, carry: Carry, following: Callable[[Moment], Stage]) -> None:
        super().__init__(goal)
        self._carry, self._following = carry, following

    def update(self, moment: Moment) -> Command:
        if self.stage is None:
            command = self._carry.update(moment)
            if not self._carry.released:
                return command
            self.begin(stage := self._following(moment))
            return stage.update(moment)
        return self.stage.update(moment)

    def end(self, reached: bool, again: bool = False) -> None:
        if self.stage is None:
            self._carry.end(reached, again)
        super().end(reached, again)

    @property
    def grasp(self) -> object:
        """The hands that set it down, then those of the stage that follows."""
        return self._carry.grasp if self.stage is None else super().grasp


class Along(Stage):
    """Go, or stay, with a box in the hands."""

    def __init__(self, goal: Goal, start: StageStart, hands: Carrying) -> None:
        super().__init__(goal)
        self.grasp = hands
        hands.keep()
        self._inner: Stage
        if BY_KEY[goal.action].aim is Aim.HERE:
            self._inner = Stay(goal, start.moment, "idle+carry", hands.prop)
        else:
            # As in the training data, who stands with a box is told where that is, and walks to before it.
            box = hands.prop
            ahead = box.stand_off(hands.facing) * heading_to_direction(np.array(goal.heading))
            held = np.append(goal.position[:2] + ahead, max(float(box.pose[2]), HELD_AT))
            self._inner = Go(goal, start.ground, BRING, CARRYING, "idle+carry", box, held)
            self.approach = self._inner.approach

    def update(self, moment: Moment) -> Command:
        return self._inner.update(moment)

    def arrived(self, moment: Moment) -> bool:
        return moment.speed < 0.15 and self._inner.arrived(moment)

    def target(self) -> tuple[Array | None, float, int]:
        return self._inner.target()


__all__ = ["Unloading", "held_by", "place_before", "with_load"]
