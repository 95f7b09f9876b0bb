"""Actions across Blender versions: slots and channelbags where they exist, plain F-curves before.

One path for 4.3 to 5.2; ``ActionChannels`` is all that the rest of the add-on sees of it.
"""

from __future__ import annotations

import secrets
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from .identity import identity

LINEAR, BEZIER = (
    bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items[kind].value
    for kind in ("LINEAR", "BEZIER")
)
_ALIGNED = bpy.types.Keyframe.bl_rna.properties["handle_left_type"].enum_items["ALIGNED"].value
# The type that marks keys as made by a tool came with 4.5; before that they are ordinary keys.
_KEY_TYPES = bpy.types.Keyframe.bl_rna.properties["type"].enum_items
GENERATED = _KEY_TYPES["GENERATED"].value if "GENERATED" in _KEY_TYPES else _KEY_TYPES["KEYFRAME"].value


@dataclass
class ActionChannels:
    """The F-curves and groups of one action for one animated object."""

    action: bpy.types.Action
    slot: Any | None  # bpy.types.ActionSlot from 4.4 on
    bag: Any  # the channelbag, or the action itself before slots

    def curves(
        self,
        path: str,
        group: str,
        frames: np.ndarray,
        values: np.ndarray,
        slopes: np.ndarray | None = None,
    ) -> None:
        """Add the F-curves of a property of C numbers: ``frames`` (N,), ``values`` and ``slopes`` (N, C), as
        ``curve``.
        """
        for i in range(values.shape[1]):
            self.curve(path, i, group, frames, values[:, i], None if slopes is None else slopes[:, i])

    def curve(
        self,
        path: str,
        index: int,
        group: str,
        frames: np.ndarray,
        values: np.ndarray,
        slopes: np.ndarray | None = None,
    ) -> bpy.types.FCurve:
        """Add an F-curve with one GENERATED key per frame: ``frames`` (N,), ``values`` (N,).

        The keys are linear, or with ``slopes`` (N,), a frame, Bézier keys whose handles span a third of the
        way to the next ones, so that the curve is the cubic with these slopes.
        """
        fcurve = self.bag.fcurves.new(path, index=index)
        fcurve.group = self.bag.groups.get(group) or self.bag.groups.new(group)
        keys = fcurve.keyframe_points
        keys.add(len(frames))
        keys.foreach_set("co", _pairs(frames, values))
        keys.foreach_set("type", np.full(len(frames), GENERATED, np.intc))
        kind = LINEAR if slopes is None else BEZIER
        keys.foreach_set("interpolation", np.full(len(frames), kind, np.intc))
        if slopes is not None and len(frames) > 1:
            thirds = np.diff(frames) / 3
            for side, third in (("left", -np.r_[thirds[0], thirds]), ("right", np.r_[thirds, thirds[-1]])):
                keys.foreach_set(f"handle_{side}_type", np.full(len(frames), _ALIGNED, np.intc))
                keys.foreach_set(f"handle_{side}", _pairs(frames + third, values + slopes * third))
        fcurve.update()
        return fcurve


