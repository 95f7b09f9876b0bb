"""Hands and feet keyed on the controls that pull them: an IK control where the wrist or the ankle is, its
pole ahead of the elbow or the knee.

A control keeps, rigidly, the place that it has at rest from the bone that shows its joint.  A pole lies in
the plane in which its limb bends; where a limb is nearly straight, where the turn of its upper bone says.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from nsm_core.body.skeleton import ARMS, FEET, INDEX, forward_kinematics
from nsm_core.rotations import Array, quat_conjugate, quat_mul, quat_normalize, quat_rotate
from nsm_core.signals import smooth_step

from ..rigs.armature import Placement, read_world_pose
from ..rigs.bone_map import BoneMap, LimbControls
from ..rigs.mount import Mount

# Joints of a limb by that at its end; feet have toes, too.
_LIMBS = {INDEX[name]: tuple(limb) for name, limb in zip(
    ("RightWrist", "LeftWrist", "RightAnkle", "LeftAnkle"), (*ARMS, *FEET), strict=True)}  # fmt: skip
_BENT = (0.004, 0.02)  # of a limb's length that its middle is off the line between its ends: straight, bent
_AHEAD = 0.8  # of a limb's length that its pole is ahead of its middle


@dataclass
class Channels:
    """Values of a control's channels over T frames: rotations (T, 4) and locations (T, 3), None where not
    keyed; and what they show.

    ``place`` (T, 3), world, is that of the joint that is held, or of the pole, ``turn`` (T, 4) the control's
    rotation in the world, ``carrier`` the control that carries this one; ``stands`` where it is a foot's.
    """

    rotation: Array | None
    location: Array | None
    place: Array
    turn: Array
    carrier: str = ""
    stands: bool = False


def replaced(bone_map: BoneMap) -> set[int]:
    """Joints that get no keys of their own since controls pull their limb."""
    found: set[int] = set()
    for joint, controls in bone_map.pulled.items():
        limb = _LIMBS[INDEX[joint]]
        found |= set(limb if controls.toe else limb[:3])
    return found


def control_mounts(
    armature: bpy.types.Object, bone_map: BoneMap, carrier: Matrix | None = None
) -> dict[str, Mount]:
    """Where the channels of controls and poles begin, by their bone; ``carrier`` as for ``Mount.of``."""
    names = (name for c in bone_map.pulled.values() for name in (c.control, c.pole) if name)
    return {name: Mount.of(armature, name, carrier) for name in names}


def control_channels(
    armature: bpy.types.Object,
    placement: Placement,
    bone_map: BoneMap,
    mounts: dict[str, Mount],
    hips: Array,
    local: Array,
    turns: Mapping[str, float] | None = None,
) -> Iterator[tuple[str, Channels]]:
    """Bones and their channels that have limbs do a take: hips (T, 3), world, Blender units, and local
    rotations (T, 23, 4).  ``turns``: by their joint, radians by which a rig's poles turn limbs, taken back.
    """
    rig = placement.seen
    positions, turned = _seen(placement, hips, local)
    unit = placement.scale / rig.size  # world units to one of the armature
    for joint, controls in bone_map.pulled.items():
        start, middle, end, *toe = _LIMBS[INDEX[joint]]
        bones = armature.data.bones
        rest, seen = bones[controls.control], bones[bone_map.seen(joint)]
        turn = quat_mul(turned[:, end], _between(seen, rest))
        offset = unit * np.array(seen.matrix_local.inverted() @ rest.head_local)
        place = positions[:, end] + quat_rotate(turned[:, end], np.broadcast_to(offset, hips.shape))
        mount = mounts[controls.control]
        held_at, foot = positions[:, end], bool(toe)
        yield (
            controls.control,
            Channels(_basis(mount, turn), mount.location(place), held_at, turn, stands=foot),
        )
        if controls.pole:
            upper = bones[bone_map.seen(_name(start))]
            ahead = np.array(bones[controls.pole].head_local - bones[bone_map.seen(_name(middle))].head_local)
            ahead = np.array(upper.matrix_local.to_3x3().inverted() @ type(upper.head_local)(ahead))
            own = quat_rotate(turned[:, start], np.broadcast_to(ahead, hips.shape))
            turn_back = -(turns or {}).get(joint, 0.0)
            pole = _pole(*(positions[:, j] for j in (start, middle, end)), own, turn_back)
            still = np.broadcast_to((1.0, 0.0, 0.0, 0.0), turn.shape)
            yield controls.pole, Channels(None, mounts[controls.pole].location(pole), pole, still)
        if controls.toe and toe:
            held, shown = bones[controls.toe], bones[bone_map.seen(_name(toe[0]))]
            rest_turn, posed = _between(seen, held), quat_mul(turned[:, toe[0]], _between(shown, held))
            relative = quat_mul(quat_conjugate(turned[:, end]), posed)
            basis = quat_mul(np.broadcast_to(quat_conjugate(rest_turn), relative.shape), relative)
            tip = positions[:, toe[0]]
            yield controls.toe, Channels(quat_normalize(basis), None, tip, posed, controls.control, True)


def pole_turns(
    armature: bpy.types.Object,
    placement: Placement,
    bone_map: BoneMap,
    mounts: dict[str, Mount],
    hips: Array,
    local: Array,
    pose: Callable[[int], None],
) -> dict[str, float]:
    """By how much poles turn limbs about the line between their ends, radians, by the joint at the end: what
    a rig makes of its poles is its own affair, and seen on its bones.

    ``pose`` poses all but the controls as in a row of the take; limbs are looked at where they are bent most.
    """
    positions, _ = _seen(placement, hips, local)
    channels = dict(control_channels(armature, placement, bone_map, mounts, hips, local))
    turns: dict[str, float] = {}
    for joint, controls in bone_map.pulled.items():
        if not controls.pole:
            continue
        start, middle, end = _LIMBS[INDEX[joint]][:3]
        meant, along, off = _bend(*(positions[:, j] for j in (start, middle, end)))
        angles = []
        for row in np.argsort(off)[[-1, -1 - len(off) // 4]].tolist():
            pose(row)
            for name, values in channels.items():
                _show(armature.pose.bones[name], values, row)
            bpy.context.view_layer.update()
            seen = read_world_pose(armature, placement)[0]
            bend = _bend(*(seen[None, j] for j in (start, middle, end)))[0][0]
            sine = float(np.cross(meant[row], bend) @ along[row])
            angles.append((float(off[row]), float(np.arctan2(sine, meant[row] @ bend))))
        weight = sum(o for o, _ in angles)
        turns[joint] = sum(o * angle for o, angle in angles) / max(weight, 1e-9)
    return turns


def _show(bone: bpy.types.PoseBone, values: Channels, row: int) -> None:
    location, rotation = (None if v is None else v[row] for v in (values.location, values.rotation))
    place = Matrix() if location is None else Matrix.Translation(Vector(location))
    turn = Matrix() if rotation is None else Quaternion(rotation).to_matrix().to_4x4()
    bone.matrix_basis = place @ turn


def _seen(placement: Placement, hips: Array, local: Array) -> tuple[Array, Array]:
    """Places (T, 23, 3), world, of a take's joints and rotations (T, 23, 4) of the bones that show them."""
    rig = placement.seen
    positions, world = forward_kinematics(hips / placement.scale, local, rig.offsets)
    return positions * placement.scale, quat_mul(world, np.broadcast_to(rig.rest, world.shape))


