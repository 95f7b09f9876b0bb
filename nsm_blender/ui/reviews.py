"""Takes under review: kept in the scene's settings, so that saving, opening and undoing keep or lose them
with their keys.
"""

from __future__ import annotations

import json
import zlib
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ..animation.channels import curves_in
from ..keys.keying import KeyedTake, discard_take
from ..keys.objects import KeyedThing, discard_thing
from .properties import NsmKeyed, NsmTake, settings_of


def remember(scene: bpy.types.Scene, take: KeyedTake) -> None:
    """Offer a take for review.

    The one that it replaces, not accepted yet and as it was made, is removed: rejecting the new one then
    gives back what was before both.  One that the animator has edited, or from whose end the new one goes on,
    stays as if accepted.
    """
    takes = settings_of(scene).takes
    for index in reversed(range(len(takes))):
        record = takes[index]
        if record.character.object not in (None, take.armature):
            continue
        old = _keyed(record) if _replaced(record, take) else None
        takes.remove(index)
        if old is not None:
            _supersede(old, take)
    record = takes.add()
    record.frame_start, record.frame_end, record.fps = take.frame_start, take.frame_end, take.fps
    _note(record.character, take.armature, take, take.previous_pose)
    for thing in take.things:
        _note(record.things.add(), thing.object, thing, thing.previous_transform)
    record.keys = _checksum(take)


def pending(scene: bpy.types.Scene) -> NsmTake | None:
    """Return the take under review of the chosen character, the newest where none is chosen; None when there
    is none.
    """
    settings = settings_of(scene)
    for record in reversed(settings.takes):
        armature = record.character.object
        if armature is None or settings.character not in (None, armature):
            continue
        if record.character.action is not None and record.character.action == _action_of(armature):
            return record
    return None


def settle(scene: bpy.types.Scene, record: NsmTake) -> KeyedTake:
    """Take a take out of the review and return what it keyed; objects and actions that are gone by now are
    passed over.
    """
    take, takes = _keyed(record), settings_of(scene).takes
    takes.remove(next(i for i, other in enumerate(takes) if other == record))
    settings_of(scene).results.clear()
    # Another one is the animator's.
    take.things = [thing for thing in take.things if _action_of(thing.object) == thing.action]
    return take


def reject(scene: bpy.types.Scene, record: NsmTake) -> None:
    """Remove a take's actions and give the character, and what it moved, back the actions and places they
    had.
    """
    discard_take(settle(scene, record))


def _note(row: NsmKeyed, target: bpy.types.Object, made: KeyedTake | KeyedThing, values: Any) -> None:
    row.object, row.action, row.slot = target, made.action, getattr(made.slot, "handle", 0)
    row.previous_action, row.previous_slot = made.previous_action, getattr(made.previous_slot, "handle", 0)
    row.previous_fake_user = made.previous_fake_user
    row.previous_values = json.dumps(_plain(values))


def _keyed(record: NsmTake) -> KeyedTake:
    row = record.character
    things = [
        KeyedThing(
            t.object,
            t.action,
            _slot(t.action, t.slot),
            t.previous_action,
            _slot(t.previous_action, t.previous_slot),
            t.previous_fake_user,
            _values(t.previous_values),
        )
        for t in record.things
        if t.object is not None and t.action is not None
    ]
    return KeyedTake(
        row.object,
        row.action,
        _slot(row.action, row.slot),
        record.frame_start,
        record.frame_end,
        record.fps,
        row.previous_action,
        _slot(row.previous_action, row.previous_slot),
        row.previous_fake_user,
        _values(row.previous_values),
        things,
    )


def _replaced(record: NsmTake, take: KeyedTake) -> bool:
    """Whether ``take`` is another try at what a record holds, and nothing of it is the animator's own
    work.
    """
    action = record.character.action
    if action is None or action != take.previous_action or record.frame_start != take.frame_start:
        return False
    return record.keys == _checksum(_keyed(record))


def _supersede(old: KeyedTake, new: KeyedTake) -> None:
    """Remove what ``old`` made and have ``new`` remember what was before both."""
    again = {thing.object: thing for thing in new.things}
    for thing in old.things:
        newer = again.get(thing.object)
        if newer is None:
            if _action_of(thing.object) == thing.action:
                discard_thing(thing)
        elif newer.previous_action == thing.action:
            _inherit(newer, thing)
            newer.previous_transform = thing.previous_transform
    _inherit(new, old)
    new.previous_pose = old.previous_pose


def _inherit(new: KeyedTake | KeyedThing, old: KeyedTake | KeyedThing) -> None:
    old.action.use_fake_user = new.previous_fake_user  # keying has set it, to keep what it replaces
    new.previous_action, new.previous_slot, new.previous_fake_user = (
        old.previous_action,
        old.previous_slot,
        old.previous_fake_user,
    )
    if old.action.users == int(old.action.use_fake_user):
        bpy.data.actions.remove(old.action)


def _checksum(take: KeyedTake) -> str:
    """Of all keys of a take, its things' included."""
    total = 0
    for made in (take, *take.things):
        for curve in curves_in(made.action, made.slot):
            places = np.empty(2 * len(curve.keyframe_points), np.float32)
            curve.keyframe_points.foreach_get("co", places)
            total = zlib.crc32(
                f"{curve.data_path}[{curve.array_index}]".encode(), zlib.crc32(places.tobytes(), total)
            )
    return f"{total:08x}"


def _action_of(target: bpy.types.Object) -> bpy.types.Action | None:
    return target.animation_data.action if target.animation_data else None


def _slot(action: bpy.types.Action | None, handle: int) -> Any | None:
    return next((s for s in getattr(action, "slots", ()) if s.handle == handle), None)


def _plain(values: Any) -> Any:
    """Matrices, vectors and tuples as JSON can hold them."""
    if isinstance(values, dict):
        return {name: _plain(value) for name, value in values.items()}
    if isinstance(values, (str, int, float)):
        return values
    kind = "matrix" if isinstance(values, Matrix) else "list"
    plain = [list(row) for row in values] if kind == "matrix" else [_plain(value) for value in values]
    return {kind: plain} if kind == "matrix" else plain


def _values(text: str) -> Any:
    """What ``_plain`` was given, tuples for lists."""
    return _back(json.loads(text or "[]"))


def _back(value: Any) -> Any:
    if isinstance(value, dict):
        return (
            Matrix(value["matrix"])
            if "matrix" in value
            else {name: _back(part) for name, part in value.items()}
        )
    return tuple(_back(part) for part in value) if isinstance(value, list) else value
