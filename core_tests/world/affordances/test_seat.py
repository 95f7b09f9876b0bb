"""Finding seats on meshes: generated furniture, turned, damaged and odd ones."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.errors import GeometryError
from nsm_core.rotations import rotate_planar, wrap_angle
from nsm_core.world.affordances.seat import find_seat
from nsm_core.world.geometry.triangles import cut_triangles
from nsm_core.world.scene.furniture import SEAT_KINDS, box_mesh, make
from nsm_core.world.scene.furniture.piece import hip_setback


@pytest.mark.parametrize("kind", SEAT_KINDS)
def test_generated_seats_are_found_where_they_are(kind):
    rng = np.random.default_rng(11)
    for _ in range(15):
        f = make(kind, rng)
        if not f.seat.back and f.size[1] > 1.2 * f.size[0]:
            continue  # a narrow stool is rightly entered from its long side
        seat = find_seat(f.vertices, f.triangles)
        assert seat.height == pytest.approx(f.seat.height, abs=0.01)
        assert abs(seat.heading) < 0.05
        np.testing.assert_allclose(seat.point, f.seat.point, atol=0.04)
        assert (seat.back, seat.arms) == (f.seat.back, f.seat.arms)
        assert seat.width == pytest.approx(f.seat.width, abs=0.06) or not f.seat.arms
        assert seat.depth == pytest.approx(f.seat.depth, abs=0.06)


@pytest.mark.parametrize("degrees", [90, 180, -90, 37, -140])
def test_the_front_turns_with_the_mesh(degrees):
    rng = np.random.default_rng(3)
    for kind in ("chair", "armchair", "sofa"):
        f = make(kind, rng)
        angle = np.deg2rad(degrees)
        shift = np.array((4.0, -3.0, 0.0))
        seat = find_seat(rotate_planar(f.vertices.astype(float), angle) + shift, f.triangles)
        assert abs(wrap_angle(seat.heading - angle)) < np.deg2rad(3)
        np.testing.assert_allclose(
            seat.point, rotate_planar(f.seat.point.astype(float), angle) + shift, atol=0.05
        )


def test_a_long_bench_without_back_is_entered_from_a_long_side():
    for size in ((1.4, 0.4), (0.4, 1.4)):
        v, t = box_mesh([(-size[0] / 2, -size[1] / 2, 0)], [(size[0] / 2, size[1] / 2, 0.45)])
        seat = find_seat(v, t)
        across = abs(np.sin(seat.heading)) if size[0] > size[1] else abs(np.cos(seat.heading))
        assert across < 0.05
        assert not seat.back and not seat.arms


def test_a_square_stool_faces_minus_y():
    v, t = box_mesh([(-0.2, -0.2, 0)], [(0.2, 0.2, 0.5)])
    assert find_seat(v, t).heading == 0


def test_hips_never_go_deeper_than_a_person_sits():
    v, t = box_mesh([(-0.9, -0.6, 0), (-0.9, 0.5, 0.4)], [(0.9, 0.5, 0.4), (0.9, 0.7, 0.9)])
    seat = find_seat(v, t)
    assert seat.point[1] == pytest.approx(-0.6 + 0.28, abs=0.03) and abs(seat.point[0]) < 0.03
    assert [hip_setback(d) for d in (0.3, 0.36, 0.4, 0.7)] == pytest.approx([0.15, 0.21, 0.25, 0.28])


def test_slats_and_a_curved_seat_are_one_seat():
    slats = [((-0.6, y, 0.42), (0.6, y + 0.06, 0.45)) for y in np.arange(-0.2, 0.2, 0.085)]
    legs = [((x, -0.2, 0), (x + 0.05, 0.2, 0.42)) for x in (-0.6, 0.55)]
    seat = find_seat(*box_mesh(*map(np.array, zip(*slats, *legs, strict=True))))
    assert seat.height == pytest.approx(0.45, abs=0.01) and seat.width > 1.1
    x = np.linspace(-0.22, 0.22, 12)
    gx, gy = np.meshgrid(x, x, indexing="ij")
    vertices = np.stack((gx, gy, 0.44 + 0.6 * (gx**2 + gy**2)), -1).reshape(-1, 3)
    a = (np.arange(11)[:, None] * 12 + np.arange(11)).reshape(-1)
    faces = np.concatenate((np.stack((a, a + 1, a + 12), 1), np.stack((a + 1, a + 13, a + 12), 1)))
    assert find_seat(vertices, faces).height == pytest.approx(0.45, abs=0.02)


def test_damage_does_not_hide_the_seat():
    rng = np.random.default_rng(8)
    f = make("armchair", rng)
    corners = cut_triangles(f.vertices[f.triangles].astype(float), 0.08)
    kept = corners[rng.random(len(corners)) > 0.1]
    kept[::2] = kept[::2, ::-1]
    loose = np.concatenate((kept.reshape(-1, 3), rng.uniform(-5, 5, (30, 3))))
    seat = find_seat(loose, np.arange(3 * len(kept)).reshape(-1, 3))
    assert seat.height == pytest.approx(f.seat.height, abs=0.01) and abs(seat.heading) < 0.05


def test_an_l_shaped_sofa_is_used_on_its_main_seat():
    boxes = [
        ((-1.2, -0.4, 0), (1.2, 0.5, 0.42)),
        ((-1.2, 0.3, 0.42), (1.2, 0.5, 0.85)),
        ((-1.2, -1.2, 0), (-0.4, -0.4, 0.42)),
        ((1.0, -0.4, 0.42), (1.2, 0.3, 0.6)),
        ((-1.2, -0.4, 0.42), (-1.0, 0.3, 0.6)),
    ]
    seat = find_seat(*box_mesh(*map(np.array, zip(*boxes, strict=True))))
    assert abs(seat.heading) < 0.05 and 0 < seat.point[0] < 0.7 and seat.back


@pytest.mark.parametrize("size", [(0.1, 0.1, 0.45), (0.5, 0.5, 0.1), (0.5, 0.5, 2.0)])
def test_what_cannot_be_sat_on_says_so(size):
    with pytest.raises(GeometryError, match="can be sat on.*goal empty"):
        find_seat(*box_mesh([(-size[0] / 2, -size[1] / 2, 0)], [(size[0] / 2, size[1] / 2, size[2])]))


def test_empty_and_broken_meshes_are_refused():
    with pytest.raises(GeometryError, match="no faces"):
        find_seat(np.zeros((0, 3)), np.zeros((0, 3), int))
    with pytest.raises(GeometryError, match="not numbers"):
        find_seat(np.full((3, 3), np.nan), [(0, 1, 2)])
