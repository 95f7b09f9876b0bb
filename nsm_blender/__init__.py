"""The NSM add-on: characters that walk to objects in a scene and use them."""

from __future__ import annotations

import atexit

import bpy


def register() -> None:
    """Add operators, panel and scene settings to Blender; a second call changes nothing."""
    from .ui import operators, panels, properties, watch

    for cls in (*properties.CLASSES, *operators.CLASSES, *panels.CLASSES):
        if not cls.is_registered:
            bpy.utils.register_class(cls)
    if not hasattr(bpy.types.Scene, "nsm"):
        bpy.types.Scene.nsm = bpy.props.PointerProperty(type=properties.NsmSettings)
    watch.install()
    if bpy.app.module:  # the wheel complains of leaks, and can hang, when a program ends with classes registered
        atexit.unregister(unregister)
        atexit.register(unregister)


def unregister() -> None:
    """Take them away again; what a file holds stays in it.  A second call changes nothing."""
    from .ui import operators, panels, properties, running, watch

    running.interrupt("The add-on was switched off meanwhile, so Generate stopped and nothing was keyed.")
    watch.uninstall()
    if hasattr(bpy.types.Scene, "nsm"):
        del bpy.types.Scene.nsm
    for cls in reversed((*properties.CLASSES, *operators.CLASSES, *panels.CLASSES)):
        if cls.is_registered:
            bpy.utils.unregister_class(cls)
