"""What stands around the goals of a take, read once: solids, free floor, and what earlier goals have moved by then."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import bpy
import numpy as np

from nsm_core.control.planning import FloorPlan
from nsm_core.control.props import Prop
from nsm_core.control.terrain import Terrain
from nsm_core.errors import GoalError
from nsm_core.rotations import Array
from nsm_core.sensors.query import DistanceQuery

from .colliders import collider_shapes, gather_colliders, solid_shapes
from .ground import ground_of
from .scene import WorldFrame

_MARGIN = 2.0  # metres of floor looked at around the places asked about


class Surroundings:
    """The scene around a take, in its character's core frame.

    ``moving`` are the objects that its goals move; they are no part of ``query``.  ``left`` holds, by the object's name, the
    props of the goals resolved so far and the poses (4,) in which these goals leave them.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        frame: WorldFrame,
        character: bpy.types.Object | None = None,
        moving: Iterable[bpy.types.Object] = (),
    ) -> None:
        self.scene, self.frame, self.character = scene, frame, character
        self.moving = list(dict.fromkeys(moving))
        self.left: dict[str, tuple[Prop, Array]] = {}
        self._plan: FloorPlan | None = None

    @property
    def _own(self) -> list[bpy.types.Object]:
        return [self.character] if self.character else []

    @cached_property
    def query(self) -> DistanceQuery:
        """Everything solid but the character and what its goals move."""
        depsgraph = bpy.context.evaluated_depsgraph_get()
        return gather_colliders(self.scene, depsgraph, [*self._own, *self.moving], self.frame)

    @cached_property
    def ground(self) -> Terrain:
        """What is walked over: rugs, thresholds, kerbs."""
        depsgraph = bpy.context.evaluated_depsgraph_get()
        return ground_of(solid_shapes(self.scene, depsgraph, [*self._own, *self.moving], self.frame))

    def plan(self, *points: Array) -> FloorPlan:
        """Free floor around places (2,)."""
        low, high = np.min(points, axis=0)[:2], np.max(points, axis=0)[:2]
        plan = self._plan
        if plan is None or (low < plan.bounds[0] + 1).any() or (high > plan.bounds[1] - 1).any():
            plan = self._plan = FloorPlan(self.query, (low - _MARGIN, high + _MARGIN))
        return plan

    def can_walk(self, start: Array, goal: Array) -> bool:
        """Whether a way over the floor leads from ``start`` to ``goal``, (2,)."""
        try:
            self.plan(start, goal).find(start, goal)
        except GoalError:
            return False
        return True

    def meshes_but(self, *left_out: bpy.types.Object) -> list[tuple[Array, Array]]:
        """Vertices (V, 3), core frame, and triangles (F, 3) of each solid but ``left_out``, the character and what was moved by now."""
        moved = [o for o in self.moving if o.name in self.left]
        shapes = collider_shapes(self.scene, bpy.context.evaluated_depsgraph_get(), [*self._own, *moved, *left_out], self.frame)
        return [(s.vertices, s.triangles) for s in shapes]
