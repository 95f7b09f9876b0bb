"""States in which animators keep their files, that a take may not disturb or must refuse in a sentence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy

from nsm_blender.animation.channels import curves_in
from nsm_blender.ui.properties import queue_of


def _hero() -> bpy.types.Object:
    return bpy.data.objects["Hero"]


def _curves():
    data = _hero().animation_data
    return curves_in(data.action, getattr(data, "action_slot", None))


def _linked(names: tuple[str, ...]) -> None:
    """Exchange objects for links to the file in which this room is saved."""
    library = bpy.data.filepath
    roles = [(n, bpy.data.objects[n].users_collection[0]) for n in names]
    chosen = bpy.context.scene.nsm.character.name
    rows = [
        (g.action, g.hold, *(o and o.name for o in (g.object, g.destination)))
        for g in queue_of(bpy.context.scene).goals
    ]
    for name in names:
        bpy.data.objects.remove(bpy.data.objects[name])
    for unused in (bpy.data.actions, bpy.data.armatures):
        for each in [b for b in unused if not b.users]:
            unused.remove(each)
    # A file cannot link from itself.
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(library).with_suffix(".links.blend")))
    with bpy.data.libraries.load(library, link=True) as (_, wanted):
        wanted.objects = list(names)
    for linked, (_, collection) in zip(wanted.objects, roles, strict=True):
        collection.objects.link(linked)
    scene = bpy.context.scene
    scene.nsm.character = scene.objects[chosen]
    goals = queue_of(scene).goals  # a linked character has none of its own
    goals.clear()
    for action, hold, what, to in rows:
        goal = goals.add()
        goal.action, goal.hold = action, hold
        goal.object, goal.destination = scene.objects.get(what), scene.objects.get(to)
    bpy.context.view_layer.objects.active = scene.nsm.character
    bpy.context.view_layer.update()


def _overridden(name: str) -> None:
    _linked((name,))
    scene, linked = bpy.context.scene, bpy.data.objects[name]
    made = linked.override_create(remap_local_usages=True)
    if made.data is not None:
        made.data = made.data.override_create(remap_local_usages=True) or made.data
    if scene.nsm.character == linked:
        scene.nsm.character = made
    if made.name not in scene.objects:
        scene.collection.objects.link(made)
    for goal in queue_of(scene).goals:  # a character's come with it, and tell of its own file
        for role in ("object", "destination"):
            meant = getattr(goal, role)
            if meant is not None:
                setattr(goal, role, scene.objects.get(meant.name))
    bpy.context.view_layer.update()


def _muted() -> None:
    for curve in _curves():
        curve.mute = True


def _locked() -> None:
    for curve in _curves():
        curve.lock = True
        if curve.group is not None:
            curve.group.lock = True


def _tweak() -> None:
    data = _hero().animation_data
    track = data.nla_tracks.new()
    strip = track.strips.new("below", 1, data.action)
    data.action = None
    track.select = strip.select = True
    data.nla_tracks.active = track
    data.use_tweak_mode = True


def _strips() -> None:
    data = _hero().animation_data
    track = data.nla_tracks.new()
    track.strips.new("below", 40, data.action)


def _solo() -> None:
    _strips()
    _hero().animation_data.nla_tracks[0].is_solo = True


def _transforms_locked() -> None:
    _hero().lock_location = _hero().lock_rotation = (True, True, True)
    for bone in _hero().pose.bones:
        bone.lock_location = bone.lock_rotation = (True, True, True)
    bpy.data.objects["Box"].lock_location = (True, True, True)


def _shared_action() -> None:
    other = bpy.data.objects.new("Double", _hero().data)
    bpy.context.scene.collection.objects.link(other)
    data = other.animation_data_create()
    data.action = _hero().animation_data.action
    if hasattr(data, "action_slot"):
        data.action_slot = _hero().animation_data.action_slot


def _linked_action() -> None:
    """The character's own old action comes from another file."""
    library = bpy.data.filepath
    action = _hero().animation_data.action
    _hero().animation_data.action = None
    bpy.data.actions.remove(action)
    bpy.ops.wm.save_as_mainfile(filepath=str(Path(library).with_suffix(".links.blend")))
    with bpy.data.libraries.load(library, link=True) as (_, wanted):
        wanted.actions = ["Old"]
    data = _hero().animation_data
    data.action = wanted.actions[0]
    if hasattr(data, "action_slot"):
        data.action_slot = data.action.slots[0]
    bpy.context.view_layer.update()


def _other_rate() -> None:
    bpy.context.scene.render.fps, bpy.context.scene.render.fps_base = 24, 1.001


def _negative_start() -> None:
    bpy.context.scene.nsm.start_frame = -20


def _pose_mode() -> None:
    bpy.context.view_layer.objects.active = _hero()
    bpy.ops.object.mode_set(mode="POSE")


def _edit_mode() -> None:
    bpy.context.view_layer.objects.active = _hero()
    bpy.ops.object.mode_set(mode="EDIT")


def _auto_keys() -> None:
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = True


def _no_camera() -> None:
    bpy.data.objects.remove(bpy.data.objects["Camera"])


def _parented() -> None:
    cart = bpy.data.objects["Bystander"]
    cart.driver_remove("scale", 0)
    cart.scale = (1, 1, 1)
    _hero().parent = bpy.data.objects["Box"].parent = cart
    cart.location = (0, 0, 0)
    cart.animation_data_clear()
    bpy.context.view_layer.update()


def _read_only_file() -> None:
    Path(bpy.data.filepath).chmod(0o444)


STATES: dict[str, Callable[[], None]] = {
    "as it comes": lambda: None,
    "scene without a camera": _no_camera,
    "linked character": lambda: _linked(("Hero",)),
    "overridden character": lambda: _overridden("Hero"),
    "linked box": lambda: _linked(("Box",)),
    "overridden box": lambda: _overridden("Box"),
    "linked table": lambda: _linked(("Table",)),
    "linked action": _linked_action,
    "muted channels": _muted,
    "locked channels": _locked,
    "locked transforms": _transforms_locked,
    "NLA tweak mode": _tweak,
    "NLA strips": _strips,
    "NLA solo": _solo,
    "action of two characters": _shared_action,
    "auto keying": _auto_keys,
    "23.976 frames a second": _other_rate,
    "start before frame 0": _negative_start,
    "Pose Mode": _pose_mode,
    "Edit Mode": _edit_mode,
    "parents": _parented,
    "read-only file": _read_only_file,
}
