"""The environment cylinder and the interaction cuboid."""

from __future__ import annotations

import numpy as np
import pytest
from mirrors import ENVIRONMENT_MIRROR, INTERACTION_MIRROR

from nsm_core.errors import GeometryError
from nsm_core.world.geometry.distance import Cuboids, Union
from nsm_core.world.scene.furniture import cuboids, make
from nsm_core.world.sensors import environment
from nsm_core.world.sensors.environment import (
    ENVIRONMENT_POINTS,
    SPHERE_RADIUS,
    environment_points_world,
    environment_sensor,
    environment_sensor_many,
)
from nsm_core.world.sensors.interaction import UNIT_CELLS, interaction_sensor


def room(seed, kinds=("chair", "sofa", "table", "wall", "shelf", "stool", "desk")):
    rng = np.random.default_rng(seed)
    return [(make(kind, rng), rng.uniform(-2.5, 2.5, 2), rng.uniform(-4, 4)) for kind in kinds]


class Ball:
    """A query that is no cuboid: one ball."""

    def __init__(self, centre, radius):
        self.centre, self.radius = np.asarray(centre), radius

    def signed_distance(self, points, max_distance):
        return np.minimum(np.linalg.norm(points - self.centre, axis=1) - self.radius, max_distance).astype(
            np.float32
        )


def test_the_cylinder_has_the_papers_1408_spheres():
    assert ENVIRONMENT_POINTS.shape == (1408, 3)
    radius = np.linalg.norm(ENVIRONMENT_POINTS[:, :2], axis=1)
    assert radius.max() == pytest.approx(2.0, abs=1e-6) and radius.min() == pytest.approx(2 / 7, abs=1e-6)
    rings, counts = np.unique(np.round(radius[:176] * 7 / 2).astype(int), return_counts=True)
    np.testing.assert_array_equal(rings, np.arange(1, 8))
    np.testing.assert_array_equal(counts, (6, 13, 19, 25, 31, 38, 44))
    np.testing.assert_allclose(np.unique(ENVIRONMENT_POINTS[:, 2]), np.linspace(0, 2, 8), atol=1e-6)


def test_neighbouring_spheres_leave_no_gap_a_point_could_hide_in():
    points = np.random.default_rng(0).uniform(-1.3, 1.3, (500, 3)) + (0, 0, 1.0)
    points = points[(points[:, 2] > 0) & (points[:, 2] < 2) & (np.linalg.norm(points[:, :2], axis=1) > 0.2)]
    gaps = [np.linalg.norm(ENVIRONMENT_POINTS - p, axis=1).min() for p in points]
    assert np.mean(np.array(gaps) < SPHERE_RADIUS) > 0.9


