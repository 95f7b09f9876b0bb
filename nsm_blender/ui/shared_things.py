"""What one of several characters has moved while they acted together, and the others act with.

Its keys stand once, in the take of the first that moves it.  When that take goes, they go over to another of
those that were made together, so that a box which is handed on does not stop, nor a door close in somebody.
"""

from __future__ import annotations

from collections.abc import Collection

import bpy

from .properties import settings_of
from .take_properties import NsmTake
from .take_records import checksum, is_shown, keyed, rows_of


def hand_over(
    scene: bpy.types.Scene, record: NsmTake, again: Collection[bpy.types.Object] = frozenset()
) -> str:
    """Have the things of a take that goes stay with another that was made together with it, but for those
    that are keyed ``again``; a sentence that says so, empty where there is nothing to hand over or nobody.
    """
    others = [t for t in settings_of(scene).takes if t != record and t.group == record.group != 0]
    others = [t for t in others if t.character.object is not None and t.character.action is not None]
    heir = min(others, key=lambda t: not is_shown(t), default=None)
    going = [row for row in rows_of(record) if row != record.character and row.object not in again]
    if heir is None or not going:
        return ""
    as_made = heir.keys == checksum(keyed(heir))
    for row in going:
        own = heir.things.add()
        for name in row.bl_rna.properties.keys():
            if name not in ("rna_type", "name"):
                setattr(own, name, getattr(row, name))
    gone = {row.object for row in going}
    for index in reversed(range(len(record.things))):
        if record.things[index].object in gone:
            record.things.remove(index)
    if as_made:
        heir.keys = checksum(keyed(heir))
    names = " and ".join(sorted(thing.name for thing in gone))
    keep = "keeps its keys" if len(gone) == 1 else "keep their keys"
    return f"{names} {keep} for {heir.character.object.name}, whose take was made together with this one."
