"""What stands around the goals of a take, read once: solids, free floor, and what earlier goals have moved by
then.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from copy import copy
from functools import cached_property

import bpy
import numpy as np

from nsm_core.errors import GoalError
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.props import Prop
from nsm_core.world.scene.stairs import Stairs
from nsm_core.world.scene.terrain import Terrain

from .beside import freely
from .bodies import GoalBody
from .colliders import belonging_to, obstacles, query_of, scene_solids, solid_seen
from .evaluated import Snapshot, family_of
from .frame import WorldFrame
from .ground import stairs_of, terrain_of
from .solids import Solid, solids_of

_MARGIN = 2.0  # metres of floor looked at around the places asked about


class _Plan(FloorPlan):
    """A plan that is searched while Blender goes on."""

    def require_way(self, start: Array, goal: Array) -> Array:
        """See ``FloorPlan.require_way``."""
        with freely():
            return super().require_way(start, goal)


class Surroundings:
    """The scene around a take, in its character's core frame, as it is when this is made, or as ``snapshot``
    has it.

    Of fronts of furniture: ``inside`` is what stands in those that goals move, ``opened`` tells of those
    that were opened to get at something in which order, and ``last_needed`` by which goal, as asked for, each
    is needed last.
    ``moving`` are the objects that its goals move; they are no part of ``query``.  ``left`` holds, by the
    object, the props of the goals resolved so far and the poses (4,) in which these goals leave them.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        frame: WorldFrame,
        character: bpy.types.Object | None = None,
        moving: Iterable[bpy.types.Object] = (),
        snapshot: Snapshot | None = None,
    ) -> None:
        self.scene, self.frame, self.character = scene, frame, character
        self.moving = list(dict.fromkeys(moving))
        self.left: dict[bpy.types.Object, tuple[Prop, Array]] = {}
        self.inside: dict[bpy.types.Object, list[bpy.types.Object]] = {}
        self.opened: list[bpy.types.Object] = []
        self.last_needed: dict[bpy.types.Object, object] = {}
        self._plan: FloorPlan | None = None
        self._bodies: dict[tuple[str, bool], GoalBody] = {}
        self._given = snapshot
        self._company: list[bpy.types.Object] = []

    def leave_out(self, company: Iterable[bpy.types.Object], moving: Iterable[bpy.types.Object] = ()) -> None:
        """Take others who act too, and what they move, out of what stands; before anything is read."""
        self._company = [other for other in company if other != self.character]
        self.moving = list(dict.fromkeys((*self.moving, *moving)))

    @cached_property
    def snapshot(self) -> Snapshot:
        """Every mesh that the scene shows."""
        return self._given or Snapshot.now(bpy.context.evaluated_depsgraph_get())

    @property
    def _own(self) -> list[bpy.types.Object]:
        return [*([self.character] if self.character else []), *self._company]

    def reading(self, *goals: bpy.types.Object) -> Callable[[Callable[[float], None]], None]:
        """The work of reading what is solid, and these objects, which needs no Blender data and may be done
        by another thread.

        It is a function of one that hears how far it is, 0..1.
        """
        seen = solid_seen(self.snapshot, self.scene, self._own)
        still = self._but(self.moving)
        objects = self.snapshot.of(o.name_full for goal in goals for o in family_of(goal))

        def read(said: Callable[[float], None]) -> None:
            solids_of(objects, self.frame)
            self.solids = scene_solids(seen, self.frame, said)
            self.standing = [s for s in self.solids if still(s)]
            self.obstacles = obstacles(self.solids)
            self.query = query_of([s for s in self.obstacles if still(s)])
            self.ground = terrain_of(self.standing)

        return read

    @cached_property
    def solids(self) -> list[Solid]:
        """Everything solid but the character, with what is walked over."""
        return scene_solids(solid_seen(self.snapshot, self.scene, self._own), self.frame)

    @cached_property
    def standing(self) -> list[Solid]:
        """Of these all that no goal moves."""
        still = self._but(self.moving)
        return [s for s in self.solids if still(s)]

    @cached_property
    def obstacles(self) -> list[Solid]:
        """Of all that is solid but the character what is not walked over."""
        solids = self.solids
        with freely():
            return obstacles(solids)

    @cached_property
    def query(self) -> DistanceQuery:
        """Everything solid but the character and what its goals move."""
        return self.query_but()

    def query_but(self, *left_out: bpy.types.Object) -> DistanceQuery:
        """Everything solid but the character, what its goals move, and some objects more."""
        still = self._but([*self.moving, *left_out])
        solids = [s for s in self.obstacles if still(s)]
        with freely():
            return query_of(solids)

    def move_too(self, *targets: bpy.types.Object) -> None:
        """Have more objects be moved by the goals: no part of ``query`` and planned floors from now on."""
        self.moving = list(dict.fromkeys((*self.moving, *targets)))
        still = self._but(self.moving)
        self.query, self.standing = self.query_but(), [s for s in self.solids if still(s)]
        self._plan = None

    def _but(self, left_out: Iterable[bpy.types.Object]) -> Callable[[Solid], bool]:
        """Whether a solid is none of ``left_out`` and does not belong to one."""
        names = belonging_to(self.scene, left_out)
        return lambda solid: solid.owner not in names

    def body(self, target: bpy.types.Object, snug: bool = False) -> GoalBody:
        """A goal object's mesh, upright; see ``GoalBody.of``."""
        key = target.name_full, snug
        if key not in self._bodies:
            # It may be newer.
            known = self.snapshot if self.snapshot.of(o.name_full for o in family_of(target)) else None
            self._bodies[key] = GoalBody.of(target, self.frame, snug, known)
        return copy(self._bodies[key])

    @cached_property
    def ground(self) -> Terrain:
        """What is walked over: rugs, thresholds, kerbs."""
        solids = self.standing
        with freely():
            return terrain_of(solids)

    @cached_property
    def stairs(self) -> Stairs:
        """Flights of stairs that are walked up and down."""
        solids = self.standing
        with freely():
            return stairs_of(solids)

    def plan(self, *points: Array) -> FloorPlan:
        """Free floor around places (2,)."""
        low, high = np.min(points, axis=0)[:2], np.max(points, axis=0)[:2]
        plan = self._plan
        if plan is None or (low < plan.bounds[0] + 1).any() or (high > plan.bounds[1] - 1).any():
            query = self.query
            with freely():
                plan = self._plan = _Plan(query, (low - _MARGIN, high + _MARGIN))
        return plan

    def can_walk(self, start: Array, goal: Array) -> bool:
        """Whether a way over the floor leads from ``start`` to ``goal``, (2,)."""
        try:
            self.plan(start, goal).require_way(start, goal)
        except GoalError:
            return False
        return True

    def meshes_but(self, *left_out: bpy.types.Object) -> list[tuple[Array, Array]]:
        """Vertices (V, 3), core frame, and triangles (F, 3) of each solid but ``left_out``, the character and
        what was moved by now.
        """
        still = self._but([*(o for o in self.moving if o in self.left), *left_out])
        return [(s.vertices, s.triangles) for s in self.obstacles if still(s)]
