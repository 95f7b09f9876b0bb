"""What people, scripts and other windows do to a file while a take is made of it."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path

import bpy

import nsm_blender
from nsm_blender.ui.properties import queue_of


def _object(name: str) -> bpy.types.Object:
    return bpy.data.objects[name]


def _edit_mode() -> None:
    bpy.context.view_layer.objects.active = _object("Hero")
    bpy.ops.object.mode_set(mode="EDIT")


def _bone_gone() -> None:
    _edit_mode()
    bones = _object("Hero").data.edit_bones
    bones.remove(bones["LeftToe"])
    bpy.ops.object.mode_set(mode="OBJECT")


def _to_scene(name: str) -> None:
    target = _object(name)
    for collection in list(target.users_collection):
        collection.objects.unlink(target)
    bpy.data.scenes["Other"].collection.objects.link(target)
    bpy.context.view_layer.update()


def _other_window_scene() -> None:
    bpy.context.window.scene = bpy.data.scenes["Other"]


def _scene_gone() -> None:
    bpy.data.scenes.remove(bpy.data.scenes["Scene"])


def _undo() -> None:
    bpy.ops.ed.undo()


def _redo() -> None:
    bpy.ops.ed.redo()


def _new_file() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def _reload_file() -> None:
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath)


def _save_copy() -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(bpy.data.filepath).with_suffix(".copy.blend")), copy=True)


def _disable() -> None:
    nsm_blender.unregister()


def _reload_scripts() -> None:
    """What Blender's Reload Scripts does with an add-on: off, its module read anew, on."""
    nsm_blender.unregister()
    importlib.reload(sys.modules["nsm_blender"])
    nsm_blender.register()


def _keys() -> None:
    hero = _object("Hero")
    hero.pose.bones["Head"].rotation_quaternion, hero.location = (0.8, 0, 0.6, 0), (0.1, 0.2, 0)
    _keyed("Head")


def _keyed(bone: str) -> None:
    hero = _object("Hero")
    hero.pose.bones[bone].keyframe_insert("rotation_quaternion", frame=20)
    hero.keyframe_insert("location", frame=3)


def _posed() -> None:
    _object("Hero").pose.bones["Head"].rotation_quaternion = (0.8, 0, 0.6, 0)
    _object("Hero").pose.bones["LeftToe"].location = (0, 0.01, 0)


def _other_action() -> None:
    data = _object("Hero").animation_data_create()
    data.action = bpy.data.actions.new("Theirs")


def _no_animation() -> None:
    _object("Hero").animation_data_clear()


def _same_name() -> None:
    bpy.data.actions.new("carry Box")
    bpy.data.objects.new("Box", None)


def _rate() -> None:
    bpy.context.scene.render.fps = 24


def _queue_cleared() -> None:
    queue_of(bpy.context.scene).goals.clear()


def _other_character() -> None:
    bpy.context.scene.nsm.character = None


def _pose_mode() -> None:
    bpy.context.view_layer.objects.active = _object("Hero")
    bpy.ops.object.mode_set(mode="POSE")


def _selection() -> None:
    for each in bpy.context.view_layer.objects:
        each.select_set(each.name == "Table")
    bpy.context.view_layer.objects.active = _object("Table")


def _purge() -> None:
    bpy.data.orphans_purge(do_recursive=True)


def _constraint() -> None:
    _object("Hero").pose.bones["Chest"].constraints.new("COPY_ROTATION").target = _object("Bystander")


def _renamed(kind: str, old: str) -> Callable[[], None]:
    def rename() -> None:
        getattr(bpy.data, kind)[old].name = f"{old} renamed"

    return rename


_NONE = 1e-12  # below it, Blender keys a zero
AS_SHOWN = "keys made of the pose that is shown"


