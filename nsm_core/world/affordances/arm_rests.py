"""Where a seat has arm rests that hands can lie on."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.scene import furniture

ASIDE = 0.45  # metres from the middle of the seat beyond which an arm would float rather than rest


def arm_rests(piece: furniture.Furniture) -> list[Array | None]:
    """Where the right and left wrist rest on a seat's arms, (3,) in the object frame; None on a side without
    one.
    """
    seat = piece.seat
    result: list[Array | None] = [None, None]
    if seat is None:
        return result
    across = rotate_planar(
        (piece.mins + piece.maxs) / 2 - seat.point, np.full(len(piece.mins), -seat.heading)
    )[:, 0]
    for side, sign in enumerate((-1, 1)):  # a sitter who faces -Y has the right side on -X
        tops = [
            k
            for k in range(len(piece.mins))
            if 0.1 < piece.maxs[k, 2] - seat.height < 0.4
            and 0.15 < sign * across[k] < ASIDE
            and np.ptp((piece.mins[k, 1], piece.maxs[k, 1])) > 0.12
        ]
        if tops:
            k = max(tops, key=lambda k: piece.maxs[k, 2])
            y = float(np.clip(seat.point[1] - 0.2, piece.mins[k, 1] + 0.05, piece.maxs[k, 1] - 0.05))
            result[side] = np.array(((piece.mins[k, 0] + piece.maxs[k, 0]) / 2, y, piece.maxs[k, 2] + 0.035))
    return result
