"""What the sidebar shows, without a window."""

from __future__ import annotations

import types

import bpy

from nsm_blender.ui import panels, running
from nsm_blender.ui.bones_panel import NSM_PT_bones
from nsm_blender.ui.properties import queue_of

ICONS = set(bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items.keys())


class Layout:
    """Takes the place of UILayout, which only a window has: notes texts, and checks that what is drawn
    exists.
    """

    def __init__(self, seen: list[str] | None = None) -> None:
        self.__dict__["seen"] = [] if seen is None else seen

    def _part(self, **_):
        return Layout(self.seen)

    row = column = box = split = _part

    def prop_search(self, data, name, found_in, among, **_):
        assert name in data.bl_rna.properties and among in found_in.bl_rna.properties
        self.seen.append(getattr(data, name))

    def separator(self, **_):
        pass

    def label(self, text="", icon="NONE"):
        assert icon in ICONS, icon
        self.seen.append(text)

    def prop(self, data, name, text=None, **_):
        assert name in data.bl_rna.properties, name
        self.seen.append(text if text is not None else data.bl_rna.properties[name].name)

    def operator(self, idname, text=None, icon="NONE", **_):
        assert icon in ICONS, icon
        kind = getattr(bpy.ops.nsm, idname.removeprefix("nsm.")).get_rna_type()
        self.seen.append(text if text is not None else kind.name)
        return types.SimpleNamespace()

    def menu(self, kind, text="", icon="NONE"):
        assert hasattr(bpy.types, kind) and icon in ICONS

    def template_list(self, kind, _name, data, collection, active_data, active, **_):
        assert hasattr(bpy.types, kind)
        for index, row in enumerate(getattr(data, collection)):
            getattr(panels, kind).draw_item(None, bpy.context, self, data, row, 0, active_data, active, index)

    def progress(self, factor, text):
        assert 0 <= factor <= 1
        self.seen.append(text)


def drawn() -> list[str]:
    """What all panels of the tab show."""
    layout = Layout()
    for kind in panels.CLASSES:
        if issubclass(kind, bpy.types.Panel) and kind is not NSM_PT_bones:
            # A panel object exists in a window only: its functions run here on a stand-in with the same
            # layout.
            shown = types.SimpleNamespace(layout=layout)
            if hasattr(kind, "draw_header_preset"):
                kind.draw_header_preset(shown, bpy.context)
            kind.draw(shown, bpy.context)
    return layout.seen


def goals():
    return queue_of(bpy.context.scene).goals


def reason() -> str:
    return running.reason_not_ready(bpy.context)
