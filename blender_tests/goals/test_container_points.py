"""What opens of furniture in the scene, as empties: on the axis and at the handle, wherever it stands."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from nsm_blender.demo_scene.kitchen import build_kitchen
from nsm_blender.goals.container_points import show_what_opens
from nsm_blender.goals.furniture_parts import AXIS, GRIP, OPENS
from nsm_blender.goals.points import goal_point_of
from nsm_blender.ui import operators
from nsm_core.errors import GeometryError, GoalError


@pytest.fixture
def kitchen(empty_scene):
    made = build_kitchen(3)[1]
    bpy.context.view_layer.update()
    return made


def test_axes_and_handles_are_where_the_furniture_has_them(kitchen, empty_scene):
    for name in ("fridge", "drawers", "oven", "wall cupboard"):
        container, body = kitchen.containers[name], bpy.data.objects[name[0].upper() + name[1:]]
        # However it stands, its points stand with it.
        move = Matrix.Translation((2, 1, 0.2)) @ Matrix.Rotation(0.9, 4, "Z")
        body.matrix_world = move @ body.matrix_world
        bpy.context.view_layer.update()
        added, proposals = show_what_opens(empty_scene, [body])
        bpy.context.view_layer.update()
        assert len(proposals) == len(container.parts) and len(added) == 2 * len(proposals)
        for part in container.parts:
            front = bpy.data.objects[f"{body.name} {part.name}"]
            axis, grip = (goal_point_of(empty_scene, front, action) for action in (AXIS, GRIP))
            truth = move @ Vector(part.to_world(part.handle))
            assert (grip.matrix_world.translation - truth).length < 0.03
            way = np.asarray(axis.matrix_world.to_3x3().col[2])
            own = np.asarray(front.matrix_world.to_3x3().col[2])
            assert abs(way @ own) > 0.999 and way @ own > 0
            assert axis[OPENS] == pytest.approx(front[OPENS], rel=0.3)
            if part.turns:
                off = np.asarray(front.matrix_world.inverted() @ axis.matrix_world.translation)
                assert np.hypot(*off[:2]) < 0.01  # on the same line


def test_points_that_are_there_stay_as_the_animator_has_them(kitchen, empty_scene):
    fridge = bpy.data.objects["Fridge"]
    (axis, _), _ = show_what_opens(empty_scene, [fridge])
    axis.location.x += 0.1
    before = axis.matrix_basis.copy()
    assert show_what_opens(empty_scene, [fridge])[0] == [] and axis.matrix_basis == before


def test_what_does_not_open_is_told(kitchen, empty_scene):
    with pytest.raises(GeometryError, match="Nothing of it looks as if it opened"):
        show_what_opens(empty_scene, [bpy.data.objects["Rack"]])
    with pytest.raises(GoalError, match="Nothing with a mesh"):
        show_what_opens(empty_scene, [])


def test_the_operator_adds_points_or_says_why_not(kitchen, empty_scene):
    for cls in operators.what_opens.CLASSES:
        bpy.utils.register_class(cls)
    try:
        bpy.ops.object.select_all(action="DESELECT")
        assert not bpy.ops.nsm.what_opens.poll()
        bpy.data.objects["Fridge"].select_set(True)
        assert bpy.ops.nsm.what_opens() == {"FINISHED"}
        assert sum(o.type == "EMPTY" for o in empty_scene.objects) == 2
        bpy.ops.object.select_all(action="DESELECT")
        bpy.data.objects["Rack"].select_set(True)
        with pytest.raises(RuntimeError, match="Nothing of it looks as if it opened"):
            bpy.ops.nsm.what_opens()
    finally:
        for cls in operators.what_opens.CLASSES:
            bpy.utils.unregister_class(cls)