def _bend(start: Array, middle: Array, end: Array) -> tuple[Array, Array, Array]:
    """The way (T, 3) that limbs bend to, from the line between their ends, the way (T, 3) along that, and how
    far (T,) they do.
    """
    line = end - start
    along = line / np.maximum(np.linalg.norm(line, axis=1, keepdims=True), 1e-9)
    bend = (middle - start) - along * ((middle - start) * along).sum(1, keepdims=True)
    off = np.linalg.norm(bend, axis=1)
    return bend / np.maximum(off, 1e-9)[:, None], along, off


def _name(joint: int) -> str:
    return list(INDEX)[joint]


def _between(a: bpy.types.Bone, b: bpy.types.Bone) -> Array:
    """Rest rotation (4,) of one bone seen from that of another."""
    one, other = (np.array(bone.matrix_local.to_quaternion(), dtype=np.float64) for bone in (a, b))
    return quat_mul(quat_conjugate(one), other)


def _basis(mount: Mount, world: Array) -> Array:
    """Rotation channels (T, 4) of a bone that has rotations (T, 4) in the world."""
    inside = quat_mul(np.broadcast_to(quat_conjugate(mount.rotation), world.shape), world)
    return quat_normalize(quat_mul(np.broadcast_to(quat_conjugate(mount.turn), world.shape), inside))


def _pole(start: Array, middle: Array, end: Array, own: Array, turn: float) -> Array:
    """Where a pole is (T, 3) of a limb with these joints (T, 3); ``own`` (T, 3) the way to it by the turn of
    the upper bone; ``turn`` radians by which it is led about the limb.
    """
    bend, along, off = _bend(start, middle, end)
    length = np.linalg.norm(middle - start, axis=1, keepdims=True) + np.linalg.norm(
        end - middle, axis=1, keepdims=True
    )
    own = own - along * (own * along).sum(1, keepdims=True)
    own /= np.maximum(np.linalg.norm(own, axis=1, keepdims=True), 1e-9)
    share = smooth_step((off[:, None] / length - _BENT[0]) / (_BENT[1] - _BENT[0]))
    way = share * bend + (1 - share) * own
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    way = np.cos(turn) * way + np.sin(turn) * np.cross(along, way)
    return middle + _AHEAD * length * way


__all__ = ["Channels", "LimbControls", "control_channels", "control_mounts", "pole_turns", "replaced"]
