"""Whatever happens while a take grows: what still exists is put back, nothing counts as running, one sentence
says why.
"""

from __future__ import annotations

import bpy
import pytest
from modal import Modal, Window
from scenes import box, empty

import nsm_blender
from nsm_blender.animation.channels import channels_of, transform_of
from nsm_blender.keys.preview import Preview
from nsm_blender.rigs.character import add_character
from nsm_blender.ui import running
from nsm_blender.ui.operators import modal as operator
from nsm_blender.ui.operators.generate import spec_of
from nsm_blender.ui.properties import queue_of
from nsm_blender.ui.session import TakeSession
from nsm_core.errors import NsmError


@pytest.fixture
def modal():
    """The modal operator in a scene where a character is to carry a box to a table, from a pose that is not
    keyed.
    """
    nsm_blender.register()
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    character = add_character((0, 0, 0))
    people = bpy.data.collections.new("People")
    scene.collection.children.link(people)
    character.users_collection[0].objects.unlink(character)
    people.objects.link(character)
    carried, table = (
        box("Box", (0.25, -1.35, 0), (0.55, -1.1, 0.3)),
        box("Table", (1.0, -1.6, 0), (1.7, -0.9, 0.72)),
    )
    empty("Bystander", (5, 5, 0))
    character.pose.bones["LeftElbow"].rotation_quaternion = (0.8, 0.6, 0, 0)
    character.pose.bones["Chest"].location = (0, 0.05, 0)
    row = scene.nsm.goals.add()
    row.action, row.object, row.destination, row.hold = "carry", carried, table, 0.2
    scene.nsm.character = character
    scene.frame_set(7)
    yield Modal(Window(scene))
    running.end_take()
    nsm_blender.unregister()


def as_it_is() -> dict[str, object]:
    """What a take may disturb, of all that exists, in values that can be compared."""
    poses = [transform_of(bone) for o in bpy.data.objects if o.type == "ARMATURE" for bone in o.pose.bones]
    places = {o.name: transform_of(o) for o in bpy.data.objects}
    return {"poses": poses, "places": places, "actions": [a.name for a in bpy.data.actions]}


def grow(modal: Modal, moment: str) -> None:
    """Bring a take to a moment: "begun" before its first tick, "reading" after it, "growing" when a pose is
    shown.
    """
    assert modal._start(modal.window) == {"RUNNING_MODAL"}
    if moment != "begun":
        modal.event("TIMER")
    while moment == "growing" and not modal._session._shown:
        assert modal.event("TIMER") == {"RUNNING_MODAL"}


def settled(modal: Modal, words: str) -> None:
    """The take must have ended with one sentence that holds ``words``, and the panel must work."""
    assert running.current() is None and modal.window.timers == 0 and modal.window.status is None
    level, sentence = modal.reports[-1]
    assert level == {"ERROR"} and words in sentence and sentence.endswith(".") and "\n" not in sentence, (
        sentence
    )
    assert "being generated" not in running.reason_not_ready(bpy.context)
    assert any(sentence == line.text for line in bpy.context.scene.nsm.results)


def in_edit_mode(change=lambda bones: None):
    bpy.context.view_layer.objects.active = bpy.data.objects["Character"]
    bpy.ops.object.mode_set(mode="EDIT")
    change(bpy.data.objects["Character"].data.edit_bones)


def without_a_bone():
    in_edit_mode(lambda bones: bones.remove(bones["LeftToe"]))
    bpy.ops.object.mode_set(mode="OBJECT")


def other_scene():
    bpy.context.window.scene = bpy.data.scenes.new("Other")


def without_the_scene():
    bpy.data.scenes.new("Other")
    bpy.data.scenes.remove(bpy.context.scene)


def other_armature():
    bpy.data.objects["Character"].data = bpy.data.objects["Character"].data.copy()


