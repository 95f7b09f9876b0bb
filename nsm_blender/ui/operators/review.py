"""The list of takes: keep them, discard them, show one, make one a strip of the NLA."""

from __future__ import annotations

import bpy

from .. import reviews
from ..properties import settings_of
from ..reviews import pending, remember
from ..take_properties import NsmTake
from .reporting import WhileIdle, sentences, telling

__all__ = ["CLASSES", "pending", "remember"]

_NONE = "There is no take on the list; generate one first."


class _OfTake(WhileIdle, bpy.types.Operator):
    """An operator of one take: the one at ``index``, or where that is -1 the one marked in the list."""

    index: bpy.props.IntProperty(default=-1, options={"HIDDEN", "SKIP_SAVE"})

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        return "" if reviews.takes_of(context.scene) else _NONE

    @telling
    def execute(self, context: bpy.types.Context) -> set[str] | None:
        takes = settings_of(context.scene).takes
        index = settings_of(context.scene).active_take if self.index < 0 else self.index
        if index >= len(takes) or takes[index] not in reviews.takes_of(context.scene):
            self.report({"WARNING"}, "This take's action is gone, or it is another character's.")
            return {"CANCELLED"}
        self.do(context.scene, takes[index])
        return None

    def do(self, scene: bpy.types.Scene, record: NsmTake) -> None:
        """What this operator does with a take."""
        raise NotImplementedError


class _Review(WhileIdle, bpy.types.Operator):
    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        if pending(context.scene) is None:
            return "There is no new take to review; generate one first, or show one of the list."
        return ""


def _tell(operator: bpy.types.Operator, sentence: str) -> None:
    if sentence:
        operator.report({"INFO"}, sentence)


class NSM_OT_take_accept(_Review):
    bl_idname = "nsm.take_accept"
    bl_label = "Accept"
    bl_description = "Keep the take that is shown and stop asking about it; it stays on the list of takes"

    def execute(self, context: bpy.types.Context) -> set[str]:
        reviews.settle(context.scene, pending(context.scene))
        return {"FINISHED"}


class NSM_OT_take_reject(_Review):
    bl_idname = "nsm.take_reject"
    bl_label = "Reject"
    bl_description = (
        "Remove the take that is shown, and give the character, and what it moved, "
        "back the actions and the places they had"
    )

    @telling
    def execute(self, context: bpy.types.Context) -> None:
        _tell(self, reviews.reject(context.scene, pending(context.scene)))


class NSM_OT_take_show(_OfTake):
    bl_idname = "nsm.take_show"
    bl_label = "Show"
    bl_description = "Have the character, and what it moved, play this take; the others stay on the list"

    def do(self, scene: bpy.types.Scene, record: NsmTake) -> None:
        reviews.show(scene, record)


class NSM_OT_take_keep(_OfTake):
    bl_idname = "nsm.take_keep"
    bl_label = "Accept Take"
    bl_description = "Mark this take as accepted, so that clearing the list leaves it"

    def do(self, scene: bpy.types.Scene, record: NsmTake) -> None:
        reviews.settle(scene, record)


class NSM_OT_take_remove(_OfTake):
    bl_idname = "nsm.take_remove"
    bl_label = "Remove Take"
    bl_description = (
        "Remove this take with its actions and its NLA strips; where it is shown, the character, and what it "
        "moved, get back what they had before it"
    )

    def do(self, scene: bpy.types.Scene, record: NsmTake) -> None:
        _tell(self, reviews.reject(scene, record))


class NSM_OT_take_push(_OfTake):
    bl_idname = "nsm.take_push"
    bl_label = "To NLA"
    bl_description = (
        "Accept this take and make it a strip on the NLA track NSM, of the character and of what it moved; "
        "what other tracks hold plays on before and after it"
    )

    def do(self, scene: bpy.types.Scene, record: NsmTake) -> None:
        reviews.push(scene, record)


class NSM_OT_take_pull(_OfTake):
    bl_idname = "nsm.take_pull"
    bl_label = "Back from NLA"
    bl_description = "Take the strip of this take off the NLA and make it the character's action again"

    def do(self, scene: bpy.types.Scene, record: NsmTake) -> None:
        reviews.pull(scene, record)


class NSM_OT_take_range(_OfTake):
    bl_idname = "nsm.take_range"
    bl_label = "Set Scene Range"
    bl_description = "Have the scene, or its preview range where that is used, start and end with this take"

    def do(self, scene: bpy.types.Scene, record: NsmTake) -> None:
        prefix = "frame_preview_" if scene.use_preview_range else "frame_"
        setattr(scene, f"{prefix}end", record.frame_end)  # the end first: it may not lie before the start
        setattr(scene, f"{prefix}start", record.frame_start)
        setattr(scene, f"{prefix}end", record.frame_end)


class NSM_OT_takes_clear(WhileIdle, bpy.types.Operator):
    bl_idname = "nsm.takes_clear"
    bl_label = "Clear Unaccepted"
    bl_description = (
        "Remove all takes of this character that are not accepted, with their actions; where one of them is "
        "shown, the character gets back what it had before"
    )

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        accepted = all(record.accepted for record in reviews.takes_of(context.scene))
        return "Every take on the list is accepted." if accepted else ""

    def execute(self, context: bpy.types.Context) -> set[str]:
        count = 0
        with sentences(self):
            while rest := [t for t in reviews.takes_of(context.scene) if not t.accepted]:
                _tell(self, reviews.reject(context.scene, rest[-1]))
                count += 1
        self.report({"INFO"}, f"{count} {'take was' if count == 1 else 'takes were'} removed.")
        return {"FINISHED"}


CLASSES = (
    NSM_OT_take_accept,
    NSM_OT_take_reject,
    NSM_OT_take_show,
    NSM_OT_take_keep,
    NSM_OT_take_remove,
    NSM_OT_take_push,
    NSM_OT_take_pull,
    NSM_OT_take_range,
    NSM_OT_takes_clear,
)
