"""The bundled character: bones, mesh, weights and how it stands."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from nsm_blender.keys.keying import key_take
from nsm_blender.rigs.armature import joint_positions_at_rest
from nsm_blender.rigs.character import add_character
from nsm_core.body.skeleton import INDEX, JOINTS, OFFSETS, PARENTS, J
from nsm_core.rotations import quat_from_axis_angle


def evaluated_vertices(body: bpy.types.Object) -> np.ndarray:
    """World positions (V, 3) of the skinned mesh as posed now."""
    evaluated = body.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    evaluated.to_mesh_clear()
    return flat.reshape(-1, 3) @ np.array(body.matrix_world.to_3x3()).T + np.array(
        body.matrix_world.translation
    )


def test_the_armature_has_the_joints_where_the_core_has_them():
    armature = add_character()
    assert armature.name == "Character" and armature.type == "ARMATURE"
    assert list(armature.data.bones.keys()) == list(JOINTS) and len(JOINTS) == 23
    for j, name in enumerate(JOINTS):
        bone = armature.data.bones[name]
        assert bone.parent == (armature.data.bones[JOINTS[PARENTS[j]]] if PARENTS[j] >= 0 else None)
        assert tuple(bone.head_local) == pytest.approx(joint_positions_at_rest()[j], abs=1e-6)
        assert bone.length > 0.04
    assert armature.mode == "OBJECT"


def test_it_stands_at_the_cursor_on_its_soles_facing_minus_y():
    bpy.context.scene.cursor.location = (1.0, 2.0, 0.5)
    armature = add_character()
    vertices = evaluated_vertices(armature.children[0]) - (1.0, 2.0, 0.5)
    assert vertices[:, 2].min() == pytest.approx(0.0, abs=2e-3)
    assert vertices[:, 2].max() == pytest.approx(1.75, abs=0.01)
    assert vertices[vertices[:, 2] < 0.05, 1].min() < -0.15, "toes point to -Y"
    assert vertices[:, 0].max() == pytest.approx(-vertices[:, 0].min(), abs=1e-4), "left and right are alike"


def test_every_vertex_is_weighted_on_bones_and_the_weights_sum_to_one():
    armature = add_character()
    body = armature.children[0]
    names = {group.index: group.name for group in body.vertex_groups}
    assert set(names.values()) == set(JOINTS)
    sums = np.array([sum(g.weight for g in v.groups) for v in body.data.vertices])
    assert np.abs(sums - 1).max() < 1e-5
    used = {names[g.group] for v in body.data.vertices for g in v.groups if g.weight > 0.1}
    assert used >= set(JOINTS) - {"RightCollar", "LeftCollar"}


def test_left_joints_move_the_left_side_only():
    armature = add_character()
    body = armature.children[0]
    before = evaluated_vertices(body)
    armature.pose.bones["LeftShoulder"].matrix_basis = Matrix.Rotation(1.0, 4, "X")
    armature.pose.bones["LeftKnee"].matrix_basis = Matrix.Rotation(1.0, 4, "X")
    bpy.context.view_layer.update()
    moved = np.linalg.norm(evaluated_vertices(body) - before, axis=1) > 1e-4
    assert moved.any() and before[moved, 0].min() > 0.03


def test_the_mesh_is_closed_and_faces_outwards():
    mesh = add_character().children[0].data
    edges: dict[tuple[int, int], int] = {}
    for polygon in mesh.polygons:
        ring = list(polygon.vertices)
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
            edges[a, b] = edges.get((a, b), 0) + 1
    assert all(count == 1 and edges.get((b, a)) == 1 for (a, b), count in edges.items())
    vertices = np.array([v.co for v in mesh.vertices])
    volume = 0.0
    for polygon in mesh.polygons:
        p = vertices[list(polygon.vertices)]
        for k in range(1, len(p) - 1):
            volume += np.dot(p[0], np.cross(p[k], p[k + 1])) / 6
    assert 0.04 < volume < 0.12, "about the volume of an adult, in cubic metres; negative were inside out"


def test_a_seated_pose_keeps_limbs_together():
    armature = add_character()
    local = np.zeros((1, J, 4))
    local[..., 0] = 1
    for side in ("Left", "Right"):
        local[0, INDEX[side + "Hip"]] = quat_from_axis_angle(np.array((1.0, 0, 0)), np.array(-1.5))
        local[0, INDEX[side + "Knee"]] = quat_from_axis_angle(np.array((1.0, 0, 0)), np.array(1.5))
    key_take(armature, np.array([[0, 0, 0.55]]), local)
    body = armature.children[0]
    vertices = evaluated_vertices(body)
    knee = INDEX["LeftKnee"]
    names = {g.index: g.name for g in body.vertex_groups}
    place = {
        j: np.array(armature.matrix_world @ armature.pose.bones[JOINTS[j]].head)
        for j in (knee, INDEX["LeftHip"])
    }
    assert np.linalg.norm(place[knee] - place[INDEX["LeftHip"]]) == pytest.approx(
        np.linalg.norm(OFFSETS[knee]), abs=1e-4
    )
    for name in ("LeftHip", "LeftKnee"):  # thigh and shin both reach to within the knee's ball
        own = np.array(
            [any(names[g.group] == name and g.weight > 0.5 for g in v.groups) for v in body.data.vertices]
        )
        assert np.linalg.norm(vertices[own] - place[knee], axis=1).min() < 0.051


def test_a_second_character_gets_its_own_name_and_mesh():
    first, second = add_character(), add_character((2, 0, 0))
    assert (first.name, second.name) == ("Character", "Character.001")
    assert first.children[0].data != second.children[0].data
    assert first.children[0].data.materials[0] == second.children[0].data.materials[0]
