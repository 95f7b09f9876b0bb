"""Rigs of controls: what is keyed by IK may be filled by FK, and is IK again outside the gap."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from foreign_rigs import rigify_rig
from gaps import cut, outside, playing, walk, walking
from test_fill_gap import filled

from nsm_blender.keys.switches import switches_of
from nsm_blender.rigs.armature import read_world_pose

START, END = 40, 60


@pytest.fixture(scope="module", autouse=True)
def motion():
    """The walk, made before a test opens its scene."""
    return walk()


@pytest.fixture
def generated(rigify, registered):
    """A rig as Rigify generates it."""
    return rigify_rig()[1]


def shown(rig, frames) -> np.ndarray:
    places = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        places.append(read_world_pose(rig)[0])
    return np.array(places)


@pytest.mark.parametrize("limbs", ["IK", "FK"])
def test_a_generated_rig_keyed_by_ik(generated, limbs):
    generated.data.nsm_rig.limbs = "IK"
    walking(generated, 30)
    cut(generated, START, END)
    keyed = {curve.data_path for curve in playing(generated)}
    generated.data.nsm_rig.limbs = limbs
    around = [*range(30, START + 1), *range(END, 70)]
    seen, before = shown(generated, around), outside(generated, START, END)
    bpy.context.scene.frame_set(50)
    done = filled(generated)
    assert done.report["frames"] == END - START - 1 and done.report["shown_off_cm"] < 3
    after = outside(generated, START, END)
    switched = {path for path, _ in before if before[path, _] != after[path, _]}
    assert all('["' in path.rpartition("]")[0].rpartition(".")[2] or "IK_FK" in path for path in switched)
    assert np.abs(shown(generated, around) - seen).max() < 1e-4
    steps = np.linalg.norm(np.diff(shown(generated, range(START, END + 1)), axis=0), axis=-1)
    assert steps.max() < 0.2  # nothing jumps from one kind of control to the other
    new = {curve.data_path for curve in playing(generated)} - keyed
    assert any("_fk" in path for path in new) == (limbs == "FK")
    bpy.context.scene.frame_set(50)
    inside = dict(switches_of(generated))
    bpy.context.scene.frame_set(35)
    assert (inside != dict(switches_of(generated))) == (limbs == "FK")
