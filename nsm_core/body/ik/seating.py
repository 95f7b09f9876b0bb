"""Hips that settle on a seat: where the reference motion has them, before the solver brings the body
along.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nsm_core.conventions import DT
from nsm_core.rotations import Array, heading_quat, quat_mul, wrap_angle
from nsm_core.signals import smooth_step

LOCK, UNLOCK = 0.5, 0.3  # of the contact label
DRAW_TIME, NEXT_SEAT = 0.5, 0.05  # seconds; metres between goals of one and the same seat
MAX_DRAW, HIP_PLAY, HIP_PLAY_TURN = 0.3, 0.008, np.radians(0.4)
# From ASKEW to MAX_TURN the draw fades: who still turns on the seat is not twisted round.
ASKEW, MAX_TURN = np.radians(20), np.radians(45)


def settle(
    hips: Array,
    local: Array,
    headings: Array,
    labels: Array,
    seats: Sequence[tuple[Array, float | None] | None],
) -> tuple[Array, Array, Array]:
    """Draw hips onto the seat while their contact label is high; new hips (T, 3), local rotations and weights
    (T,).

    ``headings`` (T,) of the body, ``labels`` (T,) of the hips' contact, ``seats`` the place (3,) of the hips
    and the heading to sit at (None while it still turns) of every frame, None without one.  A little play
    stays, so that a sitter lives.
    """
    hips, local = hips.copy(), local.copy()
    count = len(hips)
    draw, face, seated = np.zeros(count + 1), np.zeros(count + 1), False
    places, facings = np.zeros((count, 3)), np.zeros(count)
    goal: Array | None = None
    facing = 0.0
    for t, seat in enumerate(seats):
        if seat is not None and (not draw[t] or goal is None):
            goal = np.asarray(seat[0], dtype=np.float64)
        # A sitter who is sent to the next seat is let go from this one first.
        same = seat is not None and goal is not None and np.linalg.norm(goal - seat[0]) < NEXT_SEAT
        seated = bool(same) and labels[t] > (UNLOCK if seated else LOCK)
        draw[t + 1] = np.clip(draw[t] + (1 if seated else -1) * DT / DRAW_TIME, 0, 1)
        faces = seated and seat is not None and seat[1] is not None
        if faces and not face[t]:
            facing = float(seat[1])  # type: ignore[index, arg-type]
        face[t + 1] = np.clip(face[t] + (1 if faces else -1) * DT / DRAW_TIME, 0, 1)
        if draw[t + 1] and goal is not None:
            places[t], facings[t] = goal, facing
        else:
            goal = None
    weight, turning = smooth_step(draw[1:]), smooth_step(face[1:])
    gap = np.where(weight[:, None] > 0, places - hips, 0.0)
    far = np.linalg.norm(gap, axis=1)
    share = np.clip(far - HIP_PLAY, 0, MAX_DRAW) / np.maximum(far, 1e-9)
    hips += (weight * share)[:, None] * gap
    turn = wrap_angle(facings - headings)
    turn = turn * smooth_step((MAX_TURN - np.abs(turn)) / (MAX_TURN - ASKEW))
    turn = np.sign(turn) * np.maximum(np.abs(turn) - HIP_PLAY_TURN, 0)
    local[:, 0] = quat_mul(heading_quat(turning * turn), local[:, 0])
    return hips, local, weight


__all__ = ["settle"]
