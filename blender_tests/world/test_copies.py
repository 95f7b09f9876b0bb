"""Copies of an object share what is read of it, and litter is no obstacle."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from colliders_now import gather_colliders
from crates import names
from mathutils import Matrix
from scenes import box, empty

from nsm_blender.world.solids import READINGS
from nsm_core.world.geometry.distance import Cuboids

pytestmark = pytest.mark.usefixtures("nothing_read_before")


def scatter(source, places, parent=None):
    """Copies of an object at places (N, 4, 4), as a collection instance each."""
    collection = bpy.data.collections.new(source.name)
    for other in source.users_collection:
        other.objects.unlink(source)
    collection.objects.link(source)
    for i, place in enumerate(places):
        made = empty(f"{source.name} {i}", (0, 0, 0))
        made.instance_type, made.instance_collection = "COLLECTION", collection
        made.matrix_world = Matrix(place.tolist())
    bpy.context.view_layer.update()


def places(count, seed=0, spread=6.0, sizes=(0.5, 1.5), z=0.0):
    """Places (N, 4, 4) that lie apart: turned, tilted and scaled as chance has it."""
    rng, rows = np.random.default_rng(seed), int(np.ceil(np.sqrt(count)))
    out = []
    for i in range(count):
        turn = Matrix.Rotation(rng.uniform(-3, 3), 4, "Z") @ Matrix.Rotation(rng.uniform(-0.2, 0.2), 4, "X")
        at = Matrix.Translation((*(spread * (2 * np.array(divmod(i, rows)) / rows - 1)), z))
        out.append(np.array(at @ turn @ Matrix.Scale(rng.uniform(*sizes), 4)))
    return out


class TestCopies:
    def test_copies_share_a_reading_and_each_stands_where_it_is(self):
        stone = box("Stone", (-0.2, -0.15, 0), (0.2, 0.15, 0.4))
        at = places(60, spread=5.0)
        scatter(stone, at)
        query = gather_colliders(bpy.context.scene)
        assert len(query.solids) == 60 and len(READINGS) <= 8  # sizes between 0.5 and 1.5 in steps of 1.19
        exact = []
        for place in at:
            size = np.linalg.norm(place[:3, 0])
            q = np.array(Matrix((place[:3, :3] / size).tolist()).to_quaternion())
            exact.append(
                Cuboids(
                    [
                        (
                            place[:3, 3],
                            q,
                            [np.array((-0.2, -0.15, 0)) * size],
                            [np.array((0.2, 0.15, 0.4)) * size],
                        )
                    ]
                )
            )
        points = np.random.default_rng(5).uniform((-6, -6, 0), (6, 6, 0.7), (1500, 3)).astype(np.float32)
        truth = np.min([e.signed_distance(points, 0.3) for e in exact], axis=0)
        ours = query.signed_distance(points, 0.3)
        np.testing.assert_allclose(np.maximum(ours, 0), np.maximum(truth, 0), atol=1e-4)
        assert ((ours < 0) == (truth < 0))[np.abs(truth) > 1e-3].all() and (truth < -0.01).sum() > 20

    def test_large_copies_share_their_tree(self):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=80, radius=0.4)
        ball = bpy.context.object
        scatter(ball, places(8, spread=3, z=0.4))
        query = gather_colliders(bpy.context.scene)
        assert len(query.solids) == 8 and not query._chunks
        centres = np.array([s.origin for s in query.solids])
        sizes = np.array([s.size * (s.reading.high - s.reading.low).mean() / 2 for s in query.solids])
        points = np.random.default_rng(5).uniform((-3, -3, 0), (3, 3, 1), (800, 3)).astype(np.float32)
        truth = np.clip((np.linalg.norm(points[:, None] - centres, axis=2) - sizes).min(1), -0.3, 0.3)
        np.testing.assert_allclose(query.signed_distance(points, 0.3), truth, atol=0.01)

    def test_grass_and_pebbles_are_no_obstacles_unless_said(self):
        things = {
            "Grass": (0.01, 0.01, 0.3),
            "Pebble": (0.06, 0.06, 0.05),
            "Baluster": (0.02, 0.02, 0.9),
            "Rock": (0.3, 0.3, 0.3),
        }
        for name, high in things.items():
            scatter(box(name, (0, 0, 0), high), places(2, spread=1, sizes=(1, 1)))
        box("Peg", (3, 3, 0), (3.01, 3.01, 0.1))  # one that the animator has put there by hand is no litter
        assert {n.split()[0] for n in names()} == {"Baluster", "Rock", "Peg"}
        bpy.data.objects["Grass 0"]["nsm_collider"] = True
        assert "Grass 0" in names() and "Grass 1" not in names()
