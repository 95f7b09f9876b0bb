"""Pieces of furniture as things that a character moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.props import Box, Leaf, sense

from .piece import Furniture


def carried_box(piece: Furniture, pose: ArrayLike = (0, 0, 0, 0), name: str = "Box") -> Box:
    """Make a piece a box to carry.

    ``pose`` (4,) is that of the piece's own frame, on whose floor it stands: x, y, z and heading.  The prop's
    frame lies at the centre of its bounding box instead; ``piece_pose`` leads back.
    """
    mins, maxs = piece.mins - piece.centre, piece.maxs - piece.centre
    query = Cuboids([((0, 0, 0), 0.0, mins, maxs)])
    box = Box(
        name,
        query,
        sense(query, mins.min(0), maxs.max(0)),
        np.asarray(pose, dtype=np.float64),
        piece.size.astype(np.float64),
    )
    box.pose[:3] = box.to_world(piece.centre)
    return box


def piece_pose(piece: Furniture, box_poses: Array) -> Array:
    """Pose (..., 4) of a piece's own frame where the prop made of it by ``carried_box`` has the pose (...,
    4).
    """
    poses = np.array(box_poses, dtype=np.float64)
    poses[..., :3] -= rotate_planar(np.broadcast_to(piece.centre, poses[..., :3].shape), poses[..., 3])
    return poses


def door_leaf(
    piece: Furniture,
    pose: Array,
    width: float,
    handle: Array,
    thickness: float,
    swing: float = 1.0,
    name: str = "Door",
) -> Leaf:
    """Make a piece in the frame of ``props.Leaf`` a closed leaf at ``pose`` (4,); the rest as there."""
    query = Cuboids([((0, 0, 0), 0.0, piece.mins, piece.maxs)])
    volume = sense(query, piece.mins.min(0), piece.maxs.max(0))
    pose = np.asarray(pose, dtype=np.float64)
    return Leaf(
        name,
        query,
        volume,
        pose,
        width,
        np.asarray(handle, dtype=np.float64),
        thickness,
        float(swing),
        float(pose[3]),
    )
