"""What the core's skeleton means on a Blender armature: bones, rest frames, world placement.

The core's rest pose has identity world rotations; a bone's rest matrix is whatever its head, tail and
roll make of it.  With C the bone's rotation in that pose (``rig_skeleton``) and A the armature object's
rotation, a core world rotation W is the pose rotation ``A^-1 W C`` in armature space.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector

from nsm_core.body.skeleton import END_SITES, HIPS, INDEX, JOINTS, OFFSETS, PARENTS, J, root_of
from nsm_core.errors import SkeletonError
from nsm_core.rotations import Array, quat_mul

from .bone_map import BoneMap, bone_map_of, require_map
from .mount import Mount
from .rig_skeleton import RigSkeleton, rig_skeleton

# The joint that a bone's tail points to, where it has more than one child.
_MAIN_CHILD = {"Hips": "Chest", "Chest4": "Neck"}


@dataclass(frozen=True)
class StartPose:
    """Where a character stands before a take: planar root and size, world frame."""

    position: Array  # (2,) metres
    heading: float  # radians, 0 faces -Y
    scale: float  # Blender units to a metre of the core's skeleton
    hips_position: Array  # (3,) world, metres
    local_rotations: Array  # (23, 4) as in the core


@dataclass(frozen=True)
class Placement:
    """Where an armature stands, how large its skeleton is in the world, and its bones' rest frames.

    Bones may be in any unit and the object scaled (evenly) to make up for it, as importers leave them; and
    the rest pose may stand along any axis and face along any other, as with bones exported with Y up.
    """

    matrix: Array  # (4, 4) armature to world
    rotation: Array  # (4,) quaternion of it
    scale: float  # Blender units to a metre of the core's skeleton: hip height in the world over its own
    keyed: RigSkeleton  # the bones that get keys
    seen: RigSkeleton  # the bones that show the result: the same ones where no controls move them

    @property
    def own_offsets(self) -> Array:
        """Joint offsets (23, 3) of the character in its own metres; the network's where they are the same to
        a millimetre.
        """
        offsets = self.seen.offsets
        return OFFSETS if np.abs(offsets[1:] - OFFSETS[1:]).max() < 1e-3 else offsets

    @classmethod
    def of(cls, armature: bpy.types.Object) -> Placement:
        """Read an armature; SkeletonError when bones are missing, misplaced or the scale is uneven."""
        require_skeleton(armature)
        matrix = np.array(armature.matrix_world, dtype=np.float64)
        lengths = np.linalg.norm(matrix[:3, :3], axis=0)
        scale = float(lengths.mean())
        skewed = (
            scale < 1e-6
            or np.abs(matrix[:3, :3].T @ matrix[:3, :3] / max(scale, 1e-6) ** 2 - np.eye(3)).max() > 1e-3
        )
        if skewed or np.linalg.det(matrix[:3, :3]) < 0:
            raise SkeletonError(
                f"The armature {armature.name} is scaled unevenly or mirrored; apply its scale (Ctrl+A, "
                "Scale) and generate again."
            )
        rotation = np.array(armature.matrix_world.to_quaternion(), dtype=np.float64)
        bone_map = bone_map_of(armature)
        keyed = _skeleton(armature, bone_map, shown=False)
        # A root bone may be scaled as well as the object: what carries the hips carries all.
        size = scale * Mount.of(armature, bone_map.hips).scale * keyed.size
        if not 1e-6 < size < 1e6:
            raise SkeletonError(
                f"The legs of {armature.name} have no length; give hips, knees and ankles their places in "
                "edit mode."
            )
        seen = _skeleton(armature, bone_map, shown=True) if bone_map.shown else keyed
        # Bones are kept in single precision; five digits are a tenth of a millimetre on a body.
        return cls(matrix, rotation, float(f"{size:.5g}"), keyed, seen)


def _skeleton(armature: bpy.types.Object, bone_map: BoneMap, shown: bool) -> RigSkeleton:
    """The skeleton of the bones that get keys, or of those that show the result."""
    named = [bone_map.seen(j) if shown and j in bone_map.joints else bone_map.joints.get(j) for j in JOINTS]
    bones = [armature.data.bones[name] if name else None for name in named]
    turns, heads, tails = np.tile((1.0, 0.0, 0.0, 0.0), (J, 1)), np.zeros((J, 3)), np.zeros((J, 3))
    for j, bone in enumerate(bones):
        if bone is not None:
            turns[j] = bone.matrix_local.to_quaternion()
            heads[j], tails[j] = bone.head_local, bone.tail_local
    return rig_skeleton(tuple(named), _carriers(armature, bone_map), turns, heads, tails)


def _carriers(armature: bpy.types.Object, bone_map: BoneMap) -> tuple[int, ...]:
    """For every joint, the one whose bone its own hangs on, -1 for none; controls hang as the joints do."""
    joint_of = {bone: INDEX[joint] for joint, bone in bone_map.joints.items()}
    carriers = []
    for joint in JOINTS:
        name = bone_map.joints.get(joint)
        if name is None or bone_map.properties:
            carriers.append(_above(joint, bone_map))
        else:
            over = armature.data.bones[name].parent_recursive
            carriers.append(next((joint_of[bone.name] for bone in over if bone.name in joint_of), -1))
    return tuple(carriers)


def _above(joint: str, bone_map: BoneMap) -> int:
    """The nearest joint over a joint that has a bone, -1 for none."""
    above = PARENTS[INDEX[joint]]
    while above >= 0 and JOINTS[above] not in bone_map.joints:
        above = PARENTS[above]
    return above


def require_skeleton(armature: bpy.types.Object | None) -> None:
    """Raise SkeletonError unless ``armature`` is an armature with the 23 joints in the core's hierarchy."""
    if armature is None or armature.type != "ARMATURE":
        what = "Nothing" if armature is None else armature.name
        raise SkeletonError(
            f"{what} is not an armature; choose the character's armature, or add the bundled character."
        )
    bone_map = require_map(armature)
    bones = armature.data.bones
    carriers = _carriers(armature, bone_map)
    wrong = [
        name
        for j, joint in enumerate(JOINTS)
        if (name := bone_map.joints.get(joint))
        and carriers[j] >= 0
        and carriers[j] != _above(joint, bone_map)
    ]
    if wrong or carriers[HIPS] >= 0:
        raise SkeletonError(
            f"The armature {armature.name} has the bones {', '.join(wrong or [bone_map.hips])} under other "
            "parents than the 23-joint skeleton; choose others under Bones in the sidebar, or parent them "
            "as "
            "in the bundled character."
        )
    for j, joint in enumerate(JOINTS):
        name = bone_map.joints.get(joint)
        if name and carriers[j] < 0 and bones[name].use_connect and bones[name].parent:
            raise SkeletonError(
                f"The bone {name} of {armature.name} is connected to its parent and cannot move; clear "
                "Connected in edit mode."
            )


