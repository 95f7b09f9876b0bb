"""Several characters together in a scene: keyed all or none, told who waits, shown, and put back by ESC."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from modal import Modal, Window
from scenes import furnish

import nsm_blender
from nsm_blender import together
from nsm_blender.animation.channels import transform_of
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.prepare import TakeSpec
from nsm_blender.rigs.character import add_character
from nsm_blender.ui import reviews, running
from nsm_blender.ui.operators.generate_all import NSM_OT_generate_all
from nsm_blender.ui.reviews import takes_of
from nsm_core.errors import GoalError


@pytest.fixture(autouse=True)
def cast():
    """Anna and Ben, each with a queue: both want the chair, and Anna leaves it again."""
    nsm_blender.register()
    scene = bpy.context.scene
    chair, _ = furnish(position=(0.0, -1.6))
    anna, ben = add_character((0.3, 0.0, 0.0)), add_character((1.8, -0.2, 0.0))
    anna.name, ben.name = "Anna", "Ben"
    for character, goals in (
        (anna, [("sit", chair, None), ("walk", None, (-1.8, 0.0, 0.0))]),
        (ben, [("sit", chair, None)]),
    ):
        for action, target, place in goals:
            row = character.nsm_queue.goals.add()
            row.action, row.object, row.hold = action, target, 0.2
            row.location = place or (0.0, 0.0, 0.0)
    scene.nsm.character = anna
    yield anna, ben
    running.end_take()
    nsm_blender.unregister()


def as_it_is() -> dict[str, object]:
    poses = [transform_of(bone) for o in bpy.data.objects if o.type == "ARMATURE" for bone in o.pose.bones]
    return {"poses": poses, "places": {o.name: transform_of(o) for o in bpy.data.objects},
            "actions": [a.name for a in bpy.data.actions]}  # fmt: skip


def test_all_are_generated_in_one_step_and_it_is_told_who_waits(cast):
    anna, ben = cast
    assert bpy.ops.nsm.generate_all() == {"FINISHED"}
    scene = bpy.context.scene
    told = [line.text for line in scene.nsm.results]
    assert any(t.startswith("Anna: Chair: sat down") for t in told)
    assert any(t.startswith("Ben: Chair: sat down") for t in told)
    assert any(t.startswith("Ben waits ") and t.endswith("for Anna at Chair") for t in told), told
    assert anna.animation_data.action != ben.animation_data.action
    for character in cast:  # each has a take to accept or to reject
        scene.nsm.character = character
        assert len(takes_of(scene)) == 1 and bpy.ops.nsm.take_reject.poll()
    heads = []
    for frame in range(1, 400, 10):
        scene.frame_set(frame)
        heads.append([np.array(c.matrix_world @ c.pose.bones["Hips"].head) for c in cast])
    apart = np.linalg.norm(np.diff(np.array(heads), axis=1)[:, 0, :2], axis=1)
    assert apart.min() > 0.4, "nobody goes through another"


def test_escape_puts_all_back(cast):
    before, modal = as_it_is(), Modal(Window(bpy.context.scene), NSM_OT_generate_all)
    modal._start(modal.window)
    still = [transform_of(c.pose.bones["LeftKnee"]) for c in cast]
    while any(transform_of(c.pose.bones["LeftKnee"]) == s for c, s in zip(cast, still, strict=True)):
        assert modal.event("TIMER") == {"RUNNING_MODAL"}  # until both are shown to walk
    assert modal.event("ESC") == {"CANCELLED"}
    assert as_it_is() == before and running.current() is None


def idle(cast) -> None:
    """Leave each of the cast one goal, to stand, which takes no time to make."""
    for character in cast:
        while len(character.nsm_queue.goals) > 1:
            character.nsm_queue.goals.remove(1)
        character.nsm_queue.goals[0].action = "idle"


def test_one_that_cannot_be_keyed_leaves_none_keyed(cast, monkeypatch):
    keyed, count = together.key_and_check, []

    def fails(spec, *given):
        count.append(spec.character.name)
        if len(count) == 2:
            raise GoalError("The second one fails.")
        return (yield from keyed(spec, *given))

    monkeypatch.setattr(together, "key_and_check", fails)
    idle(cast)
    before = as_it_is()
    with pytest.raises(RuntimeError, match="Ben: The second one fails"):
        bpy.ops.nsm.generate_all()
    assert count == ["Anna", "Ben"] and as_it_is() == before


def test_one_that_cannot_be_listed_leaves_none_keyed(cast, monkeypatch):
    real = reviews.note

    def fails_for_ben(row, target, *given):
        if target.name == "Ben":
            raise GoalError("The list is full.")
        real(row, target, *given)

    monkeypatch.setattr(reviews, "note", fails_for_ben)
    idle(cast)
    before = as_it_is()
    with pytest.raises(RuntimeError, match="The list is full"):
        bpy.ops.nsm.generate_all()
    assert as_it_is() == before and not len(bpy.context.scene.nsm.takes)


def test_why_all_cannot_be_generated(cast):
    anna, ben = cast
    ben.nsm_queue.goals[0].object = None
    assert running.reason_no_cast(bpy.context) == (
        "Ben: A goal to sit has no object; choose one, or remove the goal."
    )
    ben.nsm_queue.goals[0].enabled = False
    assert "Fewer than two characters" in running.reason_no_cast(bpy.context)
    assert not bpy.ops.nsm.generate_all.poll()
    goals = [GoalSpec("idle")]
    with pytest.raises(GoalError, match="Anna is asked for twice"):
        together.GroupSpec([TakeSpec(anna, goals), TakeSpec(anna, goals)])
    with pytest.raises(GoalError, match="the same start frame"):
        together.GroupSpec([TakeSpec(anna, goals), TakeSpec(ben, goals, start_frame=5)])
