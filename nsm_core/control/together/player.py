"""One of several characters: where it is and is about to go, seen from the world that all share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.control.actions.approach import Command
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRunner
from nsm_core.conventions import CLIMB, FPS, SIT
from nsm_core.rotations import Array
from nsm_core.world.planning.path import Course
from nsm_core.world.scene.props import Leaf, Prop
from nsm_core.world.sensors.interaction import InteractionVolume

from .bodies import spheres_of
from .frames import Frame

STEP = 0.1  # metres between the points of a way ahead
FARTHEST = 14.0  # metres of it that are looked at
RADIUS = 0.36  # metres of floor that a walker takes, arms that swing included, at the network's size
_STILL = 0.12  # m/s below which one stands
_PACE = 1.1  # m/s of one who is sent, not led
# Metres from where it is done from which on an action gives way to nobody.
AT_WORK = {"sit": 1.0, "carry": 0.9, "open": 1.5, "climb": 1.4, "touch": 0.5, "place": 0.7}
_RISEN = 0.15  # sit label below which one is up


@dataclass
class Wait:
    """A time in which a character gave way.

    ``frame`` in which it began and ``frames`` that it took; ``whom`` it waited for and ``where``, or at what.
    """

    frame: int
    frames: int
    whom: str
    where: str

    def sentence(self) -> str:
        """As a part of a report."""
        return f"waits {self.frames / FPS:.1f} s for {self.whom} at {self.where}"


@dataclass
class Ahead:
    """The way ahead: ``points`` (N, 2) common metres, ``STEP`` apart, and the ``times`` (N,), seconds from
    now, at which one is there; the first is where one is now.
    """

    points: Array
    times: Array

    def at(self, times: Array) -> Array:
        """Places (K, 2) at ``times`` (K,), held at the end."""
        return np.stack([np.interp(times, self.times, self.points[:, k]) for k in (0, 1)], axis=-1)


class Player:
    """A character with its take, and what the others need to know of it."""

    def __init__(self, name: str, runner: TakeRunner, frame: Frame, order: int) -> None:
        self.name, self.runner, self.frame, self.order = name, runner, frame, order
        self.radius = RADIUS * frame.scale
        self.waits: list[Wait] = []
        self.waits_for: dict[int, str] = {}  # the order of whom it gives way to now, and where
        self.meant: Command | None = None  # what was commanded when it began to give way
        self.veering = 0  # until this frame it goes around somebody who comes its way
        self.aside = False  # whether it is on its way to a place that is out of the way
        self.still = 0  # frames of standing
        self.patience: dict[int, int] = {}  # frames waited for each goal, by its number
        self.starved = 0  # goals that it gave up because of others
        self.ahead = Ahead(np.zeros((1, 2)), np.zeros(1))
        self._filled: tuple[int, tuple[Array, Array]] | None = None
        self.look()

    # --- now

    @property
    def place(self) -> Array:
        """Where it stands (2,), common metres."""
        return self.frame.to_common(self.runner.state.root[0, :2])

    @property
    def done(self) -> bool:
        """Whether its take is over: it stays as it is."""
        return self.runner.director.done

    @property
    def goal(self) -> Goal | None:
        """What it is doing; None before and after its goals, and while a goal that is reached is held."""
        d = self.runner.director
        return None if d.done or d.index < 0 or d.holding else d.goals[d.index]

    @property
    def last(self) -> bool:
        """Whether nothing follows what it is doing."""
        d = self.runner.director
        return d.done or d.index == len(d.goals) - 1

    @property
    def stays(self) -> bool:
        """Whether it will not move any more from where it has come to."""
        return self.done or (self.last and self.goal is None and self.runner.director.index >= 0)

    @property
    def seated(self) -> bool:
        """Whether it sits, or is sitting down or rising."""
        return float(self.runner.state.style_past[0, -1][SIT]) > _RISEN

    @property
    def settled(self) -> bool:
        """Whether it stands or sits still, or comes to stand to wait, so that ways lead around it."""
        given = self.runner.director.giving_way
        return self.still > 5 or self.done or (given is not None and given.course is None)

    @property
    def giving_way(self) -> bool:
        """Whether it waits or steps aside."""
        return self.runner.director.giving_way is not None

    @property
    def at_work(self) -> bool:
        """Whether it is about to do something, or does it, and so gives way to nobody."""
        goal, d = self.goal, self.runner.director
        if self.seated or float(self.runner.state.style_past[0, -1][CLIMB]) > _RISEN:
            return True
        if goal is None or goal.action not in AT_WORK:
            return False
        near = min(float(np.linalg.norm(self.runner.state.root[0, :2] - at[:2])) for at in self._work(goal))
        led = d.command is not None and d.command.course is not None
        return near < AT_WORK[goal.action] * (0.7 if led else 1.0)

    def _work(self, goal: Goal) -> list[Array]:
        """Where, own world, a goal's work is done: at a box where it is, and where it goes."""
        if isinstance(goal.prop, Leaf):
            leaf = goal.prop
            return [leaf.to_world((leaf.width / 2, 0.0, 0.0), leaf.pose_at(0.0))]
        places = [np.asarray(goal.position, dtype=np.float64)]
        return places if goal.prop is None else [*places, goal.prop.pose[:3]]

    def spheres(self) -> tuple[Array, Array]:
        """Spheres (S, 3), (S,) of its newest pose, common metres."""
        if self._filled is None or self._filled[0] != self.runner.frames:
            centres, radii = spheres_of(*self.runner.pose(), self.runner.request.figure)
            common = self.frame.to_common(centres), radii * self.frame.scale
            self._filled = self.runner.frames, common
        return self._filled[1]

    # --- ahead

    def look(self) -> None:
        """Note whether it stands, once a frame."""
        past = self.runner.state.root_past[0]
        speed = float(np.linalg.norm(past[-1, :2] - past[-4, :2])) * FPS / 3
        self.speed = speed * self.frame.scale
        self.still = self.still + 1 if speed < _STILL else 0

    def look_ahead(self) -> None:
        """See where it wants to go, whether or not it gives way now."""
        here = self.runner.state.root[0, :2].astype(np.float64)
        course, speed = self._wanted(here)
        if course is None:
            self.ahead = Ahead(self.place[None], np.zeros(1))
            return
        course.advance(here)
        left = min(course.length - course.progress, FARTHEST)
        s = course.progress + np.arange(0.0, max(left, STEP) + STEP / 2, STEP)
        points = np.concatenate((here[None], course.at(s[1:])))
        slow = max(0.0, 1 - self.speed / (speed * self.frame.scale))
        times = (s - course.progress) / speed + 0.6 * slow * np.minimum(1, (s - course.progress) / 0.5)
        self.ahead = Ahead(self.frame.to_common(points), times)

    def _wanted(self, here: Array) -> tuple[Course | None, float]:
        """The course that leads to what is wanted, own world, and its speed; None where one stays."""
        given, led = self.runner.director.giving_way, self.runner.director.command
        if given is None:
            command = self.meant if self.runner.director.resuming else led
        else:
            command = given if self.veering else self.meant
        if self.done or command is None or (self.goal is None and not self.giving_way):
            return None, _PACE
        if command.course is not None:
            return command.course, max(command.course.speed, 0.3)
        end = np.asarray(command.position, dtype=np.float64)[:2]
        if float(np.linalg.norm(end - here)) < 0.2 or self.seated:
            return None, _PACE
        return Course(np.stack((here, end)), command.heading, _PACE), _PACE

    # --- giving way

    def halt(self, far: float) -> None:
        """Come to stand after ``far`` common metres of the way ahead at most, without leaving it."""
        d, here = self.runner.director, self.runner.state.root[0, :2].astype(np.float64)
        self._note_meant()
        self.veering = 0
        points = self.frame.to_own(self.ahead.points)
        slowing = 0.35 * self.speed / self.frame.scale
        count = 1 + int(max(far / self.frame.scale, slowing) / STEP)
        points = points[: count + 1] if len(points) > 1 else points
        if len(points) < 2 or count < 3:
            if self.giving_way and d.giving_way is not None and d.giving_way.course is None:
                return  # it stands already: asked anew it would creep on
            at = points[min(count - 1, len(points) - 1)]
            d.giving_way = Command(
                self._gait("idle"),
                np.append(at, 0).astype(np.float32),
                float(self.runner.state.root[0, 2]),
                thing=self._held(),
            )
            return
        course = Course(points, 0.0, _PACE)
        course.final_heading = float(course.heading_at(np.array(course.length - 0.16)))
        d.giving_way = Command(self._gait("walk"), course=course, thing=self._held())
        course.advance(here)

    def step_aside(self, way: Array) -> None:
        """Go along ``way`` (N, 2), common metres, and wait at its end."""
        own = self.frame.to_own(way)
        self._note_meant()
        course = Course(own, float(self.runner.state.root[0, 2]), _PACE)
        course.final_heading = float(course.heading_at(np.array(course.length)))
        self.runner.director.giving_way = Command(self._gait("walk"), course=course, thing=self._held())
        self.aside = True

    def veer(self, way: Array, frames: int) -> None:
        """Go along ``way`` (N, 2), common metres, for so many frames instead of what was meant."""
        d = self.runner.director
        self._note_meant()
        assert self.meant is not None
        course, meant = Course(self.frame.to_own(way), self.meant.heading), self.meant.course
        if meant is not None:
            course.final_heading, course.speed = meant.final_heading, meant.speed
        action = self.meant.action if meant is not None else self._gait("walk")
        d.giving_way = Command(action, course=course, thing=self._held())
        self.veering = self.runner.frames + frames

    def _note_meant(self) -> None:
        """Keep what was commanded before it gave way: in the frame in which it goes on that is not yet told
        again, and what is commanded is still how it gave way.
        """
        d = self.runner.director
        if d.giving_way is None and not d.resuming:
            self.meant = d.command

    def go_on(self) -> None:
        """Give way no longer."""
        self.aside, self.veering = False, 0
        self.runner.director.resume()

    def note_wait(self, whom: str, where: str) -> None:
        """Count a frame of giving way."""
        d = self.runner.director
        self.patience[d.index] = self.patience.get(d.index, 0) + 1
        now, last = self.runner.frames, self.waits[-1] if self.waits else None
        if last is not None and last.whom == whom and now - (last.frame + last.frames) < FPS // 2:
            last.frames = now - last.frame + 1
        else:
            self.waits.append(Wait(now, 1, whom, where))

    def _held(self) -> Prop | InteractionVolume | None:
        """What it has in its hands, as commands name it."""
        command = self.meant
        return command.thing if command is not None and "+carry" in command.action else None

    def _gait(self, how: str) -> str:
        return f"{how}+carry" if self._held() is not None else how


__all__ = ["Ahead", "Player", "Wait"]
