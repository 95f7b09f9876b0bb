"""Solids of revolution: how far points are from a pot, a bottle or a bowl, and their meshes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array


class Revolved:
    """What a closed outline makes when it turns about the Z axis.

    ``outline`` (K, 2) radii, 0 at least, and heights, metres, own frame, in order around the solid; its last
    point is joined to its first.  Raises GeometryError on fewer than three points or a negative radius.
    """

    def __init__(self, outline: ArrayLike) -> None:
        self.outline = np.asarray(outline, dtype=np.float64)
        if self.outline.ndim != 2 or self.outline.shape[1] != 2 or len(self.outline) < 3:
            raise GeometryError("A solid of revolution needs an outline of three points at least.")
        if not np.isfinite(self.outline).all() or (self.outline[:, 0] < 0).any():
            raise GeometryError("The outline of a solid of revolution has a negative radius; mirror it.")

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Corners (3,), (3,) of its bounding box, metres."""
        r, (low, high) = self.outline[:, 0].max(), (self.outline[:, 1].min(), self.outline[:, 1].max())
        return np.array((-r, -r, low)), np.array((r, r, high))

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32 in metres of ``points`` (N, 3), own frame: negative inside, never over
        ``max_distance``.
        """
        points = np.asarray(points, dtype=np.float64)
        out = np.full(len(points), max_distance, dtype=np.float32)
        low, high = self.bounds
        near = ((points > low - max_distance) & (points < high + max_distance)).all(1)
        out[near] = np.minimum(self._distance(points[near]), max_distance)
        return out

    def _distance(self, p: Array) -> Array:
        """Signed distances (N,) of points (N, 3), own frame."""
        flat = np.stack((np.hypot(p[:, 0], p[:, 1]), p[:, 2]), -1)[:, None]
        a = self.outline[None]
        b = np.roll(self.outline, -1, axis=0)[None]
        edge, way = b - a, flat - a
        length = np.maximum((edge * edge).sum(-1), 1e-18)
        share = np.clip((way * edge).sum(-1) / length, 0, 1)
        square = ((way - share[..., None] * edge) ** 2).sum(-1)
        # Edges on the axis are inside the solid, not on its surface.
        on_axis = (a[..., 0] < 1e-9) & (b[..., 0] < 1e-9)
        distance = np.sqrt(np.where(on_axis, np.inf, square).min(1))
        # Crossings of a ray outwards.
        over = (a[..., 1] > flat[..., 1]) != (b[..., 1] > flat[..., 1])
        rise = np.where(np.abs(edge[..., 1]) > 1e-18, edge[..., 1], 1.0)
        crossing = a[..., 0] + (flat[..., 1] - a[..., 1]) / rise * edge[..., 0]
        inside = (over & (flat[..., 0] < crossing)).sum(1) % 2 == 1
        return np.where(inside, -distance, distance)

    def mesh(self, around: int = 24) -> tuple[Array, Array]:
        """A mesh of it: vertices (K * around, 3) float32 and triangles (F, 3), facing outwards for an outline
        that runs counter-clockwise as seen with radii to the right and heights upwards.
        """
        angle = np.arange(around) * 2 * np.pi / around
        r, z = self.outline[:, :1], self.outline[:, 1:]
        vertices = np.stack((r * np.cos(angle), r * np.sin(angle), z + 0 * angle), -1)
        k, j = np.meshgrid(np.arange(len(self.outline)), np.arange(around), indexing="ij")
        k1, j1 = (k + 1) % len(self.outline), (j + 1) % around
        a, b, c, d = (m * around + n for m, n in ((k, j), (k, j1), (k1, j1), (k1, j)))
        faces = np.stack((np.stack((a, b, c), -1), np.stack((a, c, d), -1))).reshape(-1, 3)
        flat = vertices.reshape(-1, 3)
        corners = flat[faces]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        return flat.astype(np.float32), faces[area > 1e-12]
