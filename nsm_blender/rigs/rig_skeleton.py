"""The 23-joint skeleton at a rig's own proportions, and what its bones' rest pose differs from our T-pose.

The rest pose may be a T, an A or a slouch, with any rolls.  For every joint with a bone the body's turn from
our T-pose to the rest pose, D, is found from where the joints lie; with R the bone's rest rotation and A the
rest pose's axes, ``C = D^-1 A^-1 R`` is the bone's rotation in the T-pose, so that a world rotation W of the
joint is the bone's rotation W C in the world.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mathutils import Matrix, Vector

from nsm_core.body.skeleton import (
    ANKLE_HEIGHT,
    FEET,
    HIPS,
    INDEX,
    JOINTS,
    OFFSETS,
    PARENTS,
    TOE_HEIGHT,
    J,
    forward_kinematics,
    local_from_world,
)
from nsm_core.rotations import Array, quat_conjugate, quat_mul, quat_normalize, quat_rotate

_SIDES = ("Right", "Left")
# A spine that leans so much (the sine) in the rest pose is still upright: only the pose differs, not the
# axes.
_ASKEW = 0.35
_SLOUCH = 0.25  # sine of the lean of a trunk in the rest pose over which it is taken for one, and put upright
_MIDDLE = OFFSETS[[INDEX["RightHip"], INDEX["LeftHip"]]].mean(0).astype(np.float64)  # of the hip joints
_LEG = float(-OFFSETS[list(FEET[0][1:3]), 2].sum())  # from hip to ankle, metres
_DROP = (ANKLE_HEIGHT - TOE_HEIGHT) / _LEG  # of an ankle over its toe, in legs
_HIGHEST_ANKLE, _HIGHEST_TOE = 0.5, 0.15  # legs over the floor of what stands on it
_IDENTITY = np.array((1.0, 0.0, 0.0, 0.0))
_NEXT = {"Chest": "Chest2", "Chest2": "Chest3", "Chest3": "Chest4", "Neck": "Head"} | {
    side + "Collar": side + "Shoulder" for side in _SIDES
}


@dataclass(frozen=True)
class RigSkeleton:
    """A rig's bones as the 23 joints.

    Joints without a bone follow the joint above them: they lie where the next one does, so that no turn of
    theirs moves anything.  The Hips joint lies over the middle of the hip joints as in our skeleton, wherever
    the head of its bone is.
    """

    bones: tuple[str | None, ...]  # of the 23 joints
    carriers: tuple[int, ...]  # joint whose bone carries a joint's bone; -1 for what is over all of them
    turns: Array  # (23, 4) rest rotations of the bones in the armature
    rest: Array  # (23, 4) the same in our T-pose, seen along the axes of the body: up its Z, ahead its -Y
    offsets: (
        Array  # (23, 3) joints from their parents in our T-pose, metres of the core; Hips: over the floor
    )
    hips_head: Array  # (3,) from the Hips joint to the head of its bone, in our T-pose, metres of the core
    size: float  # armature units to a metre of the core's skeleton

    @property
    def mapped(self) -> list[int]:
        """Joints with a bone."""
        return [j for j, bone in enumerate(self.bones) if bone is not None]

    @property
    def apart(self) -> list[int]:
        """Joints, the hips first, whose bones no other joint's bone carries: they get locations."""
        return [HIPS, *(j for j in self.mapped if j != HIPS and self.carriers[j] < 0)]

    def to_bones(self, hips: Array, local: Array) -> tuple[dict[int, Array], Array]:
        """What the bones do in a take: hips (T, 3), metres of the core, and rotations (T, 23, 4) as in the
        core.

        Returns the places (T, 3) of the heads of the bones ``apart``, metres of the core, and the rotations
        (T, 23, 4) of all bones in the world; those of joints without a bone are as of our own skeleton.
        """
        positions, world = forward_kinematics(hips, local, self.offsets)
        places = {j: positions[:, j] for j in self.apart}
        places[HIPS] = hips + quat_rotate(world[:, HIPS], np.broadcast_to(self.hips_head, hips.shape))
        return places, quat_mul(world, np.broadcast_to(self.rest, world.shape))

    def basis(self, world: Array) -> Array:
        """Channels (T, 23, 4) of bones that turn with what carries them, of the bones' rotations (T, 23, 4)
        in the world; those of the bones ``apart`` are left out.
        """
        basis = np.zeros_like(world)
        basis[..., 0] = 1
        for j in self.mapped:
            carrier = self.carriers[j]
            if carrier >= 0:  # the rest of a bone within its carrier's, seen from the pose
                rest = quat_mul(quat_conjugate(self.turns[j]), self.turns[carrier])
                relative = quat_mul(quat_conjugate(world[:, carrier]), world[:, j])
                basis[:, j] = quat_mul(np.broadcast_to(rest, relative.shape), relative)
        return basis

    def from_bones(self, heads: Array, rotations: Array, scale: float) -> tuple[Array, Array]:
        """Joints (23, 3) and local rotations (23, 4) of bones whose heads (23, 3) and rotations (23, 4) are
        seen in the world; ``scale`` is world units to a metre of the core.  Rows of joints without a bone are
        not read.
        """
        world = quat_mul(rotations, quat_conjugate(self.rest))
        positions = heads.astype(np.float64)
        positions[HIPS] -= quat_rotate(world[HIPS], self.hips_head) * scale
        for j, bone in enumerate(self.bones):
            if bone is None:
                world[j] = world[PARENTS[j]]
                positions[j] = positions[PARENTS[j]] + quat_rotate(world[j], self.offsets[j]) * scale
        return positions, local_from_world(world)


