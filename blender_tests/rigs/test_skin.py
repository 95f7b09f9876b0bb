"""Bodies of characters' own: read from the skin that is seen, whatever the pose, and fitted."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from nsm_blender.rigs.armature import Placement
from nsm_blender.rigs.character import add_character
from nsm_blender.rigs.skin import Skin
from nsm_core.body.capsules import BUNDLED, Body, Figure, penetration_depths, rest_joints
from nsm_core.body.fitted import fitted
from nsm_core.body.skeleton import INDEX, OFFSETS
from nsm_core.rotations import quat_from_rotvec
from nsm_core.world.geometry.distance import Cuboids

STILL = np.tile((1.0, 0.0, 0.0, 0.0), (1, 23, 1))


def skin_of(rig: bpy.types.Object) -> Skin:
    bpy.context.view_layer.update()
    steps = Skin.reading(rig, Placement.of(rig))
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value


def swollen(
    rig: bpy.types.Object, times: float, groups=("Hips", "Chest", "Chest2", "LeftHip", "RightHip")
) -> None:
    """Thicken trunk and thighs of the bundled character's skin."""
    skin = rig.children[0]
    rest = rest_joints()
    for vertex in skin.data.vertices:
        group = max(vertex.groups, key=lambda g: g.weight)
        name = skin.vertex_groups[group.group].name
        if name in groups:
            middle = rest[INDEX[name]]
            vertex.co.x = middle[0] + times * (vertex.co.x - middle[0])
            vertex.co.y = middle[1] + times * (vertex.co.y - middle[1])


def test_the_bundled_character_keeps_its_body_at_any_size_and_pose():
    rig = add_character((1.0, 2.0, 0.0))
    rig.scale = (1.3,) * 3
    rig.pose.bones["LeftHip"].rotation_mode = "XYZ"
    rig.pose.bones["LeftHip"].rotation_euler.x = -0.8
    bpy.context.view_layer.update()
    assert skin_of(rig).figure() is BUNDLED


def test_a_fit_to_the_bundled_skin_comes_near_the_bundled_body():
    skin = skin_of(add_character((0, 0, 0)))
    body = Body.of(rest_joints()[None, 0], STILL, fitted(skin.points, skin.joints, skin.offsets))
    away = (np.linalg.norm(skin.points[:, None] - body.centres[0], axis=-1) - body.radii[0]).min(1)
    assert np.quantile(away, 0.97) < 0.025 and np.median(np.abs(away)) < 0.012


def test_thick_thighs_and_bellies_are_noticed_and_hold_hips_off_seats():
    rig = add_character((0, 0, 0))
    swollen(rig, 1.5)
    figure = skin_of(rig).figure()
    assert figure is not BUNDLED
    # A board before the belly, from 13 cm off the middle on.
    wall = Cuboids([((0.0, -1.0, 0.0), 0.0, ((-2.0, -0.87, 0.85),), ((2.0, 0.87, 1.2),))])
    hips = rest_joints()[None, 0]
    before, own = (penetration_depths(hips, STILL, wall, each)[0] for each in (BUNDLED, figure))
    assert own > before + 0.01
    behind, under = np.subtract(figure.seat, BUNDLED.seat)
    assert behind > 0.02 and under > 0.01


def test_what_the_pose_is_does_not_matter():
    rig = add_character((0, 0, 0))
    swollen(rig, 1.5)
    first = skin_of(rig).figure()
    for name, turn in (
        ("LeftShoulder", (0.0, 1.2, 0.0)),
        ("RightHip", (-0.9, 0.0, 0.0)),
        ("Chest2", (0.3, 0.0, 0.0)),
    ):
        bone = rig.pose.bones[name]
        bone.rotation_mode = "QUATERNION"
        bone.rotation_quaternion = quat_from_rotvec(np.array(turn))
    again = skin_of(rig).figure()
    assert again.seat == pytest.approx(first.seat, abs=0.012)
    assert len(again.spheres.radii) == pytest.approx(len(first.spheres.radii), abs=6)
    assert again.sole.toe_height == pytest.approx(first.sole.toe_height, abs=0.004)


def test_thick_soles_raise_the_ankles_and_stiff_shoes_have_tips():
    rig = add_character((0, 0, 0))
    skin = rig.children[0]
    for vertex in skin.data.vertices:
        name = skin.vertex_groups[max(vertex.groups, key=lambda g: g.weight).group].name
        if name.endswith(("Ankle", "Toe")) and vertex.co.z < 0.04:
            vertex.co.z -= 0.05
    read = skin_of(rig)
    sole = read.figure().sole
    assert sole.ankle_height == pytest.approx(BUNDLED.sole.ankle_height + 0.05, abs=0.012)
    read.toes = False
    stiff = read.figure().sole
    raised = quat_from_rotvec(np.array((0.5, 0.0, 0.0)))  # the heel is lifted over the ball of the foot
    assert stiff.tip is not None and sole.tip is None
    toe = np.array((0.0, 0.0, stiff.toe_height))
    assert stiff.depth(toe, raised) > sole.depth(toe, raised) + 0.02


def test_who_has_no_skin_is_as_thick_as_the_bundled_body():
    rig = add_character((0, 0, 0))
    bpy.data.objects.remove(rig.children[0])
    assert skin_of(rig).figure() is BUNDLED
    longer = OFFSETS.astype(float)
    longer[INDEX["LeftKnee"]] *= 1.2
    bare = Skin(np.zeros((0, 3)), np.zeros(0, int), longer, True).figure()
    assert isinstance(bare, Figure) and bare.spheres is BUNDLED.spheres and bare.offsets is longer
