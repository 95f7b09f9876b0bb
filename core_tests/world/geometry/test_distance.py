"""Distances to cuboids against brute force."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from nsm_core.errors import GeometryError
from nsm_core.world.geometry.distance import Cuboids, Union

REACH = 0.4


def random_objects(rng, count, tilted):
    objects = []
    for _ in range(count):
        mins = rng.uniform(-0.8, 0.4, (rng.integers(1, 9), 3))
        maxs = mins + rng.uniform(0.02, 0.8, mins.shape)
        rotation = (
            Rotation.random(random_state=rng) if tilted else Rotation.from_rotvec((0, 0, rng.uniform(-4, 4)))
        )
        xyzw = rotation.as_quat()
        objects.append((rng.uniform(-2, 2, 3), rotation, xyzw[[3, 0, 1, 2]], mins, maxs))
    return objects


def brute_distance(objects, point):
    """One point at a time: nearest face point outside, least face depth inside."""
    best = np.inf
    for position, rotation, _, mins, maxs in objects:
        local = rotation.inv().apply(point - position)
        for lo, hi in zip(mins, maxs, strict=True):
            nearest = np.clip(local, lo, hi)
            d = np.linalg.norm(local - nearest)
            best = min(best, d if d > 0 else -min((local - lo).min(), (hi - local).min()))
    return min(best, REACH)


@pytest.mark.parametrize("tilted", [False, True])
def test_signed_distance_equals_brute_force(tilted):
    rng = np.random.default_rng(7)
    objects = random_objects(rng, 6, tilted)
    query = Cuboids([(p, q, lo, hi) for p, _, q, lo, hi in objects])
    points = rng.uniform(-3, 3, (800, 3)).astype(np.float32)
    expected = [brute_distance(objects, p) for p in points]
    got = query.signed_distance(points, REACH)
    assert got.dtype == np.float32
    np.testing.assert_allclose(got, expected, atol=1e-5)
    assert (got < 0).any() and ((got > 0) & (got < REACH)).any() and (got == REACH).any()


def test_a_heading_and_its_quaternion_are_the_same_pose():
    box = ([(-0.3, -0.1, 0)], [(0.3, 0.4, 0.5)])
    points = np.random.default_rng(0).uniform(-1, 2, (500, 3))
    angle = 2.2
    one = Cuboids([((1, 0.5), angle, *box)])
    two = Cuboids([((1, 0.5, 0), (np.cos(angle / 2), 0, 0, np.sin(angle / 2)), *box)])
    assert two.groups[0].heading == pytest.approx(angle)
    np.testing.assert_allclose(one.signed_distance(points, 0.5), two.signed_distance(points, 0.5), atol=1e-6)


def test_heading_zero_faces_minus_y_and_grows_counter_clockwise():
    front = ([(-0.1, -1.1, 0)], [(0.1, -0.9, 1)])  # a post one metre in front
    query = Cuboids([((0, 0), np.pi / 2, *front)])
    assert query.signed_distance(np.array([(1.0, 0, 0.5)]), 0.2)[0] < 0


def test_a_union_takes_the_nearest_of_its_parts():
    a = Cuboids([((0, 0), 0.0, [(0, 0, 0)], [(1, 1, 1)])])
    b = Cuboids([((3, 0), 0.0, [(0, 0, 0)], [(1, 1, 1)])])
    points = np.array([(1.1, 0.5, 0.5), (2.8, 0.5, 0.5), (0.5, 0.5, 0.5), (2, 0.5, 0.5)])
    np.testing.assert_allclose(
        Union([a, Union([b])]).signed_distance(points, 0.5), (0.1, 0.2, -0.5, 0.5), atol=1e-6
    )


def test_groups_that_are_exchanged_are_the_ones_that_are_asked():
    def at(x):
        return Cuboids([((x, 0), 0.0, [(0, 0, 0)], [(1, 1, 1)])])

    query, point = at(0), np.array([(0.5, 0.5, 1.2), (5.5, 0.5, 1.2)], np.float32)
    assert np.allclose(query.signed_distance(point, 1.0), (0.2, 1.0))
    query.groups[0] = at(5).groups[0]
    assert np.allclose(query.signed_distance(point, 1.0), (1.0, 0.2))
    query.groups += at(0).groups
    assert np.allclose(query.signed_distance(point, 1.0), (0.2, 0.2))
    query.groups = []
    assert np.allclose(query.signed_distance(point, 1.0), 1.0)


def test_nothing_is_far_from_everything():
    points = np.zeros((4, 3))
    for query in (Cuboids(), Cuboids([((0, 0), 0.0, np.zeros((0, 3)), np.zeros((0, 3)))]), Union([])):
        np.testing.assert_array_equal(query.signed_distance(points, 0.3), np.float32(0.3))
    assert len(Cuboids([((0, 0), 0.0, [(0, 0, 0)], [(1, 1, 1)])]).signed_distance(np.zeros((0, 3)), 1)) == 0


@pytest.mark.parametrize(
    "bad",
    [
        ((0, np.nan), 0.0, [(0, 0, 0)], [(1, 1, 1)]),
        ((0, 0), np.inf, [(0, 0, 0)], [(1, 1, 1)]),
        ((0, 0), 0.0, [(0, 0, np.nan)], [(1, 1, 1)]),
        ((0, 0), 0.0, [(0, 2, 0)], [(1, 1, 1)]),
        ((0, 0), 0.0, [(0, 0, 0)], [(1, 1, 1), (2, 2, 2)]),
        ((0, 0, 0, 0), 0.0, [(0, 0, 0)], [(1, 1, 1)]),
        ((0, 0), (1, 0, 0), [(0, 0, 0)], [(1, 1, 1)]),
        ((0, 0), (0, 0, 0, 0), [(0, 0, 0)], [(1, 1, 1)]),
    ],
)
def test_bad_colliders_are_refused_with_a_sentence(bad):
    with pytest.raises(GeometryError, match=r"\.$"):
        Cuboids([bad])
