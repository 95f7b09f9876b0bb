"""The list of takes, kept in the scene's settings, so that saving, opening and undoing keep or lose them with
their keys.

Every take stands in it until it is removed: pending first, accepted later; the one whose action its character
plays is the one shown.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import bpy

from .ghosts import remove_ghosts
from .kept_takes import KeptTakes
from .properties import settings_of
from .shared_things import hand_over
from .take_properties import NsmKeyed, NsmTake
from .take_records import checksum, is_pushed, is_shown, keyed, note, note_before, playing, rows_of, slot_of

if TYPE_CHECKING:
    from ..keys.keyed import KeyedTake
    from ..keys.objects import KeyedThing


def remember(scene: bpy.types.Scene, take: KeyedTake, seed: int = 0, beside: bool = False) -> NsmTake:
    """``remember_all`` of one take; its record."""
    remember_all(scene, [(take, seed)], beside)
    return settings_of(scene).takes[-1]


def remember_all(
    scene: bpy.types.Scene,
    made: Sequence[tuple[KeyedTake, int]],
    beside: bool = False,
    together: bool = False,
) -> None:
    """Put takes, each with its seed, on the list: all or none.

    The one that each replaces, not accepted yet and as it was made, is removed: rejecting the new one then
    gives back what was before both.  One that the animator has edited, or from whose end the new one goes on,
    stays as if accepted.  ``beside``: one that it is another try of stays on the list as it is.
    ``together``: their characters act together, so that what one has moved is the others' concern, too.
    """
    from ..animation.channels import remove_unused

    takes, unused = settings_of(scene).takes, list[bpy.types.Action]()
    listed = [row.object for record in takes for row in rows_of(record)]
    targets = [target for take, _ in made for target in (take.armature, *(t.object for t in take.things))]
    group = 1 + max((record.group for record in takes), default=0) if together else 0
    with _whole(scene, [*targets, *listed]):
        for take, seed in made:
            unused += _make_way(scene, take, beside)
            record = takes.add()
            record.frame_start, record.frame_end, record.fps = take.first, take.last, take.fps
            record.seed, record.group = seed, group
            note(record.character, take.armature, take, take.previous_pose)
            for thing in take.things:
                note(record.things.add(), thing.object, thing, thing.previous_transform)
            record.keys = checksum(take)
        settings_of(scene).active_take = len(takes) - 1
        remove_ghosts(scene, unused)  # the last that may fail: copies cannot be put back
    for action in unused:
        remove_unused(action)


def _make_way(scene: bpy.types.Scene, take: KeyedTake, beside: bool) -> list[bpy.types.Action]:
    """Settle the takes that ``take`` replaces; the actions of those that are removed by it."""
    takes, unused = settings_of(scene).takes, list[bpy.types.Action]()
    for index in reversed(range(len(takes))):
        record = takes[index]
        if record.character.object is None or record.character.action is None:
            takes.remove(index)
        elif record.character.object == take.armature and record.character.action == take.previous_action:
            same = not record.accepted and record.frame_start == take.first
            if same and beside:
                _inherit_all(take, keyed(record))
            elif same and record.keys == checksum(keyed(record)):
                hand_over(scene, record, {thing.object for thing in take.things})
                old = keyed(record)
                takes.remove(index)
                _supersede(old, take)
                unused += [gone.action for gone in (old, *old.things)]
            else:
                record.accepted = True
    return unused


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


def settle(scene: bpy.types.Scene, record: NsmTake) -> None:
    """Accept a take: it stays on the list and nothing asks about it any more."""
    record.accepted = True
    if is_shown(record):
        settings_of(scene).results.clear()


def reject(scene: bpy.types.Scene, record: NsmTake) -> str:
    """Remove a take, its actions, strips and copies; where it was shown, the character and what it moved get
    their old actions and places back.

    What it has moved stays with the takes that were made together with it, as long as there is one; then a
    sentence that says so, else an empty one.
    """
    from ..animation.channels import remove_unused
    from ..keys import strips
    from ..keys.keyed import take_off

    shown, take = is_shown(record), keyed(record)
    free = shown or is_pushed(record) and playing(take.armature) is None
    _require_no_tweaking(record)
    with _whole(scene, [row.object for row in rows_of(record)]):
        told = hand_over(scene, record)
        take = keyed(record)
        rows = [(row.object, row.action) for row in rows_of(record)]
        if free:
            # Another action on an object is the animator's.
            take.things = [t for t in take.things if playing(t.object) in (t.action, None)]
            take_off(take)
        for row in rows_of(record):
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
    return told


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
    targets = [*(row.object for row in rows_of(record)), *(thing.object for thing in old)]
    with _whole(scene, targets):
        for thing in old:
            if thing.object not in moved and playing(thing.object) == thing.action:
                take_off_thing(thing)
        ours = {row.action for take in settings_of(scene).takes for row in rows_of(take)}
        for row in rows_of(record):
            now = playing(row.object)
            if now is not None and now not in ours:
                note_before(row, now)
            assign(row.object, row.action, slot_of(row.action, row.slot))
            row.object.update_tag(refresh={"TIME"})
        bpy.context.view_layer.update()


def push(scene: bpy.types.Scene, record: NsmTake) -> None:
    """Make a take a strip of the NLA, of its character and of what it moved; it counts as accepted."""
    from ..animation.kept import Kept, restored_on_failure
    from ..keys import strips

    _require_no_tweaking(record)
    rows = list(rows_of(record))
    with restored_on_failure(Kept(scene, [row.object for row in rows])):
        try:
            for row in rows:
                strips.push(row.object, row.action, slot_of(row.action, row.slot))
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

    for row in rows_of(record):
        strips.pull(row.object, row.action)


def _require_no_tweaking(record: NsmTake) -> None:
    from ..keys import strips

    for row in rows_of(record):
        strips.require_no_tweaking(row.object)


def _forget(scene: bpy.types.Scene, record: NsmTake) -> None:
    takes = settings_of(scene).takes
    takes.remove(next(i for i, other in enumerate(takes) if other == record))
    settings_of(scene).active_take = max(min(settings_of(scene).active_take, len(takes) - 1), 0)


def _bypass(scene: bpy.types.Scene, gone: NsmKeyed) -> None:
    """Have takes that replaced an action which goes away give back what that one replaced."""
    for record in settings_of(scene).takes:
        for row in rows_of(record):
            if row != gone and row.object == gone.object and row.previous_action == gone.action is not None:
                row.previous_action, row.previous_slot = gone.previous_action, gone.previous_slot
                row.previous_fake_user = gone.previous_fake_user
                row.previous_values = gone.previous_values


def _supersede(old: KeyedTake, new: KeyedTake) -> None:
    """Take off what ``old`` made and have ``new`` remember what was before both."""
    from ..keys.objects import take_off_thing

    again = {thing.object for thing in new.things}
    for thing in old.things:
        if thing.object not in again and playing(thing.object) == thing.action:
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
