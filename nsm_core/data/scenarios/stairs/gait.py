"""The gait on stairs, made of a level one: steps are shortened to the treads, then feet and hips raised."""

from __future__ import annotations

import numpy as np

from nsm_core.body.contacts import ANKLES, LEGS, TOE_OFFSET, TOES, foot_heading
from nsm_core.body.ik.footsteps import FootGround, footsteps
from nsm_core.body.ik.reach import into_reach, sinking
from nsm_core.body.ik.two_bone import leg_reach, place_limbs
from nsm_core.body.skeleton import forward_kinematics
from nsm_core.data.scenarios.climb.warp import heels_up, leaned
from nsm_core.rotations import (
    Array,
    heading_quat,
    heading_to_direction,
    quat_conjugate,
    quat_from_axis_angle,
    quat_mul,
    quat_rotate,
    quat_slerp,
)
from nsm_core.signals import gaussian_smooth, intervals, smooth_step
from nsm_core.world.scene.stairs import Flight, FlightGround
from nsm_core.world.scene.terrain import Terrain

# Shares of a swing in which the height of the next tread is come to, going up and down.
RISES, SINKS = (0.0, 0.75), (0.3, 1.0)
GOES_UP, GOES_DOWN = (0.12, 1.0), (0.0, 0.85)  # and in which it goes ahead: up over the edge, and clear of it
FLAT_FROM, FLAT_TO = 0.35, 0.7  # shares of a swing over which the sole turns flat
ROLLS = 0.55  # share of a stand from which on the heel comes up as it was captured
TOES_DOWN = np.radians(14)  # by which toes point down before they land on a lower tread


def shortened(hips: Array, rotations: Array, back: Array, flight: Flight, up: bool, knots: Array) -> Array:
    """Local rotations (T, J, 4) of a level walk whose feet stand nearer to each other.

    Hips (T, 3) go at their new pace already; ``back`` (T, 2) leads to where they were.  Feet that stood at
    ``knots[0]`` metres (from the end of the flight where it is begun, along the way) come to ``knots[1]``.
    """
    positions, world = forward_kinematics(hips.astype(np.float64), rotations.astype(np.float64))
    toes, feet = positions[:, TOES].copy(), world[:, ANKLES]
    toes[..., :2] += back[:, None]
    ahead = heading_to_direction(np.array(flight.heading)) * (1 if up else -1)
    along = (toes[..., :2] - (flight.foot if up else flight.top)) @ ahead
    toes[..., :2] += np.interp(along, knots[0], knots[1] - knots[0])[..., None] * ahead
    ankles: Array = toes - quat_rotate(feet, TOE_OFFSET)
    return place_limbs(hips.astype(np.float64), rotations.astype(np.float64), LEGS, ankles, feet)


