"""Which places of a floor can be walked to."""

from __future__ import annotations

import numpy as np

from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.planning.walked_to import walked_to

BOUNDS = (np.array((-3.0, -3.0)), np.array((3.0, 3.0)))


def wall(*openings: tuple[float, float], half: float = 0.05) -> FloorPlan:
    """A wall along x = 0 with openings in y, twice ``half`` thick."""
    ends = [-3.2, *(y for opening in openings for y in opening), 3.2]
    spans = np.array([(a, b) for a, b in zip(ends[::2], ends[1::2], strict=True)])
    centres = np.column_stack((np.zeros(len(spans)), spans.mean(1), np.ones(len(spans))))
    halves = np.column_stack((np.full(len(spans), half), np.ptp(spans, axis=1) / 2, np.ones(len(spans))))
    boxes = [(np.zeros(3), 0.0, centres - halves, centres + halves)]
    return FloorPlan(Cuboids(boxes), BOUNDS)


def test_behind_a_wall_nothing_is_walked_to_and_through_an_opening_all_is():
    start, there = np.array((-1.5, 0.0)), np.array(((1.5, 0.0), (1.5, 2.0), (-1.0, -2.0)))
    assert walked_to(wall(), start, there)(there).tolist() == [False, False, True]
    assert walked_to(wall((-0.5, 0.5)), start, there)(there).all()
    assert walked_to(wall((-0.2, 0.2)), start, there)(there).tolist() == [False, False, True]


def test_who_starts_on_something_comes_from_the_free_floor_beside_it():
    there = np.array(((1.5, 0.0), (-1.5, 0.0)))
    assert walked_to(wall(), np.array((0.1, 0.0)), there)(there).tolist() == [True, False]


def test_close_to_a_wall_one_stands_on_the_side_one_comes_from():
    there = np.array(((-0.06, 0.0), (0.06, 0.0)))
    assert walked_to(wall(half=0.01), np.array((-1.5, 0.0)), there)(there).tolist() == [True, False]


def test_beyond_what_is_looked_at_nothing_is_walked_to():
    reached = walked_to(wall(), np.array((-1.5, 0.0)), np.array(((-1.0, 0.0),)))
    assert reached(np.array(((-1.0, 0.5), (-20.0, 0.0), (0.0, 40.0)))).tolist() == [True, False, False]
