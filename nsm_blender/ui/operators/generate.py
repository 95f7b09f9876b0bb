"""Generate: the take that the sidebar asks for, in the window or in one go."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar

import bpy

from nsm_core.body.key_reduction import Bound
from nsm_core.errors import NsmError

from ...begin import POSE
from ...keys.keying import discard_take
from ...keys.report import result_lines
from ...prepare import TakeSpec
from ...progress import finish
from ...takes import Take, generate
from .. import running
from ..properties import queue_of, settings_of, show_results, spec_of_row
from ..reviews import remember, takes_of
from ..session import TakeSession
from .modal import Modal


def spec_of(scene: bpy.types.Scene) -> TakeSpec:
    """Return the take that the sidebar asks for; GoalError on a row whose stored action is unknown."""
    settings = settings_of(scene)
    keys = settings.keys
    return TakeSpec(
        character=settings.character,
        goals=[
            spec_of_row(row, number) for number, row in enumerate(queue_of(scene).goals, 1) if row.enabled
        ],
        start_frame=settings.start_frame,
        seed=settings.seed,
        contact_ik=settings.contact_ik,
        begin=settings.begin.lower(),
        root_motion=keys.root_motion,
        keep_edits=keys.keep_edits,
        reduce=Bound(keys.reduce_mm, keys.reduce_degrees) if keys.reduce else None,
    )


class TakeMaker(Modal):
    """What the operators share that make a take."""

    bl_options: ClassVar = {"REGISTER", "UNDO"}
    beside = False  # whether the take that is shown stays on the list beside the new one

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        reason = running.reason_not_ready(context)
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Generate in one go: scripts and background mode, where no timer runs."""
        scene = context.scene
        try:
            self._spec = self._asked(scene)
            take = finish(generate(self._spec, scene))
        except NsmError as error:
            return self._fail(scene, str(error))
        return self._keep(scene, take)

    def _open(self, context: bpy.types.Context, ended: Callable[[], None]) -> TakeSession:
        self._spec = self._asked(context.scene)
        return TakeSession(self._spec, context.scene, ended)

    def _asked(self, scene: bpy.types.Scene) -> TakeSpec:
        """What is to be generated."""
        return spec_of(scene)

    def _keep(self, scene: bpy.types.Scene, take: Take) -> set[str]:
        made = replace(take.keyed, things=[replace(thing) for thing in take.keyed.things])
        try:
            lines = result_lines(take.report, take.keyed.frame_start, scene.frame_end)
            remember(scene, take.keyed, self._spec.seed, self.beside)
        except BaseException:  # a take that nobody could reject
            discard_take(made)
            raise
        settings_of(scene).seed = self._spec.seed
        show_results(settings_of(scene), lines)
        for goal, (text, good) in zip(take.report["goals"], lines, strict=False):
            self.report({"INFO" if goal["reached"] and good else "WARNING"}, text)
        return {"FINISHED"}


class NSM_OT_generate(TakeMaker, bpy.types.Operator):
    bl_idname = "nsm.generate"
    bl_label = "Generate"
    bl_description = (
        "Have the character do the enabled goals and key the motion in a new action. It goes around what "
        "looks solid in the "
        "viewport. The custom property nsm_collider of an object decides otherwise (Properties editor, "
        "Object, Custom Properties; "
        "of type Boolean): off, it is walked through; on, it is solid even where it is hidden"
    )


class NSM_OT_another_take(TakeMaker, bpy.types.Operator):
    bl_idname = "nsm.another_take"
    bl_label = "Another Take"
    bl_description = (
        "Generate the same goals with the next seed, and keep the take that is shown on the list beside it"
    )
    beside = True

    def _asked(self, scene: bpy.types.Scene) -> TakeSpec:
        spec = spec_of(scene)
        return replace(spec, seed=max((take.seed for take in takes_of(scene)), default=spec.seed) + 1)


class NSM_OT_continue_take(TakeMaker, bpy.types.Operator):
    bl_idname = "nsm.continue_take"
    bl_label = "Continue from Here"
    bl_description = (
        "Generate the enabled goals from the current frame on: from the pose and pace that the character has "
        "there, standing, sitting or in the middle of a step. What is animated before stays as it is; what "
        "came after is replaced in the new action and kept in the old one"
    )

    def _asked(self, scene: bpy.types.Scene) -> TakeSpec:
        return replace(spec_of(scene), start_frame=scene.frame_current, begin=POSE)

    def _keep(self, scene: bpy.types.Scene, take: Take) -> set[str]:
        settings_of(scene).start_frame = take.keyed.first  # another one begins there, too
        return super()._keep(scene, take)


CLASSES = (NSM_OT_generate, NSM_OT_another_take, NSM_OT_continue_take)
