"""Next to sharp edges, corners and slivers a point outside is outside: else a body beside a leg or a wedge
counts as deep in it.
"""

from __future__ import annotations

import numpy as np
import pytest
from mathutils import Euler, Vector
from mathutils.bvhtree import BVHTree

from nsm_blender.world.bvh_query import BVHQuery

TURN = np.array(Euler((0.5, 0.7, 0.4)).to_matrix())
COUNT = 1500


def wedge():
    points = np.array([(0, 0, 0), (0, 0.6, 0), (1, 0, 0), (1, 0.6, 0), (1, 0, 0.45), (1, 0.6, 0.45)])
    return points, [(0, 1, 3), (0, 3, 2), (0, 4, 5), (0, 5, 1), (2, 3, 5), (2, 5, 4), (0, 2, 4), (1, 5, 3)]


def tapered_leg(corners=12):
    turn = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    points = np.concatenate(
        (np.stack((0.15 * np.cos(turn), 0.15 * np.sin(turn), 0 * turn), -1), [(0, 0, 1.0), (0, 0, 0)])
    )
    ring = [(i, (i + 1) % corners) for i in range(corners)]
    return points, [(a, b, corners) for a, b in ring] + [(b, a, corners + 1) for a, b in ring]


def star():
    turn = np.linspace(0, 2 * np.pi, 10, endpoint=False)
    radius = np.where(np.arange(10) % 2, 0.15, 0.5)
    ring = np.stack((radius * np.cos(turn), radius * np.sin(turn), 0 * turn), -1)
    points = np.concatenate((ring, ring + (0, 0, 0.2), [(0, 0, 0), (0, 0, 0.2)]))
    faces = [
        ((i, j, j + 10), (i, j + 10, i + 10), (j, i, 20), (i + 10, j + 10, 21))
        for i in range(10)
        for j in [(i + 1) % 10]
    ]
    return points, [face for four in faces for face in four]


def dense_ring(count=240, around=130):
    """A bumpy ring of 62,400 triangles, which are thinned into slivers and folds."""
    rng = np.random.default_rng(3)
    u, v = np.meshgrid(
        *(np.linspace(0, 2 * np.pi, n, endpoint=False) for n in (count, around)), indexing="ij"
    )
    tube = 0.06 + 0.006 * np.sin(23 * u) * np.sin(9 * v) + 0.0008 * rng.normal(size=u.shape)
    points = np.stack(
        ((0.15 + tube * np.cos(v)) * np.cos(u), (0.15 + tube * np.cos(v)) * np.sin(u), tube * np.sin(v)), -1
    )
    i, j = np.meshgrid(np.arange(count), np.arange(around), indexing="ij")
    a, b, c, d = ((i + x) % count * around + (j + y) % around for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return points.reshape(-1, 3), np.concatenate(
        [np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))]
    )


def is_inside(tree, point, rng):
    """By the number of faces that most rays cross."""
    votes = 0
    for direction in rng.normal(size=(5, 3)):
        way, place, crossed = Vector(direction).normalized(), Vector(point), 0
        while (hit := tree.ray_cast(place, way)[0]) is not None:
            crossed, place = crossed + 1, hit + way * 1e-6
        votes += crossed % 2
    return votes >= 3


@pytest.mark.parametrize("shape", [wedge, tapered_leg, star, dense_ring], ids=lambda f: f.__name__)
@pytest.mark.parametrize("inside_out", [False, True])
def test_no_point_takes_the_wrong_side(shape, inside_out):
    rng = np.random.default_rng(1)
    points, faces = shape()
    points, faces = points @ TURN.T, np.asarray(faces)
    edges, share = faces[rng.integers(0, len(faces), COUNT)], rng.random((COUNT, 1))
    near = (
        points[edges[:, 0]] * (1 - share) + points[edges[:, 1]] * share + rng.normal(size=(COUNT, 3)) * 0.015
    )
    tree = BVHTree.FromPolygons(points.tolist(), faces.tolist(), all_triangles=True)
    # Thinning moves faces by up to half a centimetre; nearer points may change sides.
    clear = np.array([tree.find_nearest(p)[3] for p in near.tolist()]) > (
        0.006 if shape is dense_ring else 1e-4
    )
    asked = near[clear]
    found = BVHQuery.from_triangles(points, faces[:, ::-1] if inside_out else faces).signed_distance(
        asked.astype(np.float32), 0.2
    )
    truth = np.array([is_inside(tree, p, rng) for p in asked])
    assert 0.02 < truth.mean() < 0.6
    assert ((found < 0) == truth).all(), (
        np.flatnonzero((found < 0) != truth),
        np.abs(found[(found < 0) != truth]),
    )


def test_a_fold_without_thickness_has_no_inside():
    points = np.array(
        [
            (0, 0, 0),
            (0.5, 0, 0),
            (0.5, 0.5, 0),
            (0, 0.5, 0),
            (0.2, 0.2, 0.5),
            (0.2, 0.2, 1.0),
            (0.2, 0.3, 1.0),
        ]
    )
    faces = np.array([(0, 2, 1), (0, 3, 2), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4), (4, 5, 6), (4, 6, 5)])
    rng = np.random.default_rng(2)
    near = np.array((0.2, 0.25, 0.85)) + rng.uniform(-1, 1, (200, 3)) * (0.01, 0.01, 0.05)
    assert (BVHQuery.from_triangles(points, faces).signed_distance(near.astype(np.float32), 0.2) >= 0).all()
