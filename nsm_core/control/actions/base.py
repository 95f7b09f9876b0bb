"""What every action is made of: a stage, which commands the network and judges how far it has come."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import LightThing, Prop
from nsm_core.world.scene.solids import Scene

from .approach import Command, Ground
from .hold import Lead, SeenBody
from .seat_manner import SeatedManner

# Where hips (3,) are to settle, metres, and the heading to sit at; None while one still turns.
SeatTarget = tuple[Array, float | None]
EXECUTED = 0.9  # a label over this counts as executed (design of the response times)


class Stage:
    """One goal while it is performed: what is commanded, and whether it is done."""

    part = 0  # counts the parts of a stage; each has its own time limit
    endless = False  # whether it goes on until something else is asked for
    manner: SeatedManner | None = None  # in which its seat is taken
    passing = False  # whether the next goal begins at once, so that one need not come to rest

    def __init__(self, goal: Goal) -> None:
        self.goal = goal

    def update(self, moment: Moment) -> Command:
        """Look at the character and return what is commanded; GoalError where no way leads on."""
        raise NotImplementedError

    def arrived(self, moment: Moment) -> bool:
        """Whether the goal is reached now."""
        raise NotImplementedError

    def pass_on(self, onward: Array) -> None:
        """Have the next goal, which leads to ``onward`` (2,), begin as soon as this one has been done."""
        self.passing = True

    def passed(self, moment: Moment) -> bool:
        """Whether one who passes on has done what the goal asks for."""
        return self.arrived(moment)

    def target(self) -> tuple[Array | None, float, int]:
        """Place (None: any) and heading that the hips, or the box, should have in the end, and over how many
        axes that counts.
        """
        return self.goal.position, self.goal.heading, 2

    def seat(self) -> SeatTarget | None:
        """The seat that the hips are to settle on."""
        return None

    def stays_at(self) -> tuple[Array, float] | None:
        """The place (2,) and heading at which one stays while hands are at work; None where one is free to
        go.
        """
        return None

    def keeps_off(self) -> tuple[FloorPlan, Array] | None:
        """The floor on whose solids one is kept off, and the place (2,) to which one goes; None where the
        network's own way is good enough.
        """
        return None

    def line(self) -> tuple[Array | None, list[str]]:
        """The line (N, 2) that is followed, None where there is none, and sentences on how it is gone."""
        return None, []

    def leave(self, following: Goal) -> Command | None:
        """What is commanded before another goal may begin; None where it may begin at once."""
        return None

    @property
    def errors(self) -> dict[str, Any]:
        """What its result tells of its hands."""
        grasp = getattr(self, "grasp", None)
        return {} if grasp is None else grasp.errors

    def end(self, reached: bool, again: bool = False) -> None:
        """Give way to the next goal; ``again`` tells that it has the same prop."""


class Grasp(Protocol):
    """Hands that a stage puts to work on something; one call of ``apply`` a frame while it is ``active``."""

    errors: dict[str, Any]
    state: str  # the part of its work that it is at, a word of its own

    @property
    def prop(self) -> Prop | None:
        """What the hands are at work on; None for what stands still."""

    @property
    def forearms(self) -> bool:
        """Whether forearms lie along what the hands hold."""
        ...

    @property
    def active(self) -> bool:
        """Whether it still has to be called."""

    def apply(self, seen: SeenBody, root: Array, contacts: Array) -> None:
        """Go on by one frame and move the prop; ``root`` (3,), network ``contacts`` (5,)."""

    @property
    def bears(self) -> float:
        """Kilograms that its hands bear in this frame."""
        ...

    @property
    def leads(self) -> list[Lead]:
        """Where its hands are to be in this frame."""
        ...

    def holds(self, hand: int) -> float:
        """How far a hand is led by it, 0..1."""

    def touches(self, hand: int) -> bool:
        """Whether a hand is meant to touch the prop, and so is not kept off it."""

    def let_go(self) -> None:
        """End it at any time; hands return."""

    def give_way(self) -> None:
        """Leave the prop to another hold of it: these hands only return."""


@dataclass(frozen=True)
class StageStart:
    """What a stage begins with: the character's ``moment``, the ``ground`` it goes on, and the ``grasps``
    that are still at work.

    ``scene`` is what a box may rest on and a leaf may meet; without ``ik`` the body is left as the network
    has it.
    """

    ground: Ground
    moment: Moment
    grasps: Sequence[Grasp]
    scene: Scene
    ik: bool = True


@dataclass(frozen=True)
class Way:
    """What ways are looked for with: ``here`` (2,) one comes from, the free floor, and what stands still.

    ``poses`` (4,) of boxes and light things that goals move, and ``fronts`` of furniture that they open, as
    earlier goals leave them, by name, are read and kept up to date; ``things`` are the light ones.
    """

    here: Array
    plan: FloorPlan | None
    poses: dict[str, Array]
    solids: DistanceQuery | None = None
    fronts: dict[str, Front] = field(default_factory=dict)
    things: Sequence[LightThing] = ()

    def standing(self, *but: str) -> list[DistanceQuery]:
        """Everything that goals move where it is by then, and what stands still, ``but`` some by name."""
        found: list[DistanceQuery] = [] if self.solids is None else [self.solids]
        found += [front for name, front in self.fronts.items() if name not in but]
        return found + [t.put(self.poses[t.name]) for t in self.things if t.name not in but]


def _its_place(goal: Goal, way: Way) -> list[Array | None]:
    return [goal.position[:2].astype(np.float64)]


@dataclass(frozen=True)
class Performer:
    """How an action is performed: ``begin`` makes the stage of a goal; ``places`` are as
    ``registry.standing_places`` says.
    """

    begin: Callable[[Goal, StageStart], Stage]
    places: Callable[[Goal, Way], list[Array | None]] = _its_place
