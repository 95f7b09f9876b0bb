"""The list of takes, kept in the scene's settings, so that saving, opening and undoing keep or lose them with
their keys.

Every take stands in it until it is removed: pending first, accepted later; the one whose action its character
plays is the one shown.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from mathutils import Matrix

from .ghosts import remove_ghosts
from .kept_takes import KeptTakes
from .properties import NsmKeyed, NsmTake, settings_of

if TYPE_CHECKING:
    from ..keys.keyed import KeyedTake
    from ..keys.objects import KeyedThing


def remember(scene: bpy.types.Scene, take: KeyedTake, seed: int = 0, beside: bool = False) -> NsmTake:
    """Put a take on the list.

    The one that it replaces, not accepted yet and as it was made, is removed: rejecting the new one then
    gives back what was before both.  One that the animator has edited, or from whose end the new one goes on,
    stays as if accepted.  ``beside``: one that it is another try of stays on the list as it is.
    """
    from ..animation.channels import remove_unused

    takes, unused = settings_of(scene).takes, list[bpy.types.Action]()
    others = [row.object for record in takes for row in _rows(record)]
    with _whole(scene, [take.armature, *(thing.object for thing in take.things), *others]):
        for index in reversed(range(len(takes))):
            record = takes[index]
            if record.character.object is None or record.character.action is None:
                takes.remove(index)
            elif record.character.object == take.armature and record.character.action == take.previous_action:
                old = keyed(record)
                same = not record.accepted and record.frame_start == take.first
                if same and beside:
                    _inherit_all(take, old)
                elif same and record.keys == _checksum(old):
                    takes.remove(index)
                    _supersede(old, take)
                    unused += [made.action for made in (old, *old.things)]
                else:
                    record.accepted = True
        record = takes.add()
        record.frame_start, record.frame_end, record.fps = take.first, take.last, take.fps
        record.seed = seed
        _note(record.character, take.armature, take, take.previous_pose)
        for thing in take.things:
            _note(record.things.add(), thing.object, thing, thing.previous_transform)
        record.keys = _checksum(take)
        settings_of(scene).active_take = len(takes) - 1
        remove_ghosts(scene, unused)  # the last that may fail: copies cannot be put back
    for action in unused:
        remove_unused(action)
    return record


@contextmanager
def _whole(scene: bpy.types.Scene, targets: Iterable[bpy.types.Object]) -> Iterator[None]:
    """Change the list, and what ``targets`` play, as a whole or not at all."""
    from ..animation.kept import Kept, restored_on_failure

    with restored_on_failure(Kept(scene, targets)), restored_on_failure(KeptTakes(scene)):
        yield


def takes_of(scene: bpy.types.Scene, armature: bpy.types.Object | None = None) -> list[NsmTake]:
    """The takes of a character, the chosen one's where none is given, that still have their action."""
    armature = armature or settings_of(scene).character
    found = [t for t in settings_of(scene).takes if t.character.action is not None]
    return [t for t in found if t.character.object is not None and armature in (None, t.character.object)]


def pending(scene: bpy.types.Scene) -> NsmTake | None:
    """Return the take under review of the chosen character, the newest where none is chosen; None when there
    is none.
    """
    settings = settings_of(scene)
    for record in reversed(settings.takes):
        if settings.character in (None, record.character.object) and is_shown(record) and not record.accepted:
            return record
    return None


def is_shown(record: NsmTake) -> bool:
    """Whether the character of a take plays it now as its action."""
    row = record.character
    return row.object is not None and row.action is not None and row.action == _action_of(row.object)


def is_pushed(record: NsmTake) -> bool:
    """Whether a take is a strip of the NLA."""
    from ..keys import strips

    return strips.strip_of(record.character.object, record.character.action) is not None


def settle(scene: bpy.types.Scene, record: NsmTake) -> None:
    """Accept a take: it stays on the list and nothing asks about it any more."""
    record.accepted = True
    if is_shown(record):
        settings_of(scene).results.clear()


def reject(scene: bpy.types.Scene, record: NsmTake) -> None:
    """Remove a take, its actions, strips and copies; where it was shown, the character and what it moved get
    their old actions and places back.
    """
    from ..animation.channels import remove_unused
    from ..keys import strips
    from ..keys.keyed import take_off

    shown, take = is_shown(record), keyed(record)
    free = shown or is_pushed(record) and _action_of(take.armature) is None
    _require_no_tweaking(record)
    rows = [(row.object, row.action) for row in _rows(record)]
    with _whole(scene, [take.armature, *(thing.object for thing in take.things)]):
        if free:
            # Another action on an object is the animator's.
            take.things = [t for t in take.things if _action_of(t.object) in (t.action, None)]
            take_off(take)
        for row in _rows(record):
            _bypass(scene, row)
        _forget(scene, record)
        remove_ghosts(scene, [action for _, action in rows])  # copies cannot be put back: the last to fail
    try:
        for target, action in rows:
            strips.pull(target, action)
        if shown:
            settings_of(scene).results.clear()
    finally:
        for _, action in rows:
            remove_unused(action)


