"""How one sits: where hands lie on the thighs, each on its own or in the lap, and how the trunk leans."""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import FEET, INDEX
from nsm_core.rotations import Array, quat_from_axis_angle, quat_mul

OVER_THIGH = 0.085  # metres of the wrist over the line from hip to knee, on the bundled body
IN_LAP = 0.1  # metres of the wrist off the middle between the thighs
HIGHER = 0.02  # metres that hands in the lap lie higher
# Seatedness, 0 to 1, over which hands of those who lean on them come to where they lie; and of the others.
EARLY, LATE = (0.0, 0.55), (0.45, 1.0)
SEATED_LEAN = (
    float(np.radians(-2)),
    float(np.radians(10)),
)  # of a trunk that does not lean on a back rest, radians ahead
ALONG_THIGH, OFF_THIGH = (0.38, 0.78), (-0.02, 0.05)  # shares of it from the hip; metres inside its middle
LAP, LEAN_ON_HANDS = 0.2, 0.45  # shares of the hands that lie there, and of those who lean on them
NECK = 0.4  # share of the trunk's lean that neck and head undo, each
_TRUNK, _NECK = [INDEX[n] for n in ("Chest", "Chest2", "Chest3")], [INDEX[n] for n in ("Neck", "Head")]
_X, _UP = np.array((1.0, 0.0, 0.0)), np.array((0.0, 0.0, 1.0))


def on_thighs(
    positions: Array, side: int, place: tuple[float, float], lap: bool, over: float | Array = OVER_THIGH
) -> tuple[Array, Array, Array]:
    """Where the wrist of ``side``, 0 right or 1 left, lies, the normal of what it lies on, and the thigh's
    way to the knee, (T, 3) each, metres, world, of joints at ``positions`` (T, 23, 3).

    ``place``: share along the thigh, and metres to the inside of its middle; ``lap``: between the thighs
    instead.  ``over`` metres from the line from hip to knee to the wrist.
    """
    hip, knee = positions[:, FEET[side][0]], positions[:, FEET[side][1]]
    inside = (positions[:, FEET[1 - side][0]] - hip) * (1, 1, 0)
    inside = inside / np.maximum(np.linalg.norm(inside, axis=-1, keepdims=True), 1e-9)
    first, second = place
    thigh = knee - hip
    normal = _UP - thigh * thigh[:, 2:] / (thigh**2).sum(-1, keepdims=True)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-6)
    over = np.asarray(over)
    if not lap:
        return hip + first * thigh + second * inside + over * normal, normal, thigh
    hips, knees = (positions[:, [FEET[0][k], FEET[1][k]]].mean(1) for k in (0, 1))
    middle = hips + first * 0.5 * (knees - hips)
    return middle - IN_LAP * inside + (over + HIGHER) * normal, normal, thigh


def leant(local: Array, angle: Array) -> Array:
    """Local rotations (T, 23, 4) of a trunk that leans ahead by ``angle`` (T,), radians, more, under a head
    that looks on ahead.
    """
    local = local.copy()
    for joints, share in ((_TRUNK, 1 / len(_TRUNK)), (_NECK, -NECK)):
        turn = quat_from_axis_angle(_X, share * angle)
        for joint in joints:
            local[:, joint] = quat_mul(local[:, joint], turn)
    return local


__all__ = ["leant", "on_thighs"]
