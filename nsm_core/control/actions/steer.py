"""One who is steered: led where somebody says, from one frame to the next."""

from __future__ import annotations

import numpy as np

from nsm_core.control.goals import Goal, Moment, Steering
from nsm_core.control.locomotion import STANDS, Answer, Trajectory
from nsm_core.conventions import FPS, SIT
from nsm_core.distances import STAND_AHEAD, WALK_TO_RUN
from nsm_core.rotations import Array, heading_to_direction

from .approach import RUNNING, WALKING, Command, Ground
from .base import Stage

WALKS, RUNS = float(np.mean(WALKING.speeds)), float(np.mean(RUNNING.speeds))  # m/s that keys ask for
# As quick as bodies of the training data are.
_WALKS, _RUNS = Answer(1.5, 1.1, WALKING.sideways), Answer(2.8, 2.4, RUNNING.sideways)
_STOOD_UP = 0.3  # of the sit label
_PAST = 6  # frames over which the pace is told


class Steer(Stage):
    """Go where ``goal.steering`` says at each moment, until something else is asked for."""

    endless = True

    def __init__(self, goal: Goal, ground: Ground, moment: Moment) -> None:
        super().__init__(goal)
        self._steering: Steering = goal.steering or Steering()
        self._ground, self._past = ground, [moment.root.astype(np.float64)]
        self._trajectory = Trajectory()
        self._anchor: tuple[Array, float] | None = None
        self._gone, self._frames = 0.0, 0

    def update(self, moment: Moment) -> Command:
        root, wanted = moment.root.astype(np.float64), self._steering
        self._gone += float(np.linalg.norm(root[:2] - self._past[-1][:2]))
        self._frames += 1
        self._past = [*self._past[-_PAST:], root]
        change = (root[:2] - self._past[0][:2]) * FPS / (len(self._past) - 1)
        if float(moment.style[SIT]) > _STOOD_UP:  # a sitter stands up before its seat first
            self._anchor = self._anchor or (root[:2] + STAND_AHEAD * heading_to_direction(root[2]), root[2])
            return self._stand(self._anchor)
        if wanted.speed == 0 and moment.speed < STANDS:
            heading = root[2] if wanted.heading is None else wanted.heading
            if self._anchor is None:
                self._anchor = root[:2], heading
            elif wanted.heading is not None:
                self._anchor = self._anchor[0], heading
            return self._stand(self._anchor)
        self._anchor = None
        pace = float(np.linalg.norm(change))
        answer = _RUNS if max(wanted.speed, pace) > WALK_TO_RUN[0] else _WALKS
        self._trajectory.lay(root[:2], change, float(root[2]), wanted, answer, self._ground.floor())
        runs = (wanted.speed or pace) > WALK_TO_RUN[0]
        return Command((RUNNING if runs else WALKING).action, course=self._trajectory)

    def _stand(self, anchor: tuple[Array, float]) -> Command:
        place, heading = anchor
        return Command("idle", np.append(place, 0.0).astype(np.float32), float(heading))

    def arrived(self, moment: Moment) -> bool:
        return False

    def target(self) -> tuple[Array | None, float, int]:
        return None, 0.0, 2

    def line(self) -> tuple[Array | None, list[str]]:
        return None, [f"steered for {self._frames / FPS:.1f} s over {self._gone:.1f} m"]


__all__ = ["RUNS", "WALKS", "Steer"]
