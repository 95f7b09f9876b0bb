"""Objects that a character moves: boxes and leaves of doors follow their props, and get actions of
their own.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from mathutils import Euler, Matrix, Quaternion, Vector

from nsm_core.body.key_reduction import Bound, KeyedBody, KeyedChannels, Reduced, reduce_keys
from nsm_core.errors import GoalError, NsmError
from nsm_core.rotations import Array
from nsm_core.world.scene.props import Prop

from ..animation.channels import assign, new_action, strip_curves, transform_of
from ..animation.kept import Kept, restored_on_failure
from ..rigs.mount import over_frames
from .before import keep_before
from .edits import KeptEdits, edited_paths, keep_edits, note_made
from .layers import (
    acts,
    animated_switches,
    driven,
    may_move,
    require_action_rules,
    require_editable,
    varies,
)
from .style import PLAIN, KeyStyle
from .turns import rotation_channel

if TYPE_CHECKING:
    from ..world.frame import WorldFrame

_DELTAS = ("delta_location", "delta_rotation_euler", "delta_rotation_quaternion", "delta_scale")
_MOVED = 1e-5  # metres and radians between two frames that count as a move
_SHEAR = 0.01  # by which the axes of a thing may be stretched or skewed while it turns


@dataclass
class KeyedThing:
    """The action of one moved object: what was made and what it replaced."""

    object: bpy.types.Object
    action: bpy.types.Action
    slot: Any | None
    previous_action: bpy.types.Action | None
    previous_slot: Any | None
    previous_fake_user: bool
    previous_transform: dict[str, Any]  # channel name and value before the take
    kept: KeptEdits = field(default_factory=KeptEdits)
    reduced: Reduced | None = None


@dataclass
class MovedObject:
    """An object that a take moves: where it and its prop are before the first frame.

    ``world`` its matrix, ``space`` the one from the world to its own channels, ``turn`` its own rotation;
    ``pose`` (4,) of the prop that it moves with, core frame, and the name ``prop`` of that: the object's own,
    or the leaf's on which it hangs.
    """

    object: bpy.types.Object
    frame: WorldFrame
    world: Matrix
    space: Matrix
    turn: Quaternion
    pose: Array
    prop: str

    @classmethod
    def of(cls, target: bpy.types.Object, frame: WorldFrame, prop: Prop) -> MovedObject:
        """Note where an object stands now; GoalError where its parents would shear it as it turns."""
        turn = delta_turn(target) @ own_turn(target)
        _require_unsheared(target)
        return cls(
            target, frame, target.matrix_world.copy(), space_of(target), turn, prop.pose.copy(), prop.name
        )

    def world_at(self, pose: Array) -> Matrix:
        """World matrix of the object when its prop is at ``pose`` (4,), core frame."""
        return self.move_to(pose) @ self.world

    def move_to(self, pose: Array) -> Matrix:
        """Rigid move of the world (4, 4) that brings the prop to ``pose`` (4,), core frame."""
        return self._matrix(pose) @ self._matrix(self.pose).inverted()

    def _matrix(self, pose: Array) -> Matrix:
        return Matrix.Translation(Vector(self.frame.to_world(pose[:3]))) @ Matrix.Rotation(
            float(pose[3]), 4, "Z"
        )


def require_movable(target: bpy.types.Object, character: bpy.types.Object | None) -> None:
    """Raise an NsmError unless a take may key where ``target`` is."""
    require_editable(target)
    if character is not None and (
        target == character
        or target in character.children_recursive
        or character in target.children_recursive
    ):
        raise GoalError(
            f"{target.name} and the character {character.name} hang on each other; unparent them, or choose "
            "another object."
        )
    if not target.evaluated_get(bpy.context.evaluated_depsgraph_get()).is_evaluated:
        raise GoalError(
            f"{target.name} is switched off in the viewport, so that it does not move; show it and its "
            "collection."
        )
    switches = animated_switches(target)
    constraint = next((c.name for c in target.constraints if acts(c, switches.get(("", c.name), ()))), None)
    if constraint is not None:
        raise GoalError(
            f"{target.name} has constraints ({constraint}), so that keys alone do not move it; mute or "
            "apply them."
        )
    body = target.rigid_body
    if body is not None and body.type == "ACTIVE" and body.enabled and not body.kinematic:
        raise GoalError(f"{target.name} is moved by physics; set its rigid body to Animated, or remove it.")
    require_action_rules(target)
    channels = {"location", "scale", "rotation_mode", rotation_channel(target.rotation_mode), *_DELTAS}
    if channels.intersection(driven(target)):
        raise GoalError(f"{target.name} is moved by drivers; remove these, or choose another object.")
    moved = next((c.data_path for c in strip_curves(target) if c.data_path in _DELTAS and varies(c)), None)
    if moved is not None:
        raise GoalError(
            f"{target.name} is moved by an NLA strip on its {moved.replace('_', ' ')}; mute that track in "
            "the NLA editor."
        )


def rides_along(target: bpy.types.Object, others: Sequence[bpy.types.Object]) -> bool:
    """Whether an object follows one of ``others`` by a constraint, so that it needs no keys of its own."""
    return any(
        c.enabled and c.influence > 0 and getattr(c, "target", None) in others for c in target.constraints
    )


def _require_unsheared(target: bpy.types.Object) -> None:
    """Raise GoalError where location and rotation cannot turn an object about the vertical without distorting
    it.

    So it is under parents of uneven scale, unless their vertical axis alone is longer or shorter.
    """
    to_world = np.array(space_of(target).inverted_safe(), dtype=np.float64)[:3, :3]
    quarter = np.array(((0, -1, 0), (1, 0, 0), (0, 0, 1.0)))
    own = np.linalg.pinv(to_world) @ quarter @ to_world  # what would turn it so, seen from its own channels
    if np.abs(own @ own.T - np.eye(3)).max() > _SHEAR:
        over = target.parent.name if target.parent else "a parent"
        raise GoalError(
            f"{target.name} hangs on {over}, whose scale is uneven, so that it would be sheared as it "
            "turns; apply that scale "
            "(Ctrl+A, Scale), or unparent it and keep its transform."
        )


def resample_poses(poses: Array, fps_from: float, fps_to: float) -> Array:
    """Sample poses (T, 4) at another rate: (N, 4), linear, headings by the shorter way; ends as in
    ``keying.resample_take``.
    """
    poses = np.array(poses, dtype=np.float64)
    poses[:, 3] = np.unwrap(poses[:, 3])
    seconds = (len(poses) - 1) / fps_from
    at = np.arange(int(np.ceil(seconds * fps_to - 1e-6)) + 1) / fps_to * fps_from
    return np.column_stack([np.interp(at, np.arange(len(poses)), poses[:, k]) for k in range(4)])


def key_thing(
    thing: MovedObject,
    poses: Array,
    frame_start: float,
    fps: float,
    scene_rate: float,
    name: str,
    scene: bpy.types.Scene,
    keep: bool = False,
    style: KeyStyle = PLAIN,
) -> Generator[float, None, KeyedThing | None]:
    """Key a moved object as a new action and keep the action it had; the generator's value is None where it
    never moves.

    ``poses`` (T, 4), core frame, of its prop at ``fps`` are resampled to ``scene_rate`` from ``frame_start``
    on.  Keys lie where it moves, and at both ends; ``style`` may want fewer.  Raises as ``require_movable``,
    and NsmError on values that are not numbers; the object is then as before.
    """
    target = thing.object
    require_movable(target, None)
    poses = np.asarray(poses, dtype=np.float64)
    if poses.ndim != 2 or poses.shape[1] != 4 or not np.isfinite(poses).all():
        raise NsmError(
            f"The take holds places of {target.name} that are not numbers, so nothing was keyed; try "
            "another seed."
        )
    poses = resample_poses(poses, fps, scene_rate)
    rows = moving_rows(poses)
    if not len(rows):
        return None
    spaces = [thing.space]
    moving = target.parent is not None and may_move(target)
    if moving or style.reduce is not None:
        rows = np.arange(len(poses))  # keys must hold it where it stands
    if moving:
        spaces = yield from over_frames(scene, list(frame_start + rows), lambda: space_of(target))
    frames = frame_start + rows
    moves = [thing.move_to(pose) for pose in poses[rows]]
    location, rotation = channel_values(target, thing.world, thing.space, thing.turn, moves, spaces)
    scale = np.array((thing.space @ thing.world).to_scale())
    data = target.animation_data
    previous = data.action if data else None
    previous_slot = getattr(data, "action_slot", None) if previous else None
    reduced, slopes = None, None
    if style.reduce is not None and not edited_paths(previous, previous_slot, frame_start):
        reduced = _reduced(thing, moves, spaces, location, rotation, scene_rate, style.reduce)
        rows, slopes = reduced.rows[0], reduced.slopes[0]
        frames, location, rotation = frames[rows], location[rows], rotation[rows]

    keyed = KeyedThing(
        target,
        None,
        None,
        previous,
        previous_slot,
        bool(previous and previous.use_fake_user),
        transform_of(target),
    )
    with restored_on_failure(Kept(scene, [target])):
        if previous:
            previous.use_fake_user = True  # or it would be lost with the file's next save
        channels = new_action(name, target.name)
        keys = np.concatenate((rotation, location), axis=1)
        width, path, group = rotation.shape[1], rotation_channel(target.rotation_mode), "Object Transforms"
        for where, part in (("location", slice(width, None)), (path, slice(width))):
            channels.curves(where, group, frames, keys[:, part], None if slopes is None else slopes[:, part])
        # Its size must stay what it was.
        if previous or any(c.data_path == "scale" for c in strip_curves(target)):
            for i in range(3):
                channels.curve("scale", i, "Object Transforms", frames[:1], scale[i : i + 1])
        if keep:
            keep_before(channels, previous, previous_slot, frame_start)
        if style.keep_edits:
            keyed.kept = keep_edits(channels, previous, previous_slot, frame_start, scene_rate)
        note_made(channels, frame_start, keyed.kept)
        assign(target, channels.action, channels.slot)
        target.update_tag(refresh={"TIME"})
    keyed.action, keyed.slot, keyed.reduced = channels.action, channels.slot, reduced
    return keyed


def _reduced(
    thing: MovedObject,
    moves: Sequence[Matrix],
    spaces: Sequence[Matrix],
    location: Array,
    rotation: Array,
    rate: float,
    bound: Bound,
) -> Reduced:
    """The keys that keep a moved object within a bound, its corners too."""
    scale = thing.frame.scale
    seen = [move @ thing.world for move in moves]
    places = np.array([m.translation for m in seen], dtype=np.float64) / scale
    turns = np.array([m.to_quaternion() for m in seen], dtype=np.float64)
    corners = np.array([(thing.world @ Vector(c)) - thing.world.translation for c in thing.object.bound_box])
    reach = max(float(np.linalg.norm(corners, axis=1).max()) / scale, 1e-3)
    bound = Bound(bound.mm / 2, min(bound.degrees, np.degrees(bound.mm / 2000 / reach)))
    axes = np.array([np.array(space.inverted_safe())[:3, :3] for space in spaces]) / scale
    channels = {0: KeyedChannels(rotation, thing.object.rotation_mode, location, axes)}
    return reduce_keys(KeyedBody((-1,), places[:, None], turns[:, None], channels, feet=(), fps=rate), bound)


def end_thing(target: bpy.types.Object, frame: float, name: str) -> KeyedThing:
    """Give an animated object an action that is its own up to ``frame`` and holds from there on."""
    data = target.animation_data
    previous, slot = data.action, getattr(data, "action_slot", None)
    keyed = KeyedThing(target, None, None, previous, slot, previous.use_fake_user, transform_of(target))
    with restored_on_failure(Kept(bpy.context.scene, [target])):
        previous.use_fake_user = True  # or it would be lost with the file's next save
        channels = new_action(name, target.name)
        keep_before(channels, previous, slot, frame)
        assign(target, channels.action, channels.slot)
        target.update_tag(refresh={"TIME"})
    keyed.action, keyed.slot = channels.action, channels.slot
    return keyed


def take_off_thing(keyed: KeyedThing) -> None:
    """Give a moved object back the action and the place it had; its take's own action stays in the file."""
    if keyed.previous_action:
        keyed.previous_action.use_fake_user = keyed.previous_fake_user
    assign(keyed.object, keyed.previous_action, keyed.previous_slot)
    bpy.context.view_layer.update()  # the old action plays once more, before the place that was not keyed
    for channel, value in keyed.previous_transform.items():
        setattr(keyed.object, channel, value)
    keyed.object.update_tag()