def shown() -> tuple[tuple[float, ...], ...]:
    """What ``AS_SHOWN`` keys."""
    hero = bpy.data.objects.get("Hero")
    if hero is None:
        return ()
    turn = hero.pose.bones["Chest"].rotation_quaternion
    return tuple(0.0 if abs(number) < _NONE else number for number in turn), tuple(hero.location)


def show(values: tuple[tuple[float, ...], ...]) -> None:
    """Have the character look so that ``AS_SHOWN`` keys these values."""
    hero = _object("Hero")
    hero.pose.bones["Chest"].rotation_quaternion, hero.location = values


EVENTS: dict[str, Callable[[], None]] = {
    "character deleted": lambda: bpy.data.objects.remove(_object("Hero")),
    "character's armature deleted": lambda: bpy.data.armatures.remove(_object("Hero").data),
    "character's armature exchanged": lambda: setattr(_object("Hero"), "data", _object("Hero").data.copy()),
    "character renamed": _renamed("objects", "Hero"),
    "character hidden": lambda: _object("Hero").hide_set(True),
    "character off in viewports": lambda: setattr(_object("Hero"), "hide_viewport", True),
    "character to another scene": lambda: _to_scene("Hero"),
    "character moved": lambda: setattr(_object("Hero"), "location", (0.4, 0.3, 0)),
    "character's body deleted": lambda: bpy.data.objects.remove(_object("Hero").children[0]),
    "character's collection deleted": lambda: bpy.data.collections.remove(bpy.data.collections["People"]),
    "character's collection excluded": lambda: setattr(
        bpy.context.view_layer.layer_collection.children["People"], "exclude", True
    ),
    "box deleted": lambda: bpy.data.objects.remove(_object("Box")),
    "box's mesh deleted": lambda: bpy.data.meshes.remove(_object("Box").data),
    "box renamed": _renamed("objects", "Box"),
    "box hidden": lambda: _object("Box").hide_set(True),
    "box to another scene": lambda: _to_scene("Box"),
    "box moved": lambda: setattr(_object("Box"), "location", (0.1, 0, 0)),
    "box's action deleted": lambda: bpy.data.actions.remove(bpy.data.actions["Old of box"]),
    "table deleted": lambda: bpy.data.objects.remove(_object("Table")),
    "all objects deleted": lambda: bpy.data.batch_remove(list(bpy.data.objects)),
    "bone deleted": _bone_gone,
    "bone renamed": lambda: setattr(_object("Hero").data.bones["LeftKnee"], "name", "Knie"),
    "bone gets a constraint": _constraint,
    "Edit Mode": _edit_mode,
    "Pose Mode": _pose_mode,
    "something else selected": _selection,
    "another frame": lambda: bpy.context.scene.frame_set(100),
    "another scene in the window": _other_window_scene,
    "scene deleted": _scene_gone,
    "scene renamed": _renamed("scenes", "Scene"),
    "world deleted": lambda: bpy.data.worlds.remove(bpy.data.worlds["World"]),
    "camera deleted": lambda: bpy.data.objects.remove(_object("Camera")),
    "scene's rate changed": _rate,
    "undo": _undo,
    "redo": _redo,
    "another file opened": _new_file,
    "same file opened again": _reload_file,
    "file saved": _save_copy,
    "extension disabled": _disable,
    "scripts reloaded": _reload_scripts,
    "character posed": _posed,
    "keys made on the character": _keys,
    AS_SHOWN: lambda: _keyed("Chest"),
    "another action for the character": _other_action,
    "character's animation cleared": _no_animation,
    "character's old action deleted": lambda: bpy.data.actions.remove(bpy.data.actions["Old"]),
    "same names made": _same_name,
    "queue cleared": _queue_cleared,
    "another character chosen": _other_character,
    "unused data purged": _purge,
}

# Events that change nothing of the file by themselves, or put another state of it in its place.
OF_THE_FILE = {
    "undo", "redo", "another file opened", "same file opened again", "extension disabled", "scripts reloaded",
}  # fmt: skip
