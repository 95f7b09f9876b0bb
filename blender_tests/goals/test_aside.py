"""What blocks a thing in a niche is put aside first and keyed with it; what may not be moved is not."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from placings import performed, small_thing
from scenes import box, mesh_of_boxes

from nsm_blender.goals.resolve import resolve
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.prepare import start_of
from nsm_blender.rigs.character import add_character
from nsm_core.errors import GoalError

BEHIND, BEFORE = (0.0, 0.28, 1.0), (0.0, 0.12, 1.0)


def furnish():
    """A jar at the back of a niche that a tin fills before it, a table, and a character."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    niche = [
        ((-0.6, 0.0, 0.97), (0.6, 0.42, 1.0)),
        ((-0.16, 0.0, 1.0), (-0.13, 0.42, 1.2)),
        ((0.13, 0.0, 1.0), (0.16, 0.42, 1.2)),
        ((-0.16, 0.0, 1.2), (0.16, 0.42, 1.23)),
        ((-0.6, 0.42, 0.0), (0.6, 0.45, 1.5)),
    ]
    mesh_of_boxes("Niche", niche)
    box("Table", (0.9, -1.6, 0.0), (1.9, -0.9, 0.75))
    jar, tin = small_thing("Jar", BEHIND, 0.02, 0.1), small_thing("Tin", BEFORE, 0.04)
    character = add_character((0.0, -1.6, 0.0))
    bpy.context.view_layer.update()
    return jar, tin, character


def found(jar, character):
    scene = bpy.context.scene
    frame, start = start_of(character, scene)
    return resolve(GoalSpec("place", jar, to=bpy.data.objects["Table"]), scene, frame, start)


def test_what_stands_before_a_thing_is_put_aside_first_unless_it_may_not_be_moved():
    jar, tin, character = furnish()
    (first,) = found(jar, character).first
    assert first.name == "Tin" and np.linalg.norm(first.position - BEFORE) > 0.15
    limit = tin.constraints.new("LIMIT_LOCATION")  # which keys alone do not move
    bpy.context.view_layer.update()
    with pytest.raises(GoalError, match="Jar"):
        found(jar, character)
    tin.constraints.remove(limit)
    tin.location.x = 0.4
    bpy.context.view_layer.update()
    assert found(jar, character).first == ()


def test_a_take_keys_what_it_puts_aside_and_says_so(tmp_path):
    _, _, character = furnish()
    report = performed(tmp_path, character.name, "Jar")
    (goal,) = report["goals"]
    assert goal["reached"] and goal["position_error_cm"] < 1.0
    assert any("Tin stood in the way" in remark for remark in goal["remarks"])
    scene, tin, jar = bpy.context.scene, bpy.data.objects["Tin"], bpy.data.objects["Jar"]
    scene.frame_set(1)
    np.testing.assert_allclose(tin.matrix_world.translation, BEFORE, atol=1e-4)
    scene.frame_set(report["frames"])
    assert abs(jar.matrix_world.translation.z - 0.75) < 0.005
    assert np.linalg.norm(np.array(tin.matrix_world.translation) - BEFORE) > 0.15
