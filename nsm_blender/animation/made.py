"""What is made in one go: all of it, or nothing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

import bpy

from .identity import exists, identity

# In the order in which they are removed: what uses others comes first.
_KINDS = (
    "scenes", "objects", "collections", "actions", "meshes", "curves", "armatures", "cameras", "lights",
    "worlds", "materials", "node_groups", "images",
)  # fmt: skip
_GONE = (ReferenceError, RuntimeError, AttributeError)


@contextmanager
def all_or_nothing() -> Iterator[None]:
    """Where anything whatever is raised inside, a break included, remove what was made there, and show,
    select and activate what was shown, selected and active before.
    """
    before = {kind: {identity(block) for block in getattr(bpy.data, kind)} for kind in _KINDS}
    shown = [(window, window.scene) for manager in bpy.data.window_managers for window in manager.windows]
    layer, mode = bpy.context.view_layer, bpy.context.mode
    active, selected = layer.objects.active, [o for o in layer.objects if o.select_get()]
    try:
        yield
    except BaseException:
        for window, scene in shown:
            if window.scene != scene:
                window.scene = scene
        if bpy.context.mode != mode:
            with suppress(*_GONE):
                bpy.ops.object.mode_set(mode="OBJECT")
        for kind, known in before.items():
            blocks = getattr(bpy.data, kind)
            for made in [block for block in blocks if identity(block) not in known]:
                if exists(made):  # and not gone with another one
                    blocks.remove(made)
        layer.update()  # whatever was removed is still among its objects, and reading it would crash
        for each in list(layer.objects):
            each.select_set(each in selected)
        layer.objects.active = active
        raise