def _pairs(frames: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack((frames, values)).astype(np.float32).ravel()


_made: list[int | str] = []  # what tells the actions that the add-on has made in this session


def new_action(name: str, slot_name: str) -> ActionChannels:
    """Make an empty action with a slot for an object; it is not assigned to anything yet."""
    passing = f"NSM {secrets.token_hex(12)}"
    # A break may come between any two lines: by then the action has this name, or its number is noted.
    _made.append(passing)
    action = bpy.data.actions.new(passing)
    _made.append(identity(action))
    action.name = name
    if not hasattr(action, "slots"):
        return ActionChannels(action, None, action)
    slot = action.slots.new(id_type="OBJECT", name=slot_name)
    return ActionChannels(action, slot, _channelbag(action, slot))


def copied_channels(channels: ActionChannels, name: str) -> ActionChannels:
    """Copy an action with all that it holds, the channels of one object in hand; the copy is not assigned to
    anything yet.
    """
    action = channels.action.copy()
    _made.append(identity(action))
    action.name = name
    if channels.slot is None:
        return ActionChannels(action, None, action)
    slot = next(s for s in action.slots if s.handle == channels.slot.handle)
    return ActionChannels(action, slot, _channelbag(action, slot))


def made_so_far() -> int:
    """A mark in the add-on's making of actions, for ``made_since``."""
    return len(_made)


def made_since(mark: int) -> list[bpy.types.Action]:
    """Actions that the add-on has made since a mark and that are still there; what others have made meanwhile
    is not among them.
    """
    made = set(_made[mark:])
    return [action for action in bpy.data.actions if identity(action) in made or action.name in made]


def channels_of(target: bpy.types.Object) -> ActionChannels | None:
    """The channels that animate ``target`` now, or None when it has no action or no slot in it."""
    data = target.animation_data
    if data is None or data.action is None:
        return None
    if not hasattr(data.action, "slots"):
        return ActionChannels(data.action, None, data.action)
    if data.action_slot is None:
        return None
    return ActionChannels(data.action, data.action_slot, _channelbag(data.action, data.action_slot))


def strip_curves(target: bpy.types.Object, own_action: bool = False) -> Iterator[bpy.types.FCurve]:
    """F-curves of the NLA strips of ``target`` that are played, and those of its own action where
    asked for.
    """
    data = target.animation_data
    if data is None:
        return
    if own_action and data.action is not None:
        yield from curves_in(data.action, getattr(data, "action_slot", None))
    if data.use_nla:
        for track in data.nla_tracks:
            if not track.mute:
                yield from _of_strips(track.strips)


def has_strips(target: bpy.types.Object) -> bool:
    """Whether ``target`` has no action of its own and NLA strips that are played."""
    data = target.animation_data
    return data is not None and data.action is None and next(strip_curves(target), None) is not None


def _of_strips(strips: Iterable[bpy.types.NlaStrip]) -> Iterator[bpy.types.FCurve]:
    for strip in strips:
        if strip.mute:
            continue
        if strip.action is not None:
            yield from curves_in(strip.action, getattr(strip, "action_slot", None))
        yield from _of_strips(strip.strips)  # of a meta strip


def curves_in(action: bpy.types.Action, slot: Any | None) -> Iterator[bpy.types.FCurve]:
    """F-curves that an action holds for a slot."""
    if not hasattr(action, "slots"):
        yield from action.fcurves
        return
    for layer in action.layers:
        for strip in layer.strips:
            bag = strip.channelbag(slot) if slot is not None else None
            if bag is not None:
                yield from bag.fcurves


def assign(target: bpy.types.Object, action: bpy.types.Action | None, slot: Any | None) -> None:
    """Give ``target`` an action together with the slot that animates it, None for none; without an action it
    has neither.
    """
    data = target.animation_data or target.animation_data_create()
    data.action = action
    if action is not None and hasattr(data, "action_slot"):
        data.action_slot = slot


def remove_unused(action: bpy.types.Action) -> None:
    """Remove an action from the file where nothing uses it any more but its own wish to be kept."""
    if action.users == int(action.use_fake_user):
        bpy.data.actions.remove(action)


def transform_of(moving: bpy.types.Object | bpy.types.PoseBone) -> dict[str, Any]:
    """The transform channels of an object or a bone and their values, to be set again later."""
    names = ("location", "rotation_quaternion", "rotation_euler", "rotation_axis_angle", "scale")
    return {name: tuple(getattr(moving, name)) for name in names}


def _channelbag(action: bpy.types.Action, slot: Any) -> Any:
    try:
        from bpy_extras.anim_utils import action_ensure_channelbag_for_slot
    except ImportError:  # 4.4 and 4.5
        layer = action.layers[0] if action.layers else action.layers.new("Layer")
        strip = layer.strips[0] if layer.strips else layer.strips.new(type="KEYFRAME")
        return strip.channelbag(slot, ensure=True)
    return action_ensure_channelbag_for_slot(action, slot)
