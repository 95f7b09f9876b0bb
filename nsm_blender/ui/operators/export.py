"""Write the chosen character's take as a file for other programs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import ClassVar

import bpy
from bpy.props import StringProperty

from ..properties import settings_of
from ..queue import queue_of
from ..reviews import is_shown, takes_of
from .reporting import WhileIdle, telling


class _Export(WhileIdle, bpy.types.Operator):
    """Shared by both: the browser opens with the name of the character's action."""

    bl_options: ClassVar = {"REGISTER"}
    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})
    ending = ""

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        acts = action_of_character(context.scene) is not None
        return "" if acts else "The character has no action; generate a take first."

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        if not self.filepath:
            self.filepath = bpy.path.clean_name(action_of_character(context.scene).name) + self.ending
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    @telling
    def execute(self, context: bpy.types.Context) -> None:
        from ...pictures.outputs import require_writable

        path = require_writable(self.filepath, self.ending)
        self.write(path, context.scene)
        self.report({"INFO"}, f"Wrote {path.name}.")

    def write(self, path: Path, scene: bpy.types.Scene) -> None:
        raise NotImplementedError


class NSM_OT_export_bvh(_Export):
    bl_idname = "nsm.export_bvh"
    bl_label = "Export BVH"
    bl_description = "Write the character's action as a motion capture file, which most programs read"
    filter_glob: StringProperty(default="*.bvh", options={"HIDDEN"})
    ending = ".bvh"

    def write(self, path: Path, scene: bpy.types.Scene) -> None:
        from ...exports.bvh import export_bvh

        first, last = action_of_character(scene).frame_range
        export_bvh(path, settings_of(scene).character, math.floor(first), math.ceil(last), scene)


class NSM_OT_export_glb(_Export):
    bl_idname = "nsm.export_glb"
    bl_label = "Export GLB"
    bl_description = (
        "Write the character with its meshes and its action, and what it moves, as a file for game engines "
        "and the web"
    )
    filter_glob: StringProperty(default="*.glb", options={"HIDDEN"})
    ending = ".glb"

    def write(self, path: Path, scene: bpy.types.Scene) -> None:
        from ...exports.glb import export_glb

        export_glb(path, settings_of(scene).character, moved_by_character(scene), scene)


def action_of_character(scene: bpy.types.Scene) -> bpy.types.Action | None:
    """The action that the chosen character plays; None without one."""
    character = settings_of(scene).character
    return character.animation_data.action if character is not None and character.animation_data else None


def moved_by_character(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """What the take that is shown has moved, and what the goals of the queue are about and has an action."""
    from ...world.frame import holds

    found = [thing.object for take in takes_of(scene) if is_shown(take) for thing in take.things]
    found += [goal.object for goal in queue_of(scene).goals]
    acts = [o for o in found if o is not None and o.animation_data and o.animation_data.action]
    return [o for o in dict.fromkeys(acts) if holds(scene, o)]


CLASSES = (NSM_OT_export_bvh, NSM_OT_export_glb)
