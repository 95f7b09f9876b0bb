"""Doors: the leaf and its opening share a frame, swing clear of each other and give what takes need."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.distances import OPENED, WRIST_OFF_HANDLE
from nsm_core.errors import GeometryError
from nsm_core.world.affordances.passage import passage
from nsm_core.world.scene.door import make_door
from nsm_core.world.scene.furniture import cuboids


def doors(count=12):
    rng = np.random.default_rng(0)
    return [make_door(rng) for _ in range(count)]


def test_the_leaf_lies_in_its_own_frame_with_handles_on_both_sides():
    for d in doors():
        panel = slice(0, 1)
        np.testing.assert_allclose(d.piece.mins[panel][0, [0, 2]], 0, atol=1e-6)
        assert d.piece.maxs[0, 0] == pytest.approx(d.width) and d.piece.mins[0, 1] == -d.piece.maxs[0, 1]
        assert 0.75 <= d.width <= 1.0 and 2.0 <= d.piece.size[2] <= 2.1 + 1e-6
        assert 0.9 <= d.handle[2] <= 1.1 and 0.05 <= d.width - d.handle[0] <= 0.09
        assert d.piece.mins[:, 1].min() == pytest.approx(-d.thickness / 2, abs=1e-6)
        assert d.piece.maxs[:, 1].max() == pytest.approx(d.thickness / 2, abs=1e-6)


def test_the_leaf_closes_the_opening_and_turns_without_touching_the_wall():
    for d in doors():
        wall = cuboids([(d.wall, (0, 0), 0.0)])
        x0, x1, top = d.wall.opening
        assert x0 < 0 and d.width < x1 < d.width + 0.05 and d.piece.size[2] < top
        for swing in (-1.0, 1.0):
            leaf = d.leaf(swing=swing)
            grid = np.stack(
                np.meshgrid(np.linspace(0, d.width, 30), (-0.01, 0.01), (0.1, 1.0, 1.95), indexing="ij"), -1
            ).reshape(-1, 3)
            for angle in (0.0, 0.4, float(OPENED), float(np.radians(95))):
                assert (wall.signed_distance(leaf.to_world(grid, leaf.pose_at(angle)), 1.0) > 0).all()


def test_distances_and_sensor_move_with_the_leaf():
    d = make_door(np.random.default_rng(3), width=0.9, panel=0.04, grips=0.12)
    leaf = d.leaf((2.0, -1.0, 0.0, 0.7), swing=-1.0)
    middle = np.array(((0.45, 0.0, 1.0),))
    assert leaf.signed_distance(leaf.to_world(middle), 1.0)[0] == pytest.approx(-0.02, abs=1e-4)
    assert leaf.signed_distance(leaf.to_world(middle + (0, 0.3, 0)), 1.0)[0] == pytest.approx(0.28, abs=1e-4)
    shut = leaf.to_world(middle + (-0.2, 0, 0))
    leaf.pose = leaf.pose_at(np.pi / 2)
    assert leaf.angle == pytest.approx(np.pi / 2)
    assert leaf.signed_distance(shut, 1.0)[0] == pytest.approx(0.23, abs=1e-4)
    sensed = leaf.sensed()
    np.testing.assert_allclose(sensed.size, d.piece.size, atol=1e-5)
    np.testing.assert_allclose(sensed.centre, leaf.to_world(d.piece.centre), atol=1e-5)
    assert sensed.heading == pytest.approx(0.7 - np.pi / 2) and 0 < sensed.occupancy.mean() < 1


def test_the_grips_are_on_the_handles_and_the_passage_leads_through_the_opening():
    for d in doors(4):
        leaf = d.leaf((1.0, 2.0, 0.0, -0.3))
        for side in (-1.0, 1.0):
            assert abs(leaf.signed_distance(leaf.grip(side, 0.0)[None], 1.0)[0] - WRIST_OFF_HANDLE) < 1e-5
        way = passage(leaf, leaf.to_world(np.array((0.4, -2.0, 0.0)))[:2])
        local = leaf.to_local(np.append(way.middle, 0.0))
        assert d.wall.opening[0] < local[0] < d.wall.opening[1] and abs(local[1]) < 1e-6


def test_doors_repeat_by_seed_and_refuse_unknown_measures():
    a, b = (make_door(np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(a.piece.mins, b.piece.mins)
    assert make_door(np.random.default_rng(5), width=0.8).width == 0.8
    with pytest.raises(GeometryError, match="no measure colour"):
        make_door(np.random.default_rng(0), colour=1)
    with pytest.raises(GeometryError, match="no room"):
        make_door(np.random.default_rng(0), near=-1.0)
