"""Ways of hands to and from things in generated kitchens, with the fields around them.

No free captures of hands in clutter exist, so ways are made: the quickest one past everything that stands
there, slower where there is little room, straight into the grasp, timed as people reach (minimum jerk); with
the thing in the hand it is wider.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.affordances.grasps import find_grasps
from nsm_core.world.affordances.reach import LEFT, Reach, raised, reaches
from nsm_core.world.assets.kitchen import Kitchen, make_kitchen
from nsm_core.world.geometry.distance import Union
from nsm_core.world.planning.hand_fields import HandFields, HandSpace, hand_space
from nsm_core.world.planning.hand_way import timed, way_into
from nsm_core.world.scene.small_things import SmallThing
from nsm_core.world.scene.wrist import WristPose

FASTEST = (0.6, 1.2)  # m/s of a hand, drawn
_ARM = 0.75  # metres around a thing in which a hand may meet something
_TRIED, _KEPT = 24, 2  # grasps that are tried, and that are kept of a thing


@dataclass(frozen=True)
class HandWay:
    """One way of a wrist to a thing: ``path`` (T, 3) from the thing's middle and ``rotations`` (T, 3, 3), in
    the frame of what it stands in, turned by ``heading``; ``laden`` with the thing in the hand, that is a way
    to place it, or to pick it when it is gone backwards.  ``height`` metres of the thing's middle over the
    floor, ``left`` the hand.
    """

    fields: HandFields
    path: Array
    rotations: Array
    height: float
    left: bool
    laden: bool


def ways_in(seed: int, things: int) -> Iterator[HandWay]:
    """Ways to at most so many things of the kitchen of a seed, what shuts them away open."""
    kitchen = make_kitchen(seed)
    rng = np.random.default_rng((seed, 23))
    names = list(kitchen.things)
    for k in rng.permutation(len(names))[:things]:
        name = names[int(k)]
        shut, container = kitchen.shut_by(name), kitchen.things[name].container
        for part in shut:
            kitchen.open(container, part, 1.0)
        yield from _ways_to(kitchen, name, rng)
        for part in shut:
            kitchen.open(container, part, 0.0)


def _ways_to(kitchen: Kitchen, name: str, rng: np.random.Generator) -> Iterator[HandWay]:
    thing, scene = kitchen.things[name].thing, kitchen.scene()
    heading = float(kitchen.containers[kitchen.things[name].container].pose[3])
    around = scene.near(thing.pose[:2], _ARM, thing)
    grasps = find_grasps(
        name, thing.query, thing.low, thing.high, thing.pose, around, thing.mass, thing.handle, 0.01
    )
    solids = Union([scene.environment, *(p for c in kitchen.containers.values() for p in c.parts)])
    space, kept = hand_space(thing, around, thing.middle, heading), 0
    for grasp in grasps[:_TRIED]:
        wrist = grasp.at(thing.pose)
        found = reaches(wrist, solids)
        if not found:
            continue
        made = [
            _way(thing, space, wrist, found[0], laden, heading, float(rng.uniform(*FASTEST)))
            for laden in (False, True)
        ]
        good = [way for way in made if way is not None]
        yield from good
        kept += bool(good)
        if kept == _KEPT:
            return


def _way(
    thing: SmallThing,
    space: HandSpace,
    wrist: WristPose,
    reach: Reach,
    laden: bool,
    heading: float,
    fastest: float,
) -> HandWay | None:
    way = way_into(space, wrist, raised(reach), thing if laden else None)
    if way is None:
        return None
    path = timed(way, fastest)
    back = np.float64(-heading)
    rotation = np.stack([rotate_planar(column, back) for column in wrist.rotation.T], -1)
    return HandWay(
        space.along(path),
        rotate_planar(path - thing.middle, back),
        np.repeat(rotation[None], len(path), 0),
        float(thing.middle[2]),
        reach.side == LEFT,
        laden,
    )
