"""Takes that were made together: what one has moved stays as long as another acts with it."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

import nsm_blender
from nsm_blender.keys.keying import key_take, key_things
from nsm_blender.keys.objects import MovedObject
from nsm_blender.rigs.armature import build_armature
from nsm_blender.rigs.mount import last
from nsm_blender.ui import reviews
from nsm_blender.world.frame import WorldFrame
from nsm_core.body.skeleton import J

FRAMES = 20


@pytest.fixture
def scene():
    """Anna, who pushes a box that has keys of the animator's own, and Ben."""
    nsm_blender.register()
    scene = bpy.context.scene
    scene.render.fps = 30
    scene.nsm.character = build_armature("Anna")
    build_armature("Ben")
    box = bpy.data.objects.new("Box", bpy.data.meshes.new("Box"))
    scene.collection.objects.link(box)
    box.location.x = 5
    box.keyframe_insert("location", frame=1)
    box.animation_data.action.name = "Mine"
    yield scene
    nsm_blender.unregister()


class _Prop:
    name, pose = "Box", np.array((5.0, 0, 0, 0))


def keyed(name: str, box: float = 0.0):
    rotations = np.zeros((FRAMES, J, 4))
    rotations[..., 0] = 1
    hips = np.column_stack((np.linspace(0, 1, FRAMES), np.zeros(FRAMES), np.full(FRAMES, 0.97)))
    take = key_take(bpy.data.objects[name], hips, rotations, 1, 30, f"{name} acts", bpy.context.scene)
    if box:
        thing = MovedObject.of(bpy.data.objects["Box"], WorldFrame(), _Prop)
        poses = _Prop.pose + np.linspace(0, box, FRAMES)[:, None] * (1, 0, 0, 0)
        last(key_things(take, [(thing, poses)], 30, f"{name} acts", bpy.context.scene))
    return take


def made_together() -> None:
    made = [(keyed("Anna", box=1.0), 0), (keyed("Ben"), 1)]
    reviews.remember_all(bpy.context.scene, made, together=True)


def box_at(frame: int) -> float:
    bpy.context.scene.frame_set(frame)
    return round(bpy.data.objects["Box"].matrix_world.translation.x, 3)


def actions() -> set[str]:
    return {action.name for action in bpy.data.actions}


def test_what_one_moved_stays_until_the_last_of_them_is_rejected(scene):
    made_together()
    assert box_at(20) == 6.0
    told = reviews.reject(scene, scene.nsm.takes[0])
    assert told == "Box keeps its keys for Ben, whose take was made together with this one."
    assert box_at(20) == 6.0 and actions() == {"Mine", "Ben acts", "Anna acts Box"}
    assert bpy.data.objects["Anna"].animation_data.action is None
    assert reviews.reject(scene, scene.nsm.takes[0]) == ""
    assert box_at(20) == 5.0 and actions() == {"Mine"}
    assert bpy.data.objects["Box"].animation_data.action.name == "Mine"


def test_another_take_of_one_alone_leaves_the_others_their_things(scene):
    made_together()
    reviews.remember(scene, keyed("Anna"))
    assert [t.character.object.name for t in scene.nsm.takes] == ["Ben", "Anna"]
    assert box_at(20) == 6.0 and "Anna acts Box" in actions()
    reviews.reject(scene, scene.nsm.takes[1])  # a take by itself takes nothing of theirs along
    assert box_at(20) == 6.0
    scene.nsm.character = bpy.data.objects["Ben"]
    reviews.remember(scene, keyed("Ben"))  # as made: what was handed on is no edit of the animator's
    assert box_at(20) == 5.0 and actions() == {"Mine", "Ben acts.001"}


def test_takes_by_themselves_take_their_things_along(scene):
    reviews.remember(scene, keyed("Anna", box=1.0))
    reviews.remember(scene, keyed("Ben"))
    assert reviews.reject(scene, scene.nsm.takes[0]) == "" and box_at(20) == 5.0


def test_of_takes_made_together_all_are_listed_or_none(scene, monkeypatch):
    reviews.remember(scene, keyed("Anna"))
    older, made = actions(), [(keyed("Anna", box=1.0), 0), (keyed("Ben"), 1)]
    real = reviews.checksum

    def fails_for_ben(take):
        if take.armature.name == "Ben":
            raise RuntimeError("injected")
        return real(take)

    monkeypatch.setattr(reviews, "checksum", fails_for_ben)
    with pytest.raises(RuntimeError, match="injected"):
        reviews.remember_all(scene, made, together=True)
    assert len(scene.nsm.takes) == 1 and older < actions(), "what it would have replaced is still there"
    assert scene.nsm.takes[0].character.action.name in older
