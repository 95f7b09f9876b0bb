"""A take of the list and what it keyed: the settings' record and ``KeyedTake``, the one from the other."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from mathutils import Matrix

from .take_properties import NsmKeyed, NsmTake

if TYPE_CHECKING:
    from ..keys.keyed import KeyedTake
    from ..keys.objects import KeyedThing


def is_shown(record: NsmTake) -> bool:
    """Whether the character of a take plays it now as its action."""
    row = record.character
    return row.object is not None and row.action is not None and row.action == playing(row.object)


def is_pushed(record: NsmTake) -> bool:
    """Whether a take is a strip of the NLA."""
    from ..keys import strips

    return strips.strip_of(record.character.object, record.character.action) is not None


def keyed(record: NsmTake) -> KeyedTake:
    """What a take of the list has keyed; objects and actions that are gone by now are passed over."""
    from ..keys.keyed import KeyedTake
    from ..keys.objects import KeyedThing

    row = record.character
    things = [
        KeyedThing(
            t.object,
            t.action,
            slot_of(t.action, t.slot),
            t.previous_action,
            slot_of(t.previous_action, t.previous_slot),
            t.previous_fake_user,
            _values(t.previous_values),
        )
        for t in record.things
        if t.object is not None and t.action is not None
    ]
    return KeyedTake(
        row.object,
        row.action,
        slot_of(row.action, row.slot),
        record.frame_start,
        record.frame_end,
        record.fps,
        row.previous_action,
        slot_of(row.previous_action, row.previous_slot),
        row.previous_fake_user,
        _values(row.previous_values),
        things,
    )


def rows_of(record: NsmTake) -> Iterator[NsmKeyed]:
    """What a take has keyed; objects and actions that are gone by now are passed over."""
    rows = (record.character, *record.things)
    return (row for row in rows if row.object is not None and row.action is not None)


def note(row: NsmKeyed, target: bpy.types.Object, made: KeyedTake | KeyedThing, values: Any) -> None:
    row.object, row.action, row.slot = target, made.action, getattr(made.slot, "handle", 0)
    row.previous_action, row.previous_slot = made.previous_action, getattr(made.previous_slot, "handle", 0)
    row.previous_fake_user = made.previous_fake_user
    row.previous_values = json.dumps(_plain(values))


def note_before(row: NsmKeyed, action: bpy.types.Action | None) -> None:
    """Note what an object has now as what a take replaces."""
    from ..animation.channels import curves_in, transform_of
    from ..keys.keyed import pose_of

    data = row.object.animation_data
    if row.object.type == "ARMATURE":
        curves = curves_in(row.action, slot_of(row.action, row.slot))
        values = pose_of(row.object, placed=any(curve.data_path == "location" for curve in curves))
    else:
        values = transform_of(row.object)
    slot = getattr(data, "action_slot", None) if action is not None else None
    row.previous_action, row.previous_slot = action, getattr(slot, "handle", 0)
    row.previous_values = json.dumps(_plain(values))
    row.previous_fake_user = bool(action and action.use_fake_user)
    if action is not None:
        action.use_fake_user = True  # or it would be lost with the file's next save


def checksum(take: KeyedTake) -> str:
    """Of all keys of a take, its things' included."""
    from ..animation.channels import curves_in

    total = 0
    for made in (take, *take.things):
        for curve in curves_in(made.action, made.slot):
            places = np.empty(2 * len(curve.keyframe_points), np.float32)
            curve.keyframe_points.foreach_get("co", places)
            total = zlib.crc32(
                f"{curve.data_path}[{curve.array_index}]".encode(), zlib.crc32(places.tobytes(), total)
            )
    return f"{total:08x}"


def playing(target: bpy.types.Object) -> bpy.types.Action | None:
    return target.animation_data.action if target.animation_data else None


def slot_of(action: bpy.types.Action | None, handle: int) -> Any | None:
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
