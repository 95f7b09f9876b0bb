"""Voxels and cuboids of meshes against brute force; sides of closed parts; cutting triangles."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.errors import GeometryError
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.geometry.orientation import face_sides
from nsm_core.world.geometry.triangles import cut_triangles
from nsm_core.world.geometry.voxels import VoxelGrid, merge, voxelise
from nsm_core.world.scene.furniture import KINDS, box_mesh, cuboids, make


def soup(seed, count=12):
    """Random triangles of all sizes, unconnected."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-0.4, 0.4, (count, 1, 3)) + rng.uniform(-1, 1, (count, 3, 3)) * rng.uniform(
        0.01, 0.4, (count, 1, 1)
    )
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def clip_to_box(triangle, low, high):
    """What is left of a triangle inside a box, by clipping at one face after the other."""
    polygon = list(triangle)
    for axis in range(3):
        for sign, bound in ((1, low[axis]), (-1, -high[axis])):
            kept = []
            for a, b in zip(polygon, polygon[1:] + polygon[:1], strict=True):
                da, db = sign * a[axis] - bound, sign * b[axis] - bound
                if da >= 0:
                    kept.append(a)
                if da * db < 0:
                    kept.append(a + (b - a) * (da / (da - db)))
            polygon = kept
            if not polygon:
                return polygon
    return polygon


@pytest.mark.parametrize("seed", range(3))
def test_surface_voxels_are_those_that_a_clipped_triangle_meets(seed):
    vertices, triangles = soup(seed)
    grid = voxelise(vertices, triangles, 0.1)
    expected = np.zeros_like(grid.surface)
    for t in vertices[triangles]:
        for index in np.ndindex(*grid.surface.shape):
            low = grid.origin + np.array(index) * grid.cell
            if (t.min(0) > low + grid.cell + 1e-9).any() or (t.max(0) < low - 1e-9).any() or expected[index]:
                continue
            expected[index] = bool(clip_to_box(t, low - 1e-9, low + grid.cell + 1e-9))
    np.testing.assert_array_equal(grid.surface, expected)


@pytest.mark.parametrize("kind", KINDS)
def test_the_grid_keeps_the_bounding_box_and_holds_the_object(kind):
    furniture = make(kind, np.random.default_rng(1))
    grid = voxelise(furniture.vertices, furniture.triangles)
    assert (grid.cell <= 0.04 + 1e-6).all()
    mins, maxs = merge(grid)
    np.testing.assert_allclose(mins.min(0), furniture.mins.min(0), atol=1e-5)
    np.testing.assert_allclose(maxs.max(0), furniture.maxs.max(0), atol=1e-5)
    exact, voxels = cuboids([(furniture, (0, 0), 0.0)]), Cuboids([((0, 0), 0.0, mins, maxs)])
    points = np.random.default_rng(2).uniform(mins.min(0) - 0.3, maxs.max(0) + 0.3, (3000, 3))
    d, v = exact.signed_distance(points, 0.2), voxels.signed_distance(points, 0.2)
    assert (v[d < -1e-5] <= 0).all()
    # Voxels hold the mesh and never leave it by more than their diagonal; closed hollows fill.
    assert (np.maximum(v, 0) <= np.maximum(d, 0) + 1e-4).all()
    hollow = (v < 0) & (d > grid.diagonal)
    assert (np.maximum(d, 0) - np.maximum(v, 0))[~hollow].max() <= grid.diagonal + 1e-4
    assert hollow.mean() < 0.01


@pytest.mark.parametrize("seed", range(4))
def test_merging_covers_exactly_the_solid_without_overlap(seed):
    rng = np.random.default_rng(seed)
    solid = rng.random((9, 7, 8)) < (0.2, 0.5, 0.8, 0.95)[seed]
    grid = VoxelGrid(np.array((1.0, -2, 0.5)), np.array((0.1, 0.2, 0.05)), solid, solid)
    mins, maxs = merge(grid)
    count = np.zeros(solid.shape, int)
    for lo, hi in zip(mins, maxs, strict=True):
        a, b = (np.round((p - grid.origin) / grid.cell).astype(int) for p in (lo, hi))
        count[a[0] : b[0], a[1] : b[1], a[2] : b[2]] += 1
    np.testing.assert_array_equal(count, solid.astype(int))
    assert len(mins) < solid.sum()


