"""What an object looks good for, before anybody asks for a way to it: so that a goal that is added has its
action.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import bpy
import numpy as np

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.affordances.seat import find_seat
from nsm_core.world.scene.furniture.piece import Seat

from ..world.bodies import main_turn
from ..world.evaluated import Snapshot, family_of, require_finite
from ..world.frame import WorldFrame
from ..world.tops import Level, find_levels

_DENSE = 150_000  # faces' corners from which reading a mesh takes longer than a click may
_LARGEST = 3.5  # metres: larger things are guessed to be no furniture
_FULL = 0.6  # of the box around it, from which on a thing is massive


@dataclass(frozen=True)
class Looks:
    """An object's mesh as its action is guessed from it: ``vertices`` (V, 3) in metres of the character,
    upright, over the character's floor, its sides along X and Y, and ``triangles`` (F, 3).
    """

    target: bpy.types.Object
    vertices: Array
    triangles: Array

    @classmethod
    def of(cls, target: bpy.types.Object, frame: WorldFrame) -> Looks | None:
        """Look at an object as it is shown now; None where it has no faces, or so many that a click would
        have to wait for it.
        """
        seen = Snapshot.of_objects(family_of(target)).seen
        if not seen or sum(s.mesh.corners for s in seen) > _DENSE:
            return None
        points = []
        for each in seen:
            corners = each.mesh.faces[0].astype(np.float64)
            points.append(frame.to_core(corners @ each.matrix[:3, :3].T + each.matrix[:3, 3]))
            require_finite(points[-1], target.name)
        starts = np.cumsum([0] + [len(p) for p in points[:-1]])
        faces = np.concatenate([s.mesh.faces[1] + i for s, i in zip(seen, starts, strict=True)])
        vertices = np.concatenate(points)
        turned = rotate_planar(vertices, np.float64(-main_turn(vertices)))
        low, high = turned[:, :2].min(0), turned[:, :2].max(0)
        turned[:, :2] -= (low + high) / 2
        return cls(target, turned, faces)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest corner (3,)."""
        return self.vertices.min(0), self.vertices.max(0)

    @cached_property
    def size(self) -> Array:
        """Along its longer side, across, and up (3,)."""
        across, along = sorted(np.subtract(*self.bounds[::-1])[:2].tolist())
        return np.array((along, across, self.bounds[1][2] - self.bounds[0][2]))

    @property
    def base(self) -> float:
        """Height at which it begins."""
        return float(self.bounds[0][2])

    @cached_property
    def seat(self) -> Seat | None:
        """The seat on it, if there is one."""
        if self.size[0] > _LARGEST:
            return None
        try:
            return find_seat(self.vertices.astype(np.float32), self.triangles)
        except GeometryError:
            return None

    @cached_property
    def levels(self) -> list[Level]:
        """Its level tops, the largest first."""
        return find_levels(self.vertices, self.triangles, np.zeros(2))

    @cached_property
    def massive(self) -> bool:
        """Whether most of the box around it is solid, as a crate's, and nothing's on legs."""
        a, b, c = (self.vertices[self.triangles[:, k]] - self.vertices.mean(0) for k in range(3))
        volume = abs(float((a * np.cross(b, c)).sum())) / 6
        return volume > _FULL * float(self.size.prod())


def unlikely(looks: Looks) -> float:
    """An action that no object asks for by itself."""
    return 0.0
