"""Keep or discard the take that was generated last."""

from __future__ import annotations

from typing import ClassVar

import bpy

from .. import reviews
from ..reviews import pending, remember
from .reporting import sentences, while_idle

__all__ = ["CLASSES", "pending", "remember"]


class _Review(bpy.types.Operator):
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not while_idle(cls):
            return False
        if pending(context.scene) is None:
            cls.poll_message_set("There is no new take to review; generate one first.")
            return False
        return True


class NSM_OT_take_accept(_Review):
    bl_idname = "nsm.take_accept"
    bl_label = "Accept"
    bl_description = "Keep the new actions and stop asking about them"

    def execute(self, context: bpy.types.Context) -> set[str]:
        reviews.settle(context.scene, pending(context.scene))
        return {"FINISHED"}


class NSM_OT_take_reject(_Review):
    bl_idname = "nsm.take_reject"
    bl_label = "Reject"
    bl_description = (
        "Remove the new actions and give the character, and what it moved, "
        "back the actions and the places they had"
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        with sentences(self):
            reviews.reject(context.scene, pending(context.scene))
            return {"FINISHED"}
        return {"CANCELLED"}


CLASSES = (NSM_OT_take_accept, NSM_OT_take_reject)
