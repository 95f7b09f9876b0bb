"""Which way is up in a capture: a body that lies down is no file with another up axis."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array, quat_to_matrix

from .bvh_file import Bvh
from .joint_map import SIDES
from .rest_pose import Frames, is_rest

_LOOKS = 1000  # frames that are looked at
_FLOOR = (-0.15, 0.4)  # legs' lengths over the floor that the lower ankle of who stands is found at
_LYING = (0.04, 0.9)  # and the hips of who lies, crawls or sits
_LEVEL = 0.5  # legs' lengths that the hips of who does not climb stay within


def axes_of(up: Array, forward: Array | None = None) -> Array:
    """Rotation (3, 3) from axes with this ``up`` and ``forward`` (3,) to Z up, facing -Y; any level
    ``forward`` where none is told.
    """
    if forward is None:
        forward = np.array((0, -1.0, 0)) if abs(up[2]) > 0.5 else np.array((0, 0, 1.0))
    return np.stack((np.cross(up, forward), -forward, up))


def offsets_pose(source: Bvh, axes: Array) -> Frames:
    """The pose with every channel at zero, in our axes."""
    positions, rotations = source.rest()
    return Frames(positions[None] @ axes.T, axes @ quat_to_matrix(rotations[None]))


def standing_up(source: Bvh, joints: dict[str, int]) -> Array | None:
    """The axis (3,) along which the file's offsets stand as a person does, if they do."""
    positions, _ = source.rest()
    up = _tall(positions[None], joints)
    if not up.any():
        return None
    return up if is_rest(offsets_pose(source, axes_of(up)), joints) else None


def world_up(source: Bvh, joints: dict[str, int]) -> Array:
    """The axis (3,) of a file that points up.

    By the first frame where that is a T-pose; else by the offsets where these stand, so that who lies or
    crawls stays lying; else by where the head is over the ankles.  Where offsets and motion disagree, the
    file may have a root that turns offsets upright: then the ankles walk near zero of the axis of the motion,
    and the hips do not keep a height of the axis of the offsets.
    """
    positions, _ = source[:: max(1, len(source) // _LOOKS)].world()
    moving = _tall(positions, joints)
    first = _tall(positions[:1], joints)
    standing = standing_up(source, joints)
    if first.any() and is_rest(_first_pose(source, axes_of(first)), joints, arms=25.0):
        return (
            first if standing is None or _stands_along(first, standing, positions[:1], joints) else standing
        )
    if standing is None or not moving.any():
        return moving if standing is None else standing
    return moving if _stands_along(moving, standing, positions, joints) else standing


def _first_pose(source: Bvh, axes: Array) -> Frames:
    positions, rotations = source[:1].world()
    return Frames(positions @ axes.T, axes @ quat_to_matrix(rotations))


def _tall(positions: Array, joints: dict[str, int]) -> Array:
    """The axis nearest to the way from the ankles to the head, on the median of (T, N, 3); zero where there
    is none.
    """
    tall = positions[:, joints["Head"]] - positions[:, [joints[s + "Ankle"] for s in SIDES]].mean(1)
    up = np.median(tall, axis=0)
    axis = np.zeros(3)
    most = int(np.argmax(np.abs(up)))
    axis[most] = np.sign(up[most])
    return axis


def _stands_along(moving: Array, standing: Array, positions: Array, joints: dict[str, int]) -> bool:
    """Whether a motion (T, N, 3) stands along ``moving`` on a floor at zero, and does not lie over one along
    ``standing``.
    """
    # No file has its up at -Y, -Z or along X.
    if (moving == standing).all() or moving.min() < 0 or not moving[1:].any():
        return False
    leg = sum(
        float(np.median(np.linalg.norm(positions[:, joints[s + a]] - positions[:, joints[s + b]], axis=-1)))
        for s in SIDES
        for a, b in (("Hip", "Knee"), ("Knee", "Ankle"))
    ) / len(SIDES)
    ankles = positions[:, [joints[s + "Ankle"] for s in SIDES]] @ moving
    hips = positions[:, joints["Hips"]] @ standing
    over = float(np.median(ankles.min(1))) / max(leg, 1e-9)
    low, high = np.percentile(hips, (5, 95)) / max(leg, 1e-9)
    lies = _LYING[0] < low and high < _LYING[1] and high - low < _LEVEL
    # Where it may be either, the file is taken to have its up at Y, as most have.
    return _FLOOR[0] < over < _FLOOR[1] and (moving[1] > 0 or not lies)