def test_no_two_merged_cuboids_make_a_cuboid():
    furniture = make("armchair", np.random.default_rng(0))
    mins, maxs = merge(voxelise(furniture.vertices, furniture.triangles))
    for i in range(len(mins)):
        for j in range(i):
            low, high = np.minimum(mins[i], mins[j]), np.maximum(maxs[i], maxs[j])
            parts = np.prod(maxs[i] - mins[i]) + np.prod(maxs[j] - mins[j])
            assert np.prod(high - low) > parts * (1 + 1e-6)


def test_a_box_is_one_cuboid_and_a_broken_one_still_shows_its_faces():
    vertices, triangles = box_mesh([(0, 0, 0)], [(0.5, 0.4, 0.3)])
    mins, maxs = merge(voxelise(vertices, triangles))
    np.testing.assert_allclose((mins[0], maxs[0]), ((0, 0, 0), (0.5, 0.4, 0.3)), atol=1e-6)
    assert len(mins) == 1
    flipped = triangles.copy()
    flipped[::2] = flipped[::2, ::-1]
    assert voxelise(vertices, flipped).solid.all()
    open_ = voxelise(vertices, triangles[2:])  # a whole side is gone
    assert open_.surface.sum() == open_.solid.sum() < open_.solid.size
    assert open_.solid.any((1, 2)).all()


def test_a_gap_narrower_than_a_voxel_does_not_open_a_solid():
    vertices, triangles = box_mesh([(0, 0, 0)], [(0.4, 0.4, 0.4)])
    corners = cut_triangles(vertices[triangles].astype(float), 0.03)
    corners = np.delete(corners, np.random.default_rng(0).choice(len(corners), 20, replace=False), axis=0)
    grid = voxelise(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    assert grid.solid[2:-2, 2:-2, 2:-2].all()


def test_a_room_is_not_solid_but_a_wardrobe_is():
    for size, solid in (((4, 3, 2.5), False), ((1.2, 0.6, 2.0), True), ((6, 0.3, 2.5), True)):
        grid = voxelise(*box_mesh([(0, 0, 0)], [size]))
        assert grid.solid[tuple(np.array(grid.solid.shape) // 2)] == solid
        assert grid.surface[0].all() and grid.solid[-1].all()


def test_a_sheet_without_thickness_has_voxels():
    grid = voxelise([(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)], [(0, 1, 2), (0, 2, 3)])
    assert grid.solid.shape[2] == 1 and grid.solid.all()


def test_large_meshes_get_larger_cells_not_endless_grids():
    grid = voxelise(*box_mesh([(-60, -60, 0)], [(60, 60, 40)]))
    assert grid.solid.size < 1e7


def test_cut_triangles_keep_area_and_stay_small():
    vertices, triangles = soup(5, 30)
    corners = vertices[triangles]
    pieces = cut_triangles(corners, 0.07)

    def area(t):
        return np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum() / 2

    assert area(pieces) == pytest.approx(area(corners))
    assert np.linalg.norm(pieces - np.roll(pieces, 1, axis=1), axis=-1).max() <= 0.07 + 1e-9


def test_sides_are_known_for_closed_parts_only():
    vertices, triangles = box_mesh([(0, 0, 0), (2, 0, 0), (4, 0, 0)], [(1, 1, 1), (3, 1, 1), (5, 1, 1)])
    triangles = triangles.copy()
    triangles[12:24] = triangles[12:24, ::-1]  # the second box is inside out
    sides = face_sides(vertices, triangles[:-1])  # the third lacks a face
    np.testing.assert_array_equal(sides, [1] * 12 + [-1] * 12 + [0] * 11)
    split = vertices[triangles].reshape(-1, 3)
    np.testing.assert_array_equal(
        face_sides(split, np.arange(len(split)).reshape(-1, 3))[:24], [1] * 12 + [-1] * 12
    )
    triangles[0] = triangles[0, ::-1]
    assert (face_sides(vertices, triangles)[:12] == 0).all()


def test_the_sides_of_a_box_tell_its_inside():
    vertices, triangles = box_mesh([(-1, -1, -1)], [(1, 1, 1)])
    corners = vertices[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((normal * corners.mean(1)).sum(1) > 0).all()


@pytest.mark.parametrize(
    "vertices, triangles, words",
    [
        (np.zeros((0, 3)), np.zeros((0, 3), int), "no faces"),
        (np.zeros((3, 3)), np.zeros((0, 3), int), "no faces"),
        ([(0, 0, 0), (1, 0, 0), (0, 1, np.nan)], [(0, 1, 2)], "not numbers"),
        ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 7)], "without corners"),
    ],
)
def test_unusable_meshes_are_refused(vertices, triangles, words):
    with pytest.raises(GeometryError, match=words):
        voxelise(vertices, triangles)
