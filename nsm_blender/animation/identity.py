"""Which piece of Blender's data is which: by the number that it keeps through renaming, undo and redo, not by
its name.
"""

from __future__ import annotations

import bpy


def exists(block: bpy.types.ID) -> bool:
    """Whether a reference to Blender's data still leads to something."""
    try:
        return bool(block.name)
    except ReferenceError:
        return False


def identity(block: bpy.types.ID) -> int | str:
    """What tells ``block`` from all others of its kind in this session, also from one made later under its
    name.

    Two blocks may share a name (one of them linked from another file), and undo gives out new references to
    the same block.
    """
    return getattr(block, "session_uid", 0) or block.name_full


class Known:
    """A block as it was met: whether a reference still leads to that very one, and what to call it."""

    def __init__(self, block: bpy.types.ID) -> None:
        self.block, self.name, self._identity = block, block.name, identity(block)

    @property
    def here(self) -> bool:
        """Whether the block is still in the file: one that was made anew under its name is another one.

        ``name`` is what the animator called it when this was last asked for and true.
        """
        if not exists(self.block) or identity(self.block) != self._identity:
            return False
        self.name = self.block.name
        return True
