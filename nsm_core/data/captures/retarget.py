"""Carry the motion of any BVH hierarchy over to the 23 joints by world rotations.

Every target joint's world rotation is the source joint's times a constant.  The constant comes from a pose in
which both skeletons' rotations are known (the rest pose, limb directions aligned), or, where a file has none,
from the motion itself: bones along their children, knees and elbows bending about their hinges, the trunk
upright on average.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import ANKLE_HEIGHT, FEET, INDEX, OFFSETS, TOE_HEIGHT, J, local_from_world
from nsm_core.conventions import FPS
from nsm_core.errors import CaptureError, SkeletonError
from nsm_core.rotations import Array, quat_from_matrix, quat_slerp, quat_to_matrix
from nsm_core.signals import intervals

from .joint_map import SIDES, SPINE, Mapping
from .rest_pose import Frames, from_motion, from_pose, is_rest, normalized, shortest_turn
from .up_axis import axes_of, offsets_pose, standing_up, world_up

if TYPE_CHECKING:
    from .bvh_file import Bvh

_LEG = float(-OFFSETS[list(FEET[0][1:3]), 2].sum())
_STILL = 0.25  # metres a second under which a foot counts as standing
_MAX_SOLE_TURN = np.radians(25)
# Rise of the trunk per length, or of the hips over the feet per leg, of who is up.
_UPRIGHT, _STANDING = 0.5, 0.7
_SELDOM = 0.05  # share of frames below which nobody is
_BED = (-0.1, 1.5)  # metres over a floor that the lowest joint of who lies is found at
_FLESH = 0.05  # metres between a joint and what it lies on


def retarget(source: Bvh, mapping: Mapping) -> Clip:
    """Retarget a BVH file: a Clip at 30 Hz with its lowest soles at z = 0; SkeletonError where the mapping
    does not fit.
    """
    joints = _found(source, mapping)
    spine = [
        j
        for j in map(source.joints.index, _known(source, mapping.spine, mapping))
        if j not in joints.values()
    ]
    axes = _axes(source, mapping, joints)
    rest, first = _rest_pose(source, mapping, joints, axes)
    if first >= len(source):
        raise CaptureError(f"{source.name}.bvh holds nothing but its rest pose; there is no motion to read.")
    motion = source.at_rate()
    skip = int(np.ceil(first * source.interval * FPS - 1e-6))
    frames = _frames(motion, axes, skip)
    constants = from_motion(frames, joints, spine) if rest is None else from_pose(rest, joints, spine)
    scale = mapping.units or _LEG / _leg_length(frames, joints)
    return Clip(source.name, *_solve(frames, joints, spine, constants, scale))


def _known(source: Bvh, names: tuple[str, ...], mapping: Mapping) -> tuple[str, ...]:
    for name in names:
        if name not in source.joints:
            there = ", ".join(n for n in source.joints if not n.endswith("_End"))
            raise SkeletonError(
                f"{source.name}.bvh has no joint {name}, which {mapping.name or 'the mapping'} names; it "
                f"has {there}."
            )
    return names


def _found(source: Bvh, mapping: Mapping) -> dict[str, int]:
    """Index in the file of every mapped joint."""
    _known(source, tuple(mapping.joints.values()), mapping)
    found = {target: source.joints.index(name) for target, name in mapping.joints.items()}
    for side in SIDES:  # an ankle's end site serves for a toe
        end = f"{mapping.joints[side + 'Ankle']}_End"
        if side + "Toe" not in found and end in source.joints:
            found[side + "Toe"] = source.joints.index(end)
    return found


def _axes(source: Bvh, mapping: Mapping, joints: dict[str, int]) -> Array:
    """Rotation (3, 3) from the file's axes to Z up, facing -Y."""
    up = world_up(source, joints) if mapping.up == "auto" else _axis(mapping.up)
    if mapping.forward != "auto":
        forward = _axis(mapping.forward)
        if abs(forward @ up) > 0.5:
            raise CaptureError(
                f"{mapping.name or source.name}: forward and up are the same axis; forward must be level."
            )
    else:
        forward = np.array((0, -1.0, 0)) if abs(up[2]) > 0.5 else np.array((0, 0, 1.0))
    return axes_of(up, forward)


def _axis(name: str) -> Array:
    axis = np.zeros(3)
    axis["XYZ".index(name[1])] = -1 if name[0] == "-" else 1
    return axis


def _frames(source: Bvh, axes: Array, start: int = 0) -> Frames:
    """World positions and rotation matrices of a motion from frame ``start`` on, in our axes, the file's
    units.
    """
    positions, rotations = source[start:].world()
    return Frames(positions @ axes.T, axes @ quat_to_matrix(rotations))


