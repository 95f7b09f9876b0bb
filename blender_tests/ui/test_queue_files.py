"""Queues that are kept, the example scene, and the preferences."""

from __future__ import annotations

import types

import bpy
import pytest
from drawn import Layout
from scenes import box, empty

import nsm_blender
from nsm_blender import user_folder
from nsm_blender.ui import lookout, overlays, preferences, queue_files
from nsm_blender.ui.goals_panel import NSM_MT_queues
from nsm_blender.ui.operators.generate import spec_of
from nsm_blender.ui.queue import queue_of


@pytest.fixture(autouse=True)
def settings(tmp_path, monkeypatch):
    nsm_blender.register()
    monkeypatch.setattr(user_folder, "user_folder", lambda kind: tmp_path / kind)
    yield bpy.context.scene.nsm
    nsm_blender.unregister()


def fill(queue):
    crate, table = box("Crate", (0, 0, 0), (0.3, 0.3, 0.3)), box('Table "big"', (2, 0, 0), (3, 1, 0.7))
    row = queue.goals.add()
    row.object, row.action, row.destination, row.hold, row.enabled = crate, "carry", table, 1.25, False
    row = queue.goals.add()
    row.action, row.location = "run", (1.0, -2.5, 0.0)


def rows(queue):
    return [
        (r.action, r.object, r.destination, round(r.hold, 4), r.enabled, tuple(r.location))
        for r in queue.goals
    ]


def test_a_queue_is_kept_and_found_again(settings):
    scene = bpy.context.scene
    assert not bpy.ops.nsm.queue_save.poll()
    fill(queue_of(scene))
    before = rows(queue_of(scene))
    assert bpy.ops.nsm.queue_save(name="Evening scene") == {"FINISHED"}
    queue_of(scene).goals.clear()
    queue_of(scene).goals.add().action = "idle"
    (name,) = queue_files.saved()
    assert bpy.ops.nsm.queue_load(name=name) == {"FINISHED"}
    assert rows(queue_of(scene)) == before
    menu = types.SimpleNamespace(layout=Layout())
    NSM_MT_queues.draw(menu, bpy.context)
    assert name in menu.layout.seen and f"Delete {name}" in menu.layout.seen
    bpy.ops.nsm.queue_delete(name=name)
    assert queue_files.saved() == []
    with pytest.raises(RuntimeError, match="There is no queue called"):
        bpy.ops.nsm.queue_load(name=name)


def test_what_another_scene_lacks_is_named_and_its_goal_is_kept(settings):
    scene = bpy.context.scene
    fill(queue_of(scene))
    bpy.ops.nsm.queue_save(name="q")
    bpy.data.objects.remove(bpy.data.objects["Crate"])
    missing = queue_files.load_queue(queue_files.path_of("q"), queue_of(scene), scene)
    assert missing == ["Crate"]
    first, second = queue_of(scene).goals
    assert first.object is None and first.destination.name == 'Table "big"' and first.action == "carry"
    assert second.action == "run"


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ('action = "fly"', "action cannot be 'fly'"),
        ("hold = -1", "hold cannot be -1"),
        ("location = [1, 2]", "location cannot be"),
        ('wings = "two"', "'wings' is not known"),
        ("object = 3", "object"),
        ("enabled = 1", "enabled cannot be 1"),
    ],
)
def test_a_wrong_file_is_told_and_changes_nothing(settings, tmp_path, entry, told):
    scene = bpy.context.scene
    fill(queue_of(scene))
    before = rows(queue_of(scene))
    path = queue_files.path_of("q")
    path.parent.mkdir()
    path.write_text(f'[[goal]]\naction = "idle"\n[[goal]]\n{entry}\n', encoding="utf-8")
    with pytest.raises(RuntimeError, match="q.toml: goal 2") as raised:
        bpy.ops.nsm.queue_load(name="q")
    assert told in str(raised.value) and rows(queue_of(scene)) == before
    path.write_text("nonsense", encoding="utf-8")
    with pytest.raises(RuntimeError, match="not valid TOML"):
        bpy.ops.nsm.queue_load(name="q")
    assert rows(queue_of(scene)) == before


def test_names_are_needed_and_made_fit_for_files(settings):
    fill(queue_of(bpy.context.scene))
    with pytest.raises(RuntimeError, match="needs a name"):
        bpy.ops.nsm.queue_save(name="  ")
    bpy.ops.nsm.queue_save(name="../up/and: away")
    assert len(queue_files.saved()) == 1
    assert [p.parent for p in queue_files.folder().glob("*")] == [queue_files.folder()]


def test_the_example_leaves_the_animators_scene_alone(settings):
    mine, chair = bpy.context.scene, empty("Chair", (5, 5, 5))
    names = [o.name for o in mine.objects]
    assert bpy.ops.nsm.example() == {"FINISHED"}
    example = bpy.context.window_manager.windows[0].scene
    assert example != mine and [o.name for o in mine.objects] == names
    with bpy.context.temp_override(scene=example):
        spec = spec_of(example)
        assert [g.action for g in spec.goals] == ["sit", "open", "carry", "climb", "run"]
        needed = [o for g in spec.goals for o in (g.object, g.to) if o is not None]
        assert all(o.name in example.objects and o != chair for o in needed)
        assert spec.character.name in example.objects
        lookout.look_now(example)
        queue = queue_of(example).goals
        assert [lookout.told_of(example, i, row).problem for i, row in enumerate(queue)] == [""] * 5


def test_a_new_scene_begins_as_the_preferences_say(settings, monkeypatch):
    chosen = types.SimpleNamespace(
        begin="STAND", contact_ik=False, folder="", overlays={"way"}, show_picked=False,
        keys=types.SimpleNamespace(root_motion="object", reduce=True, reduce_mm=3.0, reduce_degrees=2.0),
    )  # fmt: skip
    monkeypatch.setattr(user_folder, "preferences", lambda: chosen)
    settings.contact_ik = True  # chosen already
    bpy.ops.nsm.add_character()
    assert (settings.begin, settings.contact_ik, settings.keys.root_motion) == ("STAND", True, "object")
    settings.begin = "POSE"
    bpy.ops.nsm.add_character()
    assert settings.begin == "POSE", "what was chosen since stays"
    for layer in overlays.LAYERS:  # whatever was on in this window
        setattr(overlays.toggles(), layer.key, False)
    overlays.switch_on_defaults()
    assert overlays.toggles().way and not overlays.toggles().colliders


def test_preferences_show_all_they_have(settings):
    layout = Layout()
    shown = types.SimpleNamespace(
        layout=layout, keys=bpy.context.scene.nsm.keys, folder="",
        bl_rna=preferences.NsmPreferences.bl_rna,
    )  # fmt: skip
    preferences.NsmPreferences.draw(shown, bpy.context)
    for prop in preferences.NsmPreferences.bl_rna.properties:
        if prop.identifier not in ("rna_type", "bl_idname", "keys"):
            assert prop.name in layout.seen, prop.identifier
    assert preferences.NsmPreferences.bl_idname == "nsm_blender"
