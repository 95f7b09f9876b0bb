"""Turn the queue of goals into the goal series the network is fed with (section 4.1), frame by frame.

Goal-driven mode puts the goal itself on every key from now on.  It serves within the reach the network was trained
for and where the straight way is free; before that, locomotion mode leads along a planned path, each key's goal one
second ahead of it.  Switching between the two is only a change of the series.
"""

from __future__ import annotations

import numpy as np

from ..conventions import FPS, GOAL_ACTIONS, IDLE, SIT
from ..errors import GoalError
from ..rotations import Array, heading_to_direction, wrap_angle
from ..sensors.cuboid import InteractionVolume
from ..series import FUTURE, KEY_OFFSETS, KEY_STEP, PIVOT, WINDOW
from .course import Course
from .goals import SEAT_MEMORY, STAND_AHEAD, Goal, GoalResult, Moment
from .planning import FloorPlan

REACH = 3.6  # metres from which goal-driven mode takes over
BESIDE = 0.3  # metres at the end of the straight way that may touch the seat's surroundings
ELBOW_ROOM = 0.33  # metres to keep from things on the straight way: the network cuts corners a little
EXECUTED = 0.9  # a label over this counts as executed (design of the response times)
SEATED_WITHIN = 0.2  # metres between hips and goal that still count as seated on it
SETTLE = 12  # frames of rest after which a transition has ended
STALL, LED = 60, 120  # frames of standing still short of a goal before one is led on, and for how long at most


