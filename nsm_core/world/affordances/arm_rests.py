"""Where a seat has arm rests that hands can lie on."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene import furniture

ASIDE = 0.45  # metres from the middle of the seat beyond which an arm would float rather than rest
OVER_REST, AHEAD = 0.035, 0.2  # metres of the wrist over an arm rest, and ahead of the seated hips
# Metres in which rests of a seat of which only the surface is known are looked for: to the side, ahead of the
# hips and over them; and the least that one is wide.
_ASIDE, _AHEAD, _OVER = np.arange(0.19, ASIDE, 0.02), np.arange(0.08, 0.29, 0.04), np.arange(0.03, 0.3, 0.01)
_LEAST = 2  # columns


def arm_rests_beside(solids: DistanceQuery, hips: Array, heading: float) -> list[Array | None]:
    """Where the right and left wrist (3,) of a sitter rest on arms of ``solids``, world, metres; None on a
    side without one.  ``hips`` (3,) and ``heading`` are how it sits.
    """
    ahead = heading_to_direction(np.array(heading))
    left = np.array((-ahead[1], ahead[0]))
    aside, along, over = np.meshgrid(_ASIDE, _AHEAD, _OVER, indexing="ij")
    result: list[Array | None] = []
    for sign in (-1.0, 1.0):
        places = np.asarray(hips)[:2] + along[..., None] * ahead + sign * aside[..., None] * left
        points = np.concatenate((places, (hips[2] + over)[..., None]), axis=-1)
        solid = solids.signed_distance(points.reshape(-1, 3).astype(np.float32), 0.05).reshape(over.shape) < 0
        # A top: solid below, and nothing over it up to where a forearm would be.
        top = solid.shape[2] - 1 - np.argmax(solid[..., ::-1], axis=2)
        is_top = solid.any(2) & (top < solid.shape[2] - 2)
        wide = is_top.sum(0) >= _LEAST
        if not wide.any():
            result.append(None)
            continue
        at = int(np.flatnonzero(wide)[np.abs(_AHEAD[wide] - AHEAD).argmin()])
        columns = np.flatnonzero(is_top[:, at])
        middle = places[columns, at, 0].mean(0)
        height = float(np.median(hips[2] + _OVER[top[columns, at]]))
        result.append(np.append(middle, height + OVER_REST))
    return result


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
            y = float(np.clip(seat.point[1] - AHEAD, piece.mins[k, 1] + 0.05, piece.maxs[k, 1] - 0.05))
            result[side] = np.array(
                ((piece.mins[k, 0] + piece.maxs[k, 0]) / 2, y, piece.maxs[k, 2] + OVER_REST)
            )
    return result
