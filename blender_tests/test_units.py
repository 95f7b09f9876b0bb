"""Whatever units scene, object and bones are in, a character is as large as its legs are long, and does the
same.
"""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from colliders_now import gather_colliders
from mathutils import Matrix
from scenes import box, furnish

from nsm_blender.goals.spec import GoalSpec
from nsm_blender.keys.keying import key_take, read_back
from nsm_blender.prepare import TakeSpec, prepare, start_of
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import finish, generate
from nsm_blender.world.frame import WorldFrame
from nsm_core.body.skeleton import INDEX, OFFSETS, forward_kinematics
from nsm_core.errors import SkeletonError
from nsm_core.rotations import quat_normalize


def character(
    bones: float = 1.0, scale: float = 1.0, y_up: bool = False, location=(1.5, -2.0, 0.0)
) -> bpy.types.Object:
    """The bundled character as importers leave it: bones ``bones`` times as long, perhaps Y up, the object
    scaled and turned back.
    """
    made = add_character(location)
    for child in list(made.children):
        bpy.data.objects.remove(child)
    bpy.context.view_layer.objects.active = made
    made.data.transform(
        Matrix.Scale(bones, 4) @ (Matrix.Rotation(-math.pi / 2, 4, "X") if y_up else Matrix())
    )
    made.scale, made.rotation_euler.x = (scale,) * 3, math.pi / 2 if y_up else 0.0
    bpy.context.view_layer.update()
    return made


@pytest.mark.parametrize(
    ("bones", "scale", "y_up"),
    [(100, 0.01, False), (100, 0.01, True), (1, 100, False), (0.01, 1, True), (2, 1.5, False)],
)
def test_size_place_and_keys_whatever_the_units(bones, scale, y_up):
    made, size = character(bones, scale, y_up), bones * scale
    frame, (start, heading) = start_of(made, bpy.context.scene)
    assert frame.scale == pytest.approx(size, rel=1e-5) and frame.floor == 0
    np.testing.assert_allclose(start * size, (1.5, -2.0), atol=1e-4 * max(size, 1))
    assert heading == pytest.approx(0, abs=1e-4)
    rng = np.random.default_rng(4)
    local = quat_normalize(np.concatenate((np.ones((2, 23, 1)), rng.normal(0, 0.3, (2, 23, 3))), -1))
    hips = size * np.array(((0.2, 0.3, 0.9), (0.4, 0.1, 0.5)))
    take = key_take(made, hips, local)
    expected, _ = forward_kinematics(hips, local, OFFSETS.astype(float) * size)
    for i in (0, 1):
        bpy.context.scene.frame_set(take.frame_start + i)
        shown = made.evaluated_get(bpy.context.evaluated_depsgraph_get())
        names = ("Head", "LeftWrist", "RightWrist", "LeftToe", "RightAnkle")
        heads = np.array([shown.matrix_world @ shown.pose.bones[n].head for n in names])
        np.testing.assert_allclose(heads / size, expected[i, [INDEX[n] for n in names]] / size, atol=1e-4)
    back_hips, back = read_back(made, [take.frame_start, take.frame_end])
    np.testing.assert_allclose(back_hips / size, hips / size, atol=1e-4)
    assert (np.abs((back * local).sum(-1)) > 1 - 1e-5).all()


def test_legs_without_length_are_refused():
    made = character()
    bpy.context.view_layer.objects.active = made
    bpy.ops.object.mode_set(mode="EDIT")
    for name in ("LeftHip", "LeftKnee", "LeftAnkle", "RightHip", "RightKnee", "RightAnkle"):
        bone = made.data.edit_bones[name]
        bone.head, bone.tail = (0, 0, 0.9), (0, 0.1, 0.9)
    bpy.ops.object.mode_set(mode="OBJECT")
    with pytest.raises(SkeletonError, match="have no length"):
        WorldFrame.of(made)


def scene_in_units(units: float) -> tuple[bpy.types.Object, bpy.types.Object]:
    """A room, all of it ``units`` times as large, with a unit scale that makes up for it."""
    bpy.context.scene.unit_settings.scale_length = 1 / units
    made = add_character(tuple(units * x for x in (1.5, -2.0, 0.0)))
    seat, _ = furnish()
    parts = [
        box(*p)
        for p in (
            ("Floor", (-5, -5, -0.05), (5, 5, 0)),
            ("Rug", (-1.5, -1.5, 0), (1.5, 1.5, 0.015)),
            ("Wall", (-5, 3, 0), (5, 3.1, 2.6)),
        )
    ]
    for each in (made, seat, *parts):
        each.scale = (units,) * 3
    bpy.context.view_layer.update()
    return made, seat


@pytest.mark.parametrize("units", [100.0, 1000.0, 0.02])
def test_a_room_reads_the_same_in_any_units(units):
    def read(u):
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        made, seat = scene_in_units(u)
        return finish(prepare(TakeSpec(made, [GoalSpec("sit", seat)]), bpy.context.scene))[0]

    points = np.random.default_rng(1).uniform((-2, -2, 0), (2, 3.2, 2), (3000, 3)).astype(np.float32)
    one, other = read(1.0), read(units)
    np.testing.assert_allclose(other.start_position, one.start_position, atol=1e-5)
    np.testing.assert_allclose(other.goals[0].position, one.goals[0].position, atol=1e-5)
    np.testing.assert_allclose(
        other.goals[0].interaction.occupancy, one.goals[0].interaction.occupancy, atol=1e-4
    )
    a, b = (q.environment.signed_distance(points, 0.3) for q in (one, other))
    np.testing.assert_allclose(a, b, atol=1e-4)
    assert (a < 0.3).any()


def test_an_imported_character_sits_on_an_ordinary_chair():
    made = character(100, 0.01, y_up=True)
    seat, piece = furnish()
    take = finish(generate(TakeSpec(made, [GoalSpec("sit", seat, 0.3)]), bpy.context.scene))
    assert take.report["goals"][0]["reached"]
    bpy.context.scene.frame_set(take.keyed.frame_end)
    shown = made.evaluated_get(bpy.context.evaluated_depsgraph_get())
    hips = np.array(shown.matrix_world @ shown.pose.bones["Hips"].head)
    assert np.linalg.norm(hips[:2] - piece.seat.point[:2]) < 0.08


def test_the_frame_of_the_query_is_the_characters():
    box("Crate", (0, 0, 1), (200, 100, 101))
    query = gather_colliders(bpy.context.scene, None, (), WorldFrame(100.0, 1.0))
    np.testing.assert_allclose(
        query.signed_distance(np.array(((2.2, 0.5, 0.5), (1, 0.5, 0.9)), np.float32), 0.5),
        (0.2, -0.1),
        atol=1e-5,
    )
