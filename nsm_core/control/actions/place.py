"""Pick and place: walk to where one hand takes a light thing, take it out, bring it, put it down, withdraw.

The network walks and stands; the hand goes along ways that are planned past everything that stands there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.rotations import Array
from nsm_core.world.affordances.picking import Picking, plan_picking
from nsm_core.world.geometry.distance import DistanceQuery, Union
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.props import LightThing

from .approach import WALKING, Command, Gait
from .at_reach import AtReach, where_led
from .base import Performer, StageStart, Way
from .thing_grasp import Holding

LADEN = Gait(speeds=(0.85, 1.05))  # of who has a thing in one hand
_MOVED = 0.01  # metres from where it was planned to be taken at which a thing is planned for anew


def planned(
    goal: Goal, solids: DistanceQuery, plan: FloorPlan | None, here: Array, pose: Array | None = None
) -> Picking:
    """How the thing of a goal is taken and put down among ``solids``, which are everything but it, by who
    comes from ``here`` (2,); ``pose`` (4,) where it stands by then.  GoalError where it cannot be.
    """
    thing = goal.moves(LightThing)
    pose = thing.pose if pose is None else pose
    known = goal.picking
    if known is not None and np.linalg.norm(known.at[:3] - pose[:3]) < _MOVED:
        return known
    there, end = thing.put(pose), goal.position.astype(np.float64)

    goal.picking = where_led(
        lambda around: plan_picking(there, end, around), solids, plan, here, (pose[:2], end[:2])
    )
    return goal.picking


class Place(AtReach):
    """Go to the thing, take it, go to its place, put it down; where two are carried at once, take the other
    one as well before either is put down (the states of papers/002 figure 6, here errands).
    """

    def __init__(self, goal: Goal, start: StageStart) -> None:
        super().__init__(goal, start.ground)
        thing, both = goal.moves(LightThing), goal.both
        known: Holding | None = None
        if both is not None and both.leads != thing.name:
            known = both.hands.get(thing.name)
            if known is None or not (known.carries or known.puts):  # whose goal came first took it not
                self.goal = goal = replace(goal, both=None)
                both = known = None
        if known is not None:
            self.picking = known.picking
        else:
            self.picking = planned(goal, start.scene.but(thing), start.ground.plan, start.moment.root[:2])
        if both is not None and known is None:
            both.hands = {
                one.name: Holding(one, picking, start.scene.but(one), wide=True)
                for one, picking in zip(both.things, both.pickings, strict=True)
            }
        own = known or (
            both.hands[thing.name] if both else Holding(thing, self.picking, start.scene.but(thing))
        )
        self._hands: Holding = own
        self.grasp: Holding | None = known
        self.other: Holding | None = None  # the other thing's hand, once it is at work
        hands = [own] if both is None else [both.hands[one.name] for one in both.things]
        # What hands do at the same moment, errand by errand: things that are taken, then this one put down.
        self._takes = [] if known else [hands] if both and both.at_once[0] else [[hold] for hold in hands]
        self._puts = hands if both and both.at_once[1] else [own]
        self._errand = 0
        if known is not None and known.puts:
            self.part = 1
        self._set_out()

    def _set_out(self) -> None:
        """Go to where the next errand is."""
        hands = [self._hands] if self.goal.both is None else self.goal.both.hands.values()
        held = tuple(hold.prop for hold in hands if hold.bears)
        if self._errand < len(self._takes):
            reach = self._takes[self._errand][0].picking.pick.reach
            self.go(reach, LADEN if held else WALKING, held)
        else:
            for hold in self._puts:
                hold.comes = True
            self.go(self.picking.put.reach, LADEN, held)

    def update(self, moment: Moment) -> Command:
        takes = self._takes[self._errand] if self._errand < len(self._takes) else []
        works = self.part % 2 == 1
        if not works and self.there(moment):
            self.part += 1
            for hold in takes or self._puts:
                if hold is self._hands:
                    self.grasp = hold
                else:
                    self.other = hold
                if not takes:
                    hold.put_down()
        elif works and takes and all(hold.brought for hold in takes):
            self._errand += 1
            self.part += 1
            self._set_out()
        if self.part % 2 == 1:
            down = any(hold.state in ("reach", "take", "in") for hold in takes or self._puts)
            self._lower(self.reach.down if down else 0.0)
            return self.approach.final
        return self.approach.update(moment, self.there)

    def _lower(self, down: float) -> None:
        """Tell hands that carry something meanwhile by how much the body goes down, metres."""
        both = self.goal.both
        for hold in () if both is None else both.hands.values():
            hold.low = down

    def stays_at(self) -> tuple[Array, float] | None:
        return (self.reach.place, self.reach.heading) if self.part % 2 == 1 else None

    def arrived(self, moment: Moment) -> bool:
        return self.passed(moment) and not self._hands.active and moment.speed < 0.15

    def passed(self, moment: Moment) -> bool:
        return self._errand == len(self._takes) and self.part % 2 == 1 and self._hands.left

    def line(self) -> tuple[Array | None, list[str]]:
        line, remarks = super().line()
        both = self.goal.both
        if both is not None and self._errand == len(self._takes):
            names = [one.name for one in both.things]
            hand = ("right", "left")[both.pickings[0].hand]
            told = f"{names[0]} in the {hand} hand and {names[1]} in the other were carried at once"
            when = [how for how, once in zip(("taken", "put down"), both.at_once, strict=True) if once]
            told += f", {' and '.join(when)} at the same moment." if when else "."
            remarks = [told, *remarks]
        return line, remarks

    def target(self) -> tuple[Array | None, float, int]:
        return self.picking.pose[:3], float(self.picking.pose[3]), 3

    def end(self, reached: bool, again: bool = False) -> None:
        if not reached:
            self._hands.let_go()
        if not again and self.goal.both is not None:  # nobody comes to put down what the other hand has
            for hold in self.goal.both.hands.values():
                hold.let_go()


def _places(goal: Goal, way: Way) -> list[Array | None]:
    """To where the thing is taken, and to where it is put down; where two are carried at once, the first
    goal's way leads to both, the last one's to its own place.
    """
    thing, both = goal.moves(LightThing), goal.both
    if way.solids is None:
        return []
    pose, picking = way.poses.get(thing.name), goal.picking
    if pose is not None or picking is None:
        picking = planned(goal, Union(way.standing(thing.name)), way.plan, way.here, pose)
    way.poses[thing.name] = picking.pose
    if both is None:
        return [picking.pick.reach.place, picking.put.reach.place]
    takes = [one.pick.reach.place for one in both.pickings] if both.leads == thing.name else []
    return [*takes, picking.put.reach.place]


PERFORMER = Performer(Place, _places)

__all__ = ["PERFORMER", "Place", "planned"]
