"""The capsules that depth is measured with, against the mannequin that is seen."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils.bvhtree import BVHTree

from nsm_blender.keys.keying import key_take
from nsm_blender.rigs.character import add_character
from nsm_core.body import capsules
from nsm_core.body.skeleton import INDEX, JOINTS, OFFSETS, J
from nsm_core.rotations import quat_from_rotvec


def bent(**joints) -> np.ndarray:
    """Rotations (23, 4) of the T-pose bent at both sides' ``joints`` by angles about X, and Y or Z where a
    side mirrors.
    """
    turns = np.zeros((J, 3))
    for name, turn in joints.items():
        for side, flip in (
            (("Left", (1, 1, 1)), ("Right", (1, -1, -1))) if name not in JOINTS else (("", (1, 1, 1)),)
        ):
            turns[INDEX[side + name]] = np.multiply(turn, flip)
    return quat_from_rotvec(turns)


POSES = {
    "T": bent(),
    "arms down": bent(Shoulder=(0, 1.3, 0), Elbow=(0, 0, 0.3)),
    "walking": bent(
        Shoulder=(0, 1.2, 0), Hip=(-0.5, 0, 0), Knee=(0.6, 0, 0), Ankle=(0.2, 0, 0), Chest=(0.1, 0, 0.1)
    ),
    "stooping": bent(
        Chest=(0.3, 0, 0),
        Chest2=(0.2, 0, 0),
        Chest3=(0.15, 0, 0),
        Hip=(-0.9, 0, 0),
        Knee=(1.1, 0, 0),
        Neck=(0.2, 0, 0),
    ),
}


@pytest.fixture(scope="module")
def seen():
    """The mannequin's vertices (P, V, 3) in the poses, and the body measured in them, in fine spheres."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = 30
    character = add_character((0, 0, 0))
    local, hips = np.stack(list(POSES.values())), np.tile((0.0, 0.0, 0.97), (len(POSES), 1))
    key_take(character, hips, local)
    vertices = []
    for frame in range(len(POSES)):
        bpy.context.scene.frame_set(frame + 1)
        shown = character.children[0].evaluated_get(bpy.context.evaluated_depsgraph_get())
        flat = np.empty(3 * len(shown.data.vertices), np.float32)
        shown.data.vertices.foreach_get("co", flat)
        vertices.append(flat.reshape(-1, 3) + np.array(shown.matrix_world.translation))
    return np.array(vertices)[:, ::7], hips, local


@pytest.fixture
def fine(monkeypatch):
    monkeypatch.setattr(capsules, "_SAMPLE", 0.01)


@pytest.mark.parametrize("pose", range(len(POSES)), ids=list(POSES))
def test_the_body_that_is_seen_lies_within_the_capsules(seen, fine, pose):
    vertices, hips, local = seen
    spheres = capsules.Body.of(hips[[pose]], local[[pose]])
    away = np.linalg.norm(vertices[pose][:, None] - spheres.centres[0], axis=-1) - spheres.radii[0]
    assert away.min(1).max() < 0.0175 and np.quantile(away.min(1), 0.99) < 0.0135


def test_the_capsules_are_no_thicker_than_what_is_seen(seen, fine):
    vertices, hips, local = seen
    spheres = capsules.Body.of(hips[[0]], local[[0]])
    low, high = vertices[0].min(0), vertices[0].max(0)
    bounds = (
        (spheres.centres[0] - spheres.radii[0, :, None]).min(0),
        (spheres.centres[0] + spheres.radii[0, :, None]).max(0),
    )
    np.testing.assert_allclose(bounds, (low, high), atol=0.02)
    surface = spheres.centres[0][:, None] + spheres.radii[0][:, None, None] * np.concatenate(
        (np.eye(3), -np.eye(3))
    )
    surface = surface.reshape(-1, 3)
    outside = (np.linalg.norm(surface[:, None] - spheres.centres[0], axis=-1) - spheres.radii[0]).min(
        1
    ) > -1e-6
    mesh = add_character((0, 0, 0)).children[0].data
    skin = BVHTree.FromPolygons(
        [tuple(v.co) for v in mesh.vertices], [tuple(p.vertices) for p in mesh.polygons]
    )
    gaps = np.array([skin.find_nearest(p)[3] for p in surface[outside]])
    assert np.quantile(gaps, 0.9) < 0.02 and gaps.max() < 0.04, (np.quantile(gaps, 0.9), gaps.max())


def test_a_character_of_other_proportions_has_a_body_of_its_own():
    local, hips = np.tile((1.0, 0, 0, 0), (1, J, 1)), np.array(((0.0, 0.0, 1.2),))
    longer = OFFSETS.copy()
    longer[INDEX["LeftElbow"]] *= 1.5
    standard, own = capsules.Body.of(hips, local), capsules.Body.of(hips, local, capsules.Figure(longer))
    reach = own.centres[0, :, 0].max() - standard.centres[0, :, 0].max()
    assert reach == pytest.approx(0.5 * OFFSETS[INDEX["LeftElbow"], 0], abs=1e-6)
    assert standard.centres[0, :, 0].min() == pytest.approx(own.centres[0, :, 0].min())
