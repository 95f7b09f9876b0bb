"""In which manner a seat is taken and left: the pace, the lean of the trunk, and what the hands do.

Captures say what hips, legs and trunk do; some hold their hands up all the while, others let them lie.  Arms
are led to where the manner wants them by the project's own inverse kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.ik.thighs import leant, on_thighs
from nsm_core.body.ik.two_bone import place_wrists
from nsm_core.body.skeleton import ARMS, HIP_OVER_SEAT, INDEX, forward_kinematics, root_of
from nsm_core.data.scenarios.hands import hands_on_arm_rests, lead_hand
from nsm_core.data.scenarios.motion import Motion
from nsm_core.rotations import (
    Array,
    heading_to_direction,
    quat_conjugate,
    quat_from_rotvec,
    quat_mul,
    quat_rotate,
    quat_slerp,
    rotate_planar,
)
from nsm_core.signals import gaussian_smooth, smooth_step
from nsm_core.world.affordances.arm_rests import arm_rests
from nsm_core.world.scene.furniture import Furniture

from .draws import SITS

ARM_JOINTS = [INDEX[s + n] for s in ("Right", "Left") for n in ("Collar", "Shoulder", "Elbow", "Wrist")]
OVER_SEAT = 0.05  # metres of the wrist over a seat
FINGERS_AHEAD = 0.8  # how strongly fingers on a seat are drawn ahead, against where the forearm points
MOST_ROLLED = np.radians(75)  # by which a hand turns about the forearm to lie palm down
_OVER = 14  # frames over which arms come from a walk's pose to hanging
_UP = np.array((0.0, 0.0, 1.0))


@dataclass(frozen=True)
class SitManner:
    """Seconds of the way down (``sinks``) and up (``rises``), and ``speed`` of the way there, m/s.

    ``hands`` are "rests", "beside", "thighs" or "lap", at a ``place`` (2,): share along the thigh or metres
    ahead of the hips, and metres to the inside or to the side.
    ``down`` and ``up`` are the seatedness at which hands begin to come to it and arrive; ``swing`` metres
    ahead, ``lean`` radians of the trunk seated and more of it on the ``way``.
    """

    sinks: float
    rises: float
    speed: float
    hands: str
    place: tuple[float, float]
    down: tuple[float, float]
    up: tuple[float, float]
    swing: float
    lean: float
    way: float


def draw_manner(rng: np.random.Generator, piece: Furniture, turns: bool) -> SitManner:
    """Draw how ``piece`` is sat down on; who ``turns`` on the seat has the hands with the body."""
    seat, chance = piece.require_seat(), rng.random()
    pace = (
        (SITS.brisk_down, SITS.brisk_up, SITS.brisk_way)
        if chance < SITS.brisk
        else (SITS.slow_down, SITS.slow_up, SITS.slow_way)
        if chance < SITS.brisk + SITS.slow
        else (SITS.usual_down, SITS.usual_up, SITS.usual_way)
    )
    hands = _hands(rng, piece, turns)
    if hands == "beside":
        place = (rng.uniform(*SITS.ahead_of_hips), rng.uniform(*SITS.beside_hips))
    else:
        place = (rng.uniform(*SITS.along_thigh), rng.uniform(*SITS.off_thigh))
    down, up = (SITS.early if rng.random() < SITS.lean_on_hands else SITS.late for _ in range(2))
    back = seat.back and rng.random() < SITS.against_back
    return SitManner(
        float(rng.uniform(*pace[0])),
        float(rng.uniform(*pace[1])),
        float(rng.uniform(*pace[2])),
        hands,
        (float(place[0]), float(place[1])),
        down,
        up,
        float(rng.uniform(*SITS.swing)),
        float(rng.uniform(*(SITS.back_lean if back else SITS.seated_lean))),
        float(rng.uniform(*SITS.way_lean)),
    )


def _hands(rng: np.random.Generator, piece: Furniture, turns: bool) -> str:
    seat, chance = piece.require_seat(), rng.random()
    rests = [r for r in arm_rests(piece) if r is not None]
    if rests:
        low, high = SITS.rests_over_seat
        suits = all(low < float(r[2]) - seat.height < high for r in rests)
        if suits and chance < SITS.on_rests:
            return "rests"
    elif not turns and chance < (SITS.beside if seat.back else SITS.beside_bench):
        return "beside"
    return "lap" if rng.random() < SITS.lap else "thighs"


def act_out(
    motion: Motion,
    span: slice,
    seated: int,
    weight: Array,
    manner: SitManner,
    piece: Furniture,
    goal: Array,
    heading: float,
) -> None:
    """Give a sit (``span`` of the motion) the lean and the arms of its manner, in place.

    ``weight`` (n,) is how far it is seated, ``seated`` a frame of the span at which it is; ``goal`` (3,) the
    seated hips, which face ``heading``.
    """
    hips, local = motion.hips[span].astype(np.float64), motion.rotations[span].astype(np.float64)
    local = _leant(local, weight, manner)
    local = _hanging(hips, local, weight, manner.swing)
    if manner.hands == "rests":
        motion.rotations[span] = local
        lying = _lying(weight, seated, manner)
        motion.rotations = hands_on_arm_rests(
            motion.hips, motion.rotations, 0.35 + 0.65 * lying, span, piece, goal, heading
        )
        return
    lying = _lying(weight, seated, manner)
    for side in (0, 1):
        positions, _ = forward_kinematics(hips, local)
        target, normal, along = _target(positions, side, manner, goal, heading)
        local = lead_hand(hips, local, side, target, lying, normal, along)
        local = _palm_down(hips, local, side, lying, normal)
    motion.rotations[span] = local


def _lying(weight: Array, seated: int, manner: SitManner) -> Array:
    """How far (n,) 0..1 the hands are where they lie."""
    (a, b), (c, d) = manner.down, manner.up
    n = np.arange(len(weight))
    low, high = np.where(n < seated, a, c), np.where(n < seated, b, d)
    return np.asarray(gaussian_smooth(smooth_step((weight - low) / (high - low)), 2.0))


def _leant(local: Array, weight: Array, manner: SitManner) -> Array:
    """The trunk leans, seated and on the way, and the head looks on ahead."""
    return leant(
        local, gaussian_smooth(manner.lean * weight**2 + manner.way * 4 * weight * (1 - weight), 3.0)
    )


def _hanging(hips: Array, local: Array, weight: Array, swing: float) -> Array:
    """Arms that hang down from the shoulders throughout, as they do at the end; they swing ahead by ``swing``
    metres on the way down and up.
    """
    local = local.copy()
    there = smooth_step(np.arange(len(local)) / _OVER)
    for j in ARM_JOINTS:
        local[:, j] = quat_slerp(local[:, j], np.broadcast_to(local[-1, j], local[:, j].shape), there)
    positions, _ = forward_kinematics(hips, local)
    headings = np.unwrap(root_of(positions)[1])
    ahead = np.append(heading_to_direction(headings), np.zeros((len(local), 1)), axis=-1)
    bump = swing * 4 * weight * (1 - weight)
    for side, arm in enumerate(ARMS):
        offset = rotate_planar(positions[-1, arm[2]] - positions[-1, arm[0]], -headings[-1])
        hang = positions[:, arm[0]] + rotate_planar(np.broadcast_to(offset, hips.shape), headings)
        wrist = positions[:, arm[2]] + there[:, None] * (hang - positions[:, arm[2]]) + bump[:, None] * ahead
        wrist[:, 2] += bump * swing
        local = place_wrists(hips, local, side, wrist)
    return local


def _target(
    positions: Array, side: int, manner: SitManner, goal: Array, heading: float
) -> tuple[Array, Array, Array]:
    """Where the wrist of ``side`` lies, the normal of what it lies on, and where fingers are drawn to: (n, 3)
    each.
    """
    first, second = manner.place
    if manner.hands == "beside":
        sign = -1.0 if side == 0 else 1.0
        ahead = np.append(heading_to_direction(np.array(heading)), 0)
        off = rotate_planar(np.array((sign * second, -first)), np.float64(heading))
        at = np.array((goal[0] + off[0], goal[1] + off[1], goal[2] - HIP_OVER_SEAT + OVER_SEAT))
        shape = (len(positions), 3)
        place, up, along = (np.broadcast_to(v, shape) for v in (at, _UP, FINGERS_AHEAD * ahead))
        return place, up, along
    at, over, thigh = on_thighs(positions, side, manner.place, manner.hands == "lap")
    return at, over, 0.5 * FINGERS_AHEAD * thigh


def _palm_down(hips: Array, local: Array, side: int, weight: Array, normal: Array) -> Array:
    """Turn the hand about the forearm, palm against ``normal`` (n, 3), by ``weight`` (n,)."""
    elbow, wrist = ARMS[side][1:]
    _, world = forward_kinematics(hips, local)
    hand = world[:, wrist]
    fingers = quat_rotate(hand, np.broadcast_to(np.array((-1.0 if side == 0 else 1.0, 0, 0)), hips.shape))
    palm = quat_rotate(hand, np.broadcast_to(-_UP, hips.shape))
    wanted = -normal + (normal * fingers).sum(-1, keepdims=True) * fingers
    sine = (np.cross(palm, wanted) * fingers).sum(-1)
    angle = MOST_ROLLED * sine  # none where the fingers point at it, and none over the back of the hand
    roll = quat_from_rotvec(fingers * (gaussian_smooth(angle, 2.0) * weight)[:, None])
    local = local.copy()
    local[:, wrist] = quat_mul(quat_conjugate(world[:, elbow]), quat_mul(roll, hand))
    return local


__all__ = ["SitManner", "act_out", "draw_manner"]
