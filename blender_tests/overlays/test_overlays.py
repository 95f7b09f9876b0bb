"""Overlays: what they draw is where the scene and the take have it, in the viewport's arrays and in
pictures.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from scenes import box, furnish

import nsm_blender
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.outlook import outlook
from nsm_blender.overlays import colours, kept, picture, viewport
from nsm_blender.overlays.layers import LAYERS
from nsm_blender.overlays.scene_layers import followed
from nsm_blender.overlays.shapes import Shapes, box_corners
from nsm_blender.prepare import TakeSpec
from nsm_blender.progress import finish
from nsm_blender.takes import generate
from nsm_blender.ui import lookout, overlays
from nsm_core.body.skeleton import JOINTS
from nsm_core.world.sensors.environment import DIAMETER, SPHERE_RADIUS

BY_KEY = {layer.key: layer for layer in LAYERS}


@pytest.fixture
def settings(registered):
    return registered.nsm


def room(scale: float = 1.0):
    """A character of some size, a chair beside a wall, and a goal to sit there."""
    bpy.ops.nsm.add_character()
    character = bpy.context.scene.nsm.character
    character.scale = (scale,) * 3
    chair, _ = furnish(position=(0.4, -2.3), heading=0.5)
    chair.scale = (scale,) * 3
    chair.location *= scale
    box("Wall", (-3 * scale, -3.5 * scale, 0), (3 * scale, -3.4 * scale, 2 * scale))
    row = character.nsm_queue.goals.add()
    row.object, row.action, row.hold = chair, "sit", 0.5
    bpy.context.view_layer.update()
    return character, chair, row


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_before_a_take_solids_goals_and_ways_are_where_they_are(settings, scale):
    character, chair, _ = room(scale)
    character.location.x = 0.8 * scale
    bpy.context.view_layer.update()
    scene = bpy.context.scene
    seen = finish(outlook(TakeSpec(character, [GoalSpec("sit", chair)]), scene))
    solid = BY_KEY["colliders"].before(seen)
    low, high = solid.triangles.min(0), solid.triangles.max(0)
    np.testing.assert_allclose(low[:2], (-3 * scale, -3.5 * scale), atol=0.02)
    np.testing.assert_allclose(high, (3 * scale, high[1], 2 * scale), atol=0.02)
    assert len(solid.lines) == len(solid.line_colours) and len(solid.lines) % 2 == 0
    assert {tuple(np.round(c, 2)) for c in solid.triangle_colours.tolist()} == {
        tuple(np.round(colours.SOLID, 2))
    }
    way = BY_KEY["way"].before(seen).lines.reshape(-1, 2, 3)
    np.testing.assert_allclose(way[0, 0, :2], (0.8 * scale, 0.0), atol=0.05)
    ends = np.linalg.norm(way.reshape(-1, 3)[:, :2] - np.array(chair.location)[:2], axis=1)
    assert ends.min() < 0.7 * scale, "it leads before the seat"
    ((place, text, colour),) = BY_KEY["goals"].before(seen).words
    assert text == "1 Sit" and colour == colours.GOAL
    assert 0.3 * scale < place[2] < 0.6 * scale and np.linalg.norm(
        place[:2] - np.array(chair.location)[:2]
    ) < (0.4 * scale)


def test_solid_things_are_drawn_where_they_are_at_the_frame(settings):
    character, chair, _ = room()
    scene = bpy.context.scene
    cart = box("Cart", (2, 2, 0), (2.5, 2.5, 0.5))
    for frame, x in ((1, 0.0), (11, 1.0)):
        cart.location.x = x
        cart.keyframe_insert("location", frame=frame)
    scene.frame_set(1)
    seen = finish(outlook(TakeSpec(character, [GoalSpec("sit", chair)]), scene))
    solid = BY_KEY["colliders"].before(seen)
    scene.frame_set(11)
    moved = followed(solid, seen, scene)
    by = moved.triangles - solid.triangles
    of_cart = np.abs(by[:, 0]) > 1e-6
    assert of_cart.sum() == 36 and np.allclose(by[of_cart], (1.0, 0.0, 0.0), atol=1e-5)
    assert (solid.triangles[of_cart][:, :2] > 1.9).all()
    scene.frame_set(1)
    assert followed(solid, seen, scene) is solid


def test_a_mesh_as_dense_as_a_scan_is_drawn_as_the_box_around_it(settings, monkeypatch):
    from nsm_blender.overlays import scene_layers

    character, chair, _ = room()
    monkeypatch.setattr(scene_layers, "_MOST_FACES", 4)
    seen = finish(outlook(TakeSpec(character, [GoalSpec("sit", chair)]), bpy.context.scene))
    drawn = BY_KEY["colliders"].before(seen)
    assert not len(drawn.triangles) and len(drawn.lines) == 2 * 24
    wall = drawn.lines[np.abs(drawn.lines[:, 1] + 3.45) < 0.1]
    np.testing.assert_allclose([wall.min(0), wall.max(0)], [(-3, -3.5, 0), (3, -3.4, 2)], atol=0.02)


@pytest.fixture(scope="module")
def taken():
    """A take kept in memory, with what was keyed of it: its scene is gone with the first test."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    nsm_blender.register()
    character, chair, _ = room()
    scene = bpy.context.scene
    scene.render.fps = 24
    take = finish(generate(TakeSpec(character, [GoalSpec("sit", chair, hold=0.5)], start_frame=11), scene))
    shown = kept.remembered_take(character)
    scene.frame_set(take.keyed.frame_end)
    bones = character.pose.bones
    feet = [tuple(character.matrix_world @ bones[name].head) for name in ("RightAnkle", "LeftAnkle")]
    seat = tuple(chair.location)
    assert shown is not None
    nsm_blender.unregister()
    return shown, np.array(feet), np.array(seat), take.keyed.frame_end


