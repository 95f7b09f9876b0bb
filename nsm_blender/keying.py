"""A take becomes an ordinary slotted action, and can be read back from it frame by frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Quaternion

from nsm_core import clip
from nsm_core.conventions import FPS
from nsm_core.errors import NsmError, SkeletonError
from nsm_core.rotations import Array, quat_conjugate, quat_mul, quat_normalize, quat_to_rotvec
from nsm_core.skeleton import HIPS, JOINTS, J

from .armature import Placement, StartPose, read_pose, read_world_pose, relative_to
from .channels import ActionChannels, assign, new_action
from .things import KeyedThing, Thing, discard_thing, key_thing

__all__ = ["KeyedTake", "StartPose", "discard_take", "key_take", "read_back", "read_pose", "resample"]


@dataclass
class KeyedTake:
    """A take in an action: what was made, where it lies, and what it replaced; ``things`` the same of the objects it moved."""

    armature: bpy.types.Object
    action: bpy.types.Action
    slot: Any | None
    frame_start: int
    frame_end: int
    fps: float  # of the scene, keys per second
    previous_action: bpy.types.Action | None
    previous_slot: Any | None
    previous_fake_user: bool
    previous_pose: list[tuple[str, Any]]  # bone name, matrix_basis before the take
    things: list[KeyedThing] = field(default_factory=list)


def scene_fps(scene: bpy.types.Scene) -> float:
    """Frames per second that the scene plays, its base included."""
    return scene.render.fps / scene.render.fps_base


def resample(hips_position: Array, local_rotations: Array, fps_from: float, fps_to: float) -> tuple[Array, Array]:
    """Sample a take at another rate: (T, 3), (T, J, 4) to (N, 3), (N, J, 4), linear and by slerp.

    The first frame stays the first; the last sample is the first one at or after the take's end, held there.
    """
    seconds = (len(hips_position) - 1) / fps_from
    count = int(np.ceil(seconds * fps_to - 1e-6)) + 1
    return clip.resample(hips_position, local_rotations, np.arange(count) / fps_to, fps_from)


def key_take(
    armature: bpy.types.Object,
    hips_position: Array,
    local_rotations: Array,
    frame_start: int = 1,
    fps: float = FPS,
    name: str = "Take",
    scene: bpy.types.Scene | None = None,
) -> KeyedTake:
    """Key a take as a new action on ``armature`` and keep the action it had.

    ``hips_position`` (T, 3), world metres, and ``local_rotations`` (T, 23, 4) at ``fps`` are resampled to the
    scene's rate from ``frame_start`` on.  The armature may stand, face and be scaled (evenly) as it likes: its
    own transform stays and the motion lands in the world.  Bones keep their rotation modes.
    Raises SkeletonError (bones missing or misplaced) and NsmError (linked armature, NLA tweak mode, bad numbers).
    """
    scene = scene or bpy.context.scene
    bpy.context.view_layer.update()
    placement = Placement.of(armature)
    _require_editable(armature)
    hips_position = np.asarray(hips_position, dtype=np.float64)
    local_rotations = quat_normalize(np.asarray(local_rotations, dtype=np.float64))
    _require_take(hips_position, local_rotations)
    rate = scene_fps(scene)
    hips, local = resample(hips_position, local_rotations, fps, rate)
    frames = frame_start + np.arange(len(hips))
    location, basis = bone_channels(armature, placement, hips, local)

    previous_pose = [(bone.name, bone.matrix_basis.copy()) for bone in armature.pose.bones]
    data = armature.animation_data
    previous = data.action if data else None
    previous_slot = getattr(data, "action_slot", None) if previous else None
    fake_user = bool(previous and previous.use_fake_user)
    if previous:
        previous.use_fake_user = True  # or it would be lost with the file's next save
    channels = new_action(name, armature.name)
    for j, joint in enumerate(JOINTS):
        _key_bone(channels, armature.pose.bones[joint], frames, basis[:, j], location if j == HIPS else None)
    assign(armature, channels.action, channels.slot)
    _touch(armature, scene)
    return KeyedTake(
        armature, channels.action, channels.slot, int(frames[0]), int(frames[-1]), rate, previous, previous_slot, fake_user, previous_pose
    )


def key_things(take: KeyedTake, moved: Sequence[tuple[Thing, Array]], fps: float, name: str, scene: bpy.types.Scene) -> None:
    """Key what a take has moved, each object in an action of its own named after ``name`` and the object.

    ``moved`` are things with the poses (T, 4) of their props at ``fps``.  Where one cannot be keyed, the whole take is
    discarded and the NsmError goes on.
    """
    try:
        for thing, poses in moved:
            keyed = key_thing(thing, poses, take.frame_start, fps, take.fps, f"{name} {thing.object.name}", scene)
            if keyed is not None:
                take.things.append(keyed)
    except NsmError:
        discard_take(take)
        raise
    _touch(take.armature, scene)


def discard_take(take: KeyedTake) -> None:
    """Remove a take's actions and give the armature, and what it moved, back the actions, the pose and the places they had."""
    for thing in take.things:
        discard_thing(thing)
    if take.previous_action:
        take.previous_action.use_fake_user = take.previous_fake_user
    assign(take.armature, take.previous_action, take.previous_slot)
    if take.action.users == 0 or take.action.users == int(take.action.use_fake_user):
        bpy.data.actions.remove(take.action)
    for name, matrix in take.previous_pose:
        if name in take.armature.pose.bones:
            take.armature.pose.bones[name].matrix_basis = matrix
    _touch(take.armature, bpy.context.scene)