class Director:
    """Leads one character through its goals; one call a frame."""

    def __init__(self, goals: list[Goal], plan: FloorPlan | None, root: Array, rng: np.random.Generator, time_limit: float) -> None:
        self.goals, self.plan, self.rng, self.time_limit = goals, plan, rng, time_limit
        self.results = [GoalResult(g.name, g.action) for g in goals]
        self.index = -1
        self.done = False
        self._course: Course | None = None
        self._static: Goal | None = None
        self._sensed: InteractionVolume | None = None
        self._frame, self._started, self._rest, self._hold = 0, 0, 0, -1
        self._stall, self._led = 0, 0
        here = np.append(root[:2], 0.0)
        self._past_position = np.repeat(here[None].astype(np.float32), WINDOW + 1, axis=0)
        self._past_heading = np.full(WINDOW + 1, root[2], np.float32)
        self._past_action = np.repeat(_one_hot("idle")[None], WINDOW + 1, axis=0)
        self._wait = int(rng.integers(4, 16))  # frames of standing before the first goal is heard

    def update(self, moment: Moment) -> tuple[Array, Array, Array, InteractionVolume | None]:
        """Return goal positions (13, 3), headings (13,) and actions (13, 6) for the next step, and the sensed object."""
        if self.index < 0:
            if self._frame >= self._wait:
                self._begin(0, moment)
        elif not self.done:
            self._judge(moment)
            self._steer(moment)
        self._frame += 1
        position, heading, action = self._ahead(moment)
        self._past_position = np.concatenate((self._past_position[1:], position[:1]))
        self._past_heading = np.append(self._past_heading[1:], heading[0]).astype(np.float32)
        self._past_action = np.concatenate((self._past_action[1:], action[:1]))
        past = slice(0, WINDOW, KEY_STEP)
        keys = (
            np.concatenate((self._past_position[past], position)),
            np.concatenate((self._past_heading[past], heading)),
            np.concatenate((self._past_action[past], action)),
        )
        if self._sensed is not None and (self._static is None or self._static.action != "sit") and moment.style[SIT] <= SEAT_MEMORY:
            self._sensed = None
        return *keys, self._sensed

    # --- goals one after the other -----------------------------------------------------------------------------

    def _begin(self, index: int, moment: Moment) -> None:
        if index >= len(self.goals):
            self.done = True
            return
        self.index, self._started, self._rest, self._hold = index, self._frame, 0, -1
        self.results[index].start_frame = self._frame
        goal = self.goals[index]
        self._course, self._static = None, None
        self._stall, self._led = 0, 0
        if goal.action == "idle":
            self._static = self._stop(goal, moment)
        else:
            self._steer(moment)

    def _stop(self, goal: Goal, moment: Moment) -> Goal:
        """Stand where one is; a sitter rises to stand before the seat."""
        seated = float(moment.style[SIT]) > 0.5
        at = moment.root[:2] + (STAND_AHEAD if seated else 0.0) * heading_to_direction(np.array(moment.heading))
        return Goal("idle", goal.name, np.append(at, 0), float(moment.heading), goal.hold)

    def _steer(self, moment: Moment) -> None:
        """Choose between goal-driven and locomotion mode."""
        goal = self.goals[self.index]
        if goal.action == "idle":
            return
        stand = standing_place(goal)
        if self._static is not None:
            self._watch(goal, stand, moment)
            return
        distance = float(np.linalg.norm(stand - moment.root[:2]))
        if self._led > 0:
            self._led -= 1
            if distance > 0.2:
                return
            self._led = 0
        free = self.plan is None or distance < 0.6 or self._free(moment.root[:2], stand)
        if distance < REACH and free:
            self._static, self._course = (goal if goal.action == "sit" else Goal("idle", goal.name, goal.position, goal.heading)), None
            if goal.interaction is not None and goal.action == "sit":
                self._sensed = goal.interaction
        elif self._course is None:
            path = self.plan.find(moment.root[:2], stand) if self.plan is not None else np.stack((moment.root[:2], stand))
            self._course = Course(np.asarray(path, dtype=np.float64), goal.heading, speed=float(self.rng.uniform(1.05, 1.25)))

    def _watch(self, goal: Goal, stand: Array, moment: Moment) -> None:
        """Where the network has come to rest short of its goal, lead it on to the standing place, then ask again."""
        stalled = moment.speed < 0.05 and float(moment.style[SIT]) < 0.1 and not self._arrived(goal, moment)
        self._stall = self._stall + 1 if stalled else 0
        distance = float(np.linalg.norm(stand - moment.root[:2]))
        if self._stall >= STALL and distance > 0.25:
            self._stall, self._led, self._static = 0, LED, None
            path = np.stack((moment.root[:2], stand)).astype(np.float64)
            self._course = Course(path, goal.heading, speed=1.0, turn_distance=0.4)

    def _free(self, a: Array, b: Array) -> bool:
        # The last stretch lies beside the seat, so the end of the line is not asked about.
        d = b - a
        length = float(np.linalg.norm(d))
        return self.plan.line_is_free(a, a + d * max(0.0, 1 - BESIDE / max(length, 1e-6)), ELBOW_ROOM)  # type: ignore[union-attr]

    def _judge(self, moment: Moment) -> None:
        """See whether the transition has ended, hold, and go on to the next goal."""
        result, goal = self.results[self.index], self.goals[self.index]
        waited = (self._frame - self._started) / FPS
        if self._hold >= 0:
            self._hold -= 1
            if self._hold <= 0:
                self._begin(self.index + 1, moment)
            return
        self._rest = self._rest + 1 if self._arrived(goal, moment) else 0
        if self._rest >= SETTLE or waited > self.time_limit:
            result.reached = self._rest >= SETTLE
            result.seconds, result.end_frame = waited, self._frame
            self._hold = max(1, round(goal.hold * FPS)) if result.reached else 1

    def _arrived(self, goal: Goal, moment: Moment) -> bool:
        if goal.action == "sit":
            near = float(np.linalg.norm(moment.hips - goal.position)) < SEATED_WITHIN
            return near and float(moment.style[SIT]) > EXECUTED and moment.speed < 0.1
        if goal.action == "idle":
            return float(moment.style[IDLE]) > EXECUTED and moment.speed < 0.15
        return float(np.linalg.norm(moment.root[:2] - goal.position[:2])) < 0.3 and moment.speed < 0.15

    # --- the series --------------------------------------------------------------------------------------------

    def _ahead(self, moment: Moment) -> tuple[Array, Array, Array]:
        """Goals (7, ...) of the pivot and the keys ahead."""
        n = FUTURE + 1
        if self._course is not None:
            self._course.advance(moment.root[:2].astype(np.float64))
            speed = max(moment.speed, 0.3)
            position, heading, pace = self._course.preview(speed, tuple(int(f) + FPS for f in KEY_OFFSETS[PIVOT:]))
            action = np.where((pace > 0.3)[:, None], _one_hot("walk"), _one_hot("idle"))
            return np.pad(position, ((0, 0), (0, 1))).astype(np.float32), heading.astype(np.float32), action.astype(np.float32)
        goal = self._static
        if goal is None:
            return np.repeat(self._past_position[-1:], n, 0), np.repeat(self._past_heading[-1:], n), np.repeat(self._past_action[-1:], n, 0)
        return (
            np.repeat(goal.position[None], n, axis=0),
            np.full(n, goal.heading, np.float32),
            np.repeat(_one_hot(goal.action)[None], n, axis=0),
        )


def standing_place(goal: Goal) -> Array:
    """Where on the floor (2,) one stands for a goal: before the seat to sit down, else the goal's own place."""
    place = goal.position[:2].astype(np.float64)
    return place + STAND_AHEAD * heading_to_direction(np.array(goal.heading)) if goal.action == "sit" else place


def check_reachable(goals: list[Goal], plan: FloorPlan, start: Array) -> None:
    """Raise GoalError that names the first goal to which no way leads from the place before it; ``start`` (2,)."""
    here = np.asarray(start, dtype=np.float64)
    for goal in goals:
        if goal.action == "idle":
            continue
        place = standing_place(goal)
        try:
            if np.linalg.norm(place - here) > 0.3:
                plan.find(here, place)
        except GoalError as error:
            raise GoalError(f"'{goal.name}' cannot be reached. {error}") from error
        here = place


def rotation_error(heading: float, goal: float) -> float:
    """Degrees between two headings."""
    return float(np.degrees(abs(wrap_angle(heading - goal))))


def _one_hot(action: str) -> Array:
    return np.eye(len(GOAL_ACTIONS), dtype=np.float32)[GOAL_ACTIONS.index(action)]
