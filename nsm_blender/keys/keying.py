"""A take becomes an ordinary slotted action, and can be read back from it frame by frame."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from nsm_core.body import clip
from nsm_core.body.key_reduction import Reduced, reduce_keys
from nsm_core.body.skeleton import HIPS, J
from nsm_core.conventions import FPS
from nsm_core.errors import NsmError, SkeletonError
from nsm_core.rotations import Array, quat_conjugate, quat_mul, quat_normalize

from ..animation.channels import ActionChannels, assign, new_action, remove_unused, transform_of
from ..animation.identity import exists
from ..animation.kept import FrameState, Kept, restored_on_failure
from ..rigs.armature import Placement, StartPose, read_pose, read_world_pose, require_skeleton
from ..rigs.bone_map import BoneMap, bone_map_of
from ..rigs.mount import Mount, go_to, last, over_frames
from ..world.beside import beside
from .before import keep_before, stand_before
from .edits import KeptEdits, edited_paths, keep_edits, note_made
from .fewer import ROOT, KeptKeys, body_of, kept_keys
from .layers import bones_between, carried, channels_of_strips, require_keyable
from .limb_controls import control_channels, control_mounts, pole_turns, replaced
from .objects import KeyedThing, MovedObject, end_thing, key_thing, take_off_thing
from .root_motion import RootChannels, RootWay, require_root
from .style import OBJECT, PLAIN, KeyStyle
from .turns import continuous, rotation_channel, rotation_values

__all__ = ["KeyedTake", "StartPose", "discard_take", "key_take", "read_back", "read_pose", "resample_take"]

_NO_TURN = {"rotation_quaternion": (1.0, 0.0, 0.0, 0.0), "rotation_axis_angle": (0.0, 0.0, 1.0, 0.0)}


_PLACE = ""  # the object itself, among the names of its bones


@dataclass
class KeyedTake:
    """A take in an action: what was made, where it lies, and what it replaced; ``things`` the same of the
    objects it moved.
    """

    armature: bpy.types.Object
    action: bpy.types.Action
    slot: Any | None
    frame_start: float
    frame_end: float
    fps: float  # of the scene, keys per second
    previous_action: bpy.types.Action | None
    previous_slot: Any | None
    previous_fake_user: bool
    # Bone name, transform channels before the take; or, where it has switches that are keyed, their values.
    previous_pose: list[tuple[str, Any]]
    things: list[KeyedThing] = field(default_factory=list)
    reduced: Reduced | None = None  # where fewer keys were asked for
    kept: KeptEdits = field(default_factory=KeptEdits)
    aside: list[Matrix] | None = None  # by which each frame is seen off its place, where it plays in place

    @property
    def first(self) -> int:
        """The first whole frame."""
        return int(np.ceil(self.frame_start))

    @property
    def last(self) -> int:
        """The last whole frame."""
        return int(np.floor(self.frame_end))

    @property
    def count(self) -> int:
        """Frames that have keys."""
        return round(self.frame_end - self.frame_start) + 1


def scene_fps(scene: bpy.types.Scene) -> float:
    """Frames per second that the scene plays, its base included."""
    return scene.render.fps / scene.render.fps_base


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
        pole_turned = _pole_turns(armature, placement, bone_map, hips, local)
        root = None
        if style.root_motion != PLAIN.root_motion:
            root = RootWay.of(armature, style.root_motion, placement, hips, local, rate)
        every_mount = yield from _mounts_over(armature, placement, root, scene, frames)
        mounts = {j: every_mount[j] for j in placement.keyed.apart}
        places, basis = bone_channels(armature, placement, mounts, hips, local)
        modes = {
            j: armature.pose.bones[placement.keyed.bones[j]].rotation_mode for j in placement.keyed.mapped
        }
        turns = {j: rotation_values(mode, basis[:, j]) for j, mode in modes.items()}
        carrier = None if root is None else (yield from root.channels(scene, frames, mounts))
        reduced, fewer = None, {}
        if style.reduce is not None:
            body = body_of(
                placement, mounts, hips, local, turns, places, modes, set(_loose_joints(armature, placement)),
                None if root is None or carrier is None else (root, carrier), rate,
            )  # fmt: skip
            reduced = yield from beside(lambda _: reduce_keys(body, style.reduce))
            edited = edited_paths(previous, previous_slot, frame_start) if style.keep_edits else set()
            fewer = _unedited(kept_keys(reduced, carrier is not None), edited, placement, carrier)
        others, pulled = channels_of_strips(armature), replaced(bone_map)
        if carrier is not None:
            _key_moves(
                channels, carrier.prefix, carrier.group, carrier.mode, frames, carrier.turns, carrier.places,
                fewer.get(ROOT),
            )  # fmt: skip
        for j in placement.keyed.mapped:
            yield j / J
            if j in pulled:
                continue
            bone = armature.pose.bones[placement.keyed.bones[j]]
            _key_bone(channels, bone, frames, turns[j], places.get(j), others, fewer.get(j))
        for name, control in control_channels(
            armature, placement, bone_map, every_mount, hips, local, pole_turned
        ):
            bone, turn = armature.pose.bones[name], control.rotation
            values = (
                None if turn is None else rotation_values(bone.rotation_mode, continuous(turn[:, None])[:, 0])
            )
            _key_bone(channels, bone, frames, values, control.location, others, None)
        still = [name for controls in bone_map.pulled.values() for name in controls.still]
        for between in (*bones_between(armature), *still):
            _key_still(channels, armature.pose.bones[between], frames, others)
        if root is not None and root.bone:
            moving = armature.pose.bones[root.bone]
            _key_still(channels, moving, frames, others, turned=True, moved=True)
        _key_switches(channels, armature, frames)
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


def take_off(take: KeyedTake) -> None:
    """Give the armature, and what it moved, back the actions, the pose and the places they had; the take's
    own actions stay in the file.
    """
    for thing in take.things:
        take_off_thing(thing)
    if take.previous_action:
        take.previous_action.use_fake_user = take.previous_fake_user
    assign(take.armature, take.previous_action, take.previous_slot)
    bpy.context.view_layer.update()  # the old action plays once more, before the pose that was not keyed
    for name, values in take.previous_pose:
        moving = take.armature if name == _PLACE else take.armature.pose.bones.get(name)
        if moving is None:
            continue
        if not isinstance(values, dict):  # a matrix, of files of an earlier version
            moving.matrix_basis = values
        elif "rotation_quaternion" in values:
            for channel, value in values.items():
                setattr(moving, channel, value)
        else:
            set_switches(moving, values)
    take.armature.update_tag()
    bpy.context.view_layer.update()


def forget_gone(take: KeyedTake) -> None:
    """Pass over what a take has replaced where somebody has deleted it since."""
    for made in (take, *take.things):
        if made.previous_action is not None and not exists(made.previous_action):
            made.previous_action = made.previous_slot = None


def discard_take(take: KeyedTake) -> None:
    """Remove a take's actions and give the armature, and what it moved, back the actions, the pose and the
    places they had.
    """
    take_off(take)
    for made in (take, *take.things):
        remove_unused(made.action)


def pose_of(armature: bpy.types.Object, placed: bool = False) -> list[tuple[str, Any]]:
    """What a take must be able to give back of a pose: bones with their transform channels (a matrix would
    lose whole turns), and with the values of their switches that are keyed; and where it is ``placed`` by the
    take, the object's own transform.
    """
    pose: list[tuple[str, Any]] = [(bone.name, transform_of(bone)) for bone in armature.pose.bones]
    return pose + switches_of(armature) + ([(_PLACE, transform_of(armature))] if placed else [])


def mounts_of(
    armature: bpy.types.Object, placement: Placement, carrier: Matrix | None = None
) -> dict[int, Mount]:
    """Where the channels of the bones begin that get locations, by their joint; ``carrier`` as for
    ``Mount.of``.
    """
    return {j: Mount.of(armature, placement.keyed.bones[j], carrier) for j in placement.keyed.apart}


def _mounts_over(
    armature: bpy.types.Object,
    placement: Placement,
    root: RootWay | None,
    scene: bpy.types.Scene,
    frames: Array,
) -> Generator[float, None, dict[int | str, Mount]]:
    """The mounts of a take's frames, or of all in one where they stay: with what else carries the armature,
    and with its root as that will be keyed.
    """
    rows, bone_map = iter(range(len(frames))), bone_map_of(armature)

    def read() -> dict[int | str, Mount]:
        carrier = None
        if root is not None and root.bone:
            shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
            carrier = root.carrier(next(rows), shown)
        own = mounts_of(armature, placement, carrier)
        return {**own, **control_mounts(armature, bone_map, carrier)}

    if carried(armature):
        every = yield from over_frames(scene, frames, read)
    else:
        every = [read() for _ in range(len(frames) if root is not None and root.bone else 1)]
    mounts = {k: Mount.over([each[k] for each in every]) for k in every[0]}
    if root is not None:
        mounts = root.mounted(mounts)
    mounts[HIPS].require_one_size(armature.name)
    return mounts


def bone_channels(
    armature: bpy.types.Object, placement: Placement, mounts: dict[int, Mount], hips: Array, local: Array
) -> tuple[dict[int, Array], Array]:
    """Turn a take into pose channels: locations (T, 3) of the bones with mounts, by their joint, and basis
    rotations (T, 23, 4), sign-continuous.

    ``hips`` (T, 3) are in the world, Blender units.  A bone's basis is its rotation seen from its rest frame
    on the bone that carries it; that of a bone which does not inherit rotation, R its rest in the armature,
    is ``R^-1 A^-1 W C``.  For the hips what carries them comes off first.
    """
    rig = placement.keyed
    places, world = rig.to_bones(hips / placement.scale, local)
    basis = rig.basis(world)
    off = quat_conjugate(mounts[HIPS].rotation)  # (N, 4), A^-1
    loose = _loose_joints(armature, placement)
    if loose:
        basis[:, loose] = quat_mul(quat_conjugate(rig.turns[loose]), quat_mul(off[:, None], world[:, loose]))
    for j, mount in mounts.items():
        basis[:, j] = quat_mul(quat_conjugate(mount.turn), quat_mul(off, world[:, j]))
    locations = {j: mount.location(places[j] * placement.scale) for j, mount in mounts.items()}
    return locations, continuous(quat_normalize(basis))


def show_pose(
    armature: bpy.types.Object, placement: Placement, places: dict[int, Array], basis: Array, row: int = 0
) -> None:
    """Pose a character by a row of its channels, without a key."""
    for j in placement.keyed.mapped:
        place = Matrix.Translation(Vector(places[j][row])) if j in places else Matrix()
        bone = armature.pose.bones[placement.keyed.bones[j]]
        bone.matrix_basis = place @ Quaternion(basis[row, j]).to_matrix().to_4x4()


def _pole_turns(
    armature: bpy.types.Object, placement: Placement, bone_map: BoneMap, hips: Array, local: Array
) -> dict[str, float]:
    """``pole_turns`` as the scene stands now."""
    if not bone_map.pulled:
        return {}
    places, basis = bone_channels(armature, placement, mounts_of(armature, placement), hips, local)
    return pole_turns(
        armature,
        placement,
        bone_map,
        control_mounts(armature, bone_map),
        hips,
        local,
        lambda row: show_pose(armature, placement, places, basis, row),
    )


def _loose_joints(armature: bpy.types.Object, placement: Placement) -> list[int]:
    """Joints whose bones do not turn with the bone that carries them."""
    rig, bones = placement.keyed, armature.data.bones
    return [j for j in rig.mapped if j not in rig.apart and not bones[rig.bones[j]].use_inherit_rotation]


def switches_of(armature: bpy.types.Object) -> list[tuple[str, dict[str, float]]]:
    """Values of the properties that are keyed with a take, by bone."""
    bones = armature.pose.bones
    return [
        (name, {key: _switch(bones[name], key) for key in values if _has_switch(bones[name], key)})
        for name, values in bone_map_of(armature).switches.items()
    ]


def set_switches(bone: bpy.types.PoseBone, values: Mapping[str, float]) -> None:
    """Set properties that a bone has, its own or custom ones, each in the kind of number that it is."""
    for key, value in values.items():
        if key in bone:
            bone[key] = type(bone[key])(value)
        elif _has_switch(bone, key):
            setattr(bone, key, type(getattr(bone, key))(value))


def _has_switch(bone: bpy.types.PoseBone, key: str) -> bool:
    return key in bone or isinstance(getattr(bone, key, None), bool | int | float)


def _switch(bone: bpy.types.PoseBone, key: str) -> float:
    return bone[key] if key in bone else getattr(bone, key)


def _key_switches(channels: ActionChannels, armature: bpy.types.Object, frames: Array) -> None:
    """Key the properties that have a rig's controls obey these keys, by one key each."""
    for name, values in bone_map_of(armature).switches.items():
        for key, value in values.items():
            bone = armature.pose.bones[name]
            if _has_switch(bone, key):
                path = f'["{bpy.utils.escape_identifier(key)}"]' if key in bone else f".{key}"
                full = f'pose.bones["{bpy.utils.escape_identifier(name)}"]{path}'
                channels.curve(full, 0, name, frames[:1], np.array([value]))


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


