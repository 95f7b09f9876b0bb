"""The motion that a take goes on from: the pose and pace that the character has at the take's first frame."""

from __future__ import annotations

import secrets
from collections.abc import Generator

import bpy
import numpy as np

from nsm_core.body.skeleton import FEET, HIP_OVER_SEAT, HIPS, forward_kinematics, root_of
from nsm_core.control.goals import Goal
from nsm_core.control.start import Start
from nsm_core.conventions import FPS
from nsm_core.errors import GoalError
from nsm_core.model.features.state import WINDOW
from nsm_core.rotations import Array, direction_to_heading, heading_to_direction

from .animation.channels import curves_in
from .animation.kept import frame_kept
from .animation.rate import scene_fps
from .goals.finder import Place
from .goals.loose_parts import seat_body
from .keys.keyed import KeyedTake
from .keys.layers import may_move
from .progress import Progress, staged
from .rigs.armature import Placement, read_world_pose
from .rigs.mount import go_to, over_frames
from .world.bvh_query import BVHQuery
from .world.frame import WorldFrame
from .world.solids import Solid
from .world.surroundings import Surroundings

BEGIN = "nsm_begin"  # on the action of a take: how it began, and its first frame
STOOD = "nsm_stood"  # and where it stood then, on its armature: a point, and the way it faced
TAKE = "nsm_take"  # on all actions of one take: the same word
STAND, POSE, FILL = "stand", "pose", "fill"
BEGINNINGS = (STAND, POSE, FILL)
# Seated: thighs that drop by less than this share of their length, a seat this near under the hips, metres,
# and hips that rest, m/s.
_THIGH, _UNDER, _RESTS = 0.75, 0.12, 0.2
_RESTING_THING = 1e-4  # by which the channels of a thing at rest may change in two frames
_AT_REST = 1e-3  # by which bones may differ from their rest pose that nobody has posed


def goes_on(armature: bpy.types.Object, start_frame: float) -> bool:
    """Whether a character, as it is shown now, has a pose to go on from at a take's first frame: one in its
    rest pose has none, nor one whose take began there with a quiet stand.
    """
    if began_at(armature, start_frame):
        return False
    mapped = {name for name in Placement.of(armature).keyed.bones if name}
    identity = np.eye(4)
    return any(
        np.abs(np.array(bone.matrix_basis) - identity).max() > _AT_REST
        for bone in armature.pose.bones
        if bone.name in mapped
    )


def began_at(armature: bpy.types.Object, start_frame: float) -> bool:
    """Whether the take that a character shows began with a quiet stand at this very frame."""
    action = armature.animation_data.action if armature.animation_data else None
    how, first = action[BEGIN] if action is not None and BEGIN in action else (1.0, 0.0)
    return bool(how == 0 and abs(first - start_frame) < 1e-3)


def noted_stand(armature: bpy.types.Object, frame: WorldFrame) -> Place | None:
    """Where the take that a character shows began with a quiet stand, if it did, on the armature as it is
    shown now: ground point (2,) and heading, core frame; None elsewhere.

    So another try with the same seed is the same take: the network's stance is not quite where it was put.
    """
    action = armature.animation_data.action if armature.animation_data else None
    if action is None or STOOD not in action:
        return None
    place, ahead = np.array(action[STOOD], dtype=np.float64).reshape(2, 3)
    matrix = np.array(armature.matrix_world, dtype=np.float64)
    forward = matrix[:3, :3] @ ahead
    if np.hypot(*forward[:2]) < 1e-6:
        return None
    here = frame.to_core(matrix[:3, :3] @ place + matrix[:3, 3])
    return here[:2].astype(np.float32), float(direction_to_heading(forward))


def note_begin(take: KeyedTake, scene: bpy.types.Scene, frame: WorldFrame, stood: Place | None) -> None:
    """Note on a take's actions how it began, ``stood`` where with a quiet stand (core frame), and that they
    belong together.
    """
    take.action[BEGIN] = [float(stood is None), float(take.frame_start)]
    if stood is not None:
        with frame_kept(scene):
            go_to(scene, take.frame_start)
            back = np.linalg.inv(np.array(take.armature.matrix_world, dtype=np.float64))
        place = frame.to_world(np.append(stood[0], 0.0))
        ahead = np.append(heading_to_direction(np.array(stood[1])), 0.0)
        take.action[STOOD] = [*(back[:3, :3] @ place + back[:3, 3]), *(back[:3, :3] @ ahead)]
    token = secrets.token_hex(8)
    for action in (take.action, *(thing.action for thing in take.things)):
        action[TAKE] = token


