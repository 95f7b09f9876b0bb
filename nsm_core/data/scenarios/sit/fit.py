"""What a captured sitter owes the seat it is put on: it comes to rest, and back, thighs and hands stay out of
what stands there.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.ik.hand_clearance import HandClearance
from nsm_core.body.ik.heels import KNEE_OVER_SEAT, Heels
from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import (
    ARMS,
    BACK_FROM,
    BACK_RADIUS,
    FEET,
    HIP_OVER_SEAT,
    INDEX,
    forward_kinematics,
    root_of,
)
from nsm_core.conventions import SIT
from nsm_core.data.scenarios.motion import Motion
from nsm_core.rotations import Array, heading_quat, quat_from_axis_angle, quat_mul, wrap_angle
from nsm_core.signals import gaussian_smooth, smooth_step
from nsm_core.world.geometry.distance import DistanceQuery

RESTLESS = 0.12  # share of its sway that a seated body keeps
_EARLY, _LATE = 5, 6  # frames before and after the seat is reached between which the rest is found
_LEANS = np.radians(np.arange(0, 29, 4.0))
_SPINE = [INDEX[name] for name in ("Chest2", "Chest3", "Chest4", "Neck")]
# Metres from a joint of the arm to a solid that the arm may touch; frames in which what moved it fades.
_ARM, _FADE = 0.22, 20
_LEGS = tuple(leg[:3] for leg in FEET)


def bring_to_rest(motion: Motion, reached: int, still: slice, rise: int) -> None:
    """Let the hips come to the mean place and heading of the frames ``still`` soon after ``reached``, and
    leave it before ``rise``.

    Captured hips go on gliding over the seat for a second; where one sits would then be no place but a
    region.  Changes hips, rotations and headings in place; the feet stay.
    """
    span = slice(max(reached - _EARLY, 0), rise)
    frames = np.arange(span.start, span.stop)
    weight = smooth_step((frames - span.start) / (_EARLY + _LATE)) * smooth_step(
        (rise - frames) / max(rise - still.stop, 1)
    )
    weight *= 1 - RESTLESS
    positions, world = forward_kinematics(motion.hips[span], motion.rotations[span])
    heading = np.unwrap(root_of(positions)[1])
    inside = slice(still.start - span.start, still.stop - span.start)
    off = wrap_angle(heading - heading[inside].mean()) * weight
    ankles = [leg[2] for leg in FEET]
    motion.hips[span] -= weight[:, None] * (motion.hips[span] - motion.hips[still].mean(axis=0))
    turned = motion.rotations[span].copy()
    turned[:, 0] = quat_mul(heading_quat(-off), turned[:, 0])
    motion.headings[span] -= off
    placed = place_limbs(motion.hips[span], turned, _LEGS, positions[:, ankles], world[:, ankles])
    motion.rotations[span] = placed.astype(motion.rotations.dtype)


def lean_off(motion: Motion, span: slice, solid: DistanceQuery) -> None:
    """Lean trunks forward from the lowest joint of the spine, as little as keeps the back out of ``solid``,
    smoothly; hands stay.
    """
    hips, local = motion.hips[span].astype(np.float64), motion.rotations[span].astype(np.float64)
    chest = INDEX["Chest"]
    depth = np.stack(
        [_back_depth(hips, _leant(local, chest, np.full(len(hips), lean)), solid) for lean in _LEANS]
    )
    if depth.max() < 0.005:
        return
    good = depth < np.maximum(depth.min(axis=0) + 0.008, 0.005)
    wanted = _LEANS[good.argmax(axis=0)]
    widest = np.lib.stride_tricks.sliding_window_view(np.pad(wanted, 8, mode="edge"), 17).max(-1)
    leant = _leant(local, chest, gaussian_smooth(widest, 4.0).clip(0))
    # The hands lie where they lay: let down with the shoulders they would go into thighs and seat.
    wrists = [arm[2] for arm in ARMS]
    positions, world = forward_kinematics(hips, local)
    motion.rotations[span] = place_limbs(hips, leant, ARMS, positions[:, wrists], world[:, wrists]).astype(
        motion.rotations.dtype
    )


def _leant(local: Array, chest: int, lean: Array) -> Array:
    turned = local.copy()
    turned[:, chest] = quat_mul(quat_from_axis_angle(np.array((1.0, 0.0, 0.0)), lean), turned[:, chest])
    return turned


def _back_depth(hips: Array, local: Array, solid: DistanceQuery) -> Array:
    """How deep (T,) the back is inside ``solid``, metres, where leaning can help it."""
    positions = forward_kinematics(hips, local)[0]
    joints = positions[:, _SPINE]
    spine = np.concatenate(
        [joints[:, :-1] + s * np.diff(joints, axis=1) for s in (0.0, 0.5)] + [joints[:, -2:-1]], axis=1
    )
    distance = solid.signed_distance(spine.reshape(-1, 3).astype(np.float32), BACK_RADIUS + 0.05).reshape(
        spine.shape[:2]
    )
    counts = np.linalg.norm(spine - positions[:, [INDEX["Chest"]]], axis=-1) > BACK_FROM
    return np.where(counts, np.maximum(BACK_RADIUS - distance, 0), 0).max(axis=1)


def lift_heels(motion: Motion, span: slice, goal: Array) -> None:
    """Lift the heels of a sitter at ``goal`` (3,) whose thighs would press into the seat, as in takes
    (``control.heels``).
    """
    knees = forward_kinematics(motion.hips[span], motion.rotations[span])[0][:, [leg[1] for leg in FEET], 2]
    if knees[motion.labels[span, SIT] > 0.3].min(initial=np.inf) > goal[2] - HIP_OVER_SEAT + KNEE_OVER_SEAT:
        return
    heels = Heels()
    for t in range(span.start, span.stop):
        motion.rotations[t] = heels.apply(
            motion.hips[t], motion.rotations[t], float(motion.labels[t, SIT]), goal
        )


def keep_hands_off(motion: Motion, span: slice, solid: DistanceQuery) -> None:
    """Move hands out of ``solid``, as in takes (``control.hands``)."""
    centres = forward_kinematics(motion.hips[span], motion.rotations[span])[0][
        :, [j for arm in ARMS for j in arm[1:]]
    ]
    distance = solid.signed_distance(centres.reshape(-1, 3).astype(np.float32), _ARM + 0.01).reshape(
        centres.shape[:2]
    )
    near = np.flatnonzero(distance.min(axis=1) < _ARM)
    if not len(near):
        return
    hands = HandClearance(solid)
    span = slice(span.start + int(near[0]), min(span.start + int(near[-1]) + _FADE, span.stop))
    for t in range(span.start, span.stop):
        motion.rotations[t] = hands.apply(motion.hips[t], motion.rotations[t])
