"""Which overlays are shown: their toggles, and what keeps them up to date outside of all drawing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import bpy
from bpy.app.handlers import persistent
from bpy.props import BoolProperty

from ..animation.identity import identity
from ..overlays.layers import LAYERS, Layer
from . import lookout, running
from .preferences import default_overlays, shows_picked
from .properties import settings_of
from .queue import queue_of

if TYPE_CHECKING:
    from ..outlook import GoalOutlook
    from ..overlays.kept import RememberedTake
    from ..overlays.shapes import Shapes

_PICKED = "picked"  # among the overlays, what shows the chosen goal
_REST = 0.6  # seconds after an edit, before one looks again


def _toggled(_group: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    scene = context.scene
    if wants_look() and lookout.is_stale():
        lookout.ask(scene)
    refresh(scene)


class NsmOverlays(bpy.types.PropertyGroup):
    """Whether each overlay is shown; kept with the window, not with the scene."""

    __annotations__ = {
        layer.key: BoolProperty(name=layer.label, description=layer.description, update=_toggled)
        for layer in LAYERS
    }


def toggles() -> Any:
    """The toggles, an attribute each by the overlay's key."""
    return bpy.context.window_manager.nsm_overlays


def wants_look() -> bool:
    """Whether an overlay is on that needs a look at the scene before a take."""
    return any(getattr(toggles(), layer.key) for layer in LAYERS if layer.before is not None)


def wants_take() -> bool:
    """Whether an overlay is on that shows a take alone."""
    return any(getattr(toggles(), layer.key) for layer in LAYERS if layer.before is None)


def reason_empty(scene: bpy.types.Scene) -> str:
    """Why the overlays that are on show nothing, or not yet, as a sentence; empty where they do."""
    from ..overlays.kept import remembered_take

    if wants_look():
        problem = lookout.problem(scene)
        if problem:
            return problem
        if lookout.under_way():
            return "Looking at the scene ..."
    if not wants_take():
        return ""
    character = settings_of(scene).character
    take = remembered_take(character)
    if take is None:
        if character is not None and character.animation_data and character.animation_data.action:
            return (
                "What this action's take has sensed is not known: it is kept until Blender is closed or "
                "another file is opened. Generate again to see it."
            )
        return "The character has no take yet; generate one to see what it senses."
    if take.frame_at(scene.frame_current_final) is None:
        return "The current frame lies outside the take; go to one of its frames."
    return ""


def refresh(scene: bpy.types.Scene) -> None:
    """Make everything anew that is shown."""
    from ..overlays import viewport
    from ..overlays.kept import remembered_take

    global _drawn_of
    take = remembered_take(settings_of(scene).character)
    t = None if take is None else take.frame_at(scene.frame_current_final)
    _drawn_of = _now(scene)
    for layer in LAYERS:
        viewport.show(scene, layer.key, _made(layer, _before(scene, layer), take, t), layer.flat)
    viewport.show(scene, _PICKED, _picked(scene), False)


def _before(scene: bpy.types.Scene, layer: Layer) -> Shapes | None:
    """What a layer draws of what was seen of the scene last; where it follows, of things where they are."""
    made, seen = lookout.shapes(scene, layer.key), lookout.seen(scene)
    if made is None or seen is None or not (layer.follows and getattr(toggles(), layer.key)):
        return made
    from ..overlays.scene_layers import followed

    return followed(made, seen, scene)


def goal_picked(scene: bpy.types.Scene) -> None:
    """Show where the goal that was picked was found, as soon as it is known."""
    if not shows_picked() or running.current() is not None:
        return
    if _active_told(scene) is None and settings_of(scene).character is not None and not bpy.app.background:
        lookout.ask(scene)
    refresh(scene)


def _active_told(scene: bpy.types.Scene) -> GoalOutlook | None:
    queue = queue_of(scene)
    index = queue.active_goal
    return lookout.told_of(scene, index, queue.goals[index]) if 0 <= index < len(queue.goals) else None


def _picked(scene: bpy.types.Scene) -> Shapes | None:
    from ..overlays.scene_layers import goals as goal_shapes

    told, seen = _active_told(scene), lookout.seen(scene)
    if told is None or seen is None or not shows_picked() or toggles().goals:
        return None
    return goal_shapes(seen, told)


