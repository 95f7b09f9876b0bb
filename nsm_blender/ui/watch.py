"""What a take under way stands on: whether it is still there, and what Blender tells before it takes
it away.
"""

from __future__ import annotations

import atexit
from collections.abc import Callable
from typing import TYPE_CHECKING

import bpy
from bpy.app.handlers import persistent

from ..animation.identity import Known
from . import running
from .properties import settings_of, show_results
from .queue import hand_over

if TYPE_CHECKING:
    from ..prepare import TakeSpec

_STOPPED = "so Generate stopped and nothing was keyed"


class Watch:
    """The scene, the character, its bones and the goals' objects of one take: these very ones, whatever they
    are called by now.
    """

    def __init__(self, spec: TakeSpec, scene: bpy.types.Scene) -> None:
        from ..rigs.bone_map import bone_map_of

        self.scene, self.character, self.data = (
            Known(scene),
            Known(spec.character),
            Known(spec.character.data),
        )
        self.bones = [*bone_map_of(spec.character).joints.values()]
        goals = [needed for goal in spec.goals for needed in (goal.object, goal.to) if needed is not None]
        self.goals = [Known(needed) for needed in dict.fromkeys(goals)]

    def changed(self) -> str:
        """Return what was deleted, exchanged or renamed meanwhile, as a sentence with what to do; empty where
        the take can go on.
        """
        from ..world.frame import holds

        scene, character, data = self.scene.block, self.character.block, self.data.block
        # And called what they are now.
        known = [block.here for block in (self.scene, self.character, self.data, *self.goals)]
        who = f"The character {self.character.name}"
        if not known[0]:
            return (
                f"The scene {self.scene.name} was deleted or undone meanwhile, {_STOPPED}; generate again "
                "in the scene that is left."
            )
        if getattr(bpy.context, "scene", scene) != scene:
            return (
                f"Another scene than {self.scene.name} was chosen meanwhile, {_STOPPED}; go back to it and "
                "generate again."
            )
        if not known[1]:
            return f"{who} was deleted or undone meanwhile, {_STOPPED}; choose another one."
        if not holds(scene, character):
            return (
                f"{who} was taken out of the scene meanwhile, {_STOPPED}; put it back, or choose another one."
            )
        if character.library is not None and character.override_library is None:
            return (
                f"{who} became a link to another file meanwhile, {_STOPPED}; make a library override of it."
            )
        if not known[2] or character.data != data:
            return f"{who} got another armature meanwhile, {_STOPPED}; generate again."
        if character.mode == "EDIT":
            return f"{who} went into Edit Mode meanwhile, {_STOPPED}; leave it with Tab and generate again."
        lost = next(
            (name for name in self.bones if name not in data.bones or name not in character.pose.bones), None
        )
        if lost is not None:
            return (
                f"The bone {lost} of {character.name} was renamed or deleted meanwhile, {_STOPPED}; undo "
                "that, or name it back."
            )
        for goal, here in zip(self.goals, known[3:], strict=True):
            if not here:
                return (
                    f"{goal.name}, a goal of the take, was deleted meanwhile, {_STOPPED}; choose another "
                    "object, or remove the goal."
                )
            if not holds(scene, goal.block):
                return (
                    f"The goal {goal.name} was taken out of the scene meanwhile, {_STOPPED}; put it back, "
                    "or choose another one."
                )
        return ""


# Why a take was stopped, to be told when the step has been undone: the sidebar's lines are undone with it.
_words = ""


def _stop(sentence: str) -> None:
    global _words
    if running.current() is not None:
        _words = sentence
        running.interrupt(sentence)


@persistent
def _before_undo(*_: object) -> None:
    # Before, not after: Blender leaves alone what it thinks unchanged between two steps, so that a preview
    # would stay.
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
def _after_load(*_: object) -> None:
    """Give the rows of files from before characters had queues of their own to their characters."""
    for scene in bpy.data.scenes:
        if hasattr(scene, "nsm"):
            hand_over(scene.nsm)


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
    "load_post": _after_load,
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
