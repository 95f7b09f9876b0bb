"""Generate All: the takes of all characters that have goals, in the window or in one go."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import bpy

from nsm_core.errors import NsmError

from ..group_session import GroupSession
from ..properties import settings_of, show_results, spec_of_row
from ..queue import cast_of
from ..reviews import remember_all
from ..running import reason_no_cast
from .generate import listed_or_discarded, spec_of
from .modal import Modal, take_back
from .reporting import Guarded

if TYPE_CHECKING:
    from ...takes import Take
    from ...together import GroupSpec


def group_of(scene: bpy.types.Scene) -> GroupSpec:
    """What all characters with enabled goals are to do; GoalError on a row whose action is unknown."""
    from ...together import GroupSpec

    asked = spec_of(scene)
    return GroupSpec(
        [
            replace(
                asked,
                character=character,
                goals=[spec_of_row(row, number) for number, row in enumerate(queue.goals, 1) if row.enabled],
                seed=asked.seed + number,
            )
            for number, (character, queue) in enumerate(cast_of(scene))
        ]
    )


class NSM_OT_generate_all(Guarded, Modal, bpy.types.Operator):
    bl_idname = "nsm.generate_all"
    bl_label = "Generate All"
    bl_description = (
        "Have all characters that have enabled goals act together: each sees the others as they move. Who is "
        "nearer to a seat, a door or a narrow place goes first, the others wait or go around. All are keyed, "
        "or none"
    )

    @classmethod
    def reason_off(cls, context: bpy.types.Context) -> str:
        return reason_no_cast(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Generate in one go: scripts and background mode, where no timer runs."""
        from ...progress import finish
        from ...together import generate_together

        scene = context.scene
        try:
            self._group = group_of(scene)
            takes = finish(generate_together(self._group, scene))
        except NsmError as error:
            return self._fail(scene, str(error))
        try:
            return self._keep(scene, takes)
        except BaseException:
            take_back(scene, takes)
            raise

    def _open(self, context: bpy.types.Context, ended: Callable[[], None]) -> GroupSession:
        self._group = group_of(context.scene)
        return GroupSession(self._group, context.scene, ended)

    def _keep(self, scene: bpy.types.Scene, takes: list[Take]) -> set[str]:
        from ...keys.report import result_lines

        lines: list[tuple[str, bool]] = []
        with listed_or_discarded(scene, [take.keyed for take in takes]):
            made = [(take.keyed, spec.seed) for take, spec in zip(takes, self._group.takes, strict=True)]
            remember_all(scene, made, together=True)
        for take in takes:
            name = take.keyed.armature.name
            told = result_lines(take.report, take.keyed.frame_start, scene.frame_end)
            lines += [(f"{name}: {text}", good) for text, good in told]
            lines += [(f"{name} {wait}", True) for wait in take.report["waits"]]
            for goal, (text, good) in zip(take.report["goals"], told, strict=False):
                self.report({"INFO" if goal["reached"] and good else "WARNING"}, f"{name}: {text}")
        show_results(settings_of(scene), lines)
        return {"FINISHED"}


CLASSES = (NSM_OT_generate_all,)
