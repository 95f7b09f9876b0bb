"""Which take runs now, and why none can start: what panels show, kept out of their drawing."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import bpy

from nsm_core.skeleton import JOINTS

from .actions import BY_KEY


@dataclass
class Running:
    """A take under way."""

    scene: bpy.types.Scene
    character: bpy.types.Object
    fraction: float = 0.0
    text: str = "Starting"
    begun: float = field(default_factory=time.monotonic)


_running: Running | None = None


def current() -> Running | None:
    """Return the take under way, or None."""
    return _running


def begin(scene: bpy.types.Scene, character: bpy.types.Object) -> None:
    """Note that a take has started."""
    global _running
    _running = Running(scene, character)


def end() -> None:
    """Note that no take runs any more."""
    global _running
    _running = None


def advance(stage: str, fraction: float) -> str:
    """Note how far the take under way is; return a line with the time left."""
    if _running is None:
        return ""
    if not _running.fraction:
        _running.begun = time.monotonic()  # loading says nothing about how fast frames come
    _running.fraction = fraction
    _running.text = f"{stage} {fraction:.0%}{time_left(fraction, time.monotonic() - _running.begun)}"
    return _running.text


def time_left(fraction: float, elapsed: float) -> str:
    """Words for the time left after ``elapsed`` seconds at ``fraction`` of the work; empty while it is a guess."""
    if fraction < 0.05 or fraction >= 1 or elapsed < 0.5:
        return ""
    return f", {max(round(elapsed * (1 - fraction) / fraction), 1)} s left"


def reason_not_ready(context: bpy.types.Context) -> str:
    """Why Generate cannot start, as a sentence with what to do; empty when it can."""
    settings = context.scene.nsm
    character = settings.character
    if _running is not None:
        return "A take is being generated; press ESC to cancel it."
    if character is None:
        return "No character is chosen; choose its armature, or add the bundled character."
    if character.name not in context.scene.objects:
        return f"The character {character.name} is no longer in this scene; choose another one."
    missing = [name for name in JOINTS if name not in character.data.bones]
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        return f"{character.name} lacks the bone {missing[0]}{more}; rename its bones to the 23 joint names, or add the bundled character."
    enabled = [goal for goal in settings.goals if goal.enabled]
    if not settings.goals:
        return "There is no goal yet; select a seat and press the plus beside the list."
    if not enabled:
        return "No goal is enabled; tick one in the list."
    for goal in enabled:
        if goal.object is None and BY_KEY[goal.action].needs_object:
            return f"A goal to {goal.action} has no object; choose one, or remove the goal."
        if goal.destination is None and BY_KEY[goal.action].needs_destination:
            return f"A goal to {goal.action} {goal.object.name} has no destination; choose the object or empty where it goes."
    if context.mode not in {"OBJECT", "POSE"}:
        return "Generate works in Object and Pose Mode; leave the present mode with Tab."
    return ""
