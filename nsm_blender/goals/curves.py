"""Curve objects as lines to walk along: evaluated, where they are in the scene, in their own direction."""

from __future__ import annotations

import bpy
import numpy as np

from nsm_core.control.actions.follow import heading_at_end
from nsm_core.control.goals import Goal
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import Array
from nsm_core.world.planning.floor_plan import FloorPlan, path_length, resample_path

from ..world.surroundings import Surroundings
from .finder import Place
from .spec import GoalSpec

SHORTEST = 0.3  # metres of a line that can be walked along
_ROOM = 2.0  # metres of floor looked at around a line
_STEP = 0.02


def follow_goal(spec: GoalSpec, around: Surroundings, before: Place) -> Goal:
    """Build the goal to go along the curve of ``spec``: from its start to its end, as it runs; around, as
    often as is asked for, where it is closed, from the place of it that is nearest to ``before`` and free.

    Its height does not matter, it lies on the floor.  Raises GoalError where it cannot be gone along,
    GeometryError where the object is no single line.
    """
    target = spec.object
    if target is None or target.type != "CURVE":
        name = f" '{target.name}'" if target is not None else ""
        raise GoalError(f"The object{name} of a goal along a curve is none; choose a curve object.")
    points, closed = line_of(target)
    line = around.frame.to_core(points)[:, :2]
    if not np.isfinite(line).all() or path_length(line) < SHORTEST:
        raise GeometryError(
            f"The curve {target.name} is shorter than {SHORTEST:g} m on the floor; draw a longer one."
        )
    if spec.rounds < 1:
        raise GoalError(f"The goal along {target.name} asks for {spec.rounds} rounds; ask for one or more.")
    if closed:
        line = _rounds(line, spec.rounds, np.asarray(before[0])[:2], around)
    line = resample_path(line, _STEP)
    place = np.append(line[-1], 0.0)
    return Goal(spec.action, spec.label, place, heading_at_end(line), spec.hold, way=line, speed=spec.speed)


def line_of(curve: bpy.types.Object) -> tuple[Array, bool]:
    """The line of a curve object as the scene shows it, without its thickness: points (N, 3), world, and
    whether it is closed (the first point then also is the last).

    Raises GeometryError where it is none, or several.
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    data = curve.data
    bare = not (data.bevel_depth or data.extrude or data.bevel_object)
    if bare:
        evaluated = curve.evaluated_get(depsgraph)
        vertices, edges = _arrays(evaluated)
    else:
        copied = curve.to_curve(depsgraph, apply_modifiers=True).copy()
        copied.bevel_depth = copied.extrude = 0.0
        copied.bevel_object = None
        holder = bpy.data.objects.new(copied.name, copied)
        try:
            vertices, edges = _arrays(holder)
        finally:
            curve.to_curve_clear()
            bpy.data.objects.remove(holder)
            bpy.data.curves.remove(copied)
    lines = [line for line in _lines(vertices, edges) if len(line) > 1]
    if len(lines) != 1:
        told = "holds no line" if not lines else f"holds {len(lines)} lines"
        raise GeometryError(
            f"The curve {curve.name} {told}; one walks along one: separate them in Edit Mode (P)."
            if lines
            else f"The curve {curve.name} {told}; give it two points or more."
        )
    world = np.array(curve.evaluated_get(depsgraph).matrix_world, dtype=np.float64)
    places = vertices[lines[0]] @ world[:3, :3].T + world[:3, 3]
    return places, lines[0][0] == lines[0][-1]


def _arrays(holder: bpy.types.Object) -> tuple[Array, Array]:
    """Vertices (N, 3), object's frame, and edges (M, 2) of an object's mesh."""
    mesh = holder.to_mesh()
    vertices, edges = np.zeros(3 * len(mesh.vertices), np.float32), np.zeros(2 * len(mesh.edges), np.int32)
    mesh.vertices.foreach_get("co", vertices)
    mesh.edges.foreach_get("vertices", edges)
    holder.to_mesh_clear()
    return vertices.reshape(-1, 3).astype(np.float64), edges.reshape(-1, 2)


def _lines(vertices: Array, edges: Array) -> list[list[int]]:
    """The numbers of the vertices of each line in its order; of a closed one, the first again at the end."""
    lines: list[list[int]] = []
    for a, b in edges.tolist():
        if lines and lines[-1][-1] == a:
            lines[-1].append(b)
        else:
            lines.append([a, b])
    return lines


def _rounds(line: Array, count: int, here: Array, around: Surroundings) -> Array:
    """A closed line (N, 2), ``count`` times around from its free place nearest to ``here`` (2,)."""
    ring = resample_path(line, _STEP)[:-1]
    plan = FloorPlan(around.query, (ring.min(0) - _ROOM, ring.max(0) + _ROOM))
    away = np.linalg.norm(ring - here, axis=1) + 1e3 * (plan.clearance(ring) < plan.radius)
    ring = np.roll(ring, -int(np.argmin(away)), axis=0)
    return np.concatenate((*[ring] * count, ring[:1]))


__all__ = ["follow_goal", "line_of"]