def bone_channels(armature: bpy.types.Object, placement: Placement, hips: Array, local: Array) -> tuple[Array, Array]:
    """Turn a take into pose channels: hips location (T, 3) and basis rotations (T, 23, 4), sign-continuous.

    A joint's basis is its local rotation seen from the bone's rest frame, ``R^-1 L R``.  For the hips the
    armature object, and any bone above them as it is posed now, come off first.
    """
    basis = quat_mul(quat_mul(quat_conjugate(placement.rest), local), placement.rest)
    parent = armature.pose.bones["Hips"].parent
    rest = np.array(armature.data.bones["Hips"].matrix_local, dtype=np.float64)
    frame = rest  # of the hips bone with no pose on it, in the armature
    if parent is not None:
        parent_rest = np.array(parent.bone.matrix_local.inverted(), dtype=np.float64)
        frame = np.array(parent.matrix, dtype=np.float64) @ parent_rest @ rest
    frame_rotation = np.array(_rotation_of(frame), dtype=np.float64)
    world = quat_mul(local[:, HIPS], np.broadcast_to(placement.rest[HIPS], local[:, HIPS].shape))
    in_armature = quat_mul(quat_conjugate(placement.rotation), world)
    basis[:, HIPS] = quat_mul(quat_conjugate(frame_rotation), in_armature)
    location = relative_to(placement.matrix @ frame, hips)
    return location, _continuous(quat_normalize(basis))


def read_back(armature: bpy.types.Object, frames: Any, scene: bpy.types.Scene | None = None) -> tuple[Array, Array]:
    """Evaluate the armature at ``frames`` and return hips (N, 3), world metres, and local rotations (N, 23, 4)."""
    scene = scene or bpy.context.scene
    frames = [float(f) for f in frames]
    hips, local = np.empty((len(frames), 3)), np.empty((len(frames), J, 4))
    current, subframe = scene.frame_current, scene.frame_subframe
    try:
        for i, frame in enumerate(frames):
            scene.frame_set(int(np.floor(frame)), subframe=frame - np.floor(frame))
            _, hips[i], local[i] = read_world_pose(armature)
    finally:
        scene.frame_set(current, subframe=subframe)
    return hips, local


def _key_bone(channels: ActionChannels, bone: bpy.types.PoseBone, frames: Array, basis: Array, location: Array | None) -> None:
    path = f'pose.bones["{bpy.utils.escape_identifier(bone.name)}"]'
    for suffix, values in _rotation_values(bone.rotation_mode, basis):
        for i in range(values.shape[1]):
            channels.curve(f"{path}.{suffix}", i, bone.name, frames, values[:, i])
    # A bone moved or scaled by hand would bend the skeleton the take was made for: one key puts it back, in this action only.
    still = frames[:1]
    if location is None and bone.location.length > 1e-7:
        location, moved = np.zeros((1, 3)), still
    else:
        moved = frames
    if location is not None:
        for i in range(3):
            channels.curve(f"{path}.location", i, bone.name, moved, location[:, i])
    if max(abs(s - 1) for s in bone.scale) > 1e-6:
        for i in range(3):
            channels.curve(f"{path}.scale", i, bone.name, still, np.ones(1))


def _rotation_values(mode: str, basis: Array) -> list[tuple[str, Array]]:
    """The rotation channel of a bone in ``mode`` and its values (T, 3 or 4) for basis quaternions (T, 4)."""
    if mode == "QUATERNION":
        return [("rotation_quaternion", basis)]
    if mode == "AXIS_ANGLE":
        vector = quat_to_rotvec(basis)
        angle = np.linalg.norm(vector, axis=-1, keepdims=True)
        axis = np.where(angle > 1e-9, vector / np.maximum(angle, 1e-9), (0.0, 1.0, 0.0))
        return [("rotation_axis_angle", np.concatenate((angle, axis), axis=-1))]
    eulers = []
    for q in basis:
        euler = Quaternion(q).to_euler(mode, eulers[-1]) if eulers else Quaternion(q).to_euler(mode)
        eulers.append(euler)
    return [("rotation_euler", np.array(eulers))]


def _continuous(q: Array) -> Array:
    """Flip signs along time so that (T, J, 4) quaternions never jump to the other cover."""
    flips = np.where(np.sum(q[1:] * q[:-1], axis=-1) < 0, -1.0, 1.0)
    signs = np.concatenate((np.where(q[:1, :, 0] < 0, -1.0, 1.0), flips))
    return q * np.cumprod(signs, axis=0)[..., None]


def _rotation_of(matrix: Array) -> Quaternion:
    return Matrix(matrix.tolist()).to_quaternion()


def _require_editable(armature: bpy.types.Object) -> None:
    if armature.library is not None and armature.override_library is None:
        raise NsmError(f"The armature {armature.name} is linked from another file; make a library override of it and generate again.")
    if armature.animation_data and armature.animation_data.use_tweak_mode:
        raise NsmError(f"The armature {armature.name} is in the NLA's tweak mode; leave it (Tab in the NLA editor) and generate again.")


def _require_take(hips: Array, local: Array) -> None:
    if hips.ndim != 2 or hips.shape[1] != 3 or local.shape != (len(hips), J, 4) or not len(hips):
        raise SkeletonError(
            f"A take needs hips (T, 3) and rotations (T, {J}, 4) of one frame or more, not {hips.shape} and {local.shape}; "
            "generate it again."
        )
    if not (np.isfinite(hips).all() and np.isfinite(local).all()):
        raise NsmError("The take holds values that are not numbers, so nothing was keyed; try another seed or another start.")


def _touch(armature: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Show the armature's new action at the current frame."""
    armature.update_tag()
    scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)
