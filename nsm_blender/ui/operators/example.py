"""The example scene: the furnished house with a character and goals, beside what the animator has."""

from __future__ import annotations

import contextlib

import bpy

from ..properties import settings_of
from ..queue import queue_of
from .reporting import InObjectMode


class NSM_OT_example(InObjectMode, bpy.types.Operator):
    bl_idname = "nsm.example"
    bl_label = "Example Scene"
    bl_description = (
        "Open a furnished house with a character and five goals in a new scene; your own scenes stay as they "
        "are, in the list at the top of the window"
    )
    adds = "The example is built"

    def execute(self, context: bpy.types.Context) -> set[str]:
        from ...animation.made import all_or_nothing

        window = context.window or context.window_manager.windows[0]
        with all_or_nothing():
            _build(window)
        _frame(context, window)
        return {"FINISHED"}


def _build(window: bpy.types.Window) -> None:
    from ...demo_scene.house import build_house
    from ...rigs.character import add_character

    scene = window.scene = bpy.data.scenes.new("Character Motion Example")
    house = build_house()
    character = add_character((*house.start, 0.0))
    character.rotation_euler.z = house.start_heading
    settings = settings_of(scene)
    settings.character = character
    queue = queue_of(scene)
    for asked in house.goals:
        row = queue.goals.add()
        row.action, row.object, row.destination, row.hold = (
            asked.action,
            asked.object,
            asked.to,
            asked.hold,
        )
        if asked.location is not None:
            row.location = asked.location


def _frame(context: bpy.types.Context, window: bpy.types.Window) -> None:
    """Have the viewport look at all of it."""
    area = context.area
    region = next((r for r in area.regions if r.type == "WINDOW"), None) if area is not None else None
    if region is not None and area.type == "VIEW_3D":
        with contextlib.suppress(RuntimeError), context.temp_override(window=window, region=region):
            bpy.ops.view3d.view_all(use_all_regions=False)


CLASSES = (NSM_OT_example,)
