"""Fill: the missing frames between keys, from the sidebar or the Key menus of the animation editors."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import TYPE_CHECKING, Any

import bpy

from nsm_core.errors import GapError

from .. import running
from ..properties import settings_of, show_results
from ..reviews import remember
from ..session import TakeSession
from .generate import TakeMaker, listed_or_discarded, next_seed
from .reporting import WhileIdle, telling

if TYPE_CHECKING:
    from ...fill.fill import FilledGap
    from ...fill.spec import FillSpec
    from ...keys.keyed import KeyedTake
    from ...progress import Progress

_MENUS = ("DOPESHEET_MT_key", "GRAPH_MT_key")


def character_of(context: bpy.types.Context, active_first: bool = False) -> bpy.types.Object | None:
    """Whose frames are filled: the chosen character; in the Key menus, which show the keys of the active
    object, that where it is an armature.
    """
    chosen, active = settings_of(context.scene).character, context.view_layer.objects.active
    armature = active if active is not None and active.type == "ARMATURE" else None
    return (armature or chosen) if active_first else (chosen or armature)


def filled_before(context: bpy.types.Context) -> tuple[float, float] | None:
    """The poses between which the action that the character plays was filled last; None where it was not."""
    from ...fill.gap import SPAN

    character = character_of(context)
    data = None if character is None else character.animation_data
    span = None if data is None or data.action is None else data.action.get(SPAN)
    return None if span is None else (float(span[0]), float(span[1]))


def _reason_now(context: bpy.types.Context) -> str:
    """Why nothing can be keyed on the character now; empty where it can."""
    busy = running.reason_busy()
    character = character_of(context)
    if busy or character is None:
        return busy or running.reason_no_character(context.scene)
    reason = running.reason_of(character, context.scene)
    if reason:
        return reason
    if context.mode not in {"OBJECT", "POSE"}:
        return "Fill works in Object and Pose Mode; leave the present mode with Tab."
    return ""


def has_strips(character: bpy.types.Object) -> bool:
    """Whether there are strips to merge."""
    from ...animation import channels

    return channels.has_strips(character)


def reason_not(context: bpy.types.Context) -> str:
    """Why Fill cannot start, as a sentence with what to do; empty when it can."""
    character = character_of(context)
    reason = _reason_now(context)
    if reason or character is None:
        return reason
    if character.animation_data is None or character.animation_data.action is None:
        if has_strips(character):
            return f"What the NLA plays on {character.name} is in several actions; press Merge Strips first."
        return f"{character.name} has no keys yet; key the pose before and the pose after the missing frames."
    return ""


class _Filler(TakeMaker):
    """What both operators share."""

    @classmethod
    def reason_off(cls, context: bpy.types.Context) -> str:
        return reason_not(context)

    def _open(self, context: bpy.types.Context, ended: Callable[[], None]) -> TakeSession:
        self._spec = self._asked(context.scene)
        return TakeSession(
            self._spec, context.scene, ended, self._steps_of, "Fill stopped and nothing was keyed"
        )

    def _steps_of(self, spec: FillSpec, scene: bpy.types.Scene) -> Generator[Progress, None, Any]:
        from ...fill.fill import fill_gap

        return fill_gap(spec, scene)

    def _keep(self, scene: bpy.types.Scene, take: FilledGap) -> set[str]:
        from ...fill.report import fill_lines

        with listed_or_discarded(scene, [take.keyed]):
            lines = fill_lines(take.report)
            remember(scene, take.keyed, self._spec.seed, self.beside)
        settings = settings_of(scene)
        settings.fill.seed = self._spec.seed
        if settings.character != take.keyed.armature:
            settings.character = take.keyed.armature  # so that Accept and Reject are its own
        show_results(settings, lines)
        for text, good in lines:
            self.report({"INFO" if good else "WARNING"}, text)
        return {"FINISHED"}


class NSM_OT_fill(_Filler, bpy.types.Operator):
    bl_idname = "nsm.fill"
    bl_label = "Fill Missing Frames"
    bl_description = (
        "Make the missing frames between two keyed poses and key them in a copy of the action; all keys "
        "outside stay as they are"
    )
    where: bpy.props.EnumProperty(
        name="Frames",
        items=(
            ("PANEL", "As in the Sidebar", ""),
            ("MENU", "Selected Keys, or around the Playhead", ""),
        ),
        options={"HIDDEN", "SKIP_SAVE"},
    )

    def _asked(self, scene: bpy.types.Scene) -> FillSpec:
        from ...fill.gap import pose_span, selected_keys
        from ...fill.spec import FillSpec

        options, menu = settings_of(scene).fill, getattr(self, "where", "PANEL") == "MENU"
        character, span, bones = character_of(bpy.context, menu), None, None
        if menu or options.where == "SELECTED":
            keys = selected_keys(character)
            if keys is not None:
                span, bones = keys[:2], keys[2]
            elif not menu:
                raise GapError(
                    "Fewer than two frames of this character's body have selected keys; select the pose that "
                    "is left and the pose that is reached."
                )
        elif options.where == "SEAM":
            at = scene.frame_current
            return FillSpec(
                character,
                at - options.seam,
                at + options.seam,
                seed=options.seed,
                replace=True,
                method=options.method,
            )
        elif options.where == "ALL":
            span = pose_span(character)
        elif options.where == "PREVIEW":
            if not scene.use_preview_range:
                raise GapError(
                    "The scene has no preview range; set one (P in the timeline) or choose others."
                )
            span = scene.frame_preview_start, scene.frame_preview_end
        start, end = span or (None, None)
        return FillSpec(
            character,
            start,
            end,
            seed=options.seed,
            replace=options.replace,
            method=options.method,
            bones=bones,
        )


class NSM_OT_another_fill(_Filler, bpy.types.Operator):
    bl_idname = "nsm.another_fill"
    bl_label = "Another Fill"
    bl_description = (
        "Fill the same frames with the next variation, and keep the one that is shown on the list beside it"
    )
    beside = True

    @classmethod
    def reason_off(cls, context: bpy.types.Context) -> str:
        none = "" if filled_before(context) is not None else "Nothing was filled yet; press Fill first."
        return reason_not(context) or none

    def _asked(self, scene: bpy.types.Scene) -> FillSpec:
        from ...fill.spec import FillSpec

        options = settings_of(scene).fill
        start, end = filled_before(bpy.context) or (None, None)
        return FillSpec(
            character_of(bpy.context), start, end, seed=next_seed(scene), replace=options.replace,
            method=options.method,
        )  # fmt: skip


class NSM_OT_decompress(_Filler, bpy.types.Operator):
    bl_idname = "nsm.decompress"
    bl_label = "Decompress"
    bl_description = (
        "Fill every gap between the first and the last pose of the character, one after the other, as of an "
        "animation that was thinned out"
    )

    def _asked(self, scene: bpy.types.Scene) -> FillSpec:
        from ...fill.gap import pose_span
        from ...fill.spec import FillSpec

        options, character = settings_of(scene).fill, character_of(bpy.context)
        start, end = pose_span(character) or (None, None)
        return FillSpec(character, start, end, seed=options.seed, method=options.method)


class NSM_OT_thin_out(WhileIdle, bpy.types.Operator):
    bl_idname = "nsm.thin_out"
    bl_label = "Thin Out"
    bl_description = (
        "Keep of the animation a pose and its pace every second, in a copy of the action; Decompress makes "
        "the frames in between again"
    )

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        return reason_not(context)

    @telling
    def execute(self, context: bpy.types.Context) -> None:
        from ...fill.thin import thin_out

        scene = context.scene
        keyed, (before, after) = thin_out(character_of(context), scene)
        text = f"{after} keys of the body's {before} are left; Decompress makes the others again."
        _listed(self, scene, keyed, text)


class NSM_OT_merge_strips(WhileIdle, bpy.types.Operator):
    bl_idname = "nsm.merge_strips"
    bl_label = "Merge Strips"
    bl_description = (
        "Key what the NLA plays on the character in one action over its strips, in which Fill makes the "
        "seams between them; Reject gives the strips back"
    )

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        reason, character = _reason_now(context), character_of(context)
        if reason or character is None:
            return reason
        if not has_strips(character):
            return f"The NLA plays no strips of {character.name}, or an action lies over them."
        return ""

    @telling
    def execute(self, context: bpy.types.Context) -> None:
        from ...fill.merge import merge_strips

        scene = context.scene
        keyed = merge_strips(character_of(context), scene)
        text = (
            f"What the NLA plays from {keyed.first} to {keyed.last} is one action now; put the playhead "
            "on a cut and fill the Seam at the Playhead."
        )
        _listed(self, scene, keyed, text)


def _listed(operator: bpy.types.Operator, scene: bpy.types.Scene, keyed: KeyedTake, text: str) -> None:
    """Put what was keyed on the list of takes and tell of it."""
    with listed_or_discarded(scene, [keyed]):
        remember(scene, keyed)
    show_results(settings_of(scene), [(text, True)])
    operator.report({"INFO"}, text)


def _draw(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.operator("nsm.fill", icon="KEYFRAME").where = "MENU"


_installed = False


def install() -> None:
    """Put Fill into the Key menus of the animation editors; a second call changes nothing."""
    global _installed
    if not _installed:
        for name in _MENUS:
            getattr(bpy.types, name).append(_draw)
        _installed = True


def uninstall() -> None:
    """Take that back."""
    global _installed
    if _installed:
        for name in _MENUS:
            getattr(bpy.types, name).remove(_draw)
        _installed = False


CLASSES = (NSM_OT_fill, NSM_OT_another_fill, NSM_OT_decompress, NSM_OT_thin_out, NSM_OT_merge_strips)