def _key_bone(
    channels: ActionChannels,
    bone: bpy.types.PoseBone,
    frames: Array,
    turns: Array | None,
    location: Array | None,
    others: set[tuple[str, str]],
    kept: KeptKeys | None,
) -> None:
    prefix = f'pose.bones["{bpy.utils.escape_identifier(bone.name)}"].'
    _key_moves(channels, prefix, bone.name, bone.rotation_mode, frames, turns, location, kept)
    _key_still(channels, bone, frames, others, turned=turns is not None, moved=location is not None)


def _key_still(
    channels: ActionChannels,
    bone: bpy.types.PoseBone,
    frames: Array,
    others: set[tuple[str, str]],
    turned: bool = False,
    moved: bool = False,
) -> None:
    """Put a bone that was moved, turned or scaled by hand, or by a strip (``others``), back by one key, in
    this action only.

    It would bend the skeleton the take was made for.  ``turned`` and ``moved``: these channels have keys.
    """
    rotation = rotation_channel(bone.rotation_mode)
    rest = {
        "location": (0.0, 0.0, 0.0),
        "scale": (1.0, 1.0, 1.0),
        rotation: _NO_TURN.get(rotation, (0.0, 0.0, 0.0)),
    }
    for channel, done in (("location", moved), (rotation, turned), ("scale", False)):
        bent = max(abs(a - b) for a, b in zip(getattr(bone, channel), rest[channel], strict=True)) > 1e-6
        if not done and (bent or (bone.name, channel) in others):
            path = f'pose.bones["{bpy.utils.escape_identifier(bone.name)}"].{channel}'
            channels.curves(path, bone.name, frames[:1], np.array([rest[channel]]))


