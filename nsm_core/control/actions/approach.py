"""Coming to a place: along a planned way from afar, then sent to the goal itself.

Goal-driven mode puts the goal on every key from now on.  It serves within the reach the network was trained
for and where the straight way is free; before that, locomotion mode leads along a planned path, each key's
goal one second ahead of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from nsm_core.control.goals import Moment
from nsm_core.conventions import SIT
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, direction_to_heading
from nsm_core.world.geometry.distance import Union
from nsm_core.world.planning.floor_plan import FloorPlan, path_length
from nsm_core.world.planning.path import Course
from nsm_core.world.scene.props import Leaf, Prop
from nsm_core.world.scene.solids import Other, Scene
from nsm_core.world.scene.stairs import ON_FLOOR, Stairs
from nsm_core.world.sensors.interaction import InteractionVolume

REACH = 3.6  # metres from which goal-driven mode takes over
LED_REACH = 1.0  # the same of one who goes at another pace than usual
BESIDE = 0.3  # metres at the end of the straight way that may touch the goal's surroundings
ELBOW_ROOM = 0.33  # metres to keep from things on the straight way: the network cuts corners a little
STALL, LED = (
    60,
    120,
)  # frames of standing still short of a goal before one is led on, and for how long at most
_STIRRED = 0.02  # metres or radians by which a thing may have moved before the floor is looked at again
STANDS_OPEN = np.radians(20)  # a leaf that is open by more stands in the way
PASSED, LEAST_ONWARD = 0.12, 0.5  # metres before a place that count as through it; of way that go on from it
LEAST_RUN = 2.5  # metres: a shorter way is walked


@dataclass(frozen=True)
class Command:
    """What the network is told now.

    With a ``course`` it is led along it by the goal action ``action``, or by the resting form of it where the
    pace is slow;
    without, ``action`` holds at the fixed ``position`` (3,) with ``heading``.  ``thing`` is what is sensed.
    """

    action: str
    position: Array | None = None
    heading: float = 0.0
    course: Course | None = None
    thing: Prop | InteractionVolume | None = None

    @property
    def resting(self) -> str:
        """The action where the course comes to rest."""
        return self.action.replace("walk", "idle").replace("run", "idle")


@dataclass(frozen=True)
class Gait:
    """How a way is gone: the goal action, the range of speeds (m/s) and how they change (m/s2).

    ``sideways`` m/s2 by which bodies of the data are turned in bends without leaving their way.
    """

    action: str = "walk"
    speeds: tuple[float, float] = (1.05, 1.25)
    acceleration: float = 1.3
    deceleration: float = 0.9
    turn_distance: float = 0.7
    sideways: float = 0.9


WALKING = Gait()
CARRYING = Gait("walk+carry", (0.85, 1.05))
RUNNING = Gait("run", (2.6, 3.0), 2.2, 1.7, 1.0, 2.5)


class Ground:
    """What a stage plans with: the free floor (None: all of it is), what moves and stands about on it, and
    the source of chance.

    Boxes stand about, and leaves that are open; a shut one stands where no way leads.
    """

    def __init__(self, plan: FloorPlan | None, rng: np.random.Generator, scene: Scene | None = None) -> None:
        self.plan, self.rng = plan, rng
        self.pace = 1.0  # of the usual speed
        self._props = [] if scene is None else list(scene.props)
        self._others = [] if scene is None else scene.others
        self._seen: tuple[list[Prop | Other], Array, FloorPlan] | None = None

    def floor(self, *but: Prop | None) -> FloorPlan | None:
        """The free floor with all that stands about where it is now, ``but`` what is in hands."""
        about: list[Prop | Other] = [
            p
            for p in self._props
            if all(p is not b for b in but) and (not isinstance(p, Leaf) or abs(p.angle) > STANDS_OPEN)
        ]
        about += [other for other in self._others if other.settled]
        if self.plan is None or not about:
            return self.plan
        poses = np.array([p.pose for p in about])
        if self._seen is None or self._seen[0] != about or np.abs(self._seen[1] - poses).max() > _STIRRED:
            reach = max(p.reach for p in about)
            self._seen = about, poses, self.plan.besides(Union(about), poses[:, :2], reach)
        return self._seen[2]

    def way(self, a: Array, b: Array, *but: Prop | None) -> Array:
        """Way (N, 2) from ``a`` to ``b`` (2,), around what stands about where there is one; GoalError where
        there is none at all.
        """
        if self.plan is None:
            return np.stack((a, b)).astype(np.float64)
        try:
            return np.asarray(self.floor(*but).find(a, b), dtype=np.float64)  # type: ignore[union-attr]
        except GoalError:
            if self.floor(*but) is self.plan:
                raise
            return np.asarray(self.plan.find(a, b), dtype=np.float64)

    def free(self, a: Array, b: Array, *but: Prop | None) -> bool:
        """Whether the straight way from ``a`` to ``b`` (2,) is free but for its very end."""
        if self.stairs and not self._level(a, b):
            return False  # one is led along flights
        # The last stretch lies beside the goal's object, so the end of the line is not asked about.
        d, floor = b - a, self.floor(*but)
        length = float(np.linalg.norm(d))
        return floor is None or floor.line_is_free(
            a, a + d * max(0.0, 1 - BESIDE / max(length, 1e-6)), ELBOW_ROOM
        )

    @property
    def stairs(self) -> Stairs:
        """The flights that ways lead along."""
        return Stairs() if self.plan is None else self.plan.stairs

    def _level(self, a: Array, b: Array) -> bool:
        """Whether the straight way from ``a`` to ``b`` (2,) leads over no flight."""
        line = a + np.linspace(0, 1, 2 + int(np.linalg.norm(b - a) / 0.1))[:, None] * (b - a)
        return bool(np.ptp(self.stairs.level(line)) < ON_FLOOR)

    def pause(self) -> int:
        """Frames from an event to the command that answers it, as in the training data."""
        return int(self.rng.integers(2, 7))


class Approach:
    """Leads to the standing place ``stand`` (2,) and then gives the command ``final``; stalled short of it,
    leads on again.
    """

    def __init__(
        self,
        ground: Ground,
        stand: Array,
        heading: float,
        final: Command,
        reach: float = REACH,
        gait: Gait = WALKING,
        ready: Callable[[Moment], bool] | None = None,
        thing: Prop | None = None,
        anyway: bool = False,
        held: Sequence[Prop] = (),
    ) -> None:
        """Plan to go to ``stand`` (2,) and face ``heading`` there.

        ``reach``: metres within which ``final`` may be given; ``ready`` another rule for that; ``thing`` is
        sensed on the way; ``anyway``: where no way is free one goes straight, instead of a GoalError in the
        middle of a take; ``held`` is in hands, and neither sensed nor in the way.
        """
        self.ground, self.stand, self.heading, self.final = ground, np.asarray(stand), heading, final
        # Who is sent to the goal itself goes at the network's own pace.
        self.reach = reach if ground.pace == 1.0 else min(reach, LED_REACH)
        self.gait, self.ready, self.thing, self.anyway = gait, ready, thing, anyway
        self._but = held or (thing,)
        self.command: Command | None = None
        self._stall = self._led = 0
        self._onward: Array | None = None
        self._through = np.inf  # metres of the course up to the standing place, of one who goes on

    def through(self, onward: Array) -> None:
        """Do not come to rest at the standing place, but go on from there to ``onward`` (2,)."""
        onward = np.asarray(onward, dtype=np.float64)
        if np.linalg.norm(onward - self.stand) > LEAST_ONWARD:
            self._onward = onward

    @property
    def passed(self) -> bool:
        """Whether one who goes on has come through the standing place."""
        course = None if self.command is None else self.command.course
        return course is not None and course.progress > self._through - PASSED

    @property
    def given(self) -> bool:
        """Whether the goal itself is commanded now."""
        return self.command is self.final

    def anew(self) -> None:
        """Look for a way once more from wherever one is by then."""
        self.command, self._stall, self._led = None, 0, 0

    def update(self, moment: Moment, arrived: Callable[[Moment], bool]) -> Command:
        """Choose what is commanded; ``arrived`` tells whether there is anything left to do."""
        if self.given:
            self._watch(moment, arrived)
            return self.command  # type: ignore[return-value]
        distance = float(np.linalg.norm(self.stand - moment.root[:2]))
        if self._led > 0:
            self._led -= 1
            if distance > 0.2:
                return self.command  # type: ignore[return-value]
            self._led = 0
        if self._ready(moment, distance):
            self.command = self.final
        elif self.command is None:
            self.command = self._lead(moment)
        return self.command

    def _ready(self, moment: Moment, distance: float) -> bool:
        if self._onward is not None:
            return False
        if self.ready is not None:
            return self.ready(moment)
        return distance < self.reach and (
            distance < 0.6 or self.ground.free(moment.root[:2], self.stand, *self._but)
        )

    def _lead(self, moment: Moment) -> Command:
        try:
            way = self.ground.way(moment.root[:2], self.stand, *self._but)
        except GoalError:
            if not self.anyway:
                raise
            way = np.stack((moment.root[:2], self.stand)).astype(np.float64)
        gait = WALKING if self.gait is RUNNING and path_length(way) < LEAST_RUN else self.gait
        speed = self.ground.pace * float(self.ground.rng.uniform(*gait.speeds))
        stairs = self.ground.stairs
        heading, self._through = self.heading, np.inf
        if self._onward is not None:
            onward = self._on_from(self._onward)
            if onward is not None:
                self._through = path_length(way)
                heading = float(direction_to_heading(onward[-1] - onward[-2]))
                way = np.concatenate((way, onward[1:]))
        course = Course(way, heading, speed, gait.turn_distance, gait.acceleration, gait.deceleration)
        if stairs:
            course.most = stairs.pace(way, speed)
        return Command(gait.action, course=course, thing=self.thing)

    def _on_from(self, onward: Array) -> Array | None:
        """Way (N, 2) from the standing place on; None, and one stops there, where none is free."""
        try:
            return self.ground.way(self.stand, onward, *self._but)
        except GoalError:
            self._onward = None
            return None

    def _watch(self, moment: Moment, arrived: Callable[[Moment], bool]) -> None:
        """Where the network has come to rest short of its goal, lead it on to the standing place, then ask
        again.
        """
        stalled = moment.speed < 0.05 and float(moment.style[SIT]) < 0.1 and not arrived(moment)
        self._stall = self._stall + 1 if stalled else 0
        distance = float(np.linalg.norm(self.stand - moment.root[:2]))
        if self._stall >= STALL and distance > 0.25:
            self._stall, self._led = 0, LED
            path = np.stack((moment.root[:2], self.stand)).astype(np.float64)
            action = (WALKING if self.gait is RUNNING else self.gait).action
            self.command = Command(
                action, course=Course(path, self.heading, speed=1.0, turn_distance=0.4), thing=self.thing
            )
