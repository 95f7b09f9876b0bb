"""What moves by itself in a scene while a take runs: obstacles and goal objects that are animated."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from dataclasses import dataclass

import bpy
import numpy as np

from nsm_core.body.animated_body import AnimatedBody
from nsm_core.body.capsules import Body, Figure
from nsm_core.body.ik.body_track import SENSED
from nsm_core.body.skeleton import forward_kinematics, root_of
from nsm_core.conventions import FPS
from nsm_core.errors import NsmError
from nsm_core.rotations import Array
from nsm_core.world.scene.movers import Mover

from ..animation.channels import strip_curves
from ..rigs.armature import Placement, read_world_pose
from ..rigs.mount import over_frames
from ..rigs.skin import Skin
from .bvh_query import BVHQuery
from .colliders import belonging_to
from .frame import WorldFrame
from .solids import Solid

_STEP = 3  # frames of the network between two looks at the scene
_LONGEST = 90 * FPS  # frames that are looked at, at most
_TAIL = 2 * FPS // _STEP  # looks, at the end of all, over which what has come to rest does not stir
_STIRS = 2e-3  # metres and radians by which what stands may seem to move


@dataclass(frozen=True)
class MovingCharacter:
    """A character that is animated already: its ``armature`` and ``figure``, and, at every third frame of the
    network from the take's first one on, ``centres`` (N, S, 3) and ``radii`` (S,) of its body's spheres in
    the world, and its ``roots`` (N, 3): x, y and heading.
    """

    owner: bpy.types.Object
    parts: tuple[str, ...]
    centres: Array
    radii: Array
    roots: Array


@dataclass(frozen=True)
class MovingThing:
    """What one object carries with it, and where that is: world ``matrices`` (N, 4, 4) at every third frame
    of the network, from the take's first one on; it ``goes_on`` after them, or stays.
    """

    owner: bpy.types.Object
    parts: tuple[str, ...]
    matrices: Array
    goes_on: bool


def tracks(
    scene: bpy.types.Scene,
    character: bpy.types.Object,
    but: Iterable[bpy.types.Object],
    start_frame: float,
    rate: float,
) -> Generator[float, None, list[MovingThing]]:
    """Look through the frames for what moves, in slices; ``rate`` frames a second.

    ``but`` are objects that the take itself moves or holds.
    """
    left_out = belonging_to(scene, [character, *but])
    groups: dict[bpy.types.Object, list[str]] = {}
    for part in scene.objects:
        if part.name_full not in left_out and part.visible_get():
            owner = _moved_by(part)
            if owner is not None and owner.name_full not in left_out:
                groups.setdefault(owner, []).append(part.name_full)
    ends = {owner: _last_frame(owner) for owner in groups}
    last = max((scene.frame_end if end is None else end for end in ends.values()), default=start_frame)
    count = min(int(np.ceil((last - start_frame) / rate * FPS / _STEP)) + 1, _LONGEST // _STEP)
    if not groups or count < 2:
        return []
    owners = list(groups)

    def read() -> Array:
        depsgraph = bpy.context.evaluated_depsgraph_get()
        return np.array([owner.evaluated_get(depsgraph).matrix_world for owner in owners], dtype=np.float64)

    frames = start_frame + np.arange(count) * _STEP * rate / FPS
    each = np.stack((yield from over_frames(scene, frames, read)))
    return [
        MovingThing(owner, tuple(groups[owner]), each[:, k], ends[owner] is None and _stirs(each[-_TAIL:, k]))
        for k, owner in enumerate(owners)
        if _stirs(each[:, k])
    ]


def _stirs(matrices: Array) -> bool:
    return bool(np.abs(matrices - matrices[0]).max() > _STIRS)


def characters(
    scene: bpy.types.Scene,
    but: Iterable[bpy.types.Object],
    start_frame: float,
    rate: float,
) -> Generator[float, None, list[MovingCharacter]]:
    """Look through the frames for characters that are animated already, in slices; as ``tracks``."""
    left_out = belonging_to(scene, but)
    actors: list[tuple[bpy.types.Object, Placement, Figure]] = []
    last = start_frame
    for armature in scene.objects:
        if armature.type != "ARMATURE" or armature.name_full in left_out or not armature.visible_get():
            continue
        data = armature.animation_data
        if data is None or (data.action is None and not data.nla_tracks):
            continue
        try:
            placement = Placement.of(armature)
            skin = yield from Skin.reading(armature, placement)
        except NsmError:
            continue  # no humanoid: what of it moves as a whole is looked for with the things
        actors.append((armature, placement, skin.figure()))
        end = _last_frame(armature)
        last = max(last, scene.frame_end if end is None else end)
    count = min(int(np.ceil((last - start_frame) / rate * FPS / _STEP)) + 1, _LONGEST // _STEP)
    if not actors or count < 2:
        return []

    def read() -> list[tuple[Array, Array]]:
        poses = (read_world_pose(armature, placement) for armature, placement, _ in actors)
        return [(hips, local) for _, hips, local in poses]

    frames = start_frame + np.arange(count) * _STEP * rate / FPS
    rows = yield from over_frames(scene, frames, read)
    made = []
    for k, (armature, placement, figure) in enumerate(actors):
        hips, local = (np.stack(column) for column in zip(*(row[k] for row in rows), strict=True))
        body = Body.of(hips / placement.scale, local, figure)
        joints, _ = forward_kinematics(hips, local, figure.offsets * placement.scale)
        place, heading = root_of(joints)
        if _stirs(body.centres):
            parts = tuple(belonging_to(scene, [armature]))
            roots = np.column_stack((place, np.unwrap(heading)))
            centres = body.centres[:, SENSED] * placement.scale
            made.append(
                MovingCharacter(armature, parts, centres, body.radii[0, SENSED] * placement.scale, roots)
            )
    return made


def keyed_bodies(found: Iterable[MovingCharacter], frame: WorldFrame) -> list[Mover]:
    """These characters in the core ``frame`` of another one, on their ways."""
    made: list[Mover] = []
    for actor in found:
        count = (len(actor.roots) - 1) * _STEP + 1
        at = np.arange(count) / _STEP
        k = np.minimum(at.astype(int), len(actor.roots) - 2)
        share = (at - k)[:, None, None]
        centres = frame.to_core(actor.centres[k] + share * (actor.centres[k + 1] - actor.centres[k]))
        rows = np.arange(len(actor.roots))
        x, y, heading = (np.interp(at, rows, column) for column in actor.roots.T)
        places = frame.to_core(np.stack((x, y, np.full(count, frame.floor)), axis=1))
        poses = np.column_stack((places, heading))
        made.append(
            AnimatedBody(actor.owner.name, centres, actor.radii / frame.scale, poses, frozenset(actor.parts))
        )
    return made


def movers(found: Iterable[MovingThing], solids: Iterable[Solid], frame: WorldFrame) -> list[Mover]:
    """The tracks' solids, read at the first frame in the character's core ``frame``, on their ways.

    They are taken to stay upright.
    """
    by_part: dict[str, list[Solid]] = {}
    for solid in solids:
        by_part.setdefault(solid.owner, []).append(solid)
    made = []
    for track in found:
        own = [solid for name in track.parts for solid in by_part.get(name, ())]
        if own:
            made.append(_mover(track, own, frame))
    return made


def _mover(track: MovingThing, solids: list[Solid], frame: WorldFrame) -> Mover:
    bounds = np.array([s.bounds for s in solids])
    low, high = bounds[:, 0].min(0), bounds[:, 1].max(0)
    centre = np.array((*(low + high)[:2] / 2, 0.0))
    query = BVHQuery([s.seen_from(np.append(centre, 0.0)) for s in solids])
    moves = track.matrices @ np.linalg.inv(track.matrices[0])
    places = frame.to_core(np.einsum("nij,j->ni", moves[:, :3, :3], frame.to_world(centre)) + moves[:, :3, 3])
    heading = np.unwrap(np.arctan2(moves[:, 1, 0], moves[:, 0, 0]))
    coarse = np.column_stack((places, heading))
    at = np.arange((len(coarse) - 1) * _STEP + 1) / _STEP
    poses = np.column_stack([np.interp(at, np.arange(len(coarse)), column) for column in coarse.T])
    reach = float(np.linalg.norm((high - low)[:2]) / 2)
    return Mover(track.owner.name, query, poses, reach, frozenset(track.parts), track.goes_on)


def _moved_by(part: bpy.types.Object) -> bpy.types.Object | None:
    """The object that may move a part: itself, or the nearest one above that is animated."""
    over: bpy.types.Object | None = part
    while over is not None:
        data = over.animation_data
        body = over.rigid_body
        if (
            len(over.constraints)
            or (body is not None and body.type == "ACTIVE")
            or (data is not None and (data.action is not None or len(data.nla_tracks) or len(data.drivers)))
        ):
            return over
        over = over.parent
    return None


def _last_frame(owner: bpy.types.Object) -> float | None:
    """The last frame in which an object may still move of itself; None where nobody can tell."""
    data = owner.animation_data
    if data is None or len(owner.constraints) or owner.rigid_body is not None or len(data.drivers):
        return None
    last = max((s.frame_end for t in data.nla_tracks for s in t.strips), default=-np.inf)
    for curve in strip_curves(owner, own_action=True):
        if len(curve.modifiers) or curve.extrapolation != "CONSTANT":
            return None
        if len(curve.keyframe_points):
            last = max(last, curve.keyframe_points[-1].co[0])
    return float(last)
