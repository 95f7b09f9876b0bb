"""The add-on's preferences: what a new scene begins with, and where the user's files lie."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, PointerProperty, StringProperty

from ..overlays.layers import LAYERS
from .options import NsmKeyOptions
from .properties import BEGINS

PACKAGE = __package__.rpartition(".")[0]
# Of the settings of a scene, those that a new scene takes from here, and of its options for keys.
_OF_SCENE, _OF_KEYS = ("begin", "contact_ik"), ("root_motion", "reduce", "reduce_mm", "reduce_degrees")


class NsmPreferences(bpy.types.AddonPreferences):
    """Shown under Edit > Preferences > Add-ons."""

    bl_idname = PACKAGE

    overlays: EnumProperty(
        name="Overlays",
        description="The overlays that are on when Blender starts",
        items=[(la.key, la.label, la.description, la.icon, 1 << k) for k, la in enumerate(LAYERS)],
        options={"ENUM_FLAG"},
    )
    show_picked: BoolProperty(
        name="Show a Goal When It Is Picked",
        description="Show in the viewport where a goal was found on its object, when its row is chosen",
        default=True,
    )
    begin: EnumProperty(
        name="Start From",
        description="How takes begin in a new scene",
        items=BEGINS,
        default="POSE",
    )
    contact_ik: BoolProperty(
        name="Plant Feet and Hands", description="Whether it is on in a new scene", default=True
    )
    keys: PointerProperty(type=NsmKeyOptions)
    folder: StringProperty(
        name="Folder",
        description="Where your lists of bones and queues of goals are kept; empty: with the extension's own "
        "data",
        subtype="DIR_PATH",
    )

    def draw(self, _context: bpy.types.Context) -> None:
        from ..user_folder import user_folder

        layout = self.layout
        layout.use_property_split = True
        layout.label(text="When Blender starts")
        layout.prop(self, "overlays")
        layout.prop(self, "show_picked")
        layout.label(text="In a new scene")
        for name in _OF_SCENE:
            layout.prop(self, name)
        for name in _OF_KEYS:
            layout.prop(self.keys, name)
        layout.label(text="Your lists of bones and queues of goals")
        layout.prop(self, "folder")
        if not self.folder:
            layout.label(text=str(user_folder("queues").parent), icon="FILE_FOLDER")


def shows_picked() -> bool:
    """Whether a goal is shown when its row is picked."""
    from ..user_folder import preferences

    return bool(getattr(preferences(), "show_picked", True))


def default_overlays() -> set[str]:
    """Keys of the overlays that are on when Blender starts."""
    from ..user_folder import preferences

    return set(getattr(preferences(), "overlays", ()))


def begin_scene(settings: Any) -> None:
    """Give a scene that gets its first character what the preferences say, where it has no choice of its
    own.
    """
    from ..user_folder import preferences

    chosen = preferences()
    if chosen is None:
        return
    for here, there, names in ((settings, chosen, _OF_SCENE), (settings.keys, chosen.keys, _OF_KEYS)):
        for name in names:
            if not here.is_property_set(name):
                setattr(here, name, getattr(there, name))


CLASSES = (NsmPreferences,)
