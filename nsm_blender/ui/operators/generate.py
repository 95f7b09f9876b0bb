"""Generate: the take that the sidebar asks for, in the window or in one go."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import bpy

from nsm_core.errors import NsmError

from .. import running
from ..ghosts import remove_ghosts, show_ghosts
from ..kept_takes import KeptTakes
from ..properties import queue_of, settings_of, show_results, spec_of_row
from ..reviews import remember, remember_all, show, takes_of
from ..session import TakeSession
from .modal import Modal, take_back
from .reporting import Guarded

if TYPE_CHECKING:
    from ...keys.keyed import KeyedTake
    from ...prepare import TakeSpec
    from ...progress import Progress
    from ...takes import Take


def spec_of(scene: bpy.types.Scene) -> TakeSpec:
    """Return the take that the sidebar asks for; GoalError on a row whose stored action is unknown."""
    from nsm_core.body.key_reduction import Bound

    from ...prepare import TakeSpec

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
        in_order=settings.in_order,
        begin=settings.begin.lower(),
        root_motion=keys.root_motion,
        keep_edits=keys.keep_edits,
        reduce=Bound(keys.reduce_mm, keys.reduce_degrees) if keys.reduce else None,
    )


class TakeMaker(Guarded, Modal):
    """What the operators share that make a take."""

    beside = False  # whether the take that is shown stays on the list beside the new one

    @classmethod
    def reason_off(cls, context: bpy.types.Context) -> str:
        return running.reason_not_ready(context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Generate in one go: scripts and background mode, where no timer runs."""
        from ...progress import finish

        scene = context.scene
        try:
            self._spec = self._asked(scene)
            value = finish(self._steps_of(self._spec, scene))
        except NsmError as error:
            return self._fail(scene, str(error))
        try:
            return self._keep(scene, value)
        except BaseException:
            take_back(scene, value)
            raise

    def _open(self, context: bpy.types.Context, ended: Callable[[], None]) -> TakeSession:
        self._spec = self._asked(context.scene)
        return TakeSession(self._spec, context.scene, ended, self._steps_of)

    def _asked(self, scene: bpy.types.Scene) -> TakeSpec:
        """What is to be generated."""
        return spec_of(scene)

    def _steps_of(self, spec: TakeSpec, scene: bpy.types.Scene) -> Generator[Progress, None, Any]:
        """The steps that generate it."""
        from ...takes import generate

        return generate(spec, scene)

    def _keep(self, scene: bpy.types.Scene, take: Take) -> set[str]:
        from ...keys.report import result_lines

        with listed_or_discarded(scene, [take.keyed]):
            lines = result_lines(take.report, take.keyed.frame_start, scene.frame_end)
            remember(scene, take.keyed, self._spec.seed, self.beside)
        settings_of(scene).seed = self._spec.seed
        show_results(settings_of(scene), lines)
        for goal, (text, good) in zip(take.report["goals"], lines, strict=False):
            self.report({"INFO" if goal["reached"] and good else "WARNING"}, text)
        return {"FINISHED"}


@contextmanager
def listed_or_discarded(scene: bpy.types.Scene, takes: Sequence[KeyedTake]) -> Iterator[None]:
    """Put takes on the list inside; where that fails, the list is as before and they are discarded, since
    nobody could reject them.
    """
    from ...keys.keyed import discard_take

    made = [replace(take, things=[replace(thing) for thing in take.things]) for take in takes]
    before = KeptTakes(scene)
    try:
        yield
    except BaseException:
        before.restore()
        for take in reversed(made):
            discard_take(take)
        raise


def next_seed(scene: bpy.types.Scene) -> int:
    """The first seed after those of the character's takes; the sidebar's where it has none."""
    return max((take.seed + 1 for take in takes_of(scene)), default=settings_of(scene).seed)


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
        return replace(spec_of(scene), seed=next_seed(scene))


class NSM_OT_continue_take(TakeMaker, bpy.types.Operator):
    bl_idname = "nsm.continue_take"
    bl_label = "Continue from Here"
    bl_description = (
        "Generate the enabled goals from the current frame on: from the pose and pace that the character has "
        "there, standing, sitting or in the middle of a step. What is animated before stays as it is; what "
        "came after is replaced in the new action and kept in the old one"
    )

    def _asked(self, scene: bpy.types.Scene) -> TakeSpec:
        from ...begin import POSE

        return replace(spec_of(scene), start_frame=scene.frame_current, begin=POSE)

    def _keep(self, scene: bpy.types.Scene, take: Take) -> set[str]:
        done = super()._keep(scene, take)
        settings_of(scene).start_frame = take.keyed.first  # another one begins there, too
        return done


class NSM_OT_variations(TakeMaker, bpy.types.Operator):
    bl_idname = "nsm.variations"
    bl_label = "Variations"
    bl_description = (
        "Generate the same goals with several seeds, one after another, and show them beside each other: the "
        "character plays the first, copies of it the others. Click the one that you like and press Pick. All "
        "of them are on the list of takes"
    )

    def _asked(self, scene: bpy.types.Scene) -> TakeSpec:
        return replace(spec_of(scene), seed=next_seed(scene), variations=settings_of(scene).keys.variations)

    def _steps_of(self, spec: TakeSpec, scene: bpy.types.Scene) -> Generator[Progress, None, Any]:
        from ...variations import generate_variations

        return generate_variations(spec, scene)

    def _keep(self, scene: bpy.types.Scene, value: list[Take]) -> set[str]:
        from ...keys.report import goal_line

        labels = [f"Variation {number}" for number in range(1, len(value) + 1)]
        lines = [
            (f"{label}: {goal_line(goal)}", bool(goal["reached"]))
            for label, take in zip(labels, value, strict=True)
            for goal in take.report["goals"]
        ]
        with listed_or_discarded(scene, [take.keyed for take in value]):
            made = [(take.keyed, self._spec.seed + number) for number, take in enumerate(value)]
            remember_all(scene, made, self.beside)
            show(scene, next(t for t in takes_of(scene) if t.character.action == value[0].keyed.action))
            try:
                show_ghosts(scene, [take.keyed for take in value[1:]], labels[1:])
            except BaseException:
                remove_ghosts(scene)
                raise
        settings_of(scene).seed = self._spec.seed
        show_results(settings_of(scene), lines)
        return {"FINISHED"}


CLASSES = (NSM_OT_generate, NSM_OT_another_take, NSM_OT_continue_take, NSM_OT_variations)