def _unedited(
    fewer: dict[int, KeptKeys], edited: set[str], placement: Placement, carrier: RootChannels | None
) -> dict[int, KeptKeys]:
    """Fewer keys only of what the animator has no keys of: to his a motion leads in every frame."""
    names = {
        j: f'pose.bones["{bpy.utils.escape_identifier(b)}"].'
        for j, b in enumerate(placement.keyed.bones)
        if b
    }
    if carrier is not None:
        names[ROOT] = carrier.prefix or "location"
    return {j: kept for j, kept in fewer.items() if not any(p.startswith(names[j]) for p in edited)}


def _key_moves(
    channels: ActionChannels,
    prefix: str,
    group: str,
    mode: str,
    frames: Array,
    turns: Array | None,
    places: Array | None,
    kept: KeptKeys | None,
) -> None:
    """Key rotation (N, 3 or 4) and location (N, 3), each where there is one, of what the paths begin with
    ``prefix``; where fewer keys are kept, those.
    """
    width = 0 if turns is None else turns.shape[1]
    for path, values, part in (
        (rotation_channel(mode), turns, slice(width)),
        ("location", places, slice(width, None)),
    ):
        if values is None:
            continue
        if kept is None:
            channels.curves(prefix + path, group, frames, values)
        else:
            slopes = kept.slopes[:, part]
            channels.curves(prefix + path, group, frames[kept.rows], values[kept.rows], slopes)


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
