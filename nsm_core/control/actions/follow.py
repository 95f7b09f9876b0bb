"""Walking or running along a line over the floor, from its start to its end."""

from __future__ import annotations

import numpy as np

from nsm_core.control.goals import Goal, Moment
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, direction_to_heading
from nsm_core.world.planning.along import Detour, around_things
from nsm_core.world.planning.floor_plan import path_length
from nsm_core.world.planning.track import Corner, Track, tight_corners

from .approach import Command, Gait, Ground
from .base import Stage, Way

_AT_START = 0.15  # metres from its start at which one is on the line at once
_RUN_UP = 0.4  # metres before its start from which on one goes as the line begins
_STRAIGHT = 0.9  # cosine of the angle with the line's beginning up to which one comes to it as one is
_TOLD = 3  # corners of a line that are told at most


class Follow(Stage):
    """Go to the start of the goal's line, along it, and stand at its end."""

    def __init__(self, goal: Goal, ground: Ground, gait: Gait, led: float) -> None:
        """``led``: metres before the end up to which one is led; from there one is sent to it."""
        super().__init__(goal)
        self._line: Array | None = None
        self._detours: list[Detour] = []
        self._ground, self._gait, self._led = ground, gait, led
        self._corners: list[Corner] = []
        self._final = Command("idle", goal.position, goal.heading)
        self._command: Command | None = None

    def update(self, moment: Moment) -> Command:
        if self._command is None:
            self._command = self._lead(moment.root[:2].astype(np.float64))
        course = self._command.course
        if course is not None and course.length - course.progress < self._led:
            self._command = self._final
        return self._command

    def arrived(self, moment: Moment) -> bool:
        near = float(np.linalg.norm(moment.root[:2] - self.goal.position[:2])) < 0.3
        return self._command is self._final and near and moment.speed < 0.15

    def line(self) -> tuple[Array | None, list[str]]:
        told: list[str] = [str(d) for d in self._detours]
        told += [str(corner) for corner in self._corners[:_TOLD]]
        return self._line, [f"It {one}" for one in told]

    def _lead(self, here: Array) -> Command:
        line, ground = np.asarray(self.goal.way, dtype=np.float64), self._ground
        floor = ground.floor()
        if floor is not None:
            line, self._detours = around_things(self.goal.name, line, floor)
        self._line = line
        joins = 0.0
        if np.linalg.norm(line[0] - here) > _AT_START:
            lead = self._joining(here, line)
            line, joins = np.concatenate((lead, line[1:])), path_length(lead)
        gait = self._gait
        speed = ground.pace * (self.goal.speed or float(ground.rng.uniform(*gait.speeds)))
        self._corners = tight_corners(np.asarray(self.goal.way), speed, gait.sideways)
        track = Track(
            line,
            self.goal.heading,
            speed,
            0.3,
            gait.acceleration,
            gait.deceleration,
            sideways=gait.sideways,
            joins=joins,
        )
        return Command(gait.action, course=track)

    def _joining(self, here: Array, line: Array) -> Array:
        """A way (N, 2) from ``here`` to the start of the line that comes to it along the line, where there is
        room: a body rounds the corner before the line, not on it.
        """
        start = line[0]
        far = line[np.argmax(np.linalg.norm(line - start, axis=1) > _AT_START)]
        along = (far - start) / max(float(np.linalg.norm(far - start)), 1e-9)
        before = start - _RUN_UP * along
        lead = self._ground.way(here, start)
        came = start - lead[-2]
        bends = float(came @ along) < _STRAIGHT * float(np.linalg.norm(came))
        if not bends or not self._ground.free(before, start):
            return lead
        try:
            run_up = self._ground.way(here, before)
        except GoalError:
            return lead
        longer = path_length(run_up) + _RUN_UP - path_length(lead)
        return lead if longer > 2 * _RUN_UP + _AT_START else np.concatenate((run_up, start[None]))


def places(goal: Goal, way: Way) -> list[Array | None]:
    """The start of the line; one that is cut where no way leads around is refused."""
    line = np.asarray(goal.way, dtype=np.float64)
    if way.plan is not None:
        around_things(goal.name, line, way.plan)
    return [line[0], None, line[-1]]


def heading_at_end(line: Array) -> float:
    """Heading, radians, in which a line (N, 2) ends."""
    steps = np.asarray(line, dtype=np.float64)
    far = steps[-1] - steps[np.linalg.norm(steps - steps[-1], axis=1) > 0.05][-1:]
    return float(direction_to_heading(far[0])) if len(far) else 0.0


__all__ = ["Follow", "heading_at_end", "places"]
