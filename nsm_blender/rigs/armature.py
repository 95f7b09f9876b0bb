"""What the core's skeleton means on a Blender armature: bones, rest frames, world placement.

The core's rest pose has identity world rotations; a bone's rest matrix is whatever its head, tail and
roll make of it.  With R the bone's rest rotation in the armature and A the armature object's rotation,
a core world rotation W is the pose rotation ``A^-1 W R`` in armature space.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

from nsm_core.body.skeleton import (
    END_SITES,
    FEET,
    HIPS,
    INDEX,
    JOINTS,
    OFFSETS,
    PARENTS,
    local_from_world,
    require_joints,
    root_of,
)
from nsm_core.errors import SkeletonError
from nsm_core.rotations import Array, quat_conjugate, quat_mul, quat_rotate

from .mount import Mount

# The joint that a bone's tail points to, where it has more than one child.
_MAIN_CHILD = {"Hips": "Chest", "Chest4": "Neck"}
# A spine that leans so much (the sine) in the rest pose is still upright: only the pose differs, not the
# axes.
_ASKEW = 0.35


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
    scale: float  # Blender units to a metre of the core's skeleton: leg length in the world over its own
    # (23, 4) rest rotations of the bones, seen along the axes of the rest pose: up is its Z, ahead its -Y
    rest: Array
    heads: Array  # (23, 3) joints of the rest pose along these axes, metres of the core's skeleton

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
        rest = np.array(
            [armature.data.bones[name].matrix_local.to_quaternion() for name in JOINTS], dtype=np.float64
        )
        heads = np.array([armature.data.bones[name].head_local for name in JOINTS], dtype=np.float64)
        # A root bone may be scaled as well as the object: what carries the hips carries all.
        scale *= Mount.of(armature).scale
        size = scale * _leg_length(heads) / _leg_length(joint_positions_at_rest())
        if not 1e-6 < size < 1e6:
            raise SkeletonError(
                f"The legs of {armature.name} have no length; give hips, knees and ankles their places in "
                "edit mode."
            )
        # Bones are kept in single precision; five digits are a tenth of a millimetre on a body.
        size, axes = float(f"{size:.5g}"), _axes(heads)
        return cls(
            matrix,
            rotation,
            size,
            quat_mul(quat_conjugate(axes), rest),
            quat_rotate(quat_conjugate(axes), heads) * scale / size,
        )


def _leg_length(heads: Array) -> float:
    """Mean length of the legs, hip by knee to ankle, of joints (23, 3)."""
    return float(
        np.mean([np.linalg.norm(np.diff(heads[list(leg[:3])], axis=0), axis=1).sum() for leg in FEET])
    )


def _axes(heads: Array) -> Array:
    """Rotation (4,) from the core's rest pose to one with joints (23, 3): the nearest along axes, its own
    where it stands askew.
    """
    up = heads[INDEX["Head"]] - heads[HIPS]
    left = sum(heads[INDEX[f"Left{part}"]] - heads[INDEX[f"Right{part}"]] for part in ("Hip", "Shoulder"))
    back = np.cross(up, left)
    if np.linalg.norm(back) < 1e-9 * max(np.linalg.norm(up), np.linalg.norm(left)) ** 2 or not back.any():
        return np.array((1.0, 0.0, 0.0, 0.0))
    z, y = up / np.linalg.norm(up), back / np.linalg.norm(back)
    own = np.stack((np.cross(y, z), y, z), axis=1)
    snapped = np.round(own)
    if np.abs(np.linalg.det(snapped) - 1) < 0.5 and np.abs(own - snapped).max() < _ASKEW:
        own = snapped
    return np.array(Matrix(own.tolist()).to_quaternion(), dtype=np.float64)


def require_skeleton(armature: bpy.types.Object | None) -> None:
    """Raise SkeletonError unless ``armature`` is an armature with the 23 joints in the core's hierarchy."""
    if armature is None or armature.type != "ARMATURE":
        what = "Nothing" if armature is None else armature.name
        raise SkeletonError(
            f"{what} is not an armature; choose the character's armature, or add the bundled character."
        )
    require_joints(list(armature.data.bones.keys()), f"The armature {armature.name}")
    wrong = [name for j, name in enumerate(JOINTS) if _parent_joint(armature.data.bones[name]) != PARENTS[j]]
    if wrong:
        raise SkeletonError(
            f"The armature {armature.name} has the bones {', '.join(wrong)} under other parents than the "
            "23-joint skeleton; "
            "parent them as in the bundled character."
        )
    if armature.data.bones["Hips"].use_connect and armature.data.bones["Hips"].parent:
        raise SkeletonError(
            f"The bone Hips of {armature.name} is connected to its parent and cannot move; clear Connected "
            "in edit mode."
        )


def _parent_joint(bone: bpy.types.Bone) -> int:
    """Index of the nearest ancestor among the 23 joints, -1 for none."""
    return next((INDEX[p.name] for p in bone.parent_recursive if p.name in INDEX), -1)


def read_world_pose(
    armature: bpy.types.Object, placement: Placement | None = None
) -> tuple[Array, Array, Array]:
    """Joint positions (23, 3), world, hips position (3,) and local rotations (23, 4) of the pose shown now.

    ``placement``, where it is known, saves time; where the armature stands is read anew.
    """
    placement = placement or Placement.of(armature)
    evaluated = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    bones = [evaluated.pose.bones[name] for name in JOINTS]
    heads = np.array([b.head for b in bones], dtype=np.float64)
    matrix = np.array(evaluated.matrix_world, dtype=np.float64)
    rotation = np.array(evaluated.matrix_world.to_quaternion(), dtype=np.float64)
    positions = heads @ matrix[:3, :3].T + matrix[:3, 3]
    pose = np.array([b.matrix.to_quaternion() for b in bones], dtype=np.float64)
    world = quat_mul(rotation, quat_mul(pose, quat_conjugate(placement.rest)))
    return positions, positions[HIPS], local_from_world(world)


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
    armature.show_in_front = True
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
