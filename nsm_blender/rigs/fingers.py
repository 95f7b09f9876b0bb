"""Fingers: found under the hand by hierarchy and names, or listed by a preset, and how they bend.

A finger bends towards the palm, which is told from where fingers and thumb point at rest.  Angles are those
of a finger's bones against each other; what they are bent by at rest counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Quaternion, Vector

from nsm_core.rotations import Array

from .bone_map import BoneMap

SIDES = ("Right", "Left")
_WORDS = ("thumb", "index", "middle", "ring", "pinky", "little", "finger", "digit")
# What hangs on hands and is no finger, and bones within the palm.
_OTHERS = ("twist", "roll", "slot", "prop", "weapon", "ik", "socket", "attach", "target", "pole", "hold")
_PALM = ("metacarpal", "palm", "carpal")
_ENDS = ("_end", "end", "nub", "tip")
_MOST = 3  # bones of a finger that bend

# Degrees by which bones of a finger bend, from the palm outwards, and those of the thumb.
RELAXED, FLAT, FIST = "relaxed", "flat", "fist"
ANGLES = {
    RELAXED: ((14.0, 20.0, 12.0), (4.0, 8.0, 8.0)),
    FLAT: ((4.0, 9.0, 5.0), (0.0, 4.0, 6.0)),
    FIST: ((52.0, 68.0, 40.0), (14.0, 22.0, 28.0)),
}
_OUTER = (
    0.15  # by which each finger away from the thumb bends more than the one before while the hand is relaxed
)


@dataclass(frozen=True)
class Finger:
    """Bones of one finger, from the palm outwards, on a ``side`` (0 right, 1 left)."""

    bones: tuple[str, ...]
    side: int
    thumb: bool


def fingers_of(armature: bpy.types.Object, bone_map: BoneMap) -> list[Finger]:
    """The fingers of a rig: those that its map lists, else what is found under hands without controls."""
    found: list[Finger] = []
    for number, side in enumerate(SIDES):
        listed = {name: bones for name, bones in bone_map.fingers.items() if name.startswith(side)}
        if listed:
            lines = [tuple(b for b in bones if b in armature.data.bones) for bones in listed.values()]
        elif bone_map.properties or side + "Wrist" not in bone_map.joints:
            lines = []
        else:
            lines = list(_under(armature.data.bones[bone_map.joints[side + "Wrist"]]))
        found += [Finger(line, number, "thumb" in line[0].lower()) for line in lines if line]
    return [finger for finger in found if not any(_held(armature, name) for name in finger.bones)]


def _under(hand: bpy.types.Bone) -> Iterator[tuple[str, ...]]:
    """Lines of bones from a hand to its tips that look like fingers."""
    lines = []
    for leaf in (bone for bone in hand.children_recursive if not bone.children):
        line = [leaf, *leaf.parent_recursive]
        line = line[: line.index(hand)][::-1]
        while len(line) > 1 and line[-1].name.lower().endswith(_ENDS):
            line = line[:-1]
        lines.append(line)
    shared = {bone for line in lines for bone in line if sum(bone in other for other in lines) > 1}
    for line in lines:
        own = [bone for bone in line if bone not in shared] or line[-1:]
        own = [bone for bone in own if not any(word in bone.name.lower() for word in _PALM)]
        names = " ".join(bone.name.lower() for bone in line)
        if own and any(w in names for w in _WORDS) and not any(w in own[-1].name.lower() for w in _OTHERS):
            yield tuple(bone.name for bone in own[-_MOST:] if bone.length > 1e-9)


def _held(armature: bpy.types.Object, name: str) -> bool:
    """Whether something else moves a bone."""
    data = armature.animation_data
    path = f'pose.bones["{bpy.utils.escape_identifier(name)}"].'
    driven = data is not None and any(d.data_path.startswith(path + "rotation") for d in data.drivers)
    return driven or any(not c.mute and c.influence > 0 for c in armature.pose.bones[name].constraints)


def bent(armature: bpy.types.Object, fingers: list[Finger], shape: str) -> dict[str, Quaternion]:
    """Rotations of the fingers' bones, from their rest, in a shape: of ``ANGLES``."""
    out: dict[str, Quaternion] = {}
    bones = armature.data.bones
    for side in (0, 1):
        mine = [finger for finger in fingers if finger.side == side]
        if not mine:
            continue
        palm, order = _palm(bones, mine, side)
        for finger in mine:
            angles = ANGLES[shape][int(finger.thumb)][-len(finger.bones) :]
            if len(finger.bones) == 1:
                angles = (0.6 * sum(ANGLES[shape][int(finger.thumb)]),)
            more = 1 + _OUTER * order.get(finger.bones, 0) if shape == RELAXED else 1.0
            out |= _finger(bones, finger, palm, [more * angle for angle in angles])
    return out


def _palm(
    bones: bpy.types.ArmatureBones, fingers: list[Finger], side: int
) -> tuple[Vector, dict[tuple[str, ...], int]]:
    """The way that a palm faces at rest, in the armature, and how far from the thumb each finger is."""
    straight = [f for f in fingers if not f.thumb] or fingers
    thumb = next((f for f in fingers if f.thumb), None)
    ahead = sum((_way(bones, f) for f in straight), Vector()).normalized()
    roots = [bones[f.bones[0]].head_local for f in straight]
    middle = sum(roots, Vector()) / len(roots)
    if thumb is not None:
        tip = bones[thumb.bones[-1]].tail_local
        aside = tip - middle
    elif len(roots) > 1:
        aside = roots[0] - roots[-1]
    else:
        aside = bones[straight[0].bones[0]].matrix_local.to_3x3().col[0]
    aside = (aside - ahead * aside.dot(ahead)).normalized()
    facing = ahead.cross(aside) * (1 if side == 1 else -1)
    order = sorted(straight, key=lambda f: -bones[f.bones[0]].head_local.dot(aside))
    return facing, {finger.bones: place for place, finger in enumerate(order)}


def _way(bones: bpy.types.ArmatureBones, finger: Finger) -> Vector:
    return (bones[finger.bones[-1]].tail_local - bones[finger.bones[0]].head_local).normalized()


def _finger(
    bones: bpy.types.ArmatureBones, finger: Finger, palm: Vector, angles: list[float]
) -> dict[str, Quaternion]:
    """Rotations that bend a finger by ``angles`` in all, of which what it is bent at rest comes off."""
    way = _way(bones, finger)
    axis = way.cross(palm - way * palm.dot(way)).normalized()
    before = _start(bones, finger)
    out = {}
    for name, angle in zip(finger.bones, angles, strict=True):
        bone = bones[name]
        along = (bone.tail_local - bone.head_local).normalized()
        at_rest = 0.0
        if before is not None:
            at_rest = float(np.arctan2(before.cross(along).dot(axis), before.dot(along)))
        turn = float(np.clip(np.radians(angle) - max(at_rest, 0.0), np.radians(-10), np.radians(95)))
        own = bone.matrix_local.to_3x3().inverted() @ axis
        out[name] = Quaternion(own, turn)
        before = along
    return out


def _start(bones: bpy.types.ArmatureBones, finger: Finger) -> Vector | None:
    """The way of what a finger hangs on; None for thumbs, which are bent from nothing."""
    if finger.thumb:
        return None
    parent = bones[finger.bones[0]].parent
    way = bones[finger.bones[0]].head_local - parent.head_local
    return way.normalized() if way.length > 1e-6 else None


def quaternions(rotations: dict[str, Quaternion]) -> dict[str, Array]:
    """The rotations as arrays (4,)."""
    return {name: np.array(q, dtype=np.float64) for name, q in rotations.items()}