def rig_skeleton(
    bones: tuple[str | None, ...], carriers: tuple[int, ...], turns: Array, heads: Array, tails: Array
) -> RigSkeleton:
    """The skeleton of bones with rest rotations (23, 4), heads and tails (23, 3) in the armature; rows of
    joints without a bone are not read.
    """
    axes = rest_axes(heads)
    places, ends = (quat_rotate(quat_conjugate(axes), p) for p in (heads, tails))
    middle = (places[INDEX["RightHip"]] + places[INDEX["LeftHip"]]) / 2
    known = [bone is not None for bone in bones]
    bends = _bends(places, ends, known)
    size = max(_size(places, known), 1e-9)
    hips_bone = places[HIPS].copy()
    places[HIPS] = middle - quat_rotate(bends[HIPS], _MIDDLE) * size
    offsets = np.zeros((J, 3))
    for j, parent in enumerate(PARENTS):
        if not known[j]:
            places[j] = _place(j, places, ends, bends, known, size)
        if parent >= 0:
            offsets[j] = quat_rotate(quat_conjugate(bends[parent]), places[j] - places[parent]) / size
    offsets[HIPS] = OFFSETS[HIPS]
    rest = quat_mul(quat_conjugate(bends), quat_mul(quat_conjugate(axes), turns))
    rest[[not k for k in known]] = _IDENTITY
    hips_head = quat_rotate(quat_conjugate(bends[HIPS]), hips_bone - places[HIPS]) / size
    return RigSkeleton(bones, carriers, turns, quat_normalize(rest), offsets, hips_head, float(size))


def rest_axes(heads: Array) -> Array:
    """Rotation (4,) from the core's rest pose to one with joints (23, 3): the nearest along axes, its own
    where it stands askew.
    """
    up = heads[INDEX["Head"]] - (heads[INDEX["RightHip"]] + heads[INDEX["LeftHip"]]) / 2
    left = sum(heads[INDEX[f"Left{part}"]] - heads[INDEX[f"Right{part}"]] for part in ("Hip", "Shoulder"))
    back = np.cross(up, left)
    if np.linalg.norm(back) < 1e-9 * max(np.linalg.norm(up), np.linalg.norm(left)) ** 2 or not back.any():
        return _IDENTITY.copy()
    z, y = up / np.linalg.norm(up), back / np.linalg.norm(back)
    own = np.stack((np.cross(y, z), y, z), axis=1)
    snapped = np.round(own)
    if np.abs(np.linalg.det(snapped) - 1) < 0.5 and np.abs(own - snapped).max() < _ASKEW:
        own = snapped
    return np.array(Matrix(own.tolist()).to_quaternion(), dtype=np.float64)


