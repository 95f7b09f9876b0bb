"""Generated furniture: exact boxes, closed meshes, seats that fit people, repeatable by seed."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.errors import GeometryError
from nsm_core.world.geometry.orientation import face_sides
from nsm_core.world.scene.furniture import KINDS, SEAT_KINDS, carried_box, cuboids, make, piece_pose, top_of


@pytest.mark.parametrize("kind", KINDS)
def test_boxes_and_mesh_are_the_same_solid_on_the_floor(kind):
    rng = np.random.default_rng(0)
    for _ in range(25):
        f = make(kind, rng)
        assert (f.maxs > f.mins).all() and f.mins[:, 2].min() == 0
        np.testing.assert_allclose(f.centre[:2], 0, atol=1e-6)
        corners = f.vertices.reshape(-1, 8, 3)
        np.testing.assert_array_equal(corners.min(1), f.mins)
        np.testing.assert_array_equal(corners.max(1), f.maxs)
        t = f.vertices[f.triangles].astype(float)
        volume = np.linalg.det(t).sum() / 6
        assert volume == pytest.approx(np.prod(f.maxs.astype(float) - f.mins, axis=1).sum(), rel=1e-3)
        assert (face_sides(f.vertices, f.triangles) != -1).all()


@pytest.mark.parametrize("kind", SEAT_KINDS)
def test_people_fit_on_the_seats(kind):
    rng = np.random.default_rng(1)
    for _ in range(50):
        f = make(kind, rng)
        seat = f.seat
        assert 0.35 <= seat.height <= 0.6 and seat.heading == 0
        query = cuboids([(f, (0, 0), 0.0)])
        under = seat.point + np.array((0, 0, -0.01))
        over = np.array(
            [
                seat.point + (dx, dy, dz)
                for dx in (-0.1, 0, 0.1)
                for dy in (-0.1, 0, 0.1)
                for dz in (0.02, 0.3, 0.7)
            ]
        )
        assert query.signed_distance(under[None], 0.5)[0] < 0
        assert (query.signed_distance(over, 0.5) > 0).all()
        front = f.mins[:, 1].min()
        assert 0.1 < seat.point[1] - front <= 0.3
        ahead = np.array([(x, front - 0.05, seat.height + 0.05) for x in (-0.1, 0.1)])
        assert (query.signed_distance(ahead, 0.5) > 0).all()


def test_the_same_seed_makes_the_same_piece_and_another_seed_another():
    for kind in KINDS:
        a, b, c = (make(kind, np.random.default_rng(s)) for s in (4, 4, 5))
        np.testing.assert_array_equal(a.mins, b.mins)
        assert a.mins.shape != c.mins.shape or not np.allclose(a.mins, c.mins)


def test_measures_can_be_given():
    f = make(
        "armchair",
        np.random.default_rng(0),
        seat_height=0.5,
        width=0.55,
        depth=0.5,
        arm_width=0.1,
        thickness=0.1,
        arm_style="block",
    )
    assert f.seat.height == 0.5 and f.seat.arms and f.seat.back
    assert f.size[0] == pytest.approx(0.75, abs=1e-6) and f.size[1] == pytest.approx(0.6, abs=1e-6)
    assert make("bench", np.random.default_rng(0), back=True).seat.back
    assert not make("bench", np.random.default_rng(0), back=False).seat.back
    wall = make("wall", np.random.default_rng(0), width=3.0, depth=0.1, height=2.5)
    np.testing.assert_allclose(wall.size, (3.0, 0.1, 2.5), atol=1e-6)
    assert wall.seat is None


def test_one_override_leaves_the_other_measures_as_drawn():
    plain, low = (make("table", np.random.default_rng(9), **o) for o in ({}, {"height": 0.5}))
    np.testing.assert_allclose(plain.size[:2], low.size[:2])
    assert low.size[2] == pytest.approx(0.5)


def test_unknown_kinds_and_impossible_measures_are_refused():
    rng = np.random.default_rng(0)
    with pytest.raises(GeometryError, match="'throne'; choose one of chair"):
        make("throne", rng)
    with pytest.raises(GeometryError, match="no measure colour"):
        make("chair", rng, colour="red")
    with pytest.raises(GeometryError, match="no room"):
        make("wall", rng, width=-1.0)


def test_a_wall_with_a_hole_lets_a_person_through_there_and_nowhere_else():
    rng = np.random.default_rng(2)
    for _ in range(10):
        wall = make("hole_wall", rng)
        x0, x1, top = wall.opening
        assert 0.8 <= x1 - x0 <= 1.2 and 1.95 <= top <= 2.2
        query = cuboids([(wall, (0, 0), 0.0)])
        through = np.array(
            [(x, 0, z) for x in (x0 + 0.01, (x0 + x1) / 2, x1 - 0.01) for z in (0.01, 1.0, top - 0.01)]
        )
        beside = np.array([(x, 0, z) for x in (x0 - 0.01, x1 + 0.01) for z in (0.01, 1.0, top + 0.01)])
        assert (query.signed_distance(through, 1.0) > 0).all() and (
            query.signed_distance(beside, 1.0) < 0
        ).all()


def test_a_flight_of_steps_rises_to_the_back():
    flight = make("step", np.random.default_rng(0), steps=3, depth=0.9, height=0.45)
    np.testing.assert_allclose(flight.maxs[:, 2], (0.15, 0.3, 0.45), atol=1e-6)
    assert (np.diff(flight.mins[:, 1]) > 0.29).all()
    assert len(make("step", np.random.default_rng(0)).mins) == 1


def test_the_top_of_a_piece_is_its_largest_free_level_surface():
    rng = np.random.default_rng(3)
    for kind in ("table", "desk", "box", "step"):
        piece = make(kind, rng)
        height, corners = top_of(piece)
        assert height == pytest.approx(piece.size[2], abs=1e-3)
        np.testing.assert_allclose(corners[1] - corners[0], piece.size[:2], atol=2e-3)
    height, corners = top_of(make("step", rng, steps=2, depth=1.0, height=0.4))
    assert height == pytest.approx(0.4, abs=1e-3) and corners[0][1] == pytest.approx(0.0, abs=1e-3)
    chair = make("chair", rng, seat_height=0.45, width=0.4, depth=0.42)
    height, corners = top_of(chair)
    assert height == pytest.approx(0.45, abs=1e-3)
    np.testing.assert_allclose(corners[1] - corners[0], (0.4, 0.42), atol=2e-3)
    with pytest.raises(GeometryError, match="Nothing can be put"):
        top_of(make("wall", rng))


def test_a_crate_becomes_a_box_to_carry_and_back():
    crate = make("crate", np.random.default_rng(4))
    box = carried_box(crate, (1.0, 2.0, 0.7, 0.5))
    np.testing.assert_allclose(box.pose, (1.0, 2.0, 0.7 + crate.size[2] / 2, 0.5), atol=1e-6)
    np.testing.assert_allclose(piece_pose(crate, box.pose), (1.0, 2.0, 0.7, 0.5), atol=1e-6)
    np.testing.assert_allclose(box.size, crate.size)
    corner = crate.maxs[0] * 0.99
    world = cuboids([(crate, (1.0, 2.0, 0.7), 0.5)])
    points = box.to_world(np.stack((corner, 1.2 * corner, (0, 0, 0))) - (0, 0, crate.size[2] / 2))
    np.testing.assert_allclose(
        box.signed_distance(points, 1.0), world.signed_distance(points, 1.0), atol=1e-5
    )
    assert box.sensed().occupancy.min() == 1.0


def test_seats_and_openings_are_given_or_missed_in_a_sentence():
    rng = np.random.default_rng(5)
    chair, wall = make("chair", rng), make("hole_wall", rng)
    assert chair.require_seat() is chair.seat and wall.require_opening() is wall.opening
    with pytest.raises(GeometryError, match="Nobody sits on a hole_wall; choose"):
        wall.require_seat()
    with pytest.raises(GeometryError, match="Nobody walks through a chair; choose"):
        chair.require_opening()
