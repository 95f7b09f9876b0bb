"""Who meets something that moves by itself waits until it has passed, and goes around where it stays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nsm_core.conventions import FPS
from nsm_core.rotations import Array
from nsm_core.world.scene.movers import Mover

from .actions.approach import Command
from .director import Director
from .goals import Moment

AHEAD = 45  # frames for which the way is looked at
ROOM = 0.4  # metres from the root that have to be free of what moves
PATIENCE = 15 * FPS  # frames of waiting for one goal after which one goes on all the same
_EVERY = 5
_HEIGHTS = (0.3, 1.0)  # metres over the floor at which a body is felt for
_STROLL, _THERE = 1.1, 0.5  # m/s of one who is sent straight to a goal, and metres off it that are there


class Yielding:
    """Has one character give way to ``movers``; one call of ``update`` a frame, before the director's."""

    def __init__(self, movers: Sequence[Mover]) -> None:
        self.movers = movers
        self._waited = {0: 0}  # frames, by the number of the goal
        self._waits = False
        self._meant: Command | None = None  # what was commanded before it waited

    def update(self, director: Director, moment: Moment, frame: int) -> None:
        """Stop the way, or go on with it, for a character in its ``frame``."""
        for mover in self.movers:
            mover.frame = frame
        waited = self._waited.get(director.index, 0)
        if self._waits:
            self._waited[director.index] = waited + 1
            way = self._way(self._meant, moment)
            if not self._met(way, frame, director) or waited > PATIENCE:
                self._waits = False
                director.resume()
        elif director.giving_way is None and not director.holding and waited <= PATIENCE:
            way = self._way(director.command, moment)
            if self._met(way, frame, director):
                self._waits, self._meant = True, director.command
                here = np.append(moment.root[:2], 0.0).astype(np.float32)
                held = director.command is not None and "+carry" in director.command.action
                thing = director.command.thing if held else None  # type: ignore[union-attr]
                director.giving_way = Command(
                    "idle+carry" if held else "idle", here, float(moment.root[2]), thing=thing
                )

    @staticmethod
    def _way(command: Command | None, moment: Moment) -> Array:
        """Places (N, 2) where one is going to be, every few frames from now on; none who stays."""
        frames = list(range(0, AHEAD + 1, _EVERY))
        here = moment.root[:2].astype(np.float64)
        if command is None:
            return np.zeros((0, 2))
        if command.course is not None:
            return np.asarray(command.course.preview(max(moment.speed, 0.3), frames)[0])
        way = np.asarray(command.position, dtype=np.float64)[:2] - here
        length = float(np.linalg.norm(way))
        if length < _THERE:
            return np.zeros((0, 2))
        shares = np.minimum(np.array(frames) / FPS * _STROLL / length, 1.0)
        return here + shares[:, None] * way

    def _met(self, way: Array, frame: int, director: Director) -> bool:
        """Whether something on the move is met on a way, other than what one goes to."""
        goal = director.goals[max(director.index, 0)].position[:2]
        movers = [m for m in self.movers if np.hypot(*(m.poses[-1, :2] - goal)) > m.reach + ROOM]
        for k, place in enumerate(way):
            when = frame + k * _EVERY
            points = np.array([(*place, z) for z in _HEIGHTS])
            for mover in movers:
                if np.hypot(*(mover.pose_at(when)[:2] - place)) > mover.reach + ROOM:
                    continue
                # What rests already has been gone around.
                if not mover.rests(frame) and mover.distance_at(when, points, ROOM).min() < ROOM:
                    return True
        return False


__all__ = ["Yielding"]