def others_of(armature: bpy.types.Object, scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """What the take moves that a character shows now, each with the take's own keys."""
    token = _token(armature)
    return [] if not token else [o for o in scene.objects if o != armature and _token(o) == token]


def _token(target: bpy.types.Object) -> str:
    action = target.animation_data.action if target.animation_data else None
    return str(action.get(TAKE, "")) if action is not None else ""


def require_at_rest(armature: bpy.types.Object, scene: bpy.types.Scene, frame: float) -> None:
    """Raise GoalError where what the character's present take moves is on its way at a frame: it may be in
    its hands.
    """
    for thing in others_of(armature, scene):
        data = thing.animation_data
        for curve in curves_in(data.action, getattr(data, "action_slot", None)):
            if abs(curve.evaluate(frame + 1) - curve.evaluate(frame - 1)) > _RESTING_THING:
                raise GoalError(
                    f"{thing.name} is being moved by {armature.name} at frame {frame:g}; go on from a frame "
                    "before it is taken, or after it has come to rest."
                )


def reading_start(
    armature: bpy.types.Object,
    scene: bpy.types.Scene,
    frame: WorldFrame,
    start_frame: float,
    around: Surroundings,
) -> Generator[Progress, None, Start]:
    """Read the second up to a take's first frame, in slices, and what the character sits on then.

    Raises GoalError as ``Start`` does.
    """
    placement = Placement.of(armature)
    count = WINDOW + 1 if _animated(armature) else 1
    times = start_frame - np.arange(count - 1, -1, -1) * scene_fps(scene) / FPS

    def read() -> tuple[Array, Array]:
        _, hips, local = read_world_pose(armature, placement)
        return frame.to_core(hips), local

    rows = yield from staged("Reading the pose", over_frames(scene, times, read))
    hips, local = (np.stack(column) for column in zip(*rows, strict=True))
    start = Start(hips, local)
    return Start(hips, local, _seat_of(start, placement.own_offsets, around))


def _animated(armature: bpy.types.Object) -> bool:
    data = armature.animation_data
    layers = data is not None and (data.action is not None or len(data.nla_tracks) > 0)
    constrained = any(len(bone.constraints) for bone in armature.pose.bones)
    return layers or constrained or may_move(armature)


def _seat_of(start: Start, offsets: Array, around: Surroundings) -> Goal | None:
    """The goal of what the character sits on, where it sits; None where it does not sit on anything."""
    hips, local = start.second()
    if np.linalg.norm(hips[-1] - hips[-4]) * FPS / 3 > _RESTS:
        return None
    joints, _ = forward_kinematics(hips[-1], local[-1], offsets)
    for hip, knee, *_ in FEET:
        thigh = joints[knee] - joints[hip]
        if -thigh[2] > _THIGH * np.linalg.norm(thigh):
            return None
    place = (joints[HIPS] - (0, 0, HIP_OVER_SEAT))[None].astype(np.float32)
    by_owner: dict[str, list[Solid]] = {}
    for solid in around.obstacles:
        low, high = solid.bounds
        if (low[:2] - _UNDER < place[0, :2]).all() and (high[:2] + _UNDER > place[0, :2]).all():
            by_owner.setdefault(solid.owner, []).append(solid)
    near = {
        owner: float(BVHQuery(solids).signed_distance(place, _UNDER)[0]) for owner, solids in by_owner.items()
    }
    owner = min(near, key=lambda name: near[name], default="")
    if not owner or near[owner] >= _UNDER:
        return None
    seat = next((o for o in around.scene.objects if o.name_full == owner), None)
    if seat is None:
        return None
    heading = float(root_of(joints)[1])
    volume = seat_body(seat, around).interaction(heading)
    return Goal("sit", seat.name, joints[HIPS].astype(np.float32), heading, 0.0, volume)
