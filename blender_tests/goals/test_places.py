"""A jar is taken from a shelf and put on a table, as a job asks for it; and what cannot be is told."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from placings import performed, shelf_and_table, small_thing
from scenes import empty

from nsm_blender.goals.resolve import resolve
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.prepare import start_of
from nsm_blender.rigs.character import add_character
from nsm_core.errors import NsmError

FOOT = (0.05, 0.1, 0.98)


def furnish():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    shelf_and_table()
    jar = small_thing("Jar", FOOT)
    character = add_character((0.0, -1.6, 0.0))
    bpy.context.view_layer.update()
    return jar, character


def found(jar, character, to, **more):
    scene = bpy.context.scene
    frame, start = start_of(character, scene)
    return resolve(GoalSpec("place", jar, to=bpy.data.objects[to], **more), scene, frame, start)


def test_a_place_is_found_on_a_top_on_a_shelf_and_at_an_empty():
    jar, character = furnish()
    on_table = found(jar, character, "Table")
    assert on_table.position[2] == pytest.approx(0.75, abs=2e-3)
    assert 1.0 < on_table.position[0] < 2.0 and -1.6 < on_table.position[1] < -0.9
    jar.location = (1.2, -1.25, 0.75)
    bpy.context.view_layer.update()
    on_shelf = found(jar, character, "Shelf")
    assert on_shelf.position[2] == pytest.approx(0.98, abs=2e-3)  # of its boards the one in reach with ease
    empty("Spot", (0.1, 0.12, 1.38))
    np.testing.assert_allclose(found(jar, character, "Spot").position, (0.1, 0.12, 1.38), atol=1e-5)


@pytest.mark.parametrize(
    ("to", "more", "told"),
    [
        ("Jar", {}, "cannot be put down on itself"),
        ("Table", {"mass": 4.0}, "weighs 4.0 kg, too much for one hand"),
        ("High", {}, "it is 2.46 m over the floor, and one hand"),
        ("Ball", {}, "no level board"),
    ],
)
def test_what_cannot_be_is_told_in_one_sentence(to, more, told):
    jar, character = furnish()
    empty("High", (0.1, 0.12, 2.4))
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3, location=(3, 0, 0.3))
    bpy.context.object.name = "Ball"
    bpy.context.view_layer.update()
    with pytest.raises(NsmError, match=told):
        found(jar, character, to, **more)


def test_a_job_picks_a_jar_and_puts_it_on_a_table(tmp_path):
    _, character = furnish()
    report = performed(tmp_path, character.name, "Jar")
    (goal,) = report["goals"]
    assert goal["reached"] and goal["position_error_cm"] < 1.0 and goal["hand_error_cm"] < 1.0
    assert report["penetration_cm"] < 2.0
    scene, jar = bpy.context.scene, bpy.data.objects["Jar"]
    scene.frame_set(1)
    np.testing.assert_allclose(jar.matrix_world.translation, FOOT, atol=1e-4)
    scene.frame_set(report["frames"])
    place = jar.matrix_world.translation
    assert 1.0 < place.x < 2.0 and -1.6 < place.y < -0.9 and abs(place.z - 0.75) < 0.005
    assert jar.matrix_world.col[2].z == pytest.approx(1.0, abs=1e-5)  # upright