def _bends(places: Array, ends: Array, known: list[bool]) -> Array:
    """Turns D (23, 4) of the joints from our T-pose to the rest pose, along the axes of the body.

    A limb's lower bone is bent from its upper one; a hand is as its forearm; feet are flat on the floor and
    turn about the vertical alone.
    """
    bends = np.tile(_IDENTITY, (J, 1))
    middles = [(places[INDEX["Right" + n]] + places[INDEX["Left" + n]]) / 2 for n in ("Shoulder", "Hip")]
    lean = middles[0] - middles[1]
    if np.linalg.norm(lean) > 1e-9 and abs(lean[1]) / np.linalg.norm(lean) > _SLOUCH:
        slouch = _turn(np.array((0.0, 0.0, 1.0)), np.array((0.0, lean[1], lean[2])))
        for name in ("Chest", "Chest2", "Chest3", "Chest4", "RightCollar", "LeftCollar"):
            bends[INDEX[name]] = slouch
    for side in _SIDES:
        for limb in (("Shoulder", "Elbow", "Wrist"), ("Hip", "Knee", "Ankle")):
            above = _IDENTITY
            for upper, lower in zip(limb[:-1], limb[1:], strict=True):
                j, k = INDEX[side + upper], INDEX[side + lower]
                ours = quat_rotate(above, OFFSETS[k].astype(np.float64))
                bends[j] = above = quat_mul(_turn(ours, places[k] - places[j]), above)
        bends[INDEX[side + "Wrist"]] = bends[INDEX[side + "Elbow"]]
        ankle, toe = INDEX[side + "Ankle"], INDEX[side + "Toe"]
        foot = (places[toe] if known[toe] else ends[ankle]) - places[ankle]
        foot[2] = 0
        if -foot[1] > 0.3 * np.linalg.norm(foot) > 0:
            bends[ankle] = bends[toe] = _turn(np.array((0.0, -1.0, 0.0)), foot)
    return bends


def _turn(a: Array, b: Array) -> Array:
    """Shortest turn (4,) from direction ``a`` to ``b``, both (3,); none where one has no length."""
    if min(np.linalg.norm(a), np.linalg.norm(b)) < 1e-9:
        return _IDENTITY.copy()
    return np.array(Vector(a).rotation_difference(Vector(b)), dtype=np.float64)


def _place(j: int, places: Array, ends: Array, bends: Array, known: list[bool], size: float) -> Array:
    """Where a joint without a bone is: at the next joint, or, for a toe, at the tip of its foot."""
    name = JOINTS[j]
    if name.endswith("Toe"):
        return _toe(PARENTS[j], places, ends, bends, size)
    following = name
    while following in _NEXT:
        following = _NEXT[following]
        if known[INDEX[following]]:
            return places[INDEX[following]]
    return places[PARENTS[j]]


def _toe(ankle: int, places: Array, ends: Array, bends: Array, size: float) -> Array:
    """The toe (3,) of a foot without one: the tip of its bone where that points ahead, else as our own."""
    foot = ends[ankle] - places[ankle]
    if -foot[1] > 0.5 * np.linalg.norm(foot):
        return ends[ankle]
    return places[ankle] + quat_rotate(bends[ankle], OFFSETS[INDEX["RightToe"]].astype(np.float64)) * size


def _size(places: Array, known: list[bool]) -> float:
    """Height of the hip joints on straight legs over our own.

    The floor is where the armature has its origin, as rigs are made; where that cannot be, the balls of the
    feet are as high as ours, and the ankle of a foot without a toe is.
    """
    legs, drops = [], []
    for hip, knee, ankle, toe in FEET:
        legs.append(float(np.linalg.norm(np.diff(places[[hip, knee, ankle]], axis=0), axis=1).sum()))
        drops.append(max(float(places[ankle, 2] - places[toe, 2]), 0.0) if known[toe] else _DROP * legs[-1])
    leg, drop = float(np.mean(legs)), float(np.mean(drops))
    feet = [ankle for _, _, ankle, _ in FEET]
    balls = [toe for *_, toe in FEET if known[toe]]
    ankles = float(places[feet, 2].mean())
    on_floor = 0 < ankles < _HIGHEST_ANKLE * leg and all(
        abs(places[t, 2]) < _HIGHEST_TOE * leg for t in balls
    )
    if on_floor:
        return (leg + ankles) / (_LEG + ANKLE_HEIGHT)
    return (leg + drop) / (_LEG * (1 + _DROP)) if leg > 0 else 0.0