STOPPING = {
    "character deleted": (
        lambda: bpy.data.objects.remove(bpy.data.objects["Character"]),
        "Character was deleted",
    ),
    "armature deleted": (
        lambda: bpy.data.armatures.remove(bpy.data.objects["Character"].data),
        "Character was deleted",
    ),
    "armature exchanged": (other_armature, "another armature"),
    "collection deleted": (
        lambda: bpy.data.collections.remove(bpy.data.collections["People"]),
        "taken out of the scene",
    ),
    "edit mode": (in_edit_mode, "Edit Mode"),
    "bone deleted": (without_a_bone, "The bone LeftToe"),
    "bone renamed": (
        lambda: setattr(bpy.data.objects["Character"].data.bones["LeftKnee"], "name", "Knie"),
        "The bone LeftKnee",
    ),
    "box deleted": (
        lambda: bpy.data.objects.remove(bpy.data.objects["Box"]),
        "Box, a goal of the take, was deleted",
    ),
    "box's mesh deleted": (
        lambda: bpy.data.meshes.remove(bpy.data.objects["Box"].data),
        "Box, a goal of the take, was deleted",
    ),
    "table deleted": (
        lambda: bpy.data.objects.remove(bpy.data.objects["Table"]),
        "Table, a goal of the take, was deleted",
    ),
    "all objects deleted": (lambda: bpy.data.batch_remove(list(bpy.data.objects)), "Character was deleted"),
    "scene deleted": (without_the_scene, "The scene Scene was deleted"),
    "another scene": (other_scene, "Another scene"),
}
HARMLESS = {
    "world deleted": lambda: bpy.data.worlds.remove(bpy.data.worlds["World"]),
    "others deleted": lambda: bpy.data.objects.remove(bpy.data.objects["Bystander"]),
    "body deleted": lambda: bpy.data.objects.remove(bpy.data.objects["Character"].children[0]),
    "objects renamed": lambda: [setattr(o, "name", f"{o.name} renamed") for o in list(bpy.data.objects)],
    "scene renamed": lambda: setattr(bpy.context.scene, "name", "Shot 7"),
    "character hidden": lambda: bpy.data.objects["Character"].hide_set(True),
    "another frame": lambda: bpy.context.scene.frame_set(100),
}


@pytest.mark.parametrize("moment", ["begun", "reading", "growing"])
@pytest.mark.parametrize("what", STOPPING)
def test_a_take_that_loses_what_it_needs_ends_in_a_sentence(modal, what, moment):
    before = as_it_is()
    grow(modal, moment)
    change, words = STOPPING[what]
    change()
    assert modal.event("TIMER") == {"CANCELLED"}
    settled(modal, words)
    after = as_it_is()
    assert after["actions"] == [] and all(
        before["places"][name] == place for name, place in after["places"].items()
    )
    if what != "bone deleted":
        assert after["poses"] == before["poses"][: len(after["poses"])]
    if what != "scene deleted":
        assert bpy.data.scenes["Scene"].frame_current == 7


@pytest.mark.parametrize("stage", ["Making keys", "Checking"])
@pytest.mark.parametrize(
    "what",
    [what for what in STOPPING if "box" not in what and "table" not in what] + ["undo", "window closed"],
)
def test_a_take_that_loses_what_it_needs_while_it_is_keyed_leaves_no_half(modal, what, stage):
    row = queue_of(bpy.context.scene).goals[0]
    row.action, row.hold = "idle", 0.0
    bpy.ops.ed.undo_push(message="laid out")
    bpy.data.objects["Bystander"].location.x = 6
    bpy.ops.ed.undo_push(message="moved")
    before = as_it_is()
    grow(modal, "reading")
    steps = modal._session._steps
    while next(steps).stage != stage:  # finer than ticks
        pass
    modal._session._others.left()  # as after each of these
    assert bpy.data.objects["Character"].animation_data.action is not None
    if what == "window closed":
        modal.cancel(modal.window)
    elif what == "undo":
        bpy.ops.ed.undo()
    else:
        STOPPING[what][0]()
        assert modal.event("TIMER") == {"CANCELLED"}
        settled(modal, STOPPING[what][1])
    assert running.current() is None and modal.window.timers == 0 and modal.window.status is None
    after = as_it_is()
    assert after["actions"] == [] and bpy.data.scenes[0].name in ("Scene", "Other")
    if what != "bone deleted":
        assert after["poses"] == before["poses"][: len(after["poses"])]
    if what != "undo":
        assert all(before["places"][name] == place for name, place in after["places"].items())


