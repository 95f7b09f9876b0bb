"""The timeline made as long as a take."""

from __future__ import annotations

import math

import bpy

from ..properties import settings_of
from ..reviews import pending
from .reporting import WhileIdle


class NSM_OT_fit_scene(WhileIdle, bpy.types.Operator):
    bl_idname = "nsm.fit_scene"
    bl_label = "Set Scene End to Take"
    bl_description = "Let the scene end with the last key of the character's take"

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        last = last_frame(context.scene)
        if last is None:
            return "The character has no keys yet; generate a take first."
        return "The scene ends with the take already." if last == context.scene.frame_end else ""

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene, last = context.scene, last_frame(context.scene)
        scene.frame_end = last
        if scene.use_preview_range:
            scene.frame_preview_end = last
        return {"FINISHED"}


def last_frame(scene: bpy.types.Scene) -> int | None:
    """Return the last frame of the take under review, else of the character's action; None without either."""
    take = pending(scene)
    if take is not None:
        return take.frame_end
    character = settings_of(scene).character
    action = character.animation_data.action if character is not None and character.animation_data else None
    return None if action is None else math.ceil(action.frame_range[1])


CLASSES = (NSM_OT_fit_scene,)
