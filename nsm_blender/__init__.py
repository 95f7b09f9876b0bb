"""The NSM add-on: characters that walk to objects in a scene and use them.

What a script needs is named here and loaded when it is first asked for; ``docs/script_in_blender.py`` shows
it at work.  Whatever else the rooms below hold may change from version to version.
"""

from __future__ import annotations

import atexit
from typing import TYPE_CHECKING, Any

import bpy

from nsm_core.earlier import keep_names

if TYPE_CHECKING:
    from .fill.fill import FilledGap, fill_gap
    from .fill.spec import FillSpec
    from .goals.spec import GoalSpec
    from .keys.report import goal_line
    from .pictures.outputs import save_blend, write_json
    from .pictures.render import contact_sheet, video
    from .prepare import TakeSpec
    from .progress import Progress, finish
    from .rigs.character import add_character
    from .takes import Take, generate

keep_names()

# Where a public name is kept.
_KEPT = {
    "FillSpec": "fill.spec",
    "FilledGap": "fill.fill",
    "GoalSpec": "goals.spec",
    "Progress": "progress",
    "Take": "takes",
    "TakeSpec": "prepare",
    "add_character": "rigs.character",
    "contact_sheet": "pictures.render",
    "fill_gap": "fill.fill",
    "finish": "progress",
    "generate": "takes",
    "goal_line": "keys.report",
    "save_blend": "pictures.outputs",
    "video": "pictures.render",
    "write_json": "pictures.outputs",
}
__all__ = [
    "FillSpec",
    "FilledGap",
    "GoalSpec",
    "Progress",
    "Take",
    "TakeSpec",
    "add_character",
    "contact_sheet",
    "fill_gap",
    "finish",
    "generate",
    "goal_line",
    "register",
    "save_blend",
    "unregister",
    "video",
    "write_json",
]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for."""
    if name not in _KEPT:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    value = globals()[name] = getattr(import_module(f"{__name__}.{_KEPT[name]}"), name)
    return value


def __dir__() -> list[str]:
    """The public names, loaded or not, for completion in a console."""
    return sorted({*globals(), *__all__})


def register() -> None:
    """Add operators, panel and scene settings to Blender; a second call changes nothing."""
    from .collecting import PutOff

    with PutOff():
        _register()
    # The wheel complains of leaks, and can hang, when a program ends with classes registered.
    if bpy.app.module:
        atexit.unregister(unregister)
        atexit.register(unregister)


def _register() -> None:
    from .ui import operators, overlays, panels, preferences, properties, watch

    for cls in (
        *properties.CLASSES,
        *preferences.CLASSES,
        *overlays.CLASSES,
        *operators.CLASSES,
        *panels.CLASSES,
    ):
        if not cls.is_registered:
            bpy.utils.register_class(cls)
    if not hasattr(bpy.types.Scene, "nsm"):
        bpy.types.Scene.nsm = bpy.props.PointerProperty(type=properties.NsmSettings)
    if not hasattr(bpy.types.Armature, "nsm_rig"):
        bpy.types.Armature.nsm_rig = bpy.props.PointerProperty(type=properties.NsmRig)
    if not hasattr(bpy.types.Object, "nsm_queue"):
        bpy.types.Object.nsm_queue = bpy.props.PointerProperty(
            type=properties.NsmQueue, override=properties.OVERRIDABLE
        )
    operators.help.install()
    operators.fill.install()
    overlays.install()
    watch.install()


def unregister() -> None:
    """Take them away again; what a file holds stays in it.  A second call changes nothing."""
    from .ui import operators, overlays, panels, preferences, properties, running, watch

    running.interrupt("The add-on was switched off meanwhile, so Generate stopped and nothing was keyed.")
    watch.uninstall()
    operators.help.uninstall()
    operators.fill.uninstall()
    overlays.uninstall()
    if hasattr(bpy.types.Scene, "nsm"):
        del bpy.types.Scene.nsm
    if hasattr(bpy.types.Armature, "nsm_rig"):
        del bpy.types.Armature.nsm_rig
    if hasattr(bpy.types.Object, "nsm_queue"):
        del bpy.types.Object.nsm_queue
    for cls in reversed(
        (*properties.CLASSES, *preferences.CLASSES, *overlays.CLASSES, *operators.CLASSES, *panels.CLASSES)
    ):
        if cls.is_registered:
            bpy.utils.unregister_class(cls)
