"""Ways of hands to and from things in generated kitchens, with the fields around them.

No free captures of hands in clutter exist, so ways are made: the quickest one past everything that stands
there, slower where there is little room, straight into the grasp, timed as people reach (minimum jerk); with
the thing in the hand it is wider.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.affordances.grasps import find_grasps
from nsm_core.world.affordances.reach import LEFT, raised, reaches
from nsm_core.world.assets.kitchen import Kitchen, make_kitchen
from nsm_core.world.geometry.distance import DistanceQuery, Union
from nsm_core.world.planning.hand_fields import HandFields, HandSpace, hand_space
from nsm_core.world.planning.hand_way import timed, way_into
from nsm_core.world.scene.small_things import SmallThing
from nsm_core.world.scene.wrist import WristPose

FASTEST = (0.6, 1.2)  # m/s of a hand, drawn
_ARM = 0.75  # metres around a thing in which a hand may meet something
_TRIED, _KEPT = 24, 2  # grasps that are tried, and that are kept of a thing


@dataclass(frozen=True)
class HandTask:
    """One hand that is to come to a ``thing`` (4,) in a scene, world: the pose of the ``wrist`` there, where
    it may ``begin`` (3,), the ``space`` around the thing in cells turned by ``heading``, ``around`` the
    distances of everything else; ``left`` the hand; ``laden`` with the thing in it, that is a way to place
    it, or to pick it when it is gone backwards.
    """

    thing: SmallThing
    around: DistanceQuery
    space: HandSpace
    heading: float
    wrist: WristPose
    begin: Array
    left: bool
    laden: bool

    @property
    def condition(self) -> Array:
        """The condition (4,) as ``field_config.CONDITION``: to pick a hand comes empty and leaves laden."""
        height = float(self.thing.middle[2])
        return np.array((height, self.left, 0.0, self.laden), np.float32)

    def to_own(self, places: Array) -> Array:
        """World places (..., 3) from the thing, in the frame of what it stands in."""
        return rotate_planar(places - self.thing.middle, np.float64(-self.heading))

    def to_world(self, places: Array) -> Array:
        """The other way round."""
        return rotate_planar(places, np.float64(self.heading)) + self.thing.middle

    @property
    def rotation(self) -> Array:
        """The wrist's (3, 3) in the frame of what the thing stands in."""
        back = np.float64(-self.heading)
        return np.stack([rotate_planar(column, back) for column in self.wrist.rotation.T], -1)

    @property
    def task(self) -> Array:
        """What is asked of the way (9,), as ``field_config.TASK``."""
        ends = self.to_own(self.wrist.place), -self.rotation[:, 1], self.to_own(self.begin)
        return np.concatenate(ends).astype(np.float32)


@dataclass(frozen=True)
class HandWay:
    """One way of a wrist that does a ``task``: ``path`` (T, 3) from the thing's middle, in the frame of what
    that stands in, and the ``fields`` along it.
    """

    task: HandTask
    fields: HandFields
    path: Array


def ways_in(seed: int, things: int) -> Iterator[HandWay]:
    """Ways to at most so many things of the kitchen of a seed, what shuts them away open."""
    kitchen = make_kitchen(seed)
    rng = np.random.default_rng((seed, 23))
    names = list(kitchen.things)
    for k in rng.permutation(len(names))[:things]:
        name, kept = names[int(k)], 0
        shut, container = kitchen.shut_by(name), kitchen.things[name].container
        for part in shut:
            kitchen.open(container, part, 1.0)
        for pair in tasks_to(kitchen, name):
            ways = [way for way in (_way(task, float(rng.uniform(*FASTEST))) for task in pair) if way]
            yield from ways
            kept += bool(ways)
            if kept == _KEPT:
                break
        for part in shut:
            kitchen.open(container, part, 0.0)


def tasks_to(kitchen: Kitchen, name: str) -> Iterator[tuple[HandTask, HandTask]]:
    """What hands could do at a thing of a kitchen as it is now, the best grasp first: come empty, and come
    laden.  They hold while nothing of the kitchen is opened or shut.
    """
    at = HandAt.thing_of(kitchen, name)
    for wrist in at.wrists:
        if (empty := at.task(wrist, laden=False)) is not None:
            yield empty, replace(empty, laden=True)


@dataclass(frozen=True)
class HandAt:
    """A thing that hands may come to: ``wrists`` poses that hold it, world, the best first, some of them out
    of reach; ``solids`` what is in the way of a body; the others as in ``HandTask``.
    """

    thing: SmallThing
    around: DistanceQuery
    space: HandSpace
    heading: float
    wrists: list[WristPose]
    solids: DistanceQuery

    @classmethod
    def thing_of(cls, kitchen: Kitchen, name: str) -> HandAt:
        """Of a kitchen as it is now; it holds while nothing of that is opened or shut."""
        thing, scene = kitchen.things[name].thing, kitchen.scene()
        heading = float(kitchen.containers[kitchen.things[name].container].pose[3])
        around = scene.near(thing.pose[:2], _ARM, thing)
        grasps = find_grasps(
            name, thing.query, thing.low, thing.high, thing.pose, around, thing.mass, thing.handle, 0.01
        )
        solids = Union([scene.environment, *(p for c in kitchen.containers.values() for p in c.parts)])
        space = hand_space(thing, around, thing.middle, heading)
        wrists = [grasp.at(thing.pose) for grasp in grasps[:_TRIED]]
        return cls(thing, around, space, heading, wrists, solids)

    def task(self, wrist: WristPose, laden: bool) -> HandTask | None:
        """What a hand does that comes to a pose; None where nobody stands who reaches it."""
        found = reaches(wrist, self.solids)
        if not found:
            return None
        left, begin = found[0].side == LEFT, raised(found[0])
        return HandTask(self.thing, self.around, self.space, self.heading, wrist, begin, left, laden)


def quickest(task: HandTask) -> Array | None:
    """The way (K, 3), world, that is learnt from: the quickest past everything; None where there is none."""
    return way_into(task.space, task.wrist, task.begin, task.thing if task.laden else None)


def _way(task: HandTask, fastest: float) -> HandWay | None:
    way = quickest(task)
    if way is None:
        return None
    path = timed(way, fastest)
    return HandWay(task, task.space.along(path), task.to_own(path))
