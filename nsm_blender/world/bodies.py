"""A goal object's mesh, upright and at the size that its character sees it in."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np
from mathutils import Vector

from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import Array, direction_to_heading, rotate_planar
from nsm_core.world.affordances.seat import find_seat
from nsm_core.world.scene.furniture.piece import Seat
from nsm_core.world.sensors.interaction import InteractionVolume, interaction_sensor

from .beside import freely
from .bvh_query import BVHQuery
from .evaluated import Snapshot, family_of, join, require_faces
from .frame import WorldFrame
from .solids import Solid, solids_of


def place_of(marker: bpy.types.Object, frame: WorldFrame) -> tuple[Array, float]:
    """Position (3,) and heading of an empty, core frame; it looks along its -Y.  GoalError where that is
    straight up or down.
    """
    matrix = marker.matrix_world
    forward = matrix.to_3x3() @ Vector((0, -1, 0))
    if forward.to_2d().length < 1e-6:
        raise GoalError(
            f"{marker.name} points straight up or down; turn it so that its -Y axis shows where the "
            "character looks."
        )
    return frame.to_core(np.array(matrix.translation)).astype(np.float32), float(
        direction_to_heading(np.array(forward))
    )


@dataclass
class GoalBody:
    """A goal object's evaluated mesh, upright: Z up, origin on the floor at the centre of its footprint.

    ``vertices`` (V, 3) and ``triangles`` (F, 3), turned by ``-yaw`` about Z, in units of the character's
    size.
    """

    name: str
    vertices: Array
    triangles: Array
    origin: Array  # (2,) core frame
    yaw: float
    solids: list[Solid] = field(default_factory=list)  # what it was read from, core frame

    @classmethod
    def of(
        cls, target: bpy.types.Object, frame: WorldFrame, snug: bool = False, snapshot: Snapshot | None = None
    ) -> GoalBody:
        """Read an object's mesh as the scene shows it, or as ``snapshot`` has it; GeometryError when there is
        none.

        The yaw is the object's own; ``snug``, that of the smallest box around it, where this is much smaller.
        """
        snapshot = snapshot or Snapshot.now(bpy.context.evaluated_depsgraph_get())
        seen, yaw = snapshot.of(o.name_full for o in family_of(target)), _yaw(target)
        require_faces(seen, target)
        with freely():
            solids = solids_of(seen, frame)
            points, triangles = join(solids)
            if snug:
                yaw += main_turn(rotate_planar(points, -yaw))
            turned = rotate_planar(points, -yaw)
            low, high = turned.min(0), turned.max(0)
            centre = np.array(((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, 0.0))
            own = (turned - centre).astype(np.float32)
        return cls(target.name, own, triangles, rotate_planar(centre[:2], yaw), yaw, solids)

    def solid_at(self, pose: Array) -> BVHQuery:
        """This object alone as a solid, in a frame that stands upright at ``pose`` (4,): x, y, z and heading,
        core frame.
        """
        pose = np.asarray(pose, dtype=np.float64)
        with freely():
            if sum(len(s.triangles) for s in self.solids) == len(self.triangles):
                return BVHQuery([s.seen_from(pose) for s in self.solids])
            # A part of what was read.
            here = rotate_planar(self.to_core(self.vertices) - pose[:3], np.float64(-pose[3]))
            return BVHQuery.from_triangles(here.astype(np.float32), self.triangles)

    def joined(self, parts: list[Solid]) -> GoalBody:
        """This and other solids, core frame, as one thing that looks the same way."""
        own = [rotate_planar(s.vertices, -self.yaw) for s in parts]
        turned = np.concatenate(
            (rotate_planar(self.to_core(self.vertices).astype(np.float64), -self.yaw), *own)
        )
        starts = np.cumsum([len(self.vertices), *(len(v) for v in own)])
        triangles = np.concatenate(
            (self.triangles, *(s.triangles + start for s, start in zip(parts, starts, strict=False)))
        )
        low, high = turned.min(0), turned.max(0)
        centre = np.array(((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, 0.0))
        place = rotate_planar(centre[:2], self.yaw)
        return GoalBody(
            self.name,
            (turned - centre).astype(np.float32),
            triangles,
            place,
            self.yaw,
            [*self.solids, *parts],
        )

    def to_core(self, points: Array) -> Array:
        """Points (..., 3) of the upright object frame in the core's frame."""
        return (
            rotate_planar(np.asarray(points, dtype=np.float64), self.yaw) + np.append(self.origin, 0.0)
        ).astype(np.float32)

    def to_own(self, points: Array) -> Array:
        """Points (..., 3) of the core's frame in the upright object frame."""
        return rotate_planar(np.asarray(points, dtype=np.float64) - np.append(self.origin, 0.0), -self.yaw)

    def to_core_heading(self, heading: float) -> float:
        """Heading in the object frame as one in the core's frame, radians."""
        return float(heading + self.yaw)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest corner (3,) of the box around it, own frame, float64."""
        return self.vertices.min(0).astype(np.float64), self.vertices.max(0).astype(np.float64)

    def seat_in_core(self) -> tuple[Array, float]:
        """Seat point (3,) and heading, core frame; GeometryError names the object when there is no seat."""
        try:
            with freely():
                seat: Seat = find_seat(self.vertices, self.triangles)
        except GeometryError as error:
            raise GeometryError(f"{self.name}: {error}") from error
        return self.to_core(seat.point), self.to_core_heading(seat.heading)

    def interaction(self, heading: float) -> InteractionVolume:
        """Read the interaction sensor over this object, its box turned to ``heading`` (core frame), as in
        training.
        """
        world = self.to_core(self.vertices)
        along = rotate_planar(world, -heading)
        low, high = along.min(0), along.max(0)
        query = self.solid_at(np.zeros(4))
        with freely():
            return interaction_sensor(query, rotate_planar((low + high) / 2, heading), high - low, heading)


def main_turn(points: Array) -> float:
    """Turn, in -45..45 degrees, of the smallest rectangle around points (N, 2 or 3) seen from above; 0 unless
    that is much smaller.
    """
    flat = points[:: max(1, len(points) // 20000), :2]

    def areas(angles: Array) -> Array:
        # A row an angle: many times faster to go through.
        along = np.stack((np.cos(angles), np.sin(angles)), 1) @ flat.T
        across = np.stack((-np.sin(angles), np.cos(angles)), 1) @ flat.T
        return np.ptp(along, axis=1) * np.ptp(across, axis=1)

    coarse = np.deg2rad(np.arange(-45, 45))
    area = areas(coarse)
    best = int(area.argmin())
    if area[best] > 0.85 * area[45]:
        return 0.0
    fine = coarse[best] + np.deg2rad(np.linspace(-1, 1, 41))
    return float(fine[areas(fine).argmin()])


def _yaw(target: bpy.types.Object) -> float:
    """Heading of an object's -Y; where that points up or down (an object imported with Y up, say) its X
    tells.
    """
    axes = target.matrix_world.to_3x3()
    y, x = axes @ Vector((0, -1, 0)), axes @ Vector((1, 0, 0))
    if y.to_2d().length > 0.5 * y.length:
        return float(direction_to_heading(np.array(y)))
    return float(np.arctan2(x.y, x.x)) if x.to_2d().length > 0.5 * x.length else 0.0
