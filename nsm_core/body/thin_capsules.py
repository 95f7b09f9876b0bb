"""A body thinner than the one that is seen: training data is checked with it, so that captures of people in
real rooms pass, and a leaf gives way to it.

How deep a take is inside solids is told by ``capsules``, which is fitted to what is seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nsm_core.rotations import Array, quat_rotate

from .skeleton import END_SITES, INDEX, forward_kinematics

if TYPE_CHECKING:
    from nsm_core.world.geometry.distance import DistanceQuery

# The body as capsules: two joints (or a joint and the end of its bone) and a radius at each, metres.  Pelvis
# and thighs are as thin below as a seated person's are once flesh and cushion have given way: the hip joints
# of a seated pose lie 4 cm over the seat (HIP_OVER_SEAT less their offset), so sitting as told counts as
# touching, not as penetrating.
THIN_CAPSULES: tuple[tuple[str, str, float, float], ...] = (
    ("RightHip", "LeftHip", 0.04, 0.04),
    ("Hips", "Chest2", 0.07, 0.09),
    ("Chest2", "Chest4", 0.10, 0.10),
    ("RightShoulder", "LeftShoulder", 0.06, 0.06),
    ("Neck", "Head", 0.05, 0.07),
    ("Head", "Head end", 0.08, 0.07),
    *(
        (side + a, side + b, ra, rb)
        for side in ("Right", "Left")
        for a, b, ra, rb in (
            ("Shoulder", "Elbow", 0.045, 0.04),
            ("Elbow", "Wrist", 0.04, 0.03),
            ("Wrist", "Wrist end", 0.03, 0.015),
            ("Hip", "Knee", 0.04, 0.055),
            ("Knee", "Ankle", 0.05, 0.04),
            ("Ankle", "Toe", 0.035, 0.025),
            ("Toe", "Toe end", 0.025, 0.02),
        )
    ),
)
_SAMPLE = 0.05  # metres between the spheres that stand for a capsule


def thin_depths(hips_position: Array, local_rotations: Array, query: DistanceQuery) -> Array:
    """Depth (T,) in metres of the deepest point of the body in each frame, 0 where it touches nothing."""
    centres, radii = thin_spheres(hips_position, local_rotations)
    reach = float(radii.max()) + 0.02
    distance = query.signed_distance(centres.reshape(-1, 3).astype(np.float32), reach).reshape(
        centres.shape[:2]
    )
    return np.maximum(0, radii - distance).max(axis=1)


def thin_spheres(hips_position: Array, local_rotations: Array) -> tuple[Array, Array]:
    """Spheres along ``THIN_CAPSULES``: centres (T, S, 3) world and radii (S,), metres."""
    positions, rotations = forward_kinematics(
        hips_position.astype(np.float64), local_rotations.astype(np.float64)
    )

    def point(name: str) -> Array:
        joint = name.removesuffix(" end")
        if joint == name:
            return positions[:, INDEX[name]]
        end = np.broadcast_to(np.array(END_SITES[joint], dtype=np.float64), positions[:, 0].shape)
        return positions[:, INDEX[joint]] + quat_rotate(rotations[:, INDEX[joint]], end)

    centres, radii = [], []
    for a, b, ra, rb in THIN_CAPSULES:
        pa, pb = point(a), point(b)
        # Lengths are rounded, so that bones have as many spheres whatever a pose's arithmetic.
        for t in np.linspace(0, 1, 2 + int(round(float(np.linalg.norm(pb[0] - pa[0])), 3) / _SAMPLE)):
            centres.append(pa + t * (pb - pa))
            radii.append(ra + t * (rb - ra))
    return np.stack(centres, axis=1), np.array(radii)
