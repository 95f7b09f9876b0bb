"""A take becomes an ordinary slotted action, and can be read back from it frame by frame."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any

import bpy
import numpy as np

from nsm_core.body import clip
from nsm_core.body.key_reduction import reduce_keys
from nsm_core.body.skeleton import J
from nsm_core.conventions import FPS
from nsm_core.errors import NsmError, SkeletonError
from nsm_core.rotations import Array, quat_normalize

from ..animation.channels import assign, new_action
from ..animation.kept import FrameState, Kept, restored_on_failure
from ..animation.rate import scene_fps
from ..rigs.armature import Placement, read_world_pose, require_skeleton
from ..rigs.bone_map import bone_map_of
from ..rigs.mount import go_to, last
from ..world.beside import beside
from .before import keep_before, stand_before
from .bone_keys import is_edited, key_bone, key_moves, key_still, unedited
from .edits import KeptEdits, edited_paths, keep_edits, note_made
from .fewer import ROOT, body_of, controls_of, joined, kept_keys, kept_of_controls
from .keyed import KeyedTake, discard_take, pose_of
from .layers import bones_between, channels_of_strips, require_keyable
from .limb_controls import control_channels, replaced
from .objects import MovedObject, end_thing, key_thing
from .pose_channels import bone_channels, loose_joints, mounts_over, poles_of
from .root_motion import RootWay, require_root
from .style import OBJECT, PLAIN, KeyStyle
from .switches import key_switches, set_switches
from .turns import continuous, rotation_values

__all__ = ["key_take", "key_take_steps", "key_things", "read_back", "resample_take"]


def resample_take(
    hips_position: Array, local_rotations: Array, fps_from: float, fps_to: float
) -> tuple[Array, Array]:
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
    frame_start: float = 1,
    fps: float = FPS,
    name: str = "Take",
    scene: bpy.types.Scene | None = None,
    style: KeyStyle = PLAIN,
) -> KeyedTake:
    """Key a take as a new action on ``armature`` and keep the action it had.

    ``style`` says what carries the root and how many keys stay.

    ``hips_position`` (T, 3), world metres, and ``local_rotations`` (T, 23, 4) at ``fps`` are resampled to the
    scene's rate from ``frame_start`` on.  The armature may stand, face, be scaled (evenly) and be carried as
    it likes: what else moves it goes on, and the motion lands in the world.  Bones keep their rotation modes.
    Raises SkeletonError (bones missing, misplaced or moved by something else) and NsmError (as
    ``layers.require_keyable``, bad numbers).  Whatever is raised, everything is then as before.
    """
    return last(
        key_take_steps(armature, hips_position, local_rotations, frame_start, fps, name, scene, style=style)
    )


def key_take_steps(
    armature: bpy.types.Object,
    hips_position: Array,
    local_rotations: Array,
    frame_start: float = 1,
    fps: float = FPS,
    name: str = "Take",
    scene: bpy.types.Scene | None = None,
    keep: bool = False,
    style: KeyStyle = PLAIN,
) -> Generator[float, None, KeyedTake]:
    """``key_take`` in slices: yields the share done after every frame that had to be looked at, and every
    bone keyed.  With ``keep``, what the armature's action shows before ``frame_start`` goes into the new one.
    """
    scene = scene or bpy.context.scene
    require_skeleton(armature)
    # As they are now: another frame does not show what was moved or turned without a key.
    before, here = Kept(scene, [armature]), FrameState(scene)
    previous_pose = pose_of(armature, placed=style.root_motion == OBJECT)
    if keep:
        go_to(scene, frame_start)  # what carries the armature is held as it is there
    bpy.context.view_layer.update()
    placement = Placement.of(armature)
    require_keyable(armature)
    require_root(armature, style.root_motion)
    hips_position = np.asarray(hips_position, dtype=np.float64)
    local_rotations = quat_normalize(np.asarray(local_rotations, dtype=np.float64))
    _require_take(hips_position, local_rotations)
    rate = scene_fps(scene)
    hips, local = resample_take(hips_position, local_rotations, fps, rate)
    frames = frame_start + np.arange(len(hips))

    data = armature.animation_data
    previous = data.action if data else None
    previous_slot = getattr(data, "action_slot", None) if previous else None
    with restored_on_failure(before):
        fake_user = bool(previous and previous.use_fake_user)
        if previous:
            previous.use_fake_user = True  # or it would be lost with the file's next save
        channels = new_action(name, armature.name)
        # Empty as it is: what carries the armature is read as it will be when the old action no longer plays.
        assign(armature, channels.action, channels.slot)
        bpy.context.view_layer.update()
        bone_map = bone_map_of(armature)
        for name, values in bone_map.switches.items():
            set_switches(armature.pose.bones[name], values)
        bpy.context.view_layer.update()
        pole_turned = poles_of(armature, placement, bone_map, hips, local)
        root = None
        if style.root_motion != PLAIN.root_motion:
            root = RootWay.of(armature, style.root_motion, placement, hips, local, rate)
        every_mount = yield from mounts_over(armature, placement, root, scene, frames)
        mounts = {j: every_mount[j] for j in placement.keyed.apart}
        places, basis = bone_channels(armature, placement, mounts, hips, local)
        modes = {
            j: armature.pose.bones[placement.keyed.bones[j]].rotation_mode for j in placement.keyed.mapped
        }
        turns = {j: rotation_values(mode, basis[:, j]) for j, mode in modes.items()}
        carrier = None if root is None else (yield from root.channels(scene, frames, mounts))
        pulled = replaced(bone_map)
        controls = dict(
            control_channels(armature, placement, bone_map, every_mount, hips, local, pole_turned)
        )
        control_modes = {name: armature.pose.bones[name].rotation_mode for name in controls}
        control_turns = {
            name: None
            if control.rotation is None
            else rotation_values(control_modes[name], continuous(control.rotation[:, None])[:, 0])
            for name, control in controls.items()
        }
        reduced, fewer, fewer_controls = None, {}, {}
        if style.reduce is not None:
            body = body_of(
                placement, mounts, hips, local, turns, places, modes, set(loose_joints(armature, placement)),
                None if root is None or carrier is None else (root, carrier), rate, pulled,
            )  # fmt: skip
            reduced = yield from beside(lambda _: reduce_keys(body, style.reduce))
            edited = edited_paths(previous, previous_slot, frame_start) if style.keep_edits else set()
            fewer = unedited(kept_keys(reduced, carrier is not None), edited, placement, carrier)
            if controls:
                holds = controls_of(
                    controls, every_mount, control_turns, control_modes, placement.scale, rate
                )
                less = yield from beside(lambda _: reduce_keys(holds, style.reduce))
                kept_there = kept_of_controls(less, controls)
                fewer_controls = {n: k for n, k in kept_there.items() if not is_edited(n, edited)}
                reduced = joined(reduced, less)
        others = channels_of_strips(armature)
        if carrier is not None:
            key_moves(
                channels, carrier.prefix, carrier.group, carrier.mode, frames, carrier.turns, carrier.places,
                fewer.get(ROOT),
            )  # fmt: skip
        for j in placement.keyed.mapped:
            yield j / J
            if j in pulled:
                continue
            bone = armature.pose.bones[placement.keyed.bones[j]]
            key_bone(channels, bone, frames, turns[j], places.get(j), others, fewer.get(j))
        for name, control in controls.items():
            bone, less_of_it = armature.pose.bones[name], fewer_controls.get(name)
            key_bone(channels, bone, frames, control_turns[name], control.location, others, less_of_it)
        still = [name for controls in bone_map.pulled.values() for name in controls.still]
        for between in (*bones_between(armature), *still):
            key_still(channels, armature.pose.bones[between], frames, others)
        if root is not None and root.bone:
            moving = armature.pose.bones[root.bone]
            key_still(channels, moving, frames, others, turned=True, moved=True)
        key_switches(channels, armature, frames)
        if keep:
            above = {
                b.name
                for j in placement.keyed.apart
                for b in armature.pose.bones[placement.keyed.bones[j]].parent_recursive
            }
            if carrier is not None:
                values = carrier.now(armature)
                stand_before(channels, previous, previous_slot, frame_start, values)
            keep_before(channels, previous, previous_slot, frame_start, above)
            here.restore()
        kept = KeptEdits()
        if style.keep_edits:
            kept = keep_edits(channels, previous, previous_slot, frame_start, rate)
        note_made(channels, frame_start, kept)
        _touch(armature)
    return KeyedTake(
        armature,
        channels.action,
        channels.slot,
        _number(frames[0]),
        _number(frames[-1]),
        rate,
        previous,
        previous_slot,
        fake_user,
        previous_pose,
        reduced=reduced,
        aside=None if root is None else root.aside(),
        kept=kept,
    )


def _number(frame: float) -> float:
    """A frame as the interface knows it: whole, or between two of them."""
    return int(frame) if frame == int(frame) else float(frame)


def key_things(
    take: KeyedTake,
    moved: Sequence[tuple[MovedObject, Array]],
    fps: float,
    name: str,
    scene: bpy.types.Scene,
    keep: bool = False,
    style: KeyStyle = PLAIN,
) -> Generator[float, None, None]:
    """Key what a take has moved, each object in an action of its own named after ``name`` and the object.
    With ``keep``, what was keyed of them before the take stays.

    ``moved`` are things with the poses (T, 4) of their props at ``fps``.  Yields the share of an object's
    frames looked at.  Where one cannot be keyed, the whole take is discarded and the error goes on.
    """
    try:
        for thing, poses in moved:
            own = f"{name} {thing.object.name}"
            keyed = yield from key_thing(
                thing, poses, take.frame_start, fps, take.fps, own, scene, keep, style
            )
            if keyed is not None:
                take.things.append(keyed)
                take.kept.join(keyed.kept)
    except BaseException:
        discard_take(take)
        raise
    _touch(take.armature)


def end_things(take: KeyedTake, things: Sequence[bpy.types.Object], name: str) -> None:
    """Have what an earlier take moved come to rest where ``take`` begins, unless that moves it, too: its own
    action gives way to one that ends there.
    """
    mine = {thing.object for thing in take.things}
    for thing in things:
        if thing not in mine:
            take.things.append(end_thing(thing, take.frame_start, f"{name} {thing.name}"))


def read_back(
    armature: bpy.types.Object, frames: Any, scene: bpy.types.Scene | None = None
) -> tuple[Array, Array]:
    """Evaluate the armature at ``frames`` and return hips (N, 3), world metres, and local rotations (N, 23,
    4).
    """
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


def _require_take(hips: Array, local: Array) -> None:
    if hips.ndim != 2 or hips.shape[1] != 3 or local.shape != (len(hips), J, 4) or not len(hips):
        raise SkeletonError(
            f"A take needs hips (T, 3) and rotations (T, {J}, 4) of one frame or more, not {hips.shape} and "
            f"{local.shape}; "
            "generate it again."
        )
    if not (np.isfinite(hips).all() and np.isfinite(local).all()):
        raise NsmError(
            "The take holds values that are not numbers, so nothing was keyed; try another seed or another "
            "start."
        )


def _touch(target: bpy.types.Object) -> None:
    """Show an object's new action at the current frame."""
    target.update_tag(refresh={"TIME"})
    bpy.context.view_layer.update()
