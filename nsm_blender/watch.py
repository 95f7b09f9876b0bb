"""What a take under way stands on: whether it is still there, and what Blender tells before it takes it away."""

from __future__ import annotations

import atexit
from collections.abc import Callable

import bpy
from bpy.app.handlers import persistent

from nsm_core.skeleton import JOINTS

from . import running
from .properties import settings_of, show_results
from .takes import TakeSpec

_STOPPED = "so Generate stopped and nothing was keyed"


class Watch:
    """The scene, the character, its bones and the goals' objects of one take, by reference and by name."""

    def __init__(self, spec: TakeSpec, scene: bpy.types.Scene) -> None:
        self.scene, self.character, self.data = scene, spec.character, spec.character.data
        self.names = {"scene": scene.name, "character": spec.character.name}
        self.bones = [name for name in JOINTS if name in self.data.bones]
        goals = [needed for goal in spec.goals for needed in (goal.object, goal.to) if needed is not None]
        self.goals = [(needed, needed.name) for needed in dict.fromkeys(goals)]

    def changed(self) -> str:
        """Return what was deleted, exchanged or renamed meanwhile, as a sentence with what to do; empty where the take can go on."""
        scene, character = self.names["scene"], f"The character {self.names['character']}"
        if not exists(self.scene):
            return f"The scene {scene} was deleted or undone meanwhile, {_STOPPED}; generate again in the scene that is left."
        if getattr(bpy.context, "scene", self.scene) != self.scene:
            return f"Another scene than {scene} was chosen meanwhile, {_STOPPED}; go back to it and generate again."
        if not exists(self.character):
            return f"{character} was deleted or undone meanwhile, {_STOPPED}; choose another one."
        if self.character.name not in self.scene.objects:
            return f"{character} was taken out of the scene meanwhile, {_STOPPED}; put it back, or choose another one."
        if self.character.library is not None and self.character.override_library is None:
            return f"{character} became a link to another file meanwhile, {_STOPPED}; make a library override of it."
        if not exists(self.data) or self.character.data != self.data:
            return f"{character} got another armature meanwhile, {_STOPPED}; generate again."
        if self.character.mode == "EDIT":
            return f"{character} went into Edit Mode meanwhile, {_STOPPED}; leave it with Tab and generate again."
        lost = next((name for name in self.bones if name not in self.data.bones or name not in self.character.pose.bones), None)
        if lost is not None:
            return f"The bone {lost} of {self.names['character']} was renamed or deleted meanwhile, {_STOPPED}; undo that, or name it back."
        for needed, name in self.goals:
            if not exists(needed) or needed.name not in self.scene.objects:
                return f"{name}, a goal of the take, was deleted meanwhile, {_STOPPED}; choose another object, or remove the goal."
        return ""


def exists(block: bpy.types.ID) -> bool:
    """Whether a reference to Blender's data still leads to something."""
    try:
        return bool(block.name)
    except ReferenceError:
        return False


_words = ""  # why a take was stopped, to be told when the step has been undone: the sidebar's lines are undone with it


def _stop(sentence: str) -> None:
    global _words
    if running.current() is not None:
        _words = sentence
        running.interrupt(sentence)


@persistent
def _before_undo(*_: object) -> None:
    # Before, not after: Blender leaves alone what it thinks unchanged between two steps, so that a preview would stay.
    _stop(f"The scene was undone meanwhile, {_STOPPED}; generate again.")


@persistent
def _before_redo(*_: object) -> None:
    _stop(f"A step was done again meanwhile, {_STOPPED}; generate again.")


@persistent
def _after_undo(*_: object) -> None:
    global _words
    if _words and hasattr(bpy.context.scene, "nsm"):
        show_results(settings_of(bpy.context.scene), [(_words, False)])
    _words = ""


@persistent
def _before_load(*_: object) -> None:
    running.interrupt(f"Another file was opened meanwhile, {_STOPPED}.")


@persistent
def _before_save(*_: object) -> None:
    """Have the file hold the animator's pose; the take goes on with its next frame."""
    state = running.current()
    if state is not None and state.put_back is not None:
        state.put_back()


_HANDLERS: dict[str, Callable[..., None]] = {
    "undo_pre": _before_undo,
    "undo_post": _after_undo,
    "redo_pre": _before_redo,
    "redo_post": _after_undo,
    "load_pre": _before_load,
    "save_pre": _before_save,
}


def install() -> None:
    """Have Blender tell before it undoes, loads or saves; a second call changes nothing."""
    for name, handler in _HANDLERS.items():
        if handler not in getattr(bpy.app.handlers, name):
            getattr(bpy.app.handlers, name).append(handler)
    if bpy.app.module:  # the wheel complains of leaks, and hangs, when a program ends with handlers in place
        atexit.unregister(uninstall)
        atexit.register(uninstall)


def uninstall() -> None:
    """Take the handlers away again."""
    for name, handler in _HANDLERS.items():
        if handler in getattr(bpy.app.handlers, name):
            getattr(bpy.app.handlers, name).remove(handler)
