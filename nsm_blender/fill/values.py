"""From a filled motion to the values of a rig's channels, led to what its curves already say.

At its ends, and at keys that are kept in between, a channel has the value that its curves have there, down
to whole turns and signs; what the motion differs from that by, on rigs with more bones than a body has joints
or at a single key, fades smoothly to the next of these anchors.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Euler, Quaternion

from nsm_core.body.skeleton import ARMS, FEET, JOINTS
from nsm_core.rotations import (
    Array,
    quat_conjugate,
    quat_from_axis_angle,
    quat_from_rotvec,
    quat_mul,
    quat_normalize,
    quat_to_rotvec,
)
from nsm_core.signals import smooth_step

from ..keys.limb_controls import control_channels, control_mounts, replaced
from ..keys.pose_channels import bone_channels, mounts_of, poles_of
from ..keys.turns import rotation_channel
from ..rigs.armature import Placement
from ..rigs.bone_map import BoneMap
from ..rigs.mount import Mount


@dataclass(frozen=True)
class Moves:
    """What a motion has one bone do over N frames: ``turns`` (N, 4) and ``places`` (N, 3) of its channels,
    None where these get no keys.
    """

    bone: str
    turns: Array | None
    places: Array | None


def read_mounts(
    character: bpy.types.Object, placement: Placement, bone_map: BoneMap
) -> dict[int | str, Mount]:
    """Where the channels of bones and controls begin, as the scene shows what carries them now."""
    return {**mounts_of(character, placement), **control_mounts(character, bone_map)}


def moves_of(
    character: bpy.types.Object,
    placement: Placement,
    bone_map: BoneMap,
    mounts: dict[int | str, Mount],
    hips: Array,
    local: Array,
) -> Iterator[Moves]:
    """What bones and controls do in a motion: hips (N, 3), world, and local rotations (N, 23, 4).  It poses
    the character, where poles have to be tried.
    """
    own = {j: mounts[j] for j in placement.keyed.apart}
    places, basis = bone_channels(character, placement, own, hips, local)
    pulled = replaced(bone_map)
    for j in placement.keyed.mapped:
        if j not in pulled:
            yield Moves(placement.keyed.bones[j] or "", basis[:, j], places.get(j))
    if bone_map.pulled:
        turned = poles_of(character, placement, bone_map, hips, local)
        for name, control in control_channels(character, placement, bone_map, mounts, hips, local, turned):
            yield Moves(name, control.rotation, control.location)


def led_places(values: Array, anchors: Array, there: Array) -> Array:
    """Places (N, C) led through those that hold ``there`` (K, C) in the rows ``anchors`` (K,)."""
    if not len(anchors):
        return values
    return values + _faded(there - values[anchors], anchors, len(values))


def led_turns(mode: str, turns: Array, anchors: Array, there: Array) -> tuple[Array, Array]:
    """Values (N, 3 or 4) of the channel of a rotation mode for ``turns`` (N, 4), led through the values
    ``there`` (K, 3 or 4) in the rows ``anchors`` (K,), and whether what follows a row (N,) is another way to
    say a turn, so that nothing may be drawn in between.
    """
    if len(anchors):
        theirs = np.stack([quaternion(mode, values) for values in there])
        apart = quat_mul(theirs, quat_conjugate(turns[anchors]))
        apart = np.where(apart[:, :1] < 0, -apart, apart)
        turns = quat_mul(quat_from_rotvec(_faded(quat_to_rotvec(apart), anchors, len(turns))), turns)
        turns = quat_normalize(turns)
    fixed = dict(zip(anchors.tolist(), there, strict=True))
    values = [np.asarray(fixed[0], dtype=np.float64)] if 0 in fixed else []
    for row in range(len(values), len(turns)):
        before = values[-1] if values else None
        values.append(
            np.asarray(fixed[row], dtype=np.float64) if row in fixed else _like(mode, turns[row], before)
        )
    told = np.array(values)
    return told, np.append(_elsewhere(mode, told), False)


def quaternion(mode: str, values: Array) -> Array:
    """The turn (4,) that the channel of a rotation mode says."""
    if mode == "QUATERNION":
        size = float(np.linalg.norm(values))
        return np.asarray(values, dtype=np.float64) / size if size > 1e-9 else np.array((1.0, 0, 0, 0))
    if mode == "AXIS_ANGLE":
        axis = np.asarray(values[1:], dtype=np.float64)
        return quat_from_axis_angle(axis / max(float(np.linalg.norm(axis)), 1e-9), float(values[0]))
    return np.array(Euler(values, mode).to_quaternion(), dtype=np.float64)


def limb_bones(bone_map: BoneMap) -> set[str]:
    """Bones of arms and legs, and their controls: those that a switch may take out of what is seen."""
    joints = {JOINTS[j] for limb in (*ARMS, *FEET) for j in limb}
    controls = {bone for limb in bone_map.limbs.values() for bone in limb.bones}
    return {bone for joint, bone in bone_map.joints.items() if joint in joints} | controls


def path_of(bone: str, channel: str) -> str:
    """Data path of a channel of a bone."""
    return f'pose.bones["{bpy.utils.escape_identifier(bone)}"].{channel}'


def rotation_path(bone: bpy.types.PoseBone) -> str:
    """Data path of the channel that turns a bone."""
    return path_of(bone.name, rotation_channel(bone.rotation_mode))


def _faded(changes: Array, anchors: Array, count: int) -> Array:
    """Changes (K, C) in the rows ``anchors``, in ascending order, led smoothly from each to the next,
    (count, C).
    """
    rows = np.arange(count)
    i = np.clip(np.searchsorted(anchors, rows, side="right") - 1, 0, len(anchors) - 1)
    k = np.minimum(i + 1, len(anchors) - 1)
    share = np.clip((rows - anchors[i]) / np.maximum(anchors[k] - anchors[i], 1), 0, 1)
    return changes[i] + (changes[k] - changes[i]) * smooth_step(share)[:, None]


def _like(mode: str, turn: Array, before: Array | None) -> Array:
    """Values for a turn (4,), of all ways to say it the nearest to those before."""
    if mode == "QUATERNION":
        return -turn if before is not None and turn @ before < 0 else turn
    if mode == "AXIS_ANGLE":
        vector = quat_to_rotvec(turn)
        angle = float(np.linalg.norm(vector))
        axis = vector / angle if angle > 1e-9 else np.array((0.0, 1.0, 0.0))
        if before is None:
            return np.append(angle, axis)
        if angle <= 1e-9 and np.linalg.norm(before[1:]) > 1e-9:
            axis = before[1:] / np.linalg.norm(before[1:])
        if axis @ before[1:] < 0:
            angle, axis = -angle, -axis
        angle += 2 * np.pi * np.round((before[0] - angle) / (2 * np.pi))
        return np.append(angle, axis)
    q = Quaternion(turn)
    return np.array(q.to_euler(mode) if before is None else q.to_euler(mode, Euler(before, mode)))


def _elsewhere(mode: str, values: Array) -> Array:
    """Whether from a row to the next (N - 1,) a turn is said in another way."""
    steps = np.diff(values, axis=0)
    if mode == "QUATERNION":
        return (values[1:] * values[:-1]).sum(1) < 0
    if mode == "AXIS_ANGLE":
        return (np.abs(steps[:, 0]) > np.pi) | (np.linalg.norm(steps[:, 1:], axis=1) > 1)
    return np.abs(steps).max(1) > np.pi


__all__ = ["Moves", "limb_bones", "led_places", "led_turns", "moves_of", "path_of", "read_mounts"]
