"""The queue of goals goes with its character: chosen, saved, undone, duplicated, appended, overridden."""

from __future__ import annotations

import bpy
import pytest
from scenes import box, empty

from nsm_blender.rigs.character import add_character
from nsm_blender.ui import running
from nsm_blender.ui.operators.generate import spec_of
from nsm_blender.ui.properties import queue_of

pytestmark = pytest.mark.usefixtures("settings")


def shown() -> list[str]:
    return [goal.object.name for goal in queue_of(bpy.context.scene).goals]


def ask(name: str, action: str = "walk") -> None:
    row = queue_of(bpy.context.scene).goals.add()
    row.object = bpy.data.objects.get(name) or empty(name, (1.0, 0.0, 0.0))
    row.action, row.hold = action, 3.5


def test_what_was_asked_before_goes_to_the_first_character_alone(settings):
    ask("Mark")
    ask("Door", "open")
    queue_of(bpy.context.scene).goals[0].enabled, settings.active_goal = False, 1
    anna, ben = add_character((0, 0, 0)), add_character((2, 0, 0))
    settings.character = anna
    assert shown() == ["Mark", "Door"] and not len(settings.goals)
    row = queue_of(bpy.context.scene).goals[1]
    assert (row.action, row.hold, row.enabled) == ("open", 3.5, True)
    assert queue_of(bpy.context.scene).active_goal == 1 and len(spec_of(bpy.context.scene).goals) == 1
    settings.character = ben
    assert shown() == [] and "no goal yet" in running.reason_not_ready(bpy.context)
    ask("Chair")
    settings.character = anna
    assert shown() == ["Mark", "Door"]
    settings.character = None
    assert shown() == []
    ask("Later")
    settings.character = ben
    assert shown() == ["Chair"], "one that has goals keeps them"


def test_rows_of_an_earlier_version_are_shown_and_go_over_when_the_file_is_opened(settings, tmp_path):
    settings.character = add_character((0, 0, 0))
    row = settings.goals.add()  # as files have it from before characters had queues
    row.object, row.action = empty("Mark", (1, 0, 0)), "run"
    assert shown() == ["Mark"]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "old.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "old.blend"))
    scene = bpy.context.scene
    assert shown() == ["Mark"] and queue_of(scene).goals[0].action == "run"
    assert not len(scene.nsm.goals) and len(scene.nsm.character.nsm_queue.goals) == 1


def test_one_undo_takes_a_choice_and_its_queue_back(settings):
    ask("Mark")
    anna = add_character((0, 0, 0))
    bpy.ops.ed.undo_push(message="asked")
    settings.character = anna
    bpy.ops.ed.undo_push(message="chosen")
    assert shown() == ["Mark"] and not len(settings.goals)
    if not bpy.ops.ed.undo.poll() or bpy.ops.ed.undo() != {"FINISHED"}:
        pytest.skip("this build keeps no undo steps without a window")
    scene = bpy.context.scene
    assert scene.nsm.character is None and [g.object.name for g in scene.nsm.goals] == ["Mark"]
    bpy.ops.ed.redo()
    assert shown() == ["Mark"] and not len(bpy.context.scene.nsm.goals)


def test_a_duplicate_has_a_queue_of_its_own(settings):
    settings.character = anna = add_character((0, 0, 0))
    ask("Mark")
    ben = anna.copy()
    bpy.context.collection.objects.link(ben)
    settings.character = ben
    assert shown() == ["Mark"]
    ask("Chair")
    assert shown() == ["Mark", "Chair"]
    settings.character = anna
    assert shown() == ["Mark"]


def test_a_character_brings_its_queue_to_another_file(settings, tmp_path):
    settings.character = anna = add_character((0, 0, 0))
    box("Chair", (1, 0, 0), (1.5, 0.5, 0.45))
    ask("Chair", "sit")
    bpy.data.libraries.write(str(tmp_path / "cast.blend"), {anna})
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / "cast.blend")) as (found, taken):
        taken.objects = list(found.objects)
    anna = next(o for o in taken.objects if o.type == "ARMATURE")
    bpy.context.collection.objects.link(anna)
    bpy.context.scene.nsm.character = anna
    assert shown() == ["Chair"]
    with pytest.raises(RuntimeError, match=r"Chair.*scene"):  # it was brought along, but stands nowhere
        bpy.ops.nsm.generate()


def test_the_queue_of_a_library_override_can_be_edited_and_is_kept(settings, tmp_path):
    anna = add_character((0, 0, 0))
    bpy.data.libraries.write(str(tmp_path / "cast.blend"), {anna, empty("Mark", (1, 0, 0))})
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / "cast.blend"), link=True) as (_, taken):
        taken.objects = ["Character"]
    bpy.context.collection.objects.link(taken.objects[0])
    ask("Here")
    bpy.context.scene.nsm.character = taken.objects[0]
    assert shown() == ["Here"] and len(bpy.context.scene.nsm.goals) == 1, "a linked one keeps nothing"
    bpy.context.scene.nsm.character = taken.objects[0].override_create(remap_local_usages=True)
    assert shown() == ["Here"] and not len(bpy.context.scene.nsm.goals)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert shown() == ["Here"] and queue_of(bpy.context.scene).goals[0].hold == 3.5
