"""What an animation shows before a take's first frame stays: its keys go into the take's action."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import bpy
import numpy as np

from nsm_core.rotations import Array

from ..animation.channels import ActionChannels, curves_in

_SAME = 1e-5  # by which a curve may differ from its keys' straight line
_HELD = ("location", "rotation_quaternion", "rotation_euler", "rotation_axis_angle", "scale")
_TURN = 2 * np.pi
_KEY = ("co", "handle_left", "handle_right")
_KINDS = ("interpolation", "easing", "handle_left_type", "handle_right_type", "type")


def keep_before(
    channels: ActionChannels,
    action: bpy.types.Action | None,
    slot: Any | None,
    first: float,
    carriers: Iterable[str] = (),
) -> None:
    """Put what ``action`` shows in ``slot`` before the frame ``first`` into the new ``channels``, which begin
    there.

    Curves that the take has none of are copied as they are; those of what carries its bones, the object
    itself and the bones ``carriers``, end at ``first`` and hold: the take was made for them as they are
    there.
    """
    if action is None:
        return
    own = {(c.data_path, c.array_index): c for c in channels.bag.fcurves}
    old = {(c.data_path, c.array_index): c for c in curves_in(action, slot) if len(c.keyframe_points)}
    turn_alike(own, old, first)
    held = tuple(f'pose.bones["{bpy.utils.escape_identifier(name)}"].' for name in carriers)
    for (path, index), curve in old.items():
        mine = own.get((path, index))
        if mine is not None:
            prepend(mine, curve, first)
            continue
        mine = new_like(channels, curve)
        if path.startswith(held) if held and path.startswith("pose.") else path in _HELD:
            _add(mine, np.array([first]), np.array([curve.evaluate(first)]))
            prepend(mine, curve, first)
        else:
            copy_whole(mine, curve)
        mine.update()


def stand_before(
    channels: ActionChannels,
    action: bpy.types.Action | None,
    slot: Any | None,
    first: float,
    values: dict[str, Iterable[float]],
) -> None:
    """Have what the new ``channels`` move from ``first`` on, and ``action`` does not, stand before that where
    it stood: ``values`` by path.
    """
    old = set() if action is None else {c.data_path for c in curves_in(action, slot)}
    for curve in channels.bag.fcurves:
        if curve.data_path in values and curve.data_path not in old:
            value = tuple(values[curve.data_path])[curve.array_index]
            _add(curve, np.array([first - 1]), np.array([value]))
            curve.update()
            curve.keyframe_points[0].interpolation = "CONSTANT"


def prepend(mine: bpy.types.FCurve, old: bpy.types.FCurve, first: float) -> None:
    """Give a curve that begins at ``first`` the keys of an old one before it, and its shape in between."""
    places = np.empty(2 * len(old.keyframe_points))
    old.keyframe_points.foreach_get("co", places)
    frames = places[::2]
    before = frames[frames < first - 1e-3]
    _copy_before(mine, old, first)
    start = float(before[-1]) if len(before) else min(float(frames[0]), first - 1)
    between = np.arange(np.floor(start) + 1, first - 1e-3)
    shaped = len(old.modifiers) > 0 or not len(before)
    if shaped:  # cycles, noise: all that the scene may show
        start = min(start, first - len(between) - 1)
    if len(between):
        values = np.array([old.evaluate(f) for f in between])
        line = np.interp(between, (start, first), (old.evaluate(start), mine.evaluate(first)))
        if shaped or np.abs(values - line).max() > _SAME:
            _add(mine, between, values)
    mine.update()


def new_like(channels: ActionChannels, curve: bpy.types.FCurve) -> bpy.types.FCurve:
    """Add a curve without keys for what another one animates, in a group of the same name."""
    mine = channels.bag.fcurves.new(curve.data_path, index=curve.array_index)
    if curve.group is not None:
        name = curve.group.name
        mine.group = channels.bag.groups.get(name) or channels.bag.groups.new(name)
    return mine


def copy_keys(mine: bpy.types.FCurve, old: bpy.types.FCurve, keys: Sequence[bpy.types.Keyframe]) -> None:
    """Add these keys of an old curve as they are."""
    count = len(mine.keyframe_points)
    mine.keyframe_points.add(len(keys))
    for new, key in zip(list(mine.keyframe_points)[count:], keys, strict=True):
        for name in (*_KEY, *_KINDS):
            setattr(new, name, getattr(key, name))


def copy_whole(mine: bpy.types.FCurve, old: bpy.types.FCurve) -> None:
    """Make a curve without keys as an old one is."""
    copy_keys(mine, old, list(old.keyframe_points))
    mine.extrapolation = old.extrapolation
    mine.mute, mine.lock = old.mute, old.lock


def _copy_before(mine: bpy.types.FCurve, old: bpy.types.FCurve, first: float) -> None:
    """Copy the keys of a curve before ``first``; the last one is reached as it was, and goes on straight."""
    keys = [k for k in old.keyframe_points if k.co[0] < first - 1e-3]
    count = len(mine.keyframe_points)
    copy_keys(mine, old, keys)
    if keys:
        last = mine.keyframe_points[count + len(keys) - 1]
        last.interpolation = "LINEAR"
        # Automatic handles would turn to what comes after them now.
        last.handle_left_type = last.handle_right_type = "FREE"
        last.handle_left, last.handle_right = keys[-1].handle_left, keys[-1].handle_right


def _add(mine: bpy.types.FCurve, frames: Array, values: Array) -> None:
    count = len(mine.keyframe_points)
    mine.keyframe_points.add(len(frames))
    for key, frame, value in zip(list(mine.keyframe_points)[count:], frames, values, strict=True):
        key.co, key.interpolation = (frame, value), "LINEAR"


def turn_alike(
    own: dict[tuple[str, int], bpy.types.FCurve], old: dict[tuple[str, int], bpy.types.FCurve], first: float
) -> None:
    """Have rotations begin on the side on which the old ones end, so that nothing turns round in between."""
    for path in {path for path, _ in own}:
        if path.endswith("rotation_quaternion"):
            pairs = [(own.get((path, i)), old.get((path, i))) for i in range(4)]
            if all(a is not None and b is not None for a, b in pairs):
                agree = sum(a.evaluate(first) * b.evaluate(first) for a, b in pairs)
                if agree < 0:
                    for mine, _ in pairs:
                        _change(mine, lambda values: -values)
        elif path.endswith("rotation_euler"):
            for i in range(3):
                mine, before = own.get((path, i)), old.get((path, i))
                if mine is not None and before is not None:
                    rounds = np.round((before.evaluate(first) - mine.evaluate(first)) / _TURN) * _TURN
                    if rounds:
                        _change(mine, lambda values, rounds=rounds: values + rounds)


def _change(curve: bpy.types.FCurve, change: Any) -> None:
    for part in _KEY:
        places = np.empty(2 * len(curve.keyframe_points), np.float32)
        curve.keyframe_points.foreach_get(part, places)
        places[1::2] = change(places[1::2])
        curve.keyframe_points.foreach_set(part, places)
    curve.update()