def _made(layer: Layer, before: Shapes | None, take: RememberedTake | None, t: int | None) -> Shapes | None:
    if not getattr(toggles(), layer.key):
        return None
    made = [before] if before is not None else []
    if layer.during is not None and take is not None and t is not None:
        made.append(layer.during(take, t))
    return made[0].joined(made[1:]) if made else None


_drawn_of: tuple[Any, ...] = ()


def _now(scene: bpy.types.Scene) -> tuple[Any, ...]:
    """What the overlays of a take stand for, to tell whether they must be made anew."""
    character = settings_of(scene).character
    action = character.animation_data.action if character is not None and character.animation_data else None
    frame = scene.frame_current_final
    return scene.name_full, frame, None if action is None else identity(action)


def _shows_any() -> bool:
    return any(getattr(toggles(), layer.key) for layer in LAYERS)


def _looks_on(scene: bpy.types.Scene) -> bool:
    """Whether what happens is the animator's doing in the scene that is shown: no take, and no rendering,
    which another thread does.
    """
    busy = running.current() is not None or bpy.app.is_job_running("RENDER")
    return not busy and scene == bpy.context.scene


@persistent
def _after_frame(scene: bpy.types.Scene, *_: object) -> None:
    if wants_take_layers() and _looks_on(scene):
        refresh(scene)


def wants_take_layers() -> bool:
    """Whether an overlay is on that changes from frame to frame."""
    return any(getattr(toggles(), la.key) for la in LAYERS if la.during is not None or la.follows)


@persistent
def _after_change(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if not _looks_on(scene):
        return
    if not lookout.is_stale() and any(
        update.is_updated_transform or update.is_updated_geometry for update in depsgraph.updates
    ):
        lookout.note_change()
    if lookout.is_stale() and wants_look():
        lookout.ask(scene, _REST)
    if _shows_any() and _now(scene) != _drawn_of:
        refresh(scene)


@persistent
def _before_undo(*_: object) -> None:
    lookout.stop()


@persistent
def _after_undo(*_: object) -> None:
    scene = bpy.context.scene
    if wants_look():
        lookout.ask(scene, _REST)
    if _shows_any():
        refresh(scene)


@persistent
def _before_load(*_: object) -> None:
    from ..overlays import kept, viewport

    lookout.stop()
    kept.forget()
    viewport.clear()


@persistent
def _after_load(*_: object) -> None:
    if _shows_any():
        _after_undo()


def _looked() -> None:
    from ..overlays import viewport

    scene = bpy.context.scene
    if scene is not None and (_shows_any() or shows_picked()):
        refresh(scene)
    viewport.redraw()


_HANDLERS = {
    "frame_change_post": _after_frame,
    "depsgraph_update_post": _after_change,
    "undo_pre": _before_undo,
    "redo_pre": _before_undo,
    "undo_post": _after_undo,
    "redo_post": _after_undo,
    "load_pre": _before_load,
    "load_post": _after_load,
}


def install() -> None:
    """Keep what is shown up to date from now on; a second call changes nothing."""
    if not hasattr(bpy.types.WindowManager, "nsm_overlays"):
        bpy.types.WindowManager.nsm_overlays = bpy.props.PointerProperty(type=NsmOverlays)
    for name, handler in _HANDLERS.items():
        if handler not in getattr(bpy.app.handlers, name):
            getattr(bpy.app.handlers, name).append(handler)
    lookout.on_change(_looked)
    if not bpy.app.background:  # while add-ons are enabled there is no scene yet
        bpy.app.timers.register(switch_on_defaults, first_interval=0.1)


def switch_on_defaults() -> None:
    """Switch on the overlays that the preferences say."""
    for key in default_overlays():
        setattr(toggles(), key, True)


def uninstall() -> None:
    """Leave nothing in the viewports, and no handler."""
    from ..overlays import kept, viewport

    for name, handler in _HANDLERS.items():
        if handler in getattr(bpy.app.handlers, name):
            getattr(bpy.app.handlers, name).remove(handler)
    lookout.uninstall()
    if not bpy.app.background and bpy.app.timers.is_registered(switch_on_defaults):
        bpy.app.timers.unregister(switch_on_defaults)
    kept.forget()
    viewport.clear()
    if hasattr(bpy.types.WindowManager, "nsm_overlays"):
        del bpy.types.WindowManager.nsm_overlays


CLASSES = (NsmOverlays,)