def test_a_take_is_shown_at_the_frame_of_the_scene(taken):
    shown, feet, _, last = taken
    assert shown.frame_at(10) is None and shown.frame_at(11) == 0
    t = shown.frame_at(last)
    assert t is not None and len(shown.result.root) - t < 3, "24 frames a second of the scene, 30 of the take"
    joints = shown.joints_at(t)
    np.testing.assert_allclose(
        joints[[JOINTS.index("RightAnkle"), JOINTS.index("LeftAnkle")]], feet, atol=0.01
    )


def test_sensors_are_drawn_about_the_character_and_over_its_seat(taken):
    shown, _, seat, last = taken
    t = shown.frame_at(last)
    spheres = BY_KEY["environment"].during(shown, t)
    centres = spheres.triangles.reshape(1408, 24, 3).mean(1)
    away = np.linalg.norm(centres[:, :2] - shown.result.root[t - 1, :2], axis=1)
    assert away.max() < DIAMETER / 2 + 0.01 and len(centres) == 1408
    red = spheres.triangle_colours.reshape(1408, 24, 4)[:, 0, 0] > 0.8
    assert red.any(), "the chair is sensed"
    assert np.linalg.norm(centres[red][:, :2] - seat[:2], axis=1).min() < 0.4 + SPHERE_RADIUS
    cells = BY_KEY["interaction"].during(shown, t)
    middle = (cells.lines.min(0) + cells.lines.max(0)) / 2
    np.testing.assert_allclose(middle[:2], seat[:2], atol=0.15)
    assert (cells.triangles.min(0) > cells.lines.min(0) - 0.01).all() and len(cells.triangles)


def test_contacts_paths_and_experts_are_those_of_the_frame(taken):
    shown, _, _, last = taken
    t = shown.frame_at(last)
    touching = BY_KEY["goals"].during(shown, t).triangle_colours[::24]
    green = np.isclose(touching[:, 1], colours.CONTACT[1] * 1.0, atol=0.01)
    np.testing.assert_array_equal(green, shown.result.contacts[t] > 0.5)
    walking = t // 2
    paths = BY_KEY["trajectories"].during(shown, walking)
    orange = np.isclose(paths.line_colours, colours.EGOCENTRIC, atol=0.01).all(1)
    ahead = paths.lines[orange][:, :2]
    np.testing.assert_allclose(ahead[0], shown.result.root[walking, :2], atol=0.01)
    plate = BY_KEY["gating"].during(shown, walking)
    assert BY_KEY["gating"].flat and plate.words[0][1] == "Experts at work"
    assert (plate.triangles[:, 2] == 0).all() and plate.triangles.min() >= 0


