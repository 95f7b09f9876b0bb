"""Which take runs now, and why none can start: what panels show, kept out of their drawing."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import bpy

from nsm_core.world.actions import BY_KEY, Aim

from .queue import cast_of, queue_of


@dataclass
class Running:
    """A take under way."""

    scene: bpy.types.Scene
    character: bpy.types.Object
    fraction: float = 0.0
    text: str = "Starting"
    begun: float = field(default_factory=time.monotonic)
    stop: Callable[[str], None] | None = None  # ends it from outside, with the sentence that says why
    put_back: Callable[[], None] | None = None  # has the scene look for a moment as it was before


_running: Running | None = None


def current() -> Running | None:
    """Return the take under way, or None."""
    return _running


def begin_take(
    scene: bpy.types.Scene,
    character: bpy.types.Object,
    stop: Callable[[str], None] | None = None,
    put_back: Callable[[], None] | None = None,
) -> None:
    """Note that a take has started."""
    global _running
    _running = Running(scene, character, stop=stop, put_back=put_back)


def end_take() -> None:
    """Note that no take runs any more."""
    global _running
    _running = None


def interrupt(sentence: str) -> None:
    """Stop the take under way, if there is one, for the reason that ``sentence`` tells; the scene is then as
    it was before.
    """
    state = _running
    end_take()
    if state is not None and state.stop is not None:
        state.stop(sentence)


def note_progress(stage: str, fraction: float) -> str:
    """Note how far the take under way is; return a line with the time left.

    A ``fraction`` below 0: nobody knows, it goes on until it is ended.
    """
    if _running is None:
        return ""
    if not _running.fraction:
        _running.begun = time.monotonic()  # loading says nothing about how fast frames come
    _running.fraction = max(fraction, 0.0)
    if fraction < 0:
        _running.text = stage
        return stage
    _running.text = f"{stage} {fraction:.0%}{time_left(fraction, time.monotonic() - _running.begun)}"
    return _running.text


def time_left(fraction: float, elapsed: float) -> str:
    """Words for the time left after ``elapsed`` seconds at ``fraction`` of the work; empty while it is a
    guess.
    """
    if fraction < 0.05 or fraction >= 1 or elapsed < 0.5:
        return ""
    return f", {max(round(elapsed * (1 - fraction) / fraction), 1)} s left"


def reason_busy() -> str:
    """Why nothing else may start now, as a sentence; empty when no take is under way."""
    return "" if _running is None else "A take is being generated; press ESC to cancel it."


def reason_not_ready(context: bpy.types.Context) -> str:
    """Why Generate cannot start, as a sentence with what to do; empty when it can."""
    if _running is not None:
        return reason_busy()
    reason = reason_no_character(context.scene)
    if reason:
        return reason
    goals = queue_of(context.scene).goals
    if not len(goals):
        return "There is no goal yet; select a seat and press the plus beside the list."
    return _reason_no_goals(goals, context.scene) or _reason_of_mode(context)


def reason_no_cast(context: bpy.types.Context) -> str:
    """Why Generate All cannot start, as a sentence with what to do; empty when it can."""
    if _running is not None:
        return reason_busy()
    cast = cast_of(context.scene)
    if len(cast) < 2:
        return "Fewer than two characters have enabled goals; choose another character and add goals to it."
    for character, queue in cast:
        reason = reason_of(character, context.scene)
        reason = reason or _reason_no_goals(queue.goals, context.scene)
        if reason:
            return reason if character.name in reason else f"{character.name}: {reason}"
    return _reason_of_mode(context)


def _reason_of_mode(context: bpy.types.Context) -> str:
    if context.mode not in {"OBJECT", "POSE"}:
        return "Generate works in Object and Pose Mode; leave the present mode with Tab."
    return ""


def _reason_no_goals(goals: Any, scene: bpy.types.Scene) -> str:
    """Why a queue's goals cannot be tried, as a sentence; empty where they can."""
    enabled = [(number, goal) for number, goal in enumerate(goals, 1) if goal.enabled]
    if not enabled:
        return "No goal is enabled; tick one in the list."
    return next((p for number, goal in enabled if (p := problem_of_row(number, goal, scene))), "")


def reason_no_character(scene: bpy.types.Scene) -> str:
    """Why the chosen character cannot act, as a sentence with what to do; empty when it can."""
    if scene.nsm.character is None:
        return "No character is chosen; choose its armature, or add the bundled character."
    return reason_of(scene.nsm.character, scene)


def reason_of(character: bpy.types.Object, scene: bpy.types.Scene) -> str:
    """Why a character cannot act, as a sentence with what to do; empty when it can."""
    from ..rigs.bone_map import told_map
    from ..world.frame import holds

    if not holds(scene, character):
        return f"The character {character.name} is no longer in this scene; choose another one."
    if character.type != "ARMATURE":
        return f"{character.name} is no armature, and none moves it; choose the armature that is to act."
    return told_map(character).problem(character.name, character.data.bones)


def problem_of_row(number: int, goal: Any, scene: bpy.types.Scene) -> str:
    """What row ``number`` of the queue lacks, as a sentence with what to do; empty where it can be tried."""
    from ..world.frame import holds

    action = BY_KEY.get(goal.action)
    if action is None:
        return unknown_action(number, goal.object.name if goal.object else "")
    if action.aim is Aim.HERE:
        return ""
    if goal.object is None and action.needs_object:
        return f"A goal to {goal.action} has no object; choose one, or remove the goal."
    if goal.object is not None and not holds(scene, goal.object):
        return f"The goal {goal.object.name} is no longer in this scene; choose another object."
    if not action.needs_destination:
        return ""
    if goal.destination is None:
        return (
            f"A goal to {goal.action} {goal.object.name} has no destination; choose the object or empty "
            "where it goes."
        )
    if not holds(scene, goal.destination):
        return f"The destination {goal.destination.name} is no longer in this scene; choose another one."
    if goal.destination == goal.object:
        return f"{goal.object.name} cannot be set down on itself; choose another destination."
    return ""


def unknown_action(number: int, name: str) -> str:
    """Sentence about row ``number`` of the queue, whose stored action this version does not know (a file of
    another version).
    """
    of = f", {name}," if name else ""
    return (
        f"Goal {number}{of} has an action that this version of the add-on does not know; choose one of the "
        "list's, or remove the goal."
    )
