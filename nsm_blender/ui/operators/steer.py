"""Steer: the character is led by the keyboard in the viewport, and what it does is recorded and keyed."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import bpy
from mathutils import Vector

from .. import running
from ..properties import queue_of
from ..session import TakeSession
from .generate import TakeMaker, spec_of


class NSM_OT_steer(TakeMaker, bpy.types.Operator):
    bl_idname = "nsm.steer"
    bl_label = "Steer"
    bl_description = (
        "Lead the character with the keys in the viewport, and record it. WASD or the arrows go where the "
        "camera looks, Shift runs, Q and E turn; 1 to 9 have it do a goal of the list by itself, G the "
        "chosen one, and any key that leads takes over again. Space or Enter keys what was recorded, ESC "
        "puts everything back"
    )

    @classmethod
    def reason_off(cls, context: bpy.types.Context) -> str:
        reason = running.reason_busy() or running.reason_no_character(context.scene)
        if bpy.app.background:
            reason = reason or "One steers in a window; from a script, drive nsm_blender.steering.steer."
        return reason

    def _open(self, context: bpy.types.Context, ended: Callable[[], None]) -> TakeSession:
        from ...steering import Controls, steer

        self._spec, queue = spec_of(context.scene), queue_of(context.scene)
        enabled = [n for n, row in enumerate(queue.goals) if row.enabled]
        active = enabled.index(queue.active_goal) + 1 if queue.active_goal in enabled else 0
        self._controls = Controls(active)
        view = _view_of(context)
        self._before = view.view_location.copy() if view else None
        self._seen: Vector | None = None
        steps = partial(steer, controls=self._controls)
        return TakeSession(self._spec, context.scene, ended, steps, "Recording stopped and nothing was keyed")

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        from ...steering import HELP

        if not self._session.over and event.type not in {"TIMER", "ESC"}:
            if self._controls.event(event.type, event.value):
                return {"RUNNING_MODAL"}
        view = _view_of(context)  # anew: areas come and go
        if view is not None:
            self._controls.view = heading_of_view(view.view_rotation @ Vector((1.0, 0.0, 0.0)))
        answer = super().modal(context, event)
        if event.type == "TIMER" and "RUNNING_MODAL" in answer:
            self._follow(view)
            told = self._controls.said or HELP
            context.workspace.status_text_set(
                f"NSM: {self._session.text}   {told}   ESC: put everything back"
            )
        return answer

    def cancel(self, context: bpy.types.Context) -> None:
        super().cancel(context)
        view = _view_of(context)
        if view is not None and self._before is not None:
            view.view_location = self._before

    def _follow(self, view: Any) -> None:
        """Have the view go with the character, as it was turned and zoomed."""
        if view is None or view.view_perspective == "CAMERA" or not self._session.posed:
            return
        character = self._session.character
        hips = _place_of(character)
        if self._seen is not None:
            view.view_location += hips - self._seen
        self._seen = hips


def heading_of_view(right: Any) -> float:
    """The heading, radians, in which a camera looks over the floor whose right side points to ``right`` (3,).

    It also is right for one that looks straight down.
    """
    return math.atan2(-right[1], -right[0]) if right[0] or right[1] else 0.0


def _place_of(character: bpy.types.Object) -> Vector:
    """Where the character is now on the floor."""
    low = min(character.pose.bones, key=lambda b: len(b.parent_recursive))
    place = character.matrix_world @ low.matrix.translation
    return Vector((place.x, place.y, 0.0))


def _view_of(context: bpy.types.Context) -> Any:
    """What the viewport looks at; None where there is none."""
    areas = [context.area, *context.screen.areas] if context.screen else []
    found = next((a for a in areas if a is not None and a.type == "VIEW_3D"), None)
    return found.spaces.active.region_3d if found else None


CLASSES = (NSM_OT_steer,)
