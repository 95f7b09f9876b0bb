"""Measures of travel: does a take walk or glide, does its body bend as bodies do, does it run into things?

End error alone can be gamed by gliding, so every goal is judged with these.  All of them take world joint
positions (T, 23, 3) or the pose itself (hips (T, 3), local rotations (T, 23, 4)) at ``fps`` frames a second,
metres and radians, and return plain floats in the units of their names.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from nsm_core.body.capsules import BUNDLED, Figure, penetration_depths
from nsm_core.body.contacts import ANKLES, TOES
from nsm_core.body.skeleton import ANKLE_HEIGHT, ARMS, FEET, HIPS, OFFSETS, TOE_HEIGHT, forward_kinematics
from nsm_core.conventions import FPS, STYLES
from nsm_core.rotations import Array, quat_conjugate, quat_mul, quat_rotate, quat_to_rotvec

if TYPE_CHECKING:
    from nsm_core.world.geometry.distance import DistanceQuery

MOVING, PLANTED, PLANTED_HEIGHT, SKATE_HEIGHT = 0.3, 0.3, 0.04, 0.025
DEEP, BELOW = 0.03, 0.01


def over_ground(positions: Array, ground: Callable[[Array], Array] | None = None) -> Array:
    """World joint positions (T, 23, 3) with the heights of ankles and toes told from the ground under each of
    them.

    ``ground`` gives heights (N,) in metres at floor points (N, 2); None is the floor at 0.
    """
    if ground is None:
        return positions
    joints, out = ANKLES + TOES, np.array(positions)
    under = np.asarray(ground(positions[:, joints, :2].reshape(-1, 2)), dtype=np.float64)
    out[:, joints, 2] -= under.reshape(-1, len(joints))
    return out


def foot_sliding(
    positions: Array,
    fps: float = FPS,
    while_moving: bool = False,
    weighted: bool = False,
    ground: Callable[[Array], Array] | None = None,
) -> float:
    """Mean horizontal speed, cm/s, of ankles and toes that are low (papers/000 section 7.1).

    A joint is low where it is less than 2.5 cm above its height over the floor with a flat sole (ankle 8.5
    cm, toe 2.5 cm) in both frames of a step.  ``while_moving`` counts only frames in which the hips move
    faster than 0.3 m/s.  0 without such frames.  A toe that swings through 2 cm over the floor counts in
    full, so captured walks lie at 5 to 30 cm/s; ``weighted`` lets a joint count by 2 - 2^(height / 2.5 cm),
    as later works do, which leaves mostly what truly stands.  ``ground`` as in ``over_ground``.
    """
    if len(positions) < 2:
        return 0.0
    positions = over_ground(positions, ground)
    joints = positions[:, ANKLES + TOES]
    height = joints[..., 2] - np.array([ANKLE_HEIGHT] * 2 + [TOE_HEIGHT] * 2)
    height = np.maximum(height[1:], height[:-1])
    counted = (
        2 - 2 ** np.clip(height / SKATE_HEIGHT, 0, 1)
        if weighted
        else (height < SKATE_HEIGHT).astype(np.float64)
    )
    if while_moving:
        counted = counted * (hips_speed(positions, fps)[1:, None] > MOVING)
    speed = np.linalg.norm(np.diff(joints[..., :2].astype(np.float64), axis=0), axis=-1) * fps
    return float(100 * (speed * counted).sum() / counted.sum()) if counted.any() else 0.0


def hips_speed(positions: Array, fps: float = FPS) -> Array:
    """Horizontal speed (T,) of the hips, m/s, averaged over three frames (0.1 s)."""
    if len(positions) < 2:
        return np.zeros(len(positions))
    step = np.diff(positions[:, HIPS, :2].astype(np.float64), axis=0)
    step = np.concatenate((step[:1], step))
    smooth = np.stack(
        [np.convolve(np.pad(step[:, k], 1, mode="edge"), np.ones(3) / 3, mode="valid") for k in (0, 1)],
        axis=-1,
    )
    return np.linalg.norm(smooth, axis=-1) * fps


def planted_share(positions: Array, fps: float = FPS) -> float:
    """Share of the moving frames in which a toe stands: lower than 4 cm and slower than 0.3 m/s; 1 if nothing
    moves.

    Moving frames are those with the hips over 0.3 m/s.  Captured walks reach 0.6 to 1 (less where push-off
    lifts the toe joint), runs 0.2 to 0.5; gliding comes near 0.
    """
    moving = hips_speed(positions, fps) > MOVING
    if not moving.any():
        return 1.0
    toes = positions[:, TOES].astype(np.float64)
    speed = np.linalg.norm(np.gradient(toes[..., :2], axis=0), axis=-1) * fps
    return float(((toes[..., 2] < PLANTED_HEIGHT) & (speed < PLANTED)).any(-1)[moving].mean())


def path_ratio(positions: Array, shortest: float | None = None, fps: float = FPS) -> float:
    """Length of the hips' way over the floor, sway averaged out over 0.5 s, by the ``shortest`` free way in
    metres.

    Without ``shortest`` it is the straight line from first to last frame.  1 where there is no way to go
    (under 0.3 m).
    """
    way = positions[:, HIPS, :2].astype(np.float64)
    half = round(0.25 * fps)
    padded = np.pad(way, ((half, half), (0, 0)), mode="edge")
    smooth = np.stack(
        [np.convolve(padded[:, k], np.ones(2 * half + 1) / (2 * half + 1), mode="valid") for k in (0, 1)],
        axis=-1,
    )
    # Averaging pulls the ends in; add what it took from them.
    ends = np.linalg.norm(smooth[[0, -1]] - way[[0, -1]], axis=-1).sum()
    length = np.linalg.norm(np.diff(smooth, axis=0), axis=-1).sum() + ends
    straight = float(np.linalg.norm(way[-1] - way[0])) if shortest is None else float(shortest)
    return float(length / straight) if straight > 0.3 else 1.0


def action_changes(action: Array, fps: float = FPS) -> tuple[int, int]:
    """Count (changes of the leading action, times that sitting begins) in labels (T, 7),
    ``conventions.STYLES``.

    The lead passes on when another label is higher by 0.1; what lasts under 0.2 s does not count.
    """
    action = np.asarray(action)
    lead = np.empty(len(action), dtype=int)
    now = int(np.argmax(action[0])) if len(action) else 0
    for t, labels in enumerate(action):
        best = int(np.argmax(labels))
        now = best if labels[best] > labels[now] + 0.1 else now
        lead[t] = now
    stays: list[int] = []
    start = 0
    for t in range(1, len(lead) + 1):
        if t == len(lead) or lead[t] != lead[start]:
            if t - start >= 0.2 * fps and (not stays or stays[-1] != lead[start]):
                stays.append(int(lead[start]))
            start = t
    sit = STYLES.index("sit")
    return max(0, len(stays) - 1), sum(s == sit for s in stays)


def depth_report(depth: Array) -> dict[str, float]:
    """Tell how deep a body is inside solids by the depths (T,) of all frames, metres: deepest and mean depth,
    cm, and the share of deep frames.

    The depth of a frame is that of its deepest point (``capsules.penetration_depths``); the mean is over all
    frames, and a frame is deep from 3 cm.
    """
    return {
        "penetration_cm": float(100 * depth.max(initial=0.0)),
        "penetration_mean_cm": float(100 * depth.mean()) if len(depth) else 0.0,
        "penetration_share": float((depth > DEEP).mean()) if len(depth) else 0.0,
    }


def backward_bend(hips_position: Array, local_rotations: Array, offsets: Array = OFFSETS) -> dict[str, float]:
    """Largest angle, degrees, by which a knee or an elbow bends the wrong way; 0 if none does."""
    positions, rotations = forward_kinematics(hips_position, local_rotations, offsets)
    hinges = {"knee": ((1, 0, 0), (1, 0, 0)), "elbow": ((0, 0, 1), (0, 0, -1))}
    out = {}
    for name, chains in (("knee", FEET), ("elbow", ARMS)):
        worst = 0.0
        for (a, b, c, *_), hinge in zip(chains, hinges[name], strict=True):
            upper, lower = positions[:, b] - positions[:, a], positions[:, c] - positions[:, b]
            axis = quat_rotate(
                rotations[:, a], np.broadcast_to(np.array(hinge, dtype=rotations.dtype), upper.shape)
            )
            flexion = np.arctan2(np.sum(np.cross(upper, lower) * axis, -1), np.sum(upper * lower, -1))
            worst = max(worst, float(-flexion.min(initial=0.0)))
        out[f"{name}_backward_deg"] = float(np.degrees(worst))
    return out


def jumps(hips_position: Array, local_rotations: Array, offsets: Array = OFFSETS) -> dict[str, float]:
    """Largest changes from frame to frame: a joint's turn in degrees, a joint's move in cm, and a joint's
    change of move in cm.
    """
    if len(hips_position) < 2:
        return {"turn_per_frame_deg": 0.0, "move_per_frame_cm": 0.0, "jolt_cm": 0.0}
    local = local_rotations.astype(np.float64)
    turn = np.linalg.norm(quat_to_rotvec(quat_mul(quat_conjugate(local[:-1]), local[1:])), axis=-1)
    move = np.diff(forward_kinematics(hips_position.astype(np.float64), local, offsets)[0], axis=0)
    return {
        "turn_per_frame_deg": float(np.degrees(turn.max())),
        "move_per_frame_cm": float(100 * np.linalg.norm(move, axis=-1).max()),
        "jolt_cm": float(100 * np.linalg.norm(np.diff(move, axis=0), axis=-1).max(initial=0.0)),
    }


def below_floor(
    hips_position: Array,
    local_rotations: Array,
    ground: Callable[[Array], Array] | None = None,
    figure: Figure = BUNDLED,
) -> dict[str, float]:
    """Share of frames in which a sole reaches more than 1 cm under the floor (or ``ground``), and the
    deepest, cm.
    """
    positions, rotations = forward_kinematics(hips_position, local_rotations, figure.offsets)
    positions = over_ground(positions, ground)
    depth = figure.sole.depth(positions[:, TOES], rotations[:, ANKLES]).max(-1)
    return {
        "below_floor_share": float((depth > BELOW).mean()),
        "below_floor_cm": float(100 * depth.max(initial=0.0)),
    }


def jerk(positions: Array, fps: float = FPS) -> float:
    """Mean size of the third derivative of all joints' positions, m/s^3."""
    if len(positions) < 4:
        return 0.0
    return float(np.linalg.norm(np.diff(positions.astype(np.float64), n=3, axis=0), axis=-1).mean() * fps**3)