def read_world_pose(
    armature: bpy.types.Object, placement: Placement | None = None
) -> tuple[Array, Array, Array]:
    """Joint positions (23, 3), world, hips position (3,) and local rotations (23, 4) of the pose shown now.

    ``placement``, where it is known, saves time; where the armature stands is read anew.
    """
    placement = placement or Placement.of(armature)
    evaluated = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    matrix = np.array(evaluated.matrix_world, dtype=np.float64)
    rotation = np.array(evaluated.matrix_world.to_quaternion(), dtype=np.float64)
    heads, turns = np.zeros((J, 3)), np.tile((1.0, 0.0, 0.0, 0.0), (J, 1))
    for j, name in enumerate(placement.seen.bones):
        if name is not None:
            bone = evaluated.pose.bones[name]
            heads[j], turns[j] = bone.head, bone.matrix.to_quaternion()
    heads = heads @ matrix[:3, :3].T + matrix[:3, 3]
    positions, local = placement.seen.from_bones(heads, quat_mul(rotation, turns), placement.scale)
    return positions, positions[HIPS], local


def read_pose(armature: bpy.types.Object) -> StartPose:
    """Read where the character stands and how large it is; SkeletonError when bones are missing.

    The heading follows the pose (hip and shoulder axes), not only the object, so a posed character
    starts the way it looks.
    """
    bpy.context.view_layer.update()
    placement = Placement.of(armature)
    positions, hips, local = read_world_pose(armature, placement)
    root, heading = root_of(positions)
    return StartPose(root, float(heading), placement.scale, hips, local)


def build_armature(name: str, location: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> bpy.types.Object:
    """Add the 23-joint armature in its T-pose, facing -Y, its origin on the floor at ``location`` (3,)
    metres.

    Bones are made in edit mode, so the new object becomes the active one; the caller's mode must be object
    mode.
    """
    data = bpy.data.armatures.new(name)
    armature = bpy.data.objects.new(name, data)
    armature.location = location
    (bpy.context.collection or bpy.context.scene.collection).objects.link(armature)
    view_layer = bpy.context.view_layer
    for other in list(view_layer.objects.selected):
        if other is not None:  # deleted a moment ago
            other.select_set(False)
    view_layer.objects.active = armature
    armature.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        _add_bones(data)
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
    data.display_type = "STICK"
    return armature


def joint_positions_at_rest() -> Array:
    """Positions (23, 3) of the bundled skeleton's joints in its T-pose, metres, floor at z = 0."""
    positions = np.zeros((len(JOINTS), 3))
    for j, parent in enumerate(PARENTS):
        positions[j] = OFFSETS[j] + (positions[parent] if parent >= 0 else 0)
    return positions


def _add_bones(data: bpy.types.Armature) -> None:
    heads = joint_positions_at_rest()
    for j, name in enumerate(JOINTS):
        bone = data.edit_bones.new(name)
        bone.head = heads[j]
        bone.tail = _tail(j, heads)
        bone.align_roll(
            Vector((0, 1, 0)) if abs((bone.tail - bone.head).normalized().y) < 0.9 else Vector((0, 0, 1))
        )
        if PARENTS[j] >= 0:
            bone.parent = data.edit_bones[JOINTS[PARENTS[j]]]


def _tail(j: int, heads: Array) -> Vector:
    name = JOINTS[j]
    if name in END_SITES:
        return Vector(heads[j] + np.array(END_SITES[name]))
    child = INDEX[_MAIN_CHILD[name]] if name in _MAIN_CHILD else PARENTS.index(j)
    return Vector(heads[child])