def moving_rows(poses: Array) -> Array:
    """Rows of poses (N, 4) that need a key: both ends and every frame next to a move; empty where nothing
    moves.
    """
    steps = np.abs(np.diff(poses, axis=0)).max(1) > _MOVED if len(poses) > 1 else np.zeros(0, bool)
    if not steps.any():
        return np.zeros(0, int)
    keyed = np.concatenate((steps, [True])) | np.concatenate(([True], steps))
    return np.flatnonzero(keyed)


def channel_values(
    target: bpy.types.Object,
    world: Matrix,
    space: Matrix,
    own: Quaternion,
    moves: Sequence[Matrix],
    spaces: list[Matrix],
) -> tuple[Array, Array]:
    """Location (N, 3) and rotation (N, 3 or 4) in the object's mode that take it from its matrix ``world`` to
    where N rigid ``moves`` of the world lead.

    ``space`` is the one from the world to the object's own channels when it was there, ``own`` its rotation
    in them, deltas included; ``spaces``, one for each move or one for all, its parents as they are then.
    """
    mode = target.rotation_mode
    undelta, back = delta_turn(target).inverted(), space.inverted_safe()
    location, rotation, last = [], [], None
    for move, now in zip(moves, spaces * len(moves) if len(spaces) == 1 else spaces, strict=True):
        move = now @ move
        location.append((move @ world).translation - target.delta_location)
        # The move's own rotation on top of the object's: a mirrored object stays as it is.
        turn = undelta @ (move @ back).to_quaternion() @ own
        if last is not None and turn.dot(last) < 0:
            turn.negate()
        if mode == "QUATERNION":
            rotation.append(tuple(turn))
        elif mode == "AXIS_ANGLE":
            axis, angle = turn.to_axis_angle()
            rotation.append((angle, *axis))
        else:
            rotation.append(
                turn.to_euler(mode, rotation[-1]) if rotation else turn.to_euler(mode, target.rotation_euler)
            )
        last = turn
    return np.array(location, dtype=np.float64), np.array(rotation, dtype=np.float64)


def space_of(target: bpy.types.Object) -> Matrix:
    """From the world to an object's own channels, its parents as they are now."""
    return target.matrix_basis @ target.matrix_world.inverted_safe()


def own_turn(target: bpy.types.Object, values: Sequence[float] | None = None) -> Quaternion:
    """The rotation channels of an object, in whatever mode, or these ``values`` of theirs, as a
    quaternion.
    """
    values = getattr(target, rotation_channel(target.rotation_mode)) if values is None else values
    if target.rotation_mode == "QUATERNION":
        return Quaternion(values).normalized()
    if target.rotation_mode == "AXIS_ANGLE":
        angle, *axis = values
        return Quaternion(axis, angle)
    return Euler(values, target.rotation_mode).to_quaternion()


def delta_turn(target: bpy.types.Object) -> Quaternion:
    """The rotation that an object adds to its own channels."""
    if target.rotation_mode == "QUATERNION":
        return target.delta_rotation_quaternion.normalized()
    return target.delta_rotation_euler.to_quaternion()
