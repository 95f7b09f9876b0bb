"""The 23-joint skeleton, its forward kinematics, its mirror image and its planar root."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array, direction_to_heading, quat_conjugate, quat_mul, quat_rotate

JOINTS = (
    "Hips", "Chest", "Chest2", "Chest3", "Chest4", "Neck", "Head",
    "RightCollar", "RightShoulder", "RightElbow", "RightWrist",
    "LeftCollar", "LeftShoulder", "LeftElbow", "LeftWrist",
    "RightHip", "RightKnee", "RightAnkle", "RightToe",
    "LeftHip", "LeftKnee", "LeftAnkle", "LeftToe",
)  # fmt: skip
PARENTS = (-1, 0, 1, 2, 3, 4, 5, 4, 7, 8, 9, 4, 11, 12, 13, 0, 15, 16, 17, 0, 19, 20, 21)
J = len(JOINTS)
INDEX = {name: i for i, name in enumerate(JOINTS)}

# Rest pose: T-pose, every joint's world rotation the identity, facing -Y, right side on -X, 1.75 m tall.
# Rows are joint offsets from the parent in metres (for the hips: their rest height above the floor).
OFFSETS = np.array(
    (
        (0, 0, 0.97), (0, 0.01, 0.09), (0, 0.005, 0.1), (0, 0, 0.105), (0, 0, 0.105),
        (0, 0.005, 0.13), (0, -0.02, 0.095),
        (-0.02, -0.02, 0.085), (-0.155, 0.025, -0.015), (-0.29, 0, 0), (-0.255, 0, 0),
        (0.02, -0.02, 0.085), (0.155, 0.025, -0.015), (0.29, 0, 0), (0.255, 0, 0),
        (-0.09, 0, -0.05), (0, 0, -0.42), (0, 0, -0.415), (0, -0.13, -0.06),
        (0.09, 0, -0.05), (0, 0, -0.42), (0, 0, -0.415), (0, -0.13, -0.06),
    ),
    dtype=np.float32,
)  # fmt: skip
# Ends of the outermost bones, from their joint, metres.
END_SITES = {
    "Head": (0, 0, 0.155),
    "RightWrist": (-0.175, 0, 0),
    "LeftWrist": (0.175, 0, 0),
    "RightToe": (0, -0.07, 0),
    "LeftToe": (0, -0.07, 0),
}
# Heights of the joints over the floor when the sole is flat, metres.
ANKLE_HEIGHT, TOE_HEIGHT = 0.085, 0.025
# How far the hip joint lies over the surface a person sits on, metres.
HIP_OVER_SEAT = 0.09

MIRROR = tuple(
    INDEX[n.replace("Right", "Left") if "Right" in n else n.replace("Left", "Right")] for n in JOINTS
)

HIPS = INDEX["Hips"]
FEET = ((INDEX["RightHip"], INDEX["RightKnee"], INDEX["RightAnkle"], INDEX["RightToe"]),
        (INDEX["LeftHip"], INDEX["LeftKnee"], INDEX["LeftAnkle"], INDEX["LeftToe"]))  # fmt: skip
ARMS = ((INDEX["RightShoulder"], INDEX["RightElbow"], INDEX["RightWrist"]),
        (INDEX["LeftShoulder"], INDEX["LeftElbow"], INDEX["LeftWrist"]))  # fmt: skip


ARM_LENGTH = float(
    np.linalg.norm(OFFSETS[list(ARMS[0][1:])], axis=-1).sum()
)  # from shoulder to wrist, metres


def _levels() -> list[tuple[Array, Array]]:
    """Joints as many steps from the hips as each other, and their parents: computed together, since each step
    costs by the call.
    """
    depth = [0] * J
    for j in range(1, J):
        depth[j] = depth[PARENTS[j]] + 1
    levels = [np.array([j for j in range(J) if depth[j] == d]) for d in range(1, max(depth) + 1)]
    return [(joints, _PARENTS[joints]) for joints in levels]


_PARENTS = np.array(PARENTS)
LEVELS = _levels()


def forward_kinematics(
    hips_position: Array, local_rotations: Array, offsets: Array = OFFSETS
) -> tuple[Array, Array]:
    """World joint positions (..., J, 3), metres, and rotations (..., J, 4) of a pose.

    ``hips_position`` (..., 3) is in the world; ``local_rotations`` (..., J, 4) are relative to the parent.
    """
    positions = np.empty(local_rotations.shape[:-1] + (3,), dtype=local_rotations.dtype)
    rotations = np.empty_like(local_rotations)
    positions[..., 0, :] = hips_position
    rotations[..., 0, :] = local_rotations[..., 0, :]
    for joints, parents in LEVELS:
        rotations[..., joints, :] = quat_mul(rotations[..., parents, :], local_rotations[..., joints, :])
    bones = quat_rotate(rotations[..., _PARENTS[1:], :], offsets[1:].astype(positions.dtype))
    for joints, parents in LEVELS:
        positions[..., joints, :] = positions[..., parents, :] + bones[..., joints - 1, :]
    return positions, rotations


def local_from_world(rotations: Array) -> Array:
    """Parent-relative rotations (..., J, 4) of world rotations (..., J, 4)."""
    local = rotations.copy()
    local[..., 1:, :] = quat_mul(quat_conjugate(rotations[..., _PARENTS[1:], :]), rotations[..., 1:, :])
    return local


def root_of(positions: Array) -> tuple[Array, Array]:
    """Planar root of world joint positions (..., J, 3): ground position (..., 2) and heading (...).

    The position lies under the hips; the heading is at right angles to the summed hip and shoulder axes
    (the reference code's rule; papers/000 section 3.1 leaves it open).
    """

    def axis(left: str, right: str) -> Array:
        v = positions[..., INDEX[left], :2] - positions[..., INDEX[right], :2]
        return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-6)

    left = axis("LeftHip", "RightHip") + axis("LeftShoulder", "RightShoulder")
    forward = np.stack((left[..., 1], -left[..., 0]), axis=-1)
    return positions[..., HIPS, :2].copy(), direction_to_heading(forward)


def mirror(hips_position: Array, local_rotations: Array) -> tuple[Array, Array]:
    """Reflect a pose at the plane x = 0: same shapes, left and right joints exchanged."""
    rotations = local_rotations[..., MIRROR, :] * np.array((1, 1, -1, -1), dtype=local_rotations.dtype)
    return hips_position * np.array((-1, 1, 1), dtype=hips_position.dtype), rotations
