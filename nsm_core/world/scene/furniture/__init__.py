"""Furniture made of boxes, for training data, the demo room and the tests.

Object frame: origin on the floor at the centre of the footprint, Z up, front -Y.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nsm_core.errors import GeometryError

from . import seating, storage
from .as_props import carried_box, piece_pose
from .piece import Furniture, box_mesh, build, cuboids, top_of

__all__ = (
    "KINDS",
    "MAKERS",
    "SEAT_KINDS",
    "Furniture",
    "box_mesh",
    "build",
    "carried_box",
    "cuboids",
    "make",
    "piece_pose",
    "top_of",
)

MAKERS: dict[str, Callable[[np.random.Generator, dict[str, Any]], Furniture]] = {
    "chair": seating.chair,
    "armchair": seating.armchair,
    "sofa": seating.sofa,
    "stool": seating.stool,
    "bench": seating.bench,
    "table": storage.table,
    "desk": storage.desk,
    "shelf": storage.shelf,
    "cabinet": storage.block("cabinet", width=(0.4, 1.6), depth=(0.35, 0.6), height=(0.7, 2.0)),
    "box": storage.block("box", width=(0.25, 0.6), depth=(0.25, 0.6), height=(0.2, 0.6)),
    "wall": storage.block("wall", width=(1.0, 4.0), depth=(0.08, 0.2), height=(2.2, 2.8)),
    "crate": storage.block("crate", width=(0.2, 0.5), depth=(0.2, 0.5), height=(0.2, 0.5)),
    "step": storage.step,
    "low_wall": storage.block("low_wall", width=(0.8, 2.5), depth=(0.08, 0.25), height=(0.2, 0.5)),
    "hole_wall": storage.hole_wall,
}
KINDS = tuple(MAKERS)
SEAT_KINDS = ("chair", "armchair", "sofa", "stool", "bench")


def make(kind: str, rng: np.random.Generator, **overrides: object) -> Furniture:
    """Make a piece of furniture of a kind in ``KINDS``; measures not given are drawn from ``rng``.

    ``overrides`` in metres: width, depth, height or seat_height, back_height, thickness, arm_width,
    arm_height, arm_start (share of the depth), plate; and legs ("posts", "pedestal", "sides", "solid"),
    back_style ("panel", "frame", "ladder"), arm_style ("block", "rail"), arms, back, drawer_side, steps (of a
    flight); and opening_width, opening_height, along (0..1: where along a wall its opening is).  On a seat,
    width and depth are those of the free surface.  Raises GeometryError on an unknown kind or measure, or on
    measures that do not fit together.
    """
    if kind not in MAKERS:
        raise GeometryError(f"There is no furniture of the kind {kind!r}; choose one of {', '.join(KINDS)}.")
    left = dict(overrides)
    made = MAKERS[kind](rng, left)
    if left:
        raise GeometryError(f"A {kind} has no measure {', '.join(sorted(left))}; leave it out.")
    return made