def _rest_pose(
    source: Bvh, mapping: Mapping, joints: dict[str, int], axes: Array
) -> tuple[Frames | None, int]:
    """The pose whose rotations are known (None: there is none) and the first frame of motion behind it."""
    if mapping.rest == "offsets":
        return offsets_pose(source, axes), 0
    if mapping.rest == "motion":
        return None, 0
    if mapping.rest.startswith("frame"):
        number = int(mapping.rest.split()[1])
        if number >= len(source):
            raise CaptureError(
                f"{source.name}.bvh has {len(source)} frames; its mapping wants the rest pose at frame "
                f"{number}."
            )
        return _frames(source[number : number + 1], axes), number + 1 if number < 3 else 0
    first = _frames(source[:1], axes)
    if is_rest(first, joints, arms=25.0):
        return first, 1
    # Offsets that stand are a rest pose whichever way they stand: a root may turn them to the world's up.
    standing = standing_up(source, joints)
    offsets = offsets_pose(source, axes if standing is None else axes_of(standing, None))
    return (offsets, 0) if is_rest(offsets, joints) else (None, 0)


def _leg_length(frames: Frames, joints: dict[str, int]) -> float:
    """Thigh and shin together, mean of both sides, in the file's units."""
    total = 0.0
    for side in SIDES:
        for a, b in (("Hip", "Knee"), ("Knee", "Ankle")):
            bone = frames.positions[:, joints[side + b]] - frames.positions[:, joints[side + a]]
            total += float(np.median(np.linalg.norm(bone, axis=-1))) / 2
    if total < 1e-9:
        raise SkeletonError(
            "The legs of the file have no length; map the joints at the hip, the knee and the ankle."
        )
    return total


def _solve(
    frames: Frames, joints: dict[str, int], spine: list[int], constants: dict[str | int, Array], scale: float
) -> tuple[Array, Array]:
    """Hips (T, 3) and parent-relative rotations (T, 23, 4), float32, of the retargeted motion."""
    world = _world_rotations(frames, joints, spine, constants)
    places = {n: frames.positions[:, j] * scale for n, j in joints.items()}
    ankles = np.stack([places[s + "Ankle"] for s in SIDES], axis=1)
    toes = np.stack([places.get(s + "Toe", places[s + "Ankle"]) for s in SIDES], axis=1)
    feet, toe_joints = [INDEX[s + "Ankle"] for s in SIDES], [INDEX[s + "Toe"] for s in SIDES]
    upright = _upright(frames, joints)
    world[:, feet] = _level_soles(world[:, feet], _standing(ankles, toes) & upright)
    for side, name in enumerate(SIDES):
        if "_toe_" + name not in constants:
            world[:, toe_joints[side]] = world[:, feet[side]]
    lever = world[:, feet] @ OFFSETS[toe_joints[0]].astype(float)
    soles = np.minimum(ankles[..., 2] - ANKLE_HEIGHT, ankles[..., 2] + lever[..., 2] - TOE_HEIGHT)
    tilt = _floor_tilt(ankles, toes, soles) if upright.any() else np.zeros(2)
    ankles[..., 2] -= ankles[..., :2] @ tilt
    toes[..., 2] -= toes[..., :2] @ tilt
    soles = soles - ankles[..., :2] @ tilt
    standing = _standing(ankles, toes) & upright
    ground = [
        float(np.percentile(soles[standing[:, s], s] if standing[:, s].any() else soles[:, s], 5))
        for s in (0, 1)
    ]
    # Legs of unequal length, as captured, still stand on one floor; feet at different heights do not.
    shift = np.array(ground) if abs(ground[0] - ground[1]) < 0.05 else np.full(2, min(ground))
    if not upright.any():  # who lies or crawls has no soles on the floor
        shift = np.full(2, _own_floor(np.stack([p[:, 2] for p in places.values()], axis=1)))
    ankles[..., 2] -= shift
    middle = (places["RightHip"] + places["LeftHip"]) / 2
    hip_offset = (OFFSETS[INDEX["RightHip"]] + OFFSETS[INDEX["LeftHip"]]).astype(float) / 2
    hips = middle - world[:, 0] @ hip_offset
    hips[:, 2] -= shift.mean() + hips[:, :2] @ tilt
    quats = quat_from_matrix(world)
    local = place_limbs(hips, local_from_world(quats), (FEET[0][:3], FEET[1][:3]), ankles, quats[:, feet])
    return _shortened(hips.astype(np.float32)), local.astype(np.float32)


def _upright(frames: Frames, joints: dict[str, int]) -> Array:
    """Frames (T, 1) bool that stand or sit, bent or straight, rather than lie or crawl; none at all where
    hardly any does.
    """
    hips = frames.positions[:, joints["Hips"]]
    trunk = normalized(frames.positions[:, joints["Head"]] - hips)[:, 2]
    ankles = frames.positions[:, [joints[s + "Ankle"] for s in SIDES], 2].max(1)
    upright = (trunk > _UPRIGHT) | (hips[:, 2] - ankles > _STANDING * _leg_length(frames, joints))
    return (upright & (upright.mean() > _SELDOM))[:, None]