def raised(
    hips: Array, rotations: Array, on: Array, flight: Flight, up: bool, rising: Array, lean: Array
) -> tuple[Array, Array, Array]:
    """Hips (T, 3), local rotations (T, J, 4) and standing feet (T, 2) of a walk on level ground, where feet
    stand ``on`` (T, 2) it, raised to the treads of a flight; ``rising`` (T,) metres by which the hips
    are raised, ``lean`` (T,) radians.
    """
    rotations = leaned(rotations, lean)
    hips = hips.astype(np.float64)
    positions, world = forward_kinematics(hips, rotations)
    toes, feet = positions[:, TOES].copy(), world[:, ANKLES].copy()
    ground = FlightGround(flight)
    for side in (0, 1):
        _go(toes[:, side], on[:, side], up)
        toes[:, side, 2] += _heights(toes[:, side], on[:, side], ground, up)
        feet[:, side] = _flat(feet[:, side], on[:, side], lean != 0, up)
    floor = FootGround(ground, Terrain(), np.zeros(len(hips)))
    steps = footsteps(toes, feet, on.astype(np.float64), floor)
    hips = hips + rising[:, None] * (0, 0, 1)
    away = np.linalg.norm(positions[:, ANKLES] - positions[:, [leg[0] for leg in LEGS]], axis=-1)
    reach = np.maximum(np.minimum(away, leg_reach()), 0.985 * leg_reach())
    turned, result = steps.rotations, rotations
    for _ in range(2):
        sole = steps.ankles + quat_rotate(steps.rotations, TOE_OFFSET)
        ankles: Array = sole - quat_rotate(turned, TOE_OFFSET)
        sunk, result = into_reach(hips, rotations, LEGS, ankles, reach, sinking())
        result = place_limbs(sunk, result, LEGS, ankles, turned)
        bent = heels_up(result)
        turned = quat_mul(turned, bent)
        # Toes stay flat where the heel comes up.
        result[:, TOES] = quat_mul(quat_conjugate(bent), result[:, TOES])
    ankles = steps.ankles + quat_rotate(steps.rotations, TOE_OFFSET) - quat_rotate(turned, TOE_OFFSET)
    hips, result = into_reach(sunk, result, LEGS, ankles, reach, sinking())
    return hips, place_limbs(hips, result, LEGS, ankles, turned), steps.planted


def _go(toe: Array, on: Array, up: bool) -> None:
    """Have the swings of a foot (T, 3) go ahead late, or early; changes it."""
    stands = intervals(on)
    begins, ends = GOES_UP if up else GOES_DOWN
    for (_, a), (b, _) in zip(stands[:-1], stands[1:], strict=True):
        before, after = toe[a - 1, :2], toe[b, :2]
        way = after - before
        u = (np.arange(a, b) - a + 1) / (b - a + 1)
        share = (toe[a:b, :2] - before) @ way / max(float(way @ way), 1e-6)
        toe[a:b, :2] += (smooth_step((u - begins) / (ends - begins)) - share)[:, None] * way


def _heights(toe: Array, on: Array, ground: Terrain, up: bool) -> Array:
    """Metres (T,) by which a foot (T, 3) is raised: to its tread where it stands, and there in between."""
    stands = intervals(on)
    out = np.zeros(len(toe))
    if not stands:
        return ground.height(toe[:, :2])
    levels = [float(ground.height(np.median(toe[a:b, :2], axis=0)[None])[0]) for a, b in stands]
    out[: stands[0][0]] = levels[0]
    out[stands[-1][0] :] = levels[-1]
    for (a, b), level in zip(stands, levels, strict=True):
        out[a:b] = level
    begins, ends = RISES if up else SINKS
    for (_, a), (b, _), low, high in zip(stands[:-1], stands[1:], levels[:-1], levels[1:], strict=True):
        u = (np.arange(a, b) - a + 1) / (b - a + 1)
        out[a:b] = low + (high - low) * smooth_step((u - begins) / (ends - begins))
    return out


def _flat(foot: Array, on: Array, climbs: Array, up: bool) -> Array:
    """Rotations (T, 4) of a foot that lands flat, or toes first, where it is on the flight."""
    flat = heading_quat(foot_heading(foot))
    share, down = np.zeros(len(foot)), np.zeros(len(foot))
    for a, b in intervals(on):
        u = (np.arange(a, b) - a) / max(b - a, 1)
        share[a:b] = 1 - smooth_step((u - ROLLS) / 0.25)
    for a, b in intervals(~on):
        u = (np.arange(a, b) - a + 1) / (b - a + 1)
        share[a:b] = smooth_step((u - FLAT_FROM) / (FLAT_TO - FLAT_FROM))
        down[a:b] = 0.0 if up else np.sin(np.pi * u**2) ** 2
    share = gaussian_smooth(share * climbs, 2.0).clip(0, 1)
    pitched = quat_mul(flat, quat_from_axis_angle(np.array((1.0, 0.0, 0.0)), TOES_DOWN * down * climbs))
    return quat_slerp(foot, pitched, share)
