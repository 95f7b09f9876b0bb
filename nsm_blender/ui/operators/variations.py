"""Variations that stand beside each other: one is picked, the copies go."""

from __future__ import annotations

import bpy

from .. import reviews
from ..ghosts import action_of, ghost_at, ghosts_of, remove_ghosts
from ..properties import settings_of
from ..take_properties import NsmTake
from .reporting import WhileIdle, telling


class _WithGhosts(WhileIdle, bpy.types.Operator):
    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        shown = ghosts_of(context.scene)
        return "" if shown else "No variations stand beside the character; press Variations first."


class NSM_OT_variation_pick(_WithGhosts):
    bl_idname = "nsm.variation_pick"
    bl_label = "Pick"
    bl_description = (
        "Have the character play the variation whose copy is selected, else the take that is marked in the "
        "list, and remove the copies"
    )
    remove_others: bpy.props.BoolProperty(
        name="Remove Others", description="Remove the other variations from the list, too", default=False
    )

    @telling
    def execute(self, context: bpy.types.Context) -> set[str] | None:
        scene = context.scene
        picked = _picked(context)
        if picked is None:
            self.report({"WARNING"}, "Click one of the variations first, in the viewport or in the list.")
            return {"CANCELLED"}
        action, armature = picked.character.action, picked.character.object
        shown = {action_of(ghost) for ghost in ghosts_of(scene)} | {action_of(armature)}
        reviews.show(scene, picked)
        remove_ghosts(scene)
        for other in [t.character.action for t in reviews.takes_of(scene, armature)]:
            if self.remove_others and other in shown and other != action:
                record = _of(scene, other)
                if record is not None and not record.accepted:
                    reviews.reject(scene, record)
        settings_of(scene).active_take = [t.character.action for t in settings_of(scene).takes].index(action)
        return None


class NSM_OT_ghosts_remove(_WithGhosts):
    bl_idname = "nsm.ghosts_remove"
    bl_label = "Remove Copies"
    bl_description = "Remove the copies beside the character; their takes stay on the list"

    def execute(self, context: bpy.types.Context) -> set[str]:
        remove_ghosts(context.scene)
        return {"FINISHED"}


def _picked(context: bpy.types.Context) -> NsmTake | None:
    """The take of the copy that is selected, or of the character itself; else the one marked in the list."""
    scene, clicked = context.scene, context.view_layer.objects.active
    if clicked is not None and clicked.select_get():
        ghost = ghost_at(scene, clicked)
        found = None if ghost is None else _of(scene, action_of(ghost))
        if found is not None:
            return found
    takes, index = settings_of(scene).takes, settings_of(scene).active_take
    return takes[index] if index < len(takes) and takes[index] in reviews.takes_of(scene) else None


def _of(scene: bpy.types.Scene, action: bpy.types.Action | None) -> NsmTake | None:
    return next((t for t in reviews.takes_of(scene) if t.character.action == action), None)


CLASSES = (NSM_OT_variation_pick, NSM_OT_ghosts_remove)
