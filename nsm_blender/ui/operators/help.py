"""Help: a page that the add-on brings, since it is at home without a network."""

from __future__ import annotations

from pathlib import Path

import bpy

GUIDE = Path(__file__).resolve().parents[2] / "help" / "guide.html"


class NSM_OT_help(bpy.types.Operator):
    bl_idname = "nsm.help"
    bl_label = "Help"
    bl_description = "Open the guide in the web browser; it comes with the add-on and needs no network"

    def execute(self, _context: bpy.types.Context) -> set[str]:
        bpy.ops.wm.url_open(url=GUIDE.as_uri())
        return {"FINISHED"}


def _manual() -> tuple[str, tuple[tuple[str, str], ...]]:
    """Where the Online Manual of the add-on's buttons is: the same page."""
    return GUIDE.parent.as_uri() + "/", (
        ("bpy.ops.nsm.*", GUIDE.name),
        ("bpy.types.nsm*", GUIDE.name),
    )


_installed = False


def install() -> None:
    """Have Blender's own Online Manual entries lead to the guide, too; a second call changes nothing."""
    global _installed
    if not _installed:
        bpy.utils.register_manual_map(_manual)
        _installed = True


def uninstall() -> None:
    """Take that back."""
    global _installed
    if _installed:
        bpy.utils.unregister_manual_map(_manual)
        _installed = False


CLASSES = (NSM_OT_help,)