def _own_floor(heights: Array) -> float:
    """Height of the floor under a body that never stands, from its joints' (T, N), metres: the file's zero,
    where it lies over that.
    """
    lowest = float(np.percentile(heights.min(1), 5))
    return 0.0 if _BED[0] < lowest < _BED[1] else lowest - _FLESH


def _shortened(hips: Array) -> Array:
    """Hips with the first frame over the origin of the floor: float32 has no room for a studio's far
    corners.
    """
    far = np.linalg.norm(hips[0, :2]) > 50
    return hips - np.array((*hips[0, :2], 0), np.float32) if far else hips


def _world_rotations(
    frames: Frames, joints: dict[str, int], spine: list[int], constants: dict[str | int, Array]
) -> Array:
    """World rotation matrices (T, 23, 3, 3) of the target joints."""
    count = len(frames)
    world = np.tile(np.eye(3), (count, J, 1, 1))
    done = {n for n in joints if n in constants}
    for name in done:
        world[:, INDEX[name]] = frames.rotations[:, joints[name]] @ constants[name]
    chain = [quat_from_matrix(world[:, 0])] + [
        quat_from_matrix(frames.rotations[:, j] @ constants[j]) for j in spine
    ]
    if not spine:  # nothing is known between pelvis and neck: bend evenly
        upper = next((n for n in ("Chest4", "Neck", "Head") if n in done), "Hips")
        chain.append(quat_slerp(chain[0], quat_from_matrix(world[:, INDEX[upper]]), np.full(count, 0.6)))
    for k, name in enumerate(SPINE, 1):
        if name in done:
            continue
        at = k / len(SPINE) * (len(chain) - 1)
        low = min(int(at - 1e-9), len(chain) - 2)
        world[:, INDEX[name]] = quat_to_matrix(
            quat_slerp(chain[low], chain[low + 1], np.full(count, at - low))
        )
    if "Neck" not in done:
        chest, head = (quat_from_matrix(world[:, INDEX[n]]) for n in ("Chest4", "Head"))
        world[:, INDEX["Neck"]] = quat_to_matrix(quat_slerp(chest, head, np.full(count, 0.5)))
    for side in SIDES:
        for name, parent in (("Collar", "Chest4"), ("Toe", side + "Ankle")):
            if side + name not in done:
                world[:, INDEX[side + name]] = world[:, INDEX[parent]]
    return world


def _speed(ankles: Array, toes: Array) -> Array:
    """Speed (T, 2) of the faster of ankle and toe, metres a second."""
    if len(ankles) < 2:
        return np.zeros(ankles.shape[:2])
    return np.maximum(*(np.linalg.norm(np.gradient(p, axis=0), axis=-1) * FPS for p in (ankles, toes)))


def _standing(ankles: Array, toes: Array) -> Array:
    """Which feet (T, 2) are low and still."""
    return (toes[..., 2] < np.percentile(toes[..., 2], 10, axis=0) + 0.04) & (_speed(ankles, toes) < _STILL)


def _floor_tilt(ankles: Array, toes: Array, soles: Array) -> Array:
    """Slope (2,) of a studio floor that is slightly out of level: rise per metre; zero where steps or a ramp
    are walked.
    """
    still = _speed(ankles, toes) < _STILL
    where, height = [], []
    for side in (0, 1):
        for a, b in intervals(still[:, side]):
            if b - a >= 3:
                where.append(ankles[a:b, side, :2].mean(0))
                height.append(soles[a:b, side].min())
    if len(where) < 5 or np.ptp(where, axis=0).max() < 2.5:
        return np.zeros(2)
    centre, height = np.array(where) - np.mean(where, axis=0), np.array(height) - np.mean(height)
    # Damped across the way that is walked.
    slope = np.linalg.solve(centre.T @ centre + np.eye(2), centre.T @ height)
    level = np.linalg.norm(slope) < 0.02 and (height - centre @ slope).std() < 0.012
    return slope if level else np.zeros(2)


def _level_soles(feet: Array, standing: Array) -> Array:
    """Turn feet (T, 2, 3, 3) by a constant each so that soles are level, on the median, while they stand."""
    feet = feet.copy()
    for side in (0, 1):
        if standing[:, side].sum() < 5:
            continue
        up = normalized(np.median(feet[standing[:, side], side, 2, :], axis=0))  # world up seen from the foot
        angle = float(np.arccos(np.clip(up[2], -1, 1)))
        share = min(1.0, _MAX_SOLE_TURN / max(angle, 1e-6))
        feet[:, side] = feet[:, side] @ shortest_turn(
            np.array((0, 0, 1.0)), normalized((1 - share) * np.array((0, 0, 1.0)) + share * up)
        )
    return feet
