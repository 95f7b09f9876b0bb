"""Keep or discard the take that was generated last."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import bpy

from ..keying import KeyedTake, discard_take
from ..properties import settings_of
from ..things import KeyedThing


@dataclass
class _Pending:
    """The last take by names, since an undo makes references to Blender's data invalid."""

    file: str
    scene: str
    armature: str
    action: str
    slot: int
    frames: tuple[int, int]
    fps: float
    previous_action: str
    previous_slot: int
    previous_fake_user: bool
    previous_pose: list[tuple[str, Any]]
    things: list[_PendingThing]


@dataclass
class _PendingThing:
    """An object that the take moved, by names."""

    object: str
    action: str
    slot: int
    previous_action: str
    previous_slot: int
    previous_fake_user: bool
    previous_transform: dict[str, Any]


_pending: _Pending | None = None


def remember(scene: bpy.types.Scene, take: KeyedTake) -> None:
    """Offer a take for review."""
    global _pending
    previous = take.previous_action
    _pending = _Pending(
        bpy.data.filepath,
        scene.name,
        take.armature.name,
        take.action.name,
        getattr(take.slot, "handle", 0),
        (take.frame_start, take.frame_end),
        take.fps,
        previous.name if previous else "",
        getattr(take.previous_slot, "handle", 0),
        take.previous_fake_user,
        take.previous_pose,
        [_pending_thing(thing) for thing in take.things],
    )


def _pending_thing(thing: KeyedThing) -> _PendingThing:
    previous = thing.previous_action
    return _PendingThing(
        thing.object.name,
        thing.action.name,
        getattr(thing.slot, "handle", 0),
        previous.name if previous else "",
        getattr(thing.previous_slot, "handle", 0),
        thing.previous_fake_user,
        thing.previous_transform,
    )


def pending(scene: bpy.types.Scene) -> _Pending | None:
    """Return the take under review in a scene, or None when it was settled, undone, renamed or replaced."""
    p = _pending
    if p is None or (p.file, p.scene) != (bpy.data.filepath, scene.name):
        return None
    armature = bpy.data.objects.get(p.armature)
    action = armature.animation_data.action if armature and armature.animation_data else None
    return p if action is not None and action.name == p.action else None


class _Review(bpy.types.Operator):
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if pending(context.scene) is None:
            cls.poll_message_set("There is no new take to review; generate one first.")
            return False
        return True


class NSM_OT_take_accept(_Review):
    bl_idname = "nsm.take_accept"
    bl_label = "Accept"
    bl_description = "Keep the new actions and stop asking about them"

    def execute(self, context: bpy.types.Context) -> set[str]:
        global _pending
        _pending = None
        settings_of(context.scene).results.clear()
        return {"FINISHED"}


class NSM_OT_take_reject(_Review):
    bl_idname = "nsm.take_reject"
    bl_label = "Reject"
    bl_description = "Remove the new actions and give the character, and what it moved, back the actions and the places they had"

    def execute(self, context: bpy.types.Context) -> set[str]:
        global _pending
        p = pending(context.scene)
        armature = bpy.data.objects[p.armature]
        action, previous = bpy.data.actions[p.action], bpy.data.actions.get(p.previous_action)
        discard_take(
            KeyedTake(
                armature, action, _slot(action, p.slot), *p.frames, p.fps,
                previous, _slot(previous, p.previous_slot), p.previous_fake_user, p.previous_pose, _things(p),
            )
        )  # fmt: skip
        _pending = None
        settings_of(context.scene).results.clear()
        return {"FINISHED"}


def _things(p: _Pending) -> list[KeyedThing]:
    """What the take has moved; objects and actions that are gone by now are passed over."""
    found = []
    for t in p.things:
        target, action, previous = bpy.data.objects.get(t.object), bpy.data.actions.get(t.action), bpy.data.actions.get(t.previous_action)
        if target is not None and action is not None:
            slots = _slot(action, t.slot), _slot(previous, t.previous_slot)
            found.append(KeyedThing(target, action, slots[0], previous, slots[1], t.previous_fake_user, t.previous_transform))
    return found


def _slot(action: bpy.types.Action | None, handle: int) -> Any | None:
    return next((s for s in getattr(action, "slots", ()) if s.handle == handle), None)


CLASSES = (NSM_OT_take_accept, NSM_OT_take_reject)
