"""Dense meshes are thinned, faces of all kinds are read, numbers that are none are told."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from colliders_now import gather_colliders
from crates import crate

from nsm_blender.world.evaluated import MeshData
from nsm_core.errors import GeometryError

pytestmark = pytest.mark.usefixtures("nothing_read_before")


def _sphere(segments: int, rings: int, radius: float, centre: tuple[float, float, float]) -> None:
    """A sphere of quads in the scene; Blender's own operator takes twenty seconds for one as dense."""
    across = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    down = np.linspace(0, np.pi, rings + 1)[1:-1, None]
    sides = np.stack(
        (np.sin(down) * np.cos(across), np.sin(down) * np.sin(across), np.cos(down) + 0 * across), -1
    )
    points = np.concatenate((sides.reshape(-1, 3), ((0, 0, 1), (0, 0, -1)))) * radius + centre
    at = np.arange(len(down) * segments).reshape(len(down), segments)
    beside = np.roll(at, -1, axis=1)
    quads = np.stack((at[:-1], at[1:], beside[1:], beside[:-1]), -1).reshape(-1, 4)
    top, bottom = np.full(segments, at.size), np.full(segments, at.size + 1)
    caps = [np.stack((top, at[0], beside[0]), -1), np.stack((bottom, beside[-1], at[-1]), -1)]
    mesh = bpy.data.meshes.new("Sphere")
    mesh.from_pydata(points.tolist(), [], [*quads.tolist(), *np.concatenate(caps).tolist()])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Sphere", mesh))


class TestDense:
    def test_a_dense_mesh_is_thinned_within_millimetres(self):
        _sphere(segments=400, rings=300, radius=0.3, centre=(0, 0, 0.5))
        query = gather_colliders(bpy.context.scene)
        assert len(query.solids[0].triangles) < 200_000
        points = (
            np.random.default_rng(1).uniform((-0.6, -0.6, 0), (0.6, 0.6, 1), (2000, 3)).astype(np.float32)
        )
        truth = np.clip(np.linalg.norm(points - (0, 0, 0.5), axis=1) - 0.3, -0.2, 0.2)
        off = np.abs(query.signed_distance(points, 0.2) - truth)
        # Slivers that thinning folds over may take a point near them for outside; they are few.
        assert (off < 0.003).mean() > 0.999 and (
            np.abs(off[off >= 0.003] - 2 * np.abs(truth[off >= 0.003])) < 0.003
        ).all()

    def test_faces_of_all_kinds_cover_what_blender_draws(self):
        """Triangles, quads, flat and concave larger faces of a mesh that is too dense to ask Blender for its
        triangles.
        """
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=90, y_subdivisions=90, size=2, location=(0, 0, 1))
        grid = bpy.context.object.data
        vertices = [v.co.copy() for v in grid.vertices]
        faces = [tuple(p.vertices) for p in grid.polygons]
        faces = [t for i, f in enumerate(faces) for t in ((f[:3], (f[0], *f[2:])) if i % 3 == 0 else (f,))]
        start = len(vertices)
        outline = [(3, 0), (5, 0), (5, 1), (4, 1), (4, 2), (3, 2)]  # an L, and a star that bends twice
        star = [
            (6 + (0.5 + 0.5 * (i % 2)) * np.cos(i * np.pi / 5), (0.5 + 0.5 * (i % 2)) * np.sin(i * np.pi / 5))
            for i in range(10)
        ]
        vertices += [(x, y, 0.3) for x, y in outline + star]
        faces += [tuple(range(start, start + 6)), tuple(range(start + 6, start + 16))]
        mesh = bpy.data.meshes.new("Mixed")
        mesh.from_pydata(vertices, [], faces)
        data = MeshData(mesh)
        assert data._made is None
        ours, triangles = data.faces

        def area(corners):
            return (
                np.linalg.norm(
                    np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
                ).sum()
                / 2
            )

        mesh.calc_loop_triangles()
        theirs = np.array([t.vertices[:] for t in mesh.loop_triangles])
        places_ = np.array([v.co for v in mesh.vertices])
        assert len(triangles) == len(theirs)
        assert area(ours[triangles]) == pytest.approx(area(places_[theirs]), rel=1e-6)
        normal = np.cross(
            ours[triangles][:, 1] - ours[triangles][:, 0], ours[triangles][:, 2] - ours[triangles][:, 0]
        )
        assert (normal[:, 2] > 0).all()  # none is folded over

    def test_numbers_that_are_none_are_told_with_the_name(self):
        made = crate("Broken")
        made.data.vertices[0].co.x = float("nan")
        made.data.update()
        bpy.context.view_layer.update()
        with pytest.raises(GeometryError, match="Broken has coordinates that are not numbers"):
            gather_colliders(bpy.context.scene)
