"""What of generated kitchens a hand can take: grasps, where one stands for them, and what is in the way."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from nsm_core.world.affordances.grasps import OneHandGrasp, find_grasps
from nsm_core.world.affordances.reach import Reach, reaches
from nsm_core.world.assets.kitchen import Kitchen
from nsm_core.world.geometry.distance import DistanceQuery, Union
from nsm_core.world.planning.hand_fields import hand_fields, straight_in

KITCHENS = 60  # of the benchmark
_ARM = 0.75  # metres around a thing in which a hand and a forearm may meet something
_TRIED = 24  # grasps, the best first, for which a place to stand is looked for


@dataclass
class Taking:
    """How one thing can be taken once what shuts it away is open.

    ``condition`` "open", "shut" or "blocked"; ``shut_by`` names of the parts that are opened; ``grasps``
    those with room, and of them ``grasp``, the best that a standing body reaches by ``reach``, None where
    there is none; ``seconds`` that it took.
    """

    name: str
    condition: str
    shut_by: list[str]
    grasps: list[OneHandGrasp]
    grasp: OneHandGrasp | None
    reach: Reach | None
    seconds: float


def take_thing(kitchen: Kitchen, name: str) -> Taking:
    """Open what shuts a thing away, look for grasps and a place to stand, and shut it again."""
    begun = perf_counter()
    standing = kitchen.things[name]
    shut = kitchen.shut_by(name)
    for part in shut:
        kitchen.open(standing.container, part, 1.0)
    thing, scene = standing.thing, kitchen.scene()
    grasps = find_grasps(
        name,
        thing.query,
        thing.low,
        thing.high,
        thing.pose,
        scene.near(thing.pose[:2], _ARM, thing),
        thing.mass,
        thing.handle,
    )
    solids = Union([scene.environment, *(p for c in kitchen.containers.values() for p in c.parts)])
    best: tuple[OneHandGrasp, Reach] | None = None
    for grasp in grasps[:_TRIED]:
        found = reaches(grasp.at(thing.pose), solids)
        if found:
            best = grasp, found[0]
            break
    for part in shut:
        kitchen.open(standing.container, part, 0.0)
    condition = "blocked" if standing.blockers else "shut" if shut else "open"
    spent = perf_counter() - begun
    if best is None:
        return Taking(name, condition, shut, grasps, None, None, spent)
    return Taking(name, condition, shut, grasps, *best, spent)


def fields_of(kitchen: Kitchen, taking: Taking) -> tuple[float, float]:
    """Compute the fields around a thing that can be taken, by a straight way to its grasp: seconds that it
    took, and the share of cells that a hand arrives at.
    """
    assert taking.grasp is not None
    thing = kitchen.things[taking.name].thing
    others = kitchen.scene().near(thing.pose[:2], _ARM, thing)
    begun = perf_counter()
    made = hand_fields(thing, others, thing.middle, straight_in(taking.grasp.at(thing.pose)))
    return perf_counter() - begun, float((made.arrival > 0).mean())


def least_gap(kitchen: Kitchen) -> float:
    """Metres between things and whatever is beside or over them, at least: what they stand on left out."""
    scene, gaps = kitchen.scene(), []
    for standing in kitchen.things.values():
        thing = standing.thing
        vertices = thing.mesh()[0].astype(np.float64)
        beside = thing.to_world(vertices[vertices[:, 2] > 0.01])
        others: DistanceQuery = scene.near(thing.pose[:2], 0.2, thing)
        gaps.append(float(others.signed_distance(beside.astype(np.float32), 0.2).min()))
    return min(gaps, default=np.inf)
