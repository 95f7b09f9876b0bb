"""Fit a composed motion to the floor and to its seats: feet that clear the floor, hands on arm rests."""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import ARMS, FEET, forward_kinematics
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.affordances.arm_rests import arm_rests
from nsm_core.world.scene import furniture

from .two_bone import place_limbs, place_wrists


def lift_swinging_feet(hips: Array, rotations: Array, contacts: Array, height: float = 0.018) -> Array:
    """Raise feet a little in the middle of their swing, (T, ...): captured toes graze the floor where seams
    blend steps.
    """
    lift = np.zeros((len(hips), 2), np.float32)
    for side in (0, 1):
        swinging = np.concatenate(([False], ~contacts[:, side].astype(bool), [False]))
        edges = np.flatnonzero(np.diff(swinging.astype(int)))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            if b - a > 4:
                lift[a:b, side] = height * np.sin(np.pi * (np.arange(b - a) + 0.5) / (b - a)) ** 2
    positions, world = forward_kinematics(hips, rotations)
    ankles = [leg[2] for leg in FEET]
    targets = positions[:, ankles]
    targets[..., 2] += lift
    return place_limbs(hips, rotations, [leg[:3] for leg in FEET], targets, world[:, ankles]).astype(
        np.float32
    )


def hands_on_arm_rests(
    hips: Array,
    rotations: Array,
    weight: Array,
    span: slice,
    piece: furniture.Furniture,
    goal: Array,
    heading: float,
) -> Array:
    """Lead the wrists of a sit (``span`` of (T, ...)) from where they were to the arm rests, by the sitting
    ``weight``.
    """
    rotations = rotations.copy()
    positions, _ = forward_kinematics(hips[span], rotations[span])
    # The arms follow the hips down: they leave the thighs' way late and come back to it early.
    w = np.clip((weight - 0.35) / 0.65, 0, 1)[:, None] ** 1.5
    for side, rest in enumerate(arm_rests(piece)):
        if rest is None:
            continue
        at = rotate_planar(rest - np.append(piece.seat.point[:2], 0), np.float64(heading)) + np.append(
            goal[:2], 0
        )
        wrist = positions[:, ARMS[side][2]]
        rotations[span] = place_wrists(
            hips[span], rotations[span], side, (wrist + w * (at - wrist)).astype(np.float32)
        )
    return rotations