def test_values_follow_the_papers_formula():
    box = Cuboids([((0, 0), 0.0, [(-0.5, -1.5, 0)], [(0.5, -1.0, 1)])])
    values = environment_sensor(box, (0, 0), 0.0)
    inside = ((ENVIRONMENT_POINTS >= (-0.5, -1.5, -1e-6)) & (ENVIRONMENT_POINTS <= (0.5, -1.0, 1.0))).all(1)
    assert inside.any() and (values[inside] > 1 - 1e-5).all()
    nearest = np.clip(ENVIRONMENT_POINTS, (-0.5, -1.5, 0), (0.5, -1.0, 1))
    d = np.linalg.norm(ENVIRONMENT_POINTS - nearest, axis=1)
    np.testing.assert_allclose(values, np.where(d < SPHERE_RADIUS, 1 - d / SPHERE_RADIUS, 0), atol=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_many_frames_read_as_one_by_one(seed, monkeypatch):
    monkeypatch.setattr(environment, "_FRAMES_AT_ONCE", 16)
    rng = np.random.default_rng(seed)
    query = cuboids(room(seed))
    positions, headings = rng.uniform(-4, 4, (50, 2)), rng.uniform(-7, 7, 50)
    many = environment_sensor_many(query, positions, headings)
    one = np.array([environment_sensor(query, p, h) for p, h in zip(positions, headings, strict=True)])
    assert many.shape == (50, 1408) and many.dtype == np.float32 and many.max() <= 1 and many.min() >= 0
    assert (many > 0).mean() > 0.02
    np.testing.assert_allclose(many, one, atol=2e-5)


def test_tilted_boxes_and_other_queries_join_the_fast_path():
    tilt = np.array((0.9, 0.3, 0.1, 0.3))
    mixed = Cuboids(
        [
            ((1, 0, 0.5), tilt, [(-0.4, -0.2, -0.3)], [(0.4, 0.2, 0.3)]),
            ((-1, 0, 0), 0.3, [(-0.3, -0.3, 0)], [(0.3, 0.3, 1)]),
        ]
    )
    query = Union([mixed, Ball((0, 1.2, 0.5), 0.4)])
    rng = np.random.default_rng(1)
    positions, headings = rng.uniform(-1, 1, (12, 2)), rng.uniform(-3, 3, 12)
    one = np.array([environment_sensor(query, p, h) for p, h in zip(positions, headings, strict=True)])
    np.testing.assert_allclose(environment_sensor_many(query, positions, headings), one, atol=2e-5)
    assert len(mixed.groups) == 2


def test_many_frames_can_fill_half_precision_memory():
    query, out = cuboids(room(0)), np.zeros((7, 1408), np.float16)
    positions, headings = np.random.default_rng(0).uniform(-1, 1, (7, 2)), np.zeros(7)
    assert environment_sensor_many(query, positions, headings, out=out) is out
    np.testing.assert_allclose(out, environment_sensor_many(query, positions, headings), atol=1e-3)


def test_the_sensor_turns_and_moves_with_the_root():
    placed = room(3)
    turn, shift = 1.1, np.array((5.0, -2.0))
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array(((c, -s), (s, c)))
    moved = [(f, matrix @ p + shift, h + turn) for f, p, h in placed]
    before = environment_sensor(cuboids(placed), (0.3, 0.2), 0.4)
    after = environment_sensor(cuboids(moved), matrix @ (0.3, 0.2) + shift, 0.4 + turn)
    np.testing.assert_allclose(before, after, atol=1e-4)
    np.testing.assert_allclose(
        environment_points_world((1, 2), 0.0), ENVIRONMENT_POINTS + np.float32((1, 2, 0)), atol=1e-6
    )


def test_mirroring_the_world_permutes_the_reading():
    boxes = ([(0.3, -1.2, 0), (-1, 0.2, 0.3)], [(0.9, -0.4, 0.8), (-0.8, 1.3, 1.2)])
    mirrored = ([(-0.9, -1.2, 0), (0.8, 0.2, 0.3)], [(-0.3, -0.4, 0.8), (1, 1.3, 1.2)])
    one = environment_sensor(Cuboids([((0.2, 0.1), 0.0, *boxes)]), (0, 0), 0.5)
    two = environment_sensor(Cuboids([((-0.2, 0.1), 0.0, *mirrored)]), (0, 0), -0.5)
    assert np.abs(one - two).max() > 0.1
    np.testing.assert_allclose(one[ENVIRONMENT_MIRROR], two, atol=1e-5)
    left, right = (Cuboids([((1, 0), 0.0, *b)]) for b in (boxes, mirrored))
    a = interaction_sensor(left, (1, 0, 0.6), (2.2, 2.6, 1.2), 0.0).occupancy
    b = interaction_sensor(right, (1, 0, 0.6), (2.2, 2.6, 1.2), 0.0).occupancy
    np.testing.assert_allclose(a[INTERACTION_MIRROR], b, atol=1e-5)


def test_interaction_cells_tile_the_objects_box():
    assert UNIT_CELLS.shape == (512, 3)
    chair = make("chair", np.random.default_rng(2))
    position, heading = np.array((2.0, -1.0, 0.0)), 0.8
    centre = position + (0, 0, chair.size[2] / 2)
    volume = interaction_sensor(cuboids([(chair, position, heading)]), centre, chair.size, heading)
    cells = volume.cells_world()
    x, y, z = (cells - centre).T
    c, s = np.cos(heading), np.sin(heading)
    back = np.stack((c * x + s * y, c * y - s * x, z), axis=1)
    np.testing.assert_allclose(back / chair.size, UNIT_CELLS, atol=1e-5)
    local = back + (0, 0, chair.size[2] / 2)
    inside = np.array([((p >= chair.mins) & (p <= chair.maxs)).all(1).any() for p in local])
    d = np.array([np.linalg.norm(p - np.clip(p, chair.mins, chair.maxs), axis=1).min() for p in local])
    diagonal = np.linalg.norm(chair.size / 8)
    np.testing.assert_allclose(
        volume.occupancy, np.where(inside, 1, np.clip(1 - d / diagonal, 0, 1)), atol=1e-4
    )
    assert volume.occupancy.dtype == np.float32


def test_a_flat_object_still_has_cells_with_volume():
    volume = interaction_sensor(Cuboids(), (0, 0, 0), (1, 1, 0), 0.0)
    assert volume.size[2] > 0 and volume.occupancy.max() == 0


@pytest.mark.parametrize(
    "centre, size, heading",
    [((0, 0, np.nan), (1, 1, 1), 0), ((0, 0, 0), (1, -1, 1), 0), ((0, 0, 0), (1, 1, 1), np.inf)],
)
def test_unusable_boxes_are_refused(centre, size, heading):
    with pytest.raises(GeometryError, match="bounding box"):
        interaction_sensor(Cuboids(), centre, size, heading)
