"""Constants between a capture's joints and the 23: from a rest pose, or from how knees and elbows bend."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from nsm_core.body.skeleton import INDEX, OFFSETS
from nsm_core.rotations import Array

from .joint_map import SIDES

_UP = np.array((0, 0, 1.0))
_CHILD = {"Shoulder": "Elbow", "Elbow": "Wrist", "Hip": "Knee", "Knee": "Ankle"}
_TRUNK = ("Hips", "Chest", "Chest2", "Chest3", "Chest4", "Neck", "Head", "RightCollar", "LeftCollar")


@dataclass(frozen=True)
class Frames:
    """World positions (T, N, 3) and rotation matrices (T, N, 3, 3) of the file's joints, Z up."""

    positions: Array
    rotations: Array

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, frames: slice | Array) -> Frames:
        return Frames(self.positions[frames], self.rotations[frames])


def normalized(v: Array) -> Array:
    """Scale (..., 3) vectors to unit length."""
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)


def shortest_turn(a: Array, b: Array) -> Array:
    """Rotation matrix (3, 3) that takes the direction ``a`` (3,) to ``b`` (3,) the short way."""
    a, b = normalized(a), normalized(b)
    axis, cosine = np.cross(a, b), float(a @ b)
    if cosine < -0.999999:
        axis = normalized(np.cross(a, np.eye(3)[np.argmin(np.abs(a))]))
        return 2 * np.outer(axis, axis) - np.eye(3)
    cross = np.array(((0, -axis[2], axis[1]), (axis[2], 0, -axis[0]), (-axis[1], axis[0], 0)))
    return np.eye(3) + cross + cross @ cross / (1 + cosine)


def _yaw(frames: Frames, joints: dict[str, int]) -> Array:
    """Level frames (T, 3, 3) that face as the hips do: columns left, back, up."""
    left = frames.positions[:, joints["LeftHip"]] - frames.positions[:, joints["RightHip"]]
    left = normalized(left * np.array((1, 1, 0)))
    return np.stack((left, np.cross(_UP, left), np.broadcast_to(_UP, left.shape)), axis=-1)


def _rest_direction(name: str, side: str) -> Array:
    return OFFSETS[INDEX[side + _CHILD[name]]].astype(float)


def is_rest(pose: Frames, joints: dict[str, int], arms: float = 95.0) -> bool:
    """Whether a pose can serve as the rest pose: upright, legs straight down, arms straight and beside the
    body.

    ``arms`` is how far, degrees, they may be from level, outwards.
    """
    yaw = _yaw(pose, joints)[0]
    if not np.isfinite(yaw).all() or np.linalg.norm(yaw[:, 0]) < 0.5:
        return False

    def direction(a: str, b: str) -> Array:
        return normalized(yaw.T @ (pose.positions[0, joints[b]] - pose.positions[0, joints[a]]))

    if direction("Hips", "Head")[2] < np.cos(np.radians(20)):
        return False
    for side, out in zip(SIDES, (-1.0, 1.0), strict=True):
        thigh, shin = direction(side + "Hip", side + "Knee"), direction(side + "Knee", side + "Ankle")
        upper, fore = direction(side + "Shoulder", side + "Elbow"), direction(side + "Elbow", side + "Wrist")
        legs = (
            thigh[2] < -np.cos(np.radians(35))
            and shin[2] < -np.cos(np.radians(35))
            and thigh @ shin > np.cos(np.radians(15))
        )
        straight = upper @ fore > np.cos(np.radians(30))
        if (
            not legs
            or not straight
            or np.abs((upper + fore)[1]) > 1.0
            or out * upper[0] < np.cos(np.radians(arms))
        ):
            return False
    return True


def from_pose(pose: Frames, joints: dict[str, int], spine: list[int]) -> dict[str | int, Array]:
    """Constants C (3, 3), target = source C, by joint name and by index of the spine, from a rest pose of one
    frame.
    """
    yaw = _yaw(pose, joints)[0]
    places, rotations = pose.positions[0], pose.rotations[0]
    constants: dict[str | int, Array] = {j: rotations[j].T @ yaw for j in spine}

    def along(a: str, b: str) -> Array:
        return yaw.T @ (places[joints[b]] - places[joints[a]])

    for name, j in joints.items():
        aligned = np.eye(3)
        side, part = (
            ("", name)
            if name in _TRUNK
            else (name[: 5 if name[0] == "R" else 4], name[5 if name[0] == "R" else 4 :])
        )
        if part in _CHILD:
            aligned = shortest_turn(_rest_direction(part, side), along(name, side + _CHILD[part]))
        elif part == "Wrist":
            aligned = shortest_turn(_rest_direction("Elbow", side), along(side + "Elbow", name))
        elif part in ("Ankle", "Toe") and side + "Toe" in joints:
            foot = along(side + "Ankle", side + "Toe") * np.array((1, 1, 0))
            if np.linalg.norm(foot) > 1e-6:
                aligned = shortest_turn(np.array((0, -1.0, 0)), foot)
        constants[name] = rotations[j].T @ yaw @ aligned
    return constants


