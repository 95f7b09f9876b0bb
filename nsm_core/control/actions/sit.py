"""Sit: walk to where one sits down, before the seat or at its side where something stands before it,
and sit.
"""

from __future__ import annotations

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.conventions import SIT
from nsm_core.distances import STAND_AHEAD
from nsm_core.rotations import Array, heading_to_direction, wrap_angle
from nsm_core.world.affordances.arm_rests import arm_rests_beside
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.floor_plan import FloorPlan

from .approach import Approach, Command, Ground
from .base import EXECUTED, Performer, SeatTarget, Stage
from .seat_manner import draw_seated

# metres of room: an open front has 0.17, and a thin board between two looked at heights seems this far off
BLOCKED = 0.14
BESIDE = 0.1  # metres of room that standing beside a seat needs
SIDES = (np.pi / 2, -np.pi / 2)
_ARM = (0.0, 0.25)  # metres over the seated hips between which an arm rest stands in the way
_LANE, _SOLID = (
    0.12,
    0.6,
)  # half the width of the way from the side to the seat, metres; occupancy that counts as solid


def before_seat(goal: Goal, plan: FloorPlan | None = None, here: Array | None = None) -> tuple[Array, float]:
    """Where on the floor (2,) one stands before sitting down, and the heading there.

    Before the seat, as a rule.  Where a desk stands there and a side of the seat is open and free of an arm
    rest, at that side, with the back to the seat: the body turns on the seat then.  ``here`` (2,): from where
    one comes.
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
    """Whether the sensed seat has something solid beside the hips, on the way from ``stand`` to ``seat``
    (2,).
    """
    if goal.interaction is None:
        return False
    cells = goal.interaction.cells_world().astype(np.float64)
    way = (stand - seat) / np.linalg.norm(stand - seat)
    offset = cells[:, :2] - seat
    along, across = offset @ way, np.abs(offset @ np.array((-way[1], way[0])))
    height = cells[:, 2] - float(goal.position[2])
    between = (
        (along > 0.1) & (along < STAND_AHEAD) & (across < _LANE) & (height > _ARM[0]) & (height < _ARM[1])
    )
    return bool((goal.interaction.occupancy[between] > _SOLID).any())


SEATED_WITHIN = 0.2  # metres between hips and goal that still count as seated on it
STILL = np.radians(3)  # a second: who turns faster has not come to rest on the seat
SLOW = 0.3  # m/s below which one who sits down from the side turns


class Sit(Stage):
    """Walk to where one sits down, before the seat or beside it, and sit; from the side one turns once one is
    seated.
    """

    def __init__(self, goal: Goal, ground: Ground, moment: Moment, solids: DistanceQuery) -> None:
        super().__init__(goal)
        stand, heading = before_seat(goal, ground.plan, moment.root[:2])
        self._side = abs(float(wrap_angle(heading - goal.heading))) > 0.1
        # Drawn beside the take's own stream of chance, which everything else goes on with.
        rests = arm_rests_beside(solids, goal.position.astype(np.float64), goal.heading)
        self.manner = draw_seated(ground.rng.spawn(1)[0], not self._side, rests)
        self._seated = self._on_it(moment)  # whether the seat has been reached
        self._there = Command("sit", goal.position, goal.heading, thing=goal.interaction)
        # One who is sent from the side to sit in another direction would walk round to the front, through
        # what stands there.
        self._back = (
            Command("sit", goal.position, heading, thing=goal.interaction) if self._side else self._there
        )
        ready = self._beside if self._side else None
        self.approach = Approach(ground, stand, heading, self._back, ready=ready, anyway=self._side)

    def _beside(self, moment: Moment) -> bool:
        """From the side one is led to the very place: the seat is asked for with the back to it."""
        near = float(np.linalg.norm(moment.root[:2] - self.approach.stand)) < 0.25
        return near and abs(float(wrap_angle(moment.heading - self.approach.heading))) < np.radians(30)

    def update(self, moment: Moment) -> Command:
        if not self._seated:
            command = self.approach.update(moment, self.arrived)
            self._seated = self.approach.given and self._on_it(moment) and moment.speed < SLOW
        return self._there if self._seated else command

    def _on_it(self, moment: Moment) -> bool:
        near = float(np.linalg.norm(moment.hips - self.goal.position)) < SEATED_WITHIN
        return near and float(moment.style[SIT]) > EXECUTED

    def arrived(self, moment: Moment) -> bool:
        turned = not self._side or abs(float(wrap_angle(moment.heading - self.goal.heading))) < np.radians(15)
        return turned and self._on_it(moment) and moment.speed < 0.1 and moment.turning < STILL

    def target(self) -> tuple[Array | None, float, int]:
        return self.goal.position, self.goal.heading, 3

    def seat(self) -> SeatTarget | None:
        return self.goal.position, None if self._side and not self._seated else self.goal.heading

    def leave(self, following: Goal) -> Command | None:
        stays = (
            following.action == self.goal.action
            and float(np.linalg.norm(following.position - self.goal.position)) < SEATED_WITHIN
        )
        return self._back if self._side and self._seated and not stays else None


PERFORMER = Performer(
    lambda goal, start: Sit(goal, start.ground, start.moment, start.scene.environment),
    lambda goal, way: [before_seat(goal, way.plan, way.here)[0]],
)