def test_a_picture_of_overlays_leaves_the_scene_as_it_was(taken, settings):
    shown, _, _, last = taken
    before = [set(kind) for kind in (bpy.data.objects, bpy.data.meshes, bpy.data.materials)]
    made = BY_KEY["trajectories"].during(shown, shown.frame_at(last))
    with picture.as_meshes(bpy.context.scene, [made], 0.01):
        drawn = [o for o in bpy.data.objects if o not in before[0]]
        faces = sum(len(o.data.polygons) for o in drawn)
        assert faces == len(made.triangles) // 3 + 8 * len(made.lines) // 2
        tones = {tuple(round(v, 2) for v in o.data.materials[0].diffuse_color) for o in drawn}
        assert len(tones) == len(drawn) >= 3
    assert before == [set(kind) for kind in (bpy.data.objects, bpy.data.meshes, bpy.data.materials)]


def test_what_lies_flat_is_painted_where_it_is():
    plate, canvas = Shapes(), np.zeros((40, 60, 4), np.float32)
    plate.add_triangles(
        np.array((((0, 0, 0), (20, 0, 0), (20, 10, 0)), ((0, 0, 0), (20, 10, 0), (0, 10, 0)))), (1, 0, 0, 0.5)
    )
    picture.paint(canvas, plate, 2.0, margin=5)
    red = canvas[..., 0]
    assert red[5:25, 5:45].min() == red.max() == 0.5, "once everywhere, on the shared side too"
    assert red.sum() == 0.5 * 20 * 40


def test_boxes_have_twelve_edges_and_twelve_triangles():
    shapes = Shapes()
    shapes.add_boxes(box_corners((2, 4, 6), (1, 2, 3))[None], (1, 1, 1, 1), (0, 0, 0, 1))
    assert len(shapes.triangles) == 36 and len(shapes.lines) == 24
    sides = np.linalg.norm(np.diff(shapes.lines.reshape(-1, 2, 3), axis=1)[:, 0], axis=1)
    assert sorted(set(np.round(sides, 5).tolist())) == [2.0, 4.0, 6.0]
    np.testing.assert_allclose(shapes.triangles.min(0), 0)


def test_goals_are_checked_before_generate_and_known_until_something_changes(settings):
    character, chair, row = room()
    far = character.nsm_queue.goals.add()
    far.action, far.location = "walk", (0.0, -3.45, 0.0)
    assert bpy.ops.nsm.check_goals() == {"FINISHED"}
    scene = bpy.context.scene
    assert lookout.told_of(scene, 0, row).problem == ""
    assert "lies inside Wall" in lookout.told_of(scene, 1, far).problem
    far.location = (0.0, -1.0, 0.0)
    assert lookout.told_of(scene, 1, far) is None, "it asks for something else now"
    assert lookout.told_of(scene, 0, row) is not None
    chair.location.x += 0.1
    bpy.context.view_layer.update()
    assert lookout.is_stale() and lookout.told_of(scene, 0, row) is None


def test_a_goal_that_no_way_leads_to_is_marked(settings):
    character, chair, row = room()
    for name, low, high in (
        ("North", (-1, -1.2, 0), (2, -1.1, 2)), ("West", (-1, -3.5, 0), (-0.9, -1.1, 2)),
        ("East", (1.9, -3.5, 0), (2, -1.1, 2)),
    ):  # fmt: skip
        box(name, low, high)
    bpy.ops.nsm.check_goals()
    assert "no free way" in lookout.told_of(bpy.context.scene, 0, row).problem


def test_overlays_that_are_on_say_why_they_are_empty(settings):
    shown = overlays.toggles()
    scene = bpy.context.scene
    assert overlays.reason_empty(scene) == ""
    shown.environment = True
    assert "no take yet" in overlays.reason_empty(scene)
    bpy.ops.nsm.add_character()
    settings.character.keyframe_insert("location", frame=1)
    assert "Generate again" in overlays.reason_empty(scene)
    shown.environment, shown.way = False, True
    lookout.look_now(scene)
    assert overlays.reason_empty(scene) == ""
    settings.character = None
    lookout.look_now(scene)
    assert "No character is chosen" in overlays.reason_empty(scene)


def test_nothing_is_left_when_the_add_on_goes(settings):
    room()
    overlays.toggles().colliders = True
    lookout.look_now(bpy.context.scene)
    assert viewport._drawn, "the toggle has made it"
    nsm_blender.unregister()
    handlers = [
        handler
        for name in dir(bpy.app.handlers)
        if isinstance(getattr(bpy.app.handlers, name), list)
        for handler in getattr(bpy.app.handlers, name)
    ]
    assert not [h for h in handlers if h.__module__.startswith("nsm_blender")]
    assert not viewport._drawn and not viewport._handles
    assert not hasattr(bpy.types.WindowManager, "nsm_overlays")