def show(scene: bpy.types.Scene, record: NsmTake) -> None:
    """Have a character play a take of the list; the one shown until now stays on it, and another action of
    the animator's is kept with a fake user and given back when the take is rejected.
    """
    from ..animation.channels import assign
    from ..keys.objects import take_off_thing

    armature = record.character.object
    before = next((t for t in takes_of(scene, armature) if is_shown(t)), None)
    moved = {row.object for row in record.things}
    old = [] if before is None or before == record else keyed(before).things
    targets = [*(row.object for row in _rows(record)), *(thing.object for thing in old)]
    with _whole(scene, targets):
        for thing in old:
            if thing.object not in moved and _action_of(thing.object) == thing.action:
                take_off_thing(thing)
        ours = {row.action for take in settings_of(scene).takes for row in _rows(take)}
        for row in _rows(record):
            now = _action_of(row.object)
            if now is not None and now not in ours:
                _note_before(row, now)
            assign(row.object, row.action, _slot(row.action, row.slot))
            row.object.update_tag(refresh={"TIME"})
        bpy.context.view_layer.update()


def push(scene: bpy.types.Scene, record: NsmTake) -> None:
    """Make a take a strip of the NLA, of its character and of what it moved; it counts as accepted."""
    from ..animation.kept import Kept, restored_on_failure
    from ..keys import strips

    _require_no_tweaking(record)
    rows = list(_rows(record))
    with restored_on_failure(Kept(scene, [row.object for row in rows])):
        try:
            for row in rows:
                strips.push(row.object, row.action, _slot(row.action, row.slot))
        except BaseException:
            _pull(record)
            raise
    settle(scene, record)


def pull(scene: bpy.types.Scene, record: NsmTake) -> None:
    """Take a take off the NLA and show it as an action again."""
    _require_no_tweaking(record)
    show(scene, record)
    _pull(record)


def _pull(record: NsmTake) -> None:
    from ..keys import strips

    for row in _rows(record):
        strips.pull(row.object, row.action)


def _require_no_tweaking(record: NsmTake) -> None:
    from ..keys import strips

    for row in _rows(record):
        strips.require_no_tweaking(row.object)


def keyed(record: NsmTake) -> KeyedTake:
    """What a take of the list has keyed; objects and actions that are gone by now are passed over."""
    from ..keys.keyed import KeyedTake
    from ..keys.objects import KeyedThing

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


def _rows(record: NsmTake) -> Iterator[NsmKeyed]:
    """What a take has keyed; objects and actions that are gone by now are passed over."""
    rows = (record.character, *record.things)
    return (row for row in rows if row.object is not None and row.action is not None)


def _note(row: NsmKeyed, target: bpy.types.Object, made: KeyedTake | KeyedThing, values: Any) -> None:
    row.object, row.action, row.slot = target, made.action, getattr(made.slot, "handle", 0)
    row.previous_action, row.previous_slot = made.previous_action, getattr(made.previous_slot, "handle", 0)
    row.previous_fake_user = made.previous_fake_user
    row.previous_values = json.dumps(_plain(values))


def _note_before(row: NsmKeyed, action: bpy.types.Action | None) -> None:
    """Note what an object has now as what a take replaces."""
    from ..animation.channels import curves_in, transform_of
    from ..keys.keyed import pose_of

    data = row.object.animation_data
    if row.object.type == "ARMATURE":
        curves = curves_in(row.action, _slot(row.action, row.slot))
        values = pose_of(row.object, placed=any(curve.data_path == "location" for curve in curves))
    else:
        values = transform_of(row.object)
    slot = getattr(data, "action_slot", None) if action is not None else None
    row.previous_action, row.previous_slot = action, getattr(slot, "handle", 0)
    row.previous_values = json.dumps(_plain(values))
    row.previous_fake_user = bool(action and action.use_fake_user)
    if action is not None:
        action.use_fake_user = True  # or it would be lost with the file's next save


def _forget(scene: bpy.types.Scene, record: NsmTake) -> None:
    takes = settings_of(scene).takes
    takes.remove(next(i for i, other in enumerate(takes) if other == record))
    settings_of(scene).active_take = max(min(settings_of(scene).active_take, len(takes) - 1), 0)


def _bypass(scene: bpy.types.Scene, gone: NsmKeyed) -> None:
    """Have takes that replaced an action which goes away give back what that one replaced."""
    for record in settings_of(scene).takes:
        for row in _rows(record):
            if row != gone and row.object == gone.object and row.previous_action == gone.action is not None:
                row.previous_action, row.previous_slot = gone.previous_action, gone.previous_slot
                row.previous_fake_user = gone.previous_fake_user
                row.previous_values = gone.previous_values


def _supersede(old: KeyedTake, new: KeyedTake) -> None:
    """Take off what ``old`` made and have ``new`` remember what was before both."""
    from ..keys.objects import take_off_thing

    again = {thing.object for thing in new.things}
    for thing in old.things:
        if thing.object not in again and _action_of(thing.object) == thing.action:
            take_off_thing(thing)
    _inherit_all(new, old)


def _inherit_all(new: KeyedTake, old: KeyedTake) -> None:
    """Have ``new`` remember what was before ``old``, which it is another try of."""
    again = {thing.object: thing for thing in new.things}
    for thing in old.things:
        newer = again.get(thing.object)
        if newer is not None and newer.previous_action == thing.action:
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


def _checksum(take: KeyedTake) -> str:
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