@pytest.mark.parametrize("what", HARMLESS)
def test_what_a_take_does_not_need_may_go_meanwhile(modal, what):
    before = as_it_is()
    grow(modal, "growing")
    HARMLESS[what]()
    for _ in range(3):
        assert modal.event("TIMER") == {"RUNNING_MODAL"}
    assert modal.event("ESC") == {"CANCELLED"}
    assert running.current() is None and modal.window.timers == 0 and modal.window.status is None
    after = as_it_is()
    assert after["poses"] == before["poses"]
    assert bpy.context.scene.frame_current == (100 if what == "another frame" else 7)
    assert list(after["places"].values()) == [
        p for n, p in before["places"].items() if n in after["places"] or what == "objects renamed"
    ]


def posed():
    bpy.data.objects["Character"].pose.bones["Head"].rotation_quaternion = (0.6, 0, 0.8, 0)


def moved():
    bpy.data.objects["Box"].location.x = 0.3


@pytest.mark.parametrize("change", [posed, moved])
def test_what_others_move_while_a_take_grows_stays_where_they_moved_it(modal, change):
    before = as_it_is()
    change()
    with_it = as_it_is()
    assert with_it != before
    bpy.data.objects["Box"].location.x = 0
    bpy.data.objects["Character"].pose.bones["Head"].rotation_quaternion = (1, 0, 0, 0)
    assert as_it_is() == before
    grow(modal, "growing")
    change()
    assert modal.event("TIMER") == {"CANCELLED"}
    settled(modal, "was moved or posed meanwhile")
    assert as_it_is() == with_it


def keyed_by_a_script():
    head = bpy.data.objects["Character"].pose.bones["Head"]
    head.rotation_quaternion = (0.6, 0, 0.8, 0)
    head.keyframe_insert("rotation_quaternion", frame=20)


def with_an_action_of_a_script():
    bpy.data.objects["Character"].animation_data.action = bpy.data.actions.new("Theirs")


def while_it_is_keyed(modal, monkeypatch):
    """Bring a short take, in ticks of one step, to where its keys are made."""
    monkeypatch.setattr(operator, "_BUDGET", 0.0)
    row = queue_of(bpy.context.scene).goals[0]
    row.action, row.hold = "idle", 0.0
    grow(modal, "reading")
    while not running.current().text.startswith("Making keys"):
        assert modal.event("TIMER") == {"RUNNING_MODAL"}
    assert bpy.data.objects["Character"].animation_data.action is not None


@pytest.mark.parametrize("change", [keyed_by_a_script, with_an_action_of_a_script])
def test_what_a_script_animates_while_a_take_is_keyed_stays_alone(modal, monkeypatch, change):
    while_it_is_keyed(modal, monkeypatch)
    ours = bpy.data.objects["Character"].animation_data.action.name
    change()
    assert modal.event("TIMER") == {"CANCELLED"}
    settled(modal, "Character were made" if change is keyed_by_a_script else "The animation of Character")
    action = bpy.data.objects["Character"].animation_data.action
    assert action is not None and list(bpy.data.actions) == [action] and action.name != ours
    keys = [
        (curve.data_path, curve.array_index, key.co.x, round(key.co.y, 5))
        for curve in channels_of(bpy.data.objects["Character"]).bag.fcurves
        for key in curve.keyframe_points
    ] if change is keyed_by_a_script else []  # fmt: skip
    path = 'pose.bones["Head"].rotation_quaternion'
    wanted = [(path, i, 20, value) for i, value in enumerate((0.6, 0, 0.8, 0))]
    assert keys == (wanted if change is keyed_by_a_script else [])


@pytest.mark.parametrize("animated", [False, True])
def test_a_file_saved_while_a_take_is_keyed_holds_nothing_of_it(modal, monkeypatch, tmp_path, animated):
    if animated:
        bpy.data.objects["Character"].pose.bones["Head"].keyframe_insert("location", frame=1)
    old = [*bpy.data.actions]
    before = as_it_is()
    while_it_is_keyed(modal, monkeypatch)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "meanwhile.blend"), copy=True)
    while (state := modal.event("TIMER")) == {"RUNNING_MODAL"}:
        pass
    assert state == {"FINISHED"}  # and the take goes on
    played = bpy.data.objects["Character"].animation_data.action
    assert played not in old and {*bpy.data.actions} == {played, *old}
    assert all(action.use_fake_user for action in old)  # or it would be lost with the file's next save
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "meanwhile.blend"))
    assert as_it_is() == before


