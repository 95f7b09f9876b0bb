"""Curve objects are gone along as the scene shows them, in their direction."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from nsm_blender.goals.curves import follow_goal, line_of
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.world.frame import WorldFrame
from nsm_blender.world.surroundings import Surroundings
from nsm_core.errors import GeometryError, GoalError

POINTS = ((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (2.0, 1.0, 1.0), (3.0, 0.0, 1.0))


def drawn(kind: str = "POLY", closed: bool = False, points=POINTS, lines: int = 1) -> bpy.types.Object:
    data = bpy.data.curves.new("Path", "CURVE")
    data.dimensions = "3D"
    for _ in range(lines):
        spline = data.splines.new(kind)
        if kind == "BEZIER":
            spline.bezier_points.add(len(points) - 1)
            for made, place in zip(spline.bezier_points, points, strict=True):
                made.co, made.handle_left_type, made.handle_right_type = place, "AUTO", "AUTO"
        else:
            spline.points.add(len(points) - 1)
            for made, place in zip(spline.points, points, strict=True):
                made.co = (*place, 1.0)
            spline.use_endpoint_u = not closed
        spline.use_cyclic_u = closed
    made = bpy.data.objects.new("Path", data)
    bpy.context.scene.collection.objects.link(made)
    bpy.context.view_layer.update()
    return made


@pytest.mark.parametrize("bevel", [0.0, 0.05])
@pytest.mark.parametrize("kind", ["POLY", "BEZIER", "NURBS"])
def test_every_kind_is_read_where_it_lies(kind, bevel):
    curve = drawn(kind)
    curve.data.bevel_depth = bevel
    curve.location, curve.rotation_euler.z, curve.scale = (1.0, 2.0, 0.0), np.pi / 2, (2.0, 2.0, 2.0)
    bpy.context.view_layer.update()
    before = len(bpy.data.curves), len(bpy.data.objects)
    points, closed = line_of(curve)
    assert not closed and points[0] == pytest.approx((1, 2, 2), abs=1e-5)
    assert points[-1] == pytest.approx((1, 8, 2), abs=1e-5), "turned, scaled and moved"
    assert (len(bpy.data.curves), len(bpy.data.objects)) == before


def test_modifiers_and_closed_lines_count():
    curve = drawn(closed=True)
    hook = bpy.data.objects.new("Hook", None)
    bpy.context.scene.collection.objects.link(hook)
    modifier = curve.modifiers.new("Hook", "HOOK")
    modifier.object = hook
    modifier.vertex_indices_set([0])
    hook.location = (0.0, -1.0, 0.0)
    bpy.context.view_layer.update()
    points, closed = line_of(curve)
    assert closed and (points[0] == points[-1]).all() and len(points) == 5
    assert points[0] == pytest.approx((0, -1, 1), abs=1e-5)


def found(curve: bpy.types.Object, here=(0.0, 0.0), **more):
    scene = bpy.context.scene
    spec = GoalSpec("walk", curve, along=True, **more)
    return follow_goal(spec, Surroundings(scene, WorldFrame()), (np.array(here), 0.0))


def test_open_curves_are_gone_from_their_start_whatever_is_nearer():
    goal = found(drawn(), here=(3.0, 0.0), speed=1.0)
    assert (
        goal.way[0] == pytest.approx((0, 0)) and goal.position == pytest.approx((3, 0, 0)) and goal.speed == 1
    )
    assert goal.heading == pytest.approx(np.pi / 4, abs=0.01)


def test_closed_ones_from_where_they_are_nearest_and_free():
    square = drawn(closed=True, points=((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)))
    goal = found(square, here=(3.0, 0.0), rounds=2)
    assert goal.way[0] == pytest.approx((2, 0), abs=0.02) and goal.way[-1] == pytest.approx((2, 0), abs=0.02)
    assert goal.way[5][1] > goal.way[0][1], "in the curve's direction"
    assert np.linalg.norm(np.diff(goal.way, axis=0), axis=1).sum() == pytest.approx(32, abs=0.3)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(2, 0, 0.5))
    away = np.linalg.norm(found(square, here=(3.0, 0.0)).way[0] - (2, 0))
    assert 0.6 < away < 1.2


def test_what_is_no_line_is_refused_in_a_sentence():
    with pytest.raises(GeometryError, match="holds 2 lines"):
        found(drawn(lines=2))
    with pytest.raises(GeometryError, match="shorter than"):
        found(drawn(points=((0, 0, 0), (0, 0, 3))))
    bpy.ops.mesh.primitive_cube_add()
    with pytest.raises(GoalError, match="choose a curve object"):
        found(bpy.context.object)