def travel_report(
    hips_position: Array,
    local_rotations: Array,
    action: Array | None = None,
    query: DistanceQuery | None = None,
    shortest_path: float | None = None,
    fps: float = FPS,
    ground: Callable[[Array], Array] | None = None,
    figure: Figure = BUNDLED,
) -> dict[str, float]:
    """Measure a whole take; every value is a float that JSON can hold.

    Args:
        hips_position: (T, 3) world, metres; local_rotations: (T, 23, 4).
        action: (T, 7) labels; adds ``action_flips`` and ``sit_count``.
        query: solids of the scene without the floor; adds ``penetration_cm``, ``penetration_mean_cm``,
        ``penetration_share``. shortest_path: metres of the shortest free way, else the straight line, for
        ``path_ratio``. ground: heights of what feet step on, as in ``over_ground``; None is the floor.
        figure: the character's own body, where it is not the bundled one.
    """
    offsets = np.asarray(figure.offsets)
    positions, _ = forward_kinematics(hips_position, local_rotations, offsets)
    speed, feet = hips_speed(positions, fps), over_ground(positions, ground)
    feet = np.array(feet)  # heights over the sole as on the bundled body
    feet[:, ANKLES, 2] += ANKLE_HEIGHT - figure.sole.ankle_height
    feet[:, TOES, 2] += TOE_HEIGHT - figure.sole.toe_height
    report = {
        "seconds": len(positions) / fps,
        "moving_seconds": float((speed > MOVING).sum() / fps),
        "foot_sliding_cm_s": foot_sliding(feet, fps),
        "slide_moving_cm_s": foot_sliding(feet, fps, while_moving=True),
        "slide_moving_weighted_cm_s": foot_sliding(feet, fps, while_moving=True, weighted=True),
        "planted_share": planted_share(feet, fps),
        "top_speed_m_s": float(speed.max(initial=0.0)),
        "path_ratio": path_ratio(positions, shortest_path, fps),
        "jerk_m_s3": jerk(positions, fps),
        **backward_bend(hips_position, local_rotations, offsets),
        **jumps(hips_position, local_rotations, offsets),
        **below_floor(hips_position, local_rotations, ground, figure),
    }
    if action is not None:
        flips, sits = action_changes(action, fps)
        report |= {"action_flips": float(flips), "sit_count": float(sits)}
    if query is not None:
        report |= depth_report(penetration_depths(hips_position, local_rotations, query, figure))
    return report
