"""Light things: as large and heavy as one hand takes, closed meshes that agree with their distances."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.errors import GeometryError
from nsm_core.world.geometry.revolved import Revolved
from nsm_core.world.scene.small_things import HEAVIEST, LARGEST, THINGS, make_thing


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = np.moveaxis(vertices[triangles].astype(np.float64), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def test_twenty_kinds_that_one_hand_takes():
    rng = np.random.default_rng(0)
    assert len(THINGS) == 20
    for kind in THINGS:
        for _ in range(8):
            thing = make_thing(kind, rng)
            assert (thing.size <= LARGEST + 1e-6).all() and 0 < thing.mass <= HEAVIEST, kind
            assert thing.low[2] == pytest.approx(0, abs=1e-9)


def test_meshes_face_outwards_and_lie_where_distances_say():
    rng = np.random.default_rng(1)
    for kind in THINGS:
        thing = make_thing(kind, rng, (1.0, 2.0, 0.5, 0.8))
        vertices, triangles = thing.mesh()
        assert volume(vertices, triangles) > 2e-5, kind
        np.testing.assert_allclose(vertices.min(0), thing.low, atol=2e-3)
        np.testing.assert_allclose(vertices.max(0), thing.high, atol=2e-3)
        # A handle's ends are let into the body; nothing else is off the surface.
        world = thing.to_world(vertices).astype(np.float32)
        assert (thing.signed_distance(world, 1.0) < 1e-4).all()
        if thing.handle is None:
            assert np.abs(thing.signed_distance(world, 1.0)).max() < 1e-4
        else:
            low, high = thing.handle
            assert (low >= thing.low - 1e-6).all() and (high <= thing.high + 1e-6).all()


def test_distances_of_a_solid_of_revolution():
    cylinder = Revolved([(0, 0), (0.1, 0), (0.1, 0.3), (0, 0.3)])
    points = np.array(((0, 0, 0.15), (0.15, 0, 0.15), (0, 0.05, 0.32), (0.13, 0, 0.34), (0.07, 0, 0.1)))
    np.testing.assert_allclose(
        cylinder.signed_distance(points, 1.0), (-0.1, 0.05, 0.02, 0.05, -0.03), atol=1e-6
    )
    assert cylinder.signed_distance(points + 5, 0.5).max() == 0.5
    vertices, triangles = cylinder.mesh(96)
    assert volume(vertices, triangles) == pytest.approx(np.pi * 0.01 * 0.3, rel=2e-3)
    for wrong in ([(0, 0), (1, 1)], [(0, 0), (-1, 0), (0, 1)]):
        with pytest.raises(GeometryError):
            Revolved(wrong)


def test_things_repeat_by_seed_and_unknown_kinds_are_refused():
    a, b = (make_thing("bowl", np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(a.outline, b.outline)
    with pytest.raises(GeometryError, match="no thing of the kind 'anvil'"):
        make_thing("anvil", np.random.default_rng(0))
