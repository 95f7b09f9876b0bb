"""Fingers of a take: relaxed, and closed on what hands hold for as long as they do; a few keys each."""

from __future__ import annotations

from collections.abc import Mapping

import bpy
import numpy as np

from nsm_core.control.take import TakeResult
from nsm_core.conventions import FPS, HAND_CONTACTS
from nsm_core.rotations import Array
from nsm_core.signals import intervals
from nsm_core.world.actions import BY_KEY
from nsm_core.world.scene.props import Openable

from ..animation.channels import ActionChannels, channels_of, curves_in
from ..rigs.bone_map import bone_map_of
from ..rigs.fingers import FIST, FLAT, RELAXED, bent, fingers_of, quaternions
from .before import prepend
from .keyed import KeyedTake
from .turns import continuous, rotation_channel, rotation_values

_HELD, _SHORTEST, _APART = (
    0.5,
    6,
    8,
)  # of the contact label; frames of a hold at least, and between two at least
_EASE = 8  # frames in which fingers close and open


def key_fingers(keyed: KeyedTake, result: TakeResult) -> None:
    """Key the fingers of a take that has keys already, where its character has any and wants them keyed."""
    armature = keyed.armature
    channels = channels_of(armature)
    if channels is None or not wants_fingers(armature):
        return
    fingers = fingers_of(armature, bone_map_of(armature))
    old = () if keyed.previous_action is None else curves_in(keyed.previous_action, keyed.previous_slot)
    before = {(curve.data_path, curve.array_index): curve for curve in old}
    shapes = {shape: quaternions(bent(armature, fingers, shape)) for shape in (RELAXED, FLAT, FIST)}
    moments = {side: _moments(result, side) for side in {finger.side for finger in fingers}}
    for finger in fingers:
        rows, held = moments[finger.side]
        frames = keyed.frame_start + np.round(np.array(rows) / FPS * keyed.fps)
        frames, last = np.unique(frames, return_index=True)
        for name in finger.bones:
            turns = np.array([shapes[held[k]][name] for k in last])
            _key(channels, armature.pose.bones[name], frames, turns, before)


def wants_fingers(armature: bpy.types.Object) -> bool:
    """Whether the fingers of a character get keys."""
    rig = getattr(armature.data, "nsm_rig", None)
    return rig is None or rig.fingers


def _moments(result: TakeResult, side: int) -> tuple[list[int], list[str]]:
    """Frames of the motion at which the fingers of a hand are keyed, and their shapes there."""
    held = result.contacts[:, HAND_CONTACTS][:, side] > _HELD
    rows, shapes = [0], [RELAXED]
    for goal in result.goals:
        action = BY_KEY[goal.action]
        if not action.hands:
            continue
        shape = FIST if action.prop is Openable else FLAT
        first, last = max(goal.start_frame, 0), goal.end_frame + 1
        spans = [(first + a, first + b) for a, b in intervals(held[first:last]) if b - a >= _SHORTEST]
        for a, b in _joined(spans):
            begin, end = max(a - _EASE, rows[-1] + 1), min(b + _EASE, len(held) - 1)
            rows += [begin, max(a, begin + 1), max(b - 1, a + 2), max(end, b + 1)]
            shapes += [RELAXED, shape, shape, RELAXED]
    return rows, shapes


def _joined(spans: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Half-open intervals, those that are nearly one as one."""
    out: list[tuple[int, int]] = []
    for a, b in spans:
        if out and a - out[-1][1] < 2 * _EASE + _APART:
            out[-1] = out[-1][0], b
        else:
            out.append((a, b))
    return out


def _key(
    channels: ActionChannels,
    bone: bpy.types.PoseBone,
    frames: Array,
    turns: Array,
    before: Mapping[tuple[str, int], bpy.types.FCurve],
) -> None:
    """Key rotations (N, 4) that ease in and out; where the action has a curve already, they go on from what
    that was ``before``.
    """
    mode = bone.rotation_mode
    path = f'pose.bones["{bpy.utils.escape_identifier(bone.name)}"].{rotation_channel(mode)}'
    values = rotation_values(mode, continuous(turns[:, None])[:, 0])
    for i in range(values.shape[1]):
        known = channels.bag.fcurves.find(path, index=i)
        if known is not None:  # copied from the action before, which goes on
            channels.bag.fcurves.remove(known)
            values[0, i] = before[path, i].evaluate(frames[0])
        made = channels.curve(path, i, bone.name, frames, values[:, i], np.zeros(len(frames)))
        if known is not None:
            prepend(made, before[path, i], float(frames[0]))
            made.update()


__all__ = ["key_fingers", "wants_fingers"]