def from_motion(frames: Frames, joints: dict[str, int], spine: list[int]) -> dict[str | int, Array]:
    """Constants as of ``from_pose`` for a file without a rest pose, from all its frames."""
    positions, rotations = frames.positions, frames.rotations
    yaw = _yaw(frames, joints)
    upright = _upright(frames, joints)
    constants: dict[str | int, Array] = {}

    def inside(j: int, vectors: Array) -> Array:
        """World vectors (T, 3) as joint ``j`` sees them."""
        return np.einsum("tji,tj->ti", rotations[:, j], vectors)

    def neutral(j: int, wanted: Array, where: Array) -> Array:
        """The constant that makes joint ``j`` agree on average with world rotations (T, 3, 3)."""
        u, _, v = np.linalg.svd(np.einsum("tji,tjk->ik", rotations[where, j], wanted[where]))
        return u @ np.diag((1, 1, np.linalg.det(u @ v))) @ v

    left = inside(joints["Hips"], positions[:, joints["LeftHip"]] - positions[:, joints["RightHip"]]).mean(0)
    up = inside(joints["Hips"], np.broadcast_to(_UP, (len(frames), 3)))[upright].mean(0)
    constants["Hips"] = _frame(left, up, 0, 2)
    for name in _TRUNK[1:]:
        if name in joints:
            constants[name] = neutral(joints[name], yaw, upright)
    constants.update({j: neutral(j, yaw, upright) for j in spine})
    hips = rotations[:, joints["Hips"]] @ constants["Hips"]
    for side, out in zip(SIDES, (-1.0, 1.0), strict=True):
        for upper, lower, hinge, spare in (
            ("Hip", "Knee", (1.0, 0, 0), hips[..., 0]),
            ("Shoulder", "Elbow", (0, 0, -out), None),
        ):
            a, b = joints[side + upper], joints[side + lower]
            bones = (
                positions[:, b] - positions[:, a],
                positions[:, joints[side + _CHILD[lower]]] - positions[:, b],
            )
            bend = np.cross(normalized(bones[0]), normalized(bones[1]))
            bend *= np.linalg.norm(bend, axis=-1, keepdims=True) > 0.2  # straight limbs have no plane
            if not bend.any():
                bend = (
                    np.broadcast_to(spare, bend.shape)
                    if spare is not None
                    else -out * np.broadcast_to(_UP, bend.shape)
                )
            for name, j, bone in ((upper, a, bones[0]), (lower, b, bones[1])):
                source = _frame(inside(j, bone).mean(0), inside(j, bend).mean(0), 0, 2)
                constants[side + name] = source @ _frame(_rest_direction(name, side), np.array(hinge), 0, 2).T
        fore = rotations[:, joints[side + "Elbow"]] @ constants[side + "Elbow"]
        constants[side + "Wrist"] = neutral(joints[side + "Wrist"], fore, np.ones(len(frames), bool))
        _foot_from_motion(frames, joints, side, constants, inside)
    return constants


def _foot_from_motion(
    frames: Frames,
    joints: dict[str, int],
    side: str,
    constants: dict[str | int, Array],
    inside: Callable[[int, Array], Array],
) -> None:
    """Add the constants of an ankle and a toe: along the foot, level across as the shin is."""
    ankle = joints[side + "Ankle"]
    shin = frames.rotations[:, joints[side + "Knee"]] @ constants[side + "Knee"]
    if side + "Toe" in joints:
        along = inside(ankle, frames.positions[:, joints[side + "Toe"]] - frames.positions[:, ankle]).mean(0)
        rest = OFFSETS[INDEX[side + "Toe"]].astype(float)
    else:
        along, rest = inside(ankle, -shin[..., 1]).mean(0), np.array((0, -1.0, 0))
    across = inside(ankle, shin[..., 0]).mean(0)
    constants[side + "Ankle"] = _frame(along, across, 0, 2) @ _frame(rest, np.array((1.0, 0, 0)), 0, 2).T
    if side + "Toe" in joints:
        foot = frames.rotations[:, ankle] @ constants[side + "Ankle"]
        toe = frames.rotations[:, joints[side + "Toe"]]
        u, _, v = np.linalg.svd(np.einsum("tji,tjk->ik", toe, foot))
        constants[side + "Toe"] = u @ np.diag((1, 1, np.linalg.det(u @ v))) @ v


def _upright(frames: Frames, joints: dict[str, int]) -> Array:
    """Frames (T,) bool whose trunk is most upright over stretched legs; at least a tenth of all."""
    trunk = normalized(frames.positions[:, joints["Head"]] - frames.positions[:, joints["Hips"]])[:, 2]
    feet = frames.positions[:, [joints[s + "Ankle"] for s in SIDES], 2].min(1)
    height = frames.positions[:, joints["Hips"], 2] - feet
    score = trunk + height / max(float(np.percentile(height, 90)), 1e-9)
    return score >= min(1.9, float(np.percentile(score, 90)))


def _frame(first: Array, second: Array, i: int, k: int) -> Array:
    """Rotation matrix whose column ``i`` is along ``first`` and column ``k`` nearest to ``second``, both
    (3,).
    """
    a = normalized(first)
    b = normalized(second - (second @ a) * a)
    matrix = np.empty((3, 3))
    matrix[:, i], matrix[:, k] = a, b
    middle = 3 - i - k
    matrix[:, middle] = np.cross(matrix[:, (middle + 1) % 3], matrix[:, (middle + 2) % 3])
    return matrix
