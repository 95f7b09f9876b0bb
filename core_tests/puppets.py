"""A puppet for the tests of the director: it goes where it is led, without a network."""

from __future__ import annotations

import numpy as np

from nsm_core.control.director import Director
from nsm_core.control.goals import Goal, Moment
from nsm_core.conventions import GOAL_ACTIONS, STYLES
from nsm_core.rotations import wrap_angle
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.floor_plan import FloorPlan

ROOM = (np.array((-9.0, -9.0)), np.array((9.0, 9.0)))
EMPTY = FloorPlan(Cuboids(), ROOM)


def cell() -> Cuboids:
    """Four walls about (0, -5.5) that nobody comes through."""
    sides = (
        ((0, -4), (1.5, 0.1)),
        ((0, -7), (1.5, 0.1)),
        ((-1.5, -5.5), (0.1, 1.6)),
        ((1.5, -5.5), (0.1, 1.6)),
    )
    return Cuboids(
        [(np.array(at), 0.0, np.array([(-x, -y, 0.0)]), np.array([(x, y, 2.5)])) for at, (x, y) in sides]
    )


class Puppet:
    """Goes where the goal series says at 1.2 m/s at most, and sits where it is told to, close enough."""

    def __init__(
        self,
        goals: list[Goal],
        root=(0.0, 0.0, 0.0),
        plan: FloorPlan = EMPTY,
        seed: int = 0,
        time_limit: float = 20.0,
    ):
        self.root, self.sitting, self.speed = np.array(root, dtype=np.float64), 0.0, 0.0
        self.director = Director(
            goals, plan, self.root.astype(np.float32), np.random.default_rng(seed), time_limit
        )
        self.position, self.heading, self.action, self.sensed, self.roots = [], [], [], [], []
        self.obedient = True
        self.lifts: np.ndarray | None = None  # a place (3,) about which the ground is as high

    def moment(self) -> Moment:
        style = np.zeros(len(STYLES))
        style[STYLES.index("sit")] = self.sitting
        style[STYLES.index("walk")] = min(self.speed, 1) * (1 - self.sitting)
        style[STYLES.index("idle")] = 1 - style.sum()
        hips = np.append(self.root[:2], 0.9 - 0.4 * self.sitting)
        if self.lifts is not None and np.abs(self.root[:2] - self.lifts[:2]).max() < 0.35:
            hips[2] += self.lifts[2]
        return Moment(self.root.astype(np.float32), hips, float(self.root[2]), self.speed, style)

    def step(self) -> bool:
        if self.director.done:
            return False
        position, heading, action, sensed = self.director.update(self.moment())
        for kept, value in (
            (self.position, position),
            (self.heading, heading),
            (self.action, action),
            (self.sensed, sensed),
        ):
            kept.append(value)
        self.roots.append(self.root.copy())
        if self.obedient:
            way = position[6, :2] - self.root[:2]
            far, sit = float(np.linalg.norm(way)), action[6, GOAL_ACTIONS.index("sit")] > 0.5
            step = min(far, 1.2 / 30)
            self.root[:2] += way / max(far, 1e-9) * step
            self.root[2] += np.clip(wrap_angle(heading[6] - self.root[2]), -0.1, 0.1)
            self.speed = 30 * step
            self.sitting = float(np.clip(self.sitting + (0.1 if sit and far < 0.1 else -0.1), 0, 1))
        return True

    def run(self, frames: int = 2000) -> Puppet:
        while len(self.position) < frames and self.step():
            pass
        return self