@pytest.mark.parametrize("moment", ["begun", "reading", "growing"])
@pytest.mark.parametrize("again", [False, True], ids=["undo", "redo"])
def test_an_undo_from_another_window_ends_the_take(modal, again, moment):
    bpy.ops.ed.undo_push(message="laid out")
    bpy.data.objects["Bystander"].location.x = 6
    bpy.ops.ed.undo_push(message="moved")
    if bpy.ops.ed.undo.poll() is False or (again and bpy.ops.ed.undo() != {"FINISHED"}):
        pytest.skip("this build keeps no undo steps without a window")
    modal = Modal(Window(bpy.context.scene))
    before = as_it_is()
    grow(modal, moment)
    (bpy.ops.ed.redo if again else bpy.ops.ed.undo)()
    assert running.current() is None and modal.window.timers == 0 and modal.window.status is None
    line = bpy.context.scene.nsm.results[0].text
    assert ("done again" if again else "undone") in line
    assert "CANCELLED" in modal.event("MOUSEMOVE")  # what Blender still has of it ends with the next event
    settled(modal, line)
    after = as_it_is()
    assert after["poses"] == before["poses"] and after["places"]["Box"] == before["places"]["Box"]
    assert bpy.data.objects["Bystander"].location.x == (6 if again else 5)


@pytest.mark.parametrize("moment", ["begun", "reading", "growing"])
def test_another_file_ends_the_take(modal, moment):
    grow(modal, moment)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert running.current() is None and modal.window.timers == 0 and modal.window.status is None
    modal.cancel(modal.window)  # as Blender does with the operators of windows that go
    assert (
        "no longer" not in running.reason_not_ready(bpy.context) and len(bpy.context.scene.nsm.results) == 0
    )


@pytest.mark.parametrize("moment", ["begun", "reading", "growing"])
def test_switching_the_add_on_off_ends_the_take(modal, moment):
    before = as_it_is()
    grow(modal, moment)
    nsm_blender.unregister()
    assert running.current() is None and modal.window.timers == 0 and modal.window.status is None
    assert as_it_is() == before
    nsm_blender.register()
    assert running.reason_not_ready(bpy.context) == ""


def test_a_closed_window_ends_the_take(modal):
    before = as_it_is()
    grow(modal, "growing")
    modal.cancel(modal.window)
    modal.cancel(modal.window)
    assert running.current() is None and modal.window.timers == 0 and as_it_is() == before


@pytest.mark.parametrize(
    "error", [KeyError("Hips"), MemoryError(), ZeroDivisionError("0")], ids=lambda e: type(e).__name__
)
def test_an_error_in_the_preview_ends_the_take(modal, monkeypatch, error):
    before = as_it_is()
    grow(modal, "growing")

    def show(*_args):
        bpy.data.objects["Box"].location.x += 1
        raise error

    monkeypatch.setattr(Preview, "show", show)
    while (state := modal.event("TIMER")) == {"RUNNING_MODAL"}:
        pass
    assert state == {"CANCELLED"}
    settled(modal, type(error).__name__)
    assert as_it_is() == before


def test_a_file_saved_meanwhile_holds_the_animators_pose(modal, tmp_path):
    before = as_it_is()
    grow(modal, "growing")
    assert as_it_is() != before
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "meanwhile.blend"), copy=True)
    assert modal.event("TIMER") == {"RUNNING_MODAL"}  # and the take goes on
    modal.event("ESC")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "meanwhile.blend"))
    assert as_it_is() == before


def test_one_take_at_a_time_and_none_after_its_end(modal):
    grow(modal, "reading")
    session = modal._session
    with pytest.raises(NsmError, match="being generated"):
        TakeSession(spec_of(bpy.context.scene), bpy.context.scene)
    assert running.current() is not None
    modal.event("ESC")
    with pytest.raises(NsmError, match="cancelled"):
        session.tick(0.1)
