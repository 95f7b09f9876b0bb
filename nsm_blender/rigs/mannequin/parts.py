"""The mannequin's shape: an adult of 1.75 m in the skeleton's T-pose, part by part, in metres.

Rounded limbs meet in balls that sit on the joints, so no pose opens a gap; the trunk bends smoothly.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import INDEX
from nsm_core.rotations import Array

from ..armature import joint_positions_at_rest
from .loft import LoftPart, ball, frame_along, loft

BODY, JOINT, SHOE = 0, 1, 2


def mannequin_parts() -> list[LoftPart]:
    """All parts of the mannequin, standing on z = 0 and facing -Y."""
    joints = joint_positions_at_rest()
    left = _arm(joints) + _hand(joints) + _leg(joints) + _foot(joints)
    return _trunk() + _head() + left + [part.mirrored() for part in left]


def _trunk() -> list[LoftPart]:
    # Full weight of each spine joint half-way between it and the next one.
    spine = [(1.0, "Hips"), (1.11, "Chest"), (1.21, "Chest2"), (1.31, "Chest3"), (1.4, "Chest4")]
    pelvis = loft(
        [
            (0.876, 0, 0.004, 0.070, 0.064, 0.066),
            (0.890, 0, 0.004, 0.115, 0.084, 0.088),
            (0.918, 0, 0.004, 0.146, 0.096, 0.103),
            (0.955, 0, 0.006, 0.153, 0.098, 0.104),
            (1.000, 0, 0.008, 0.143, 0.094, 0.094),
            (1.036, 0, 0.008, 0.131, 0.088, 0.084),
        ],
        BODY,
        caps=(0.014, 0.012),
        roundness=(2.5, 2.4),
        ring=40,
    ).rigid("Hips")
    waist = loft(
        [
            (1.010, 0, 0.008, 0.118, 0.078, 0.074),
            (1.060, 0, 0.010, 0.113, 0.078, 0.070),
            (1.110, 0, 0.012, 0.113, 0.079, 0.072),
            (1.170, 0, 0.014, 0.120, 0.082, 0.078),
        ],
        JOINT,
        roundness=(2.2, 2.2),
        ring=40,
    ).blend(2, spine)
    chest = loft(
        [
            (1.118, 0, 0.013, 0.121, 0.086, 0.080),
            (1.150, 0, 0.014, 0.129, 0.094, 0.086),
            (1.210, 0, 0.015, 0.141, 0.104, 0.094),
            (1.290, 0, 0.016, 0.156, 0.115, 0.104),
            (1.350, 0, 0.018, 0.163, 0.117, 0.106),
            (1.400, 0, 0.020, 0.160, 0.106, 0.100),
            (1.430, 0, 0.022, 0.148, 0.092, 0.090),
            (1.452, 0, 0.023, 0.124, 0.078, 0.076),
            (1.474, 0, 0.022, 0.091, 0.066, 0.066),
            (1.500, 0, 0.020, 0.064, 0.058, 0.060),
        ],
        BODY,
        caps=(0.012, 0.006),
        roundness=(2.4, 2.3),
        ring=40,
    ).blend(2, spine)
    neck = loft(
        [
            (1.465, 0, 0.022, 0.058, 0.055, 0.055),
            (1.510, 0, 0.018, 0.051, 0.050, 0.050),
            (1.570, 0, 0.010, 0.049, 0.050, 0.052),
        ],
        JOINT,
        caps=(0.005, 0.02),
    ).blend(2, [(1.475, "Chest4"), (1.515, "Neck"), (1.56, "Neck"), (1.59, "Head")])
    return [pelvis, waist, chest, neck]


def _head() -> list[LoftPart]:
    head = loft(
        [
            (1.537, 0, -0.044, 0.034, 0.046, 0.060),
            (1.562, 0, -0.024, 0.054, 0.076, 0.084),
            (1.592, 0, -0.008, 0.0645, 0.092, 0.094),
            (1.630, 0, 0.000, 0.0715, 0.099, 0.098),
            (1.664, 0, 0.003, 0.0735, 0.0985, 0.0965),
        ],
        BODY,
        caps=(0.014, 0.086),
        roundness=(2.2, 2.1),
        spacing=0.010,
        ring=56,
    )
    x, y, z = head.vertices.T
    front = np.clip(-y / 0.08, 0, 1) ** 2
    nose = np.exp(-((x / 0.0125) ** 2)) * np.interp(
        z, (1.580, 1.594, 1.602, 1.648, 1.664), (0, 0.9, 1, 0.15, 0)
    )
    eyes = np.exp(-(((np.abs(x) - 0.031) / 0.017) ** 2) - ((z - 1.640) / 0.014) ** 2)
    brow = np.exp(-((x / 0.05) ** 2) - ((z - 1.664) / 0.010) ** 2)
    mouth = np.exp(-((x / 0.022) ** 2) - ((z - 1.567) / 0.005) ** 2)
    head.vertices[:, 1] += front * (-0.019 * nose + 0.009 * eyes - 0.003 * brow + 0.002 * mouth)
    return [head.rigid("Head")] + [_ear(side) for side in (-1, 1)]


def _ear(side: int) -> LoftPart:
    ear = ball((0, 0, 0), (0.007, 0.017, 0.030), BODY, ring=14)
    ear.vertices = ear.vertices + (0.0735 * side, 0.012, 1.628)
    return ear.rigid("Head")


def _arm(joints: Array) -> list[LoftPart]:
    shoulder, elbow, wrist = (joints[INDEX[n]] for n in ("LeftShoulder", "LeftElbow", "LeftWrist"))
    axes = frame_along((1, 0, 0))  # U is Y, V is Z
    y, z = shoulder[1], shoulder[2]
    upper = loft(
        [
            (shoulder[0] + 0.014, y, z, 0.054, 0.051, 0.051),
            (shoulder[0] + 0.085, y, z, 0.051, 0.050, 0.048),
            (shoulder[0] + 0.150, y + 0.003, z, 0.047, 0.046, 0.044),
            (elbow[0] - 0.060, y + 0.001, z, 0.040, 0.039, 0.038),
            (elbow[0] - 0.026, y, z, 0.037, 0.036, 0.036),
        ],
        BODY,
        axes,
        caps=(0.046, 0.014),
    ).rigid("LeftShoulder")
    fore = loft(
        [
            (elbow[0] + 0.026, y, z, 0.037, 0.036, 0.036),
            (elbow[0] + 0.070, y, z, 0.042, 0.038, 0.038),
            (elbow[0] + 0.140, y, z, 0.036, 0.033, 0.032),
            (wrist[0] - 0.055, y, z, 0.029, 0.025, 0.025),
            (wrist[0] - 0.022, y, z, 0.027, 0.022, 0.022),
        ],
        BODY,
        axes,
        caps=(0.014, 0.010),
    ).rigid("LeftElbow")
    # The shoulder ball turns with the collar, so that it keeps filling the chest's side.
    return [
        ball(shoulder, 0.0535, JOINT).rigid("LeftCollar"),
        upper,
        ball(elbow, 0.0395, JOINT).rigid("LeftElbow"),
        fore,
        ball(wrist, (0.027, 0.027, 0.0235), JOINT).rigid("LeftWrist"),
    ]


def _hand(joints: Array) -> list[LoftPart]:
    wrist = joints[INDEX["LeftWrist"]]
    palm = loft(
        [
            (0.022, 0, 0, 0.026, 0.017, 0.017),
            (0.050, 0, -0.001, 0.036, 0.018, 0.016),
            (0.080, 0.001, -0.002, 0.0405, 0.017, 0.014),
            (0.098, 0.001, -0.003, 0.039, 0.014, 0.011),
        ],
        BODY,
        frame_along((1, 0, 0)),
        tuple(wrist),
        caps=(0.008, 0.008),
        roundness=(2.6, 2.6),
        spacing=0.014,
    )
    parts = [palm]
    for y, length, radius in (
        (-0.0295, 0.064, 0.0098),
        (-0.0098, 0.073, 0.0102),
        (0.0098, 0.067, 0.0098),
        (0.0285, 0.052, 0.0088),
    ):
        start = wrist + (0.094, y, -0.003)
        direction = np.array((1, y * 1.5, -0.16))  # fingers fan a little and hang a little
        parts.append(_finger(start, direction, length, radius))
    thumb = _finger(wrist + (0.036, -0.026, -0.006), np.array((0.78, -0.56, -0.22)), 0.058, 0.0125)
    return [part.rigid("LeftWrist") for part in parts + [thumb]]


def _finger(start: Array, direction: Array, length: float, radius: float) -> LoftPart:
    """A finger that curls slightly towards the palm (-Z)."""
    sections = [
        (s * length, 0, -0.10 * length * s**2, radius * k, radius * k, radius * k)
        for s, k in ((0, 1), (0.35, 1), (0.7, 0.93), (1, 0.80))
    ]
    return loft(
        sections,
        BODY,
        frame_along(direction),
        tuple(start),
        caps=(radius, radius * 0.8),
        spacing=0.022,
        ring=9,
    )


def _leg(joints: Array) -> list[LoftPart]:
    hip, knee, ankle = (joints[INDEX[n]] for n in ("LeftHip", "LeftKnee", "LeftAnkle"))
    x = hip[0]
    thigh = loft(
        [
            (knee[2] + 0.034, x, 0.000, 0.047, 0.050, 0.046),
            (knee[2] + 0.090, x, 0.000, 0.055, 0.058, 0.051),
            (knee[2] + 0.200, x + 0.001, -0.002, 0.067, 0.070, 0.058),
            (knee[2] + 0.320, x + 0.001, -0.002, 0.075, 0.077, 0.060),
            (hip[2], x - 0.002, 0.000, 0.076, 0.076, 0.061),
        ],
        BODY,
        caps=(0.018, 0.062),
        ring=24,
    ).rigid("LeftHip")
    shin = loft(
        [
            (ankle[2] + 0.030, x, 0.002, 0.033, 0.034, 0.036),
            (ankle[2] + 0.090, x, 0.002, 0.036, 0.036, 0.043),
            (ankle[2] + 0.190, x, 0.002, 0.046, 0.041, 0.060),
            (ankle[2] + 0.280, x, 0.001, 0.053, 0.045, 0.067),
            (ankle[2] + 0.345, x, 0.000, 0.051, 0.046, 0.057),
            (knee[2] - 0.032, x, 0.000, 0.046, 0.046, 0.046),
        ],
        BODY,
        caps=(0.012, 0.018),
        ring=24,
    ).rigid("LeftKnee")
    return [
        thigh,
        ball(knee, (0.0485, 0.0505, 0.0505), JOINT).rigid("LeftKnee"),
        shin,
        ball(ankle, (0.036, 0.038, 0.036), JOINT).rigid("LeftAnkle"),
    ]


def _foot(joints: Array) -> list[LoftPart]:
    ankle = joints[INDEX["LeftAnkle"]]
    axes = np.array(((1, 0, 0), (0, 0, 1), (0, -1, 0)), float)  # U is X, V is Z, S runs from heel to toe
    # Rows: s, side offset, half width, height of the upper.
    outline = np.array(
        (
            (-0.062, 0.000, 0.030, 0.062),
            (-0.035, 0.000, 0.036, 0.084),
            (0.000, 0.000, 0.0375, 0.096),
            (0.040, 0.001, 0.039, 0.088),
            (0.085, 0.004, 0.044, 0.069),
            (0.130, 0.006, 0.0485, 0.055),
            (0.165, 0.005, 0.0465, 0.047),
            (0.190, 0.003, 0.038, 0.039),
        )
    )
    toes = [(-0.105, "LeftAnkle"), (-0.150, "LeftToe")]
    upper = loft(
        [(s, ankle[0] + c, 0.026, w, 0.018, top - 0.026) for s, c, w, top in outline],
        SHOE,
        axes,
        caps=(0.012, 0.014),
        roundness=(3.4, 2.15),
        spacing=0.026,
        ring=24,
    )
    sole = loft(
        [(s, ankle[0] + c, 0.009, w + 0.003, 0.009, 0.008) for s, c, w, _ in outline],
        JOINT,
        axes,
        caps=(0.014, 0.017),
        roundness=(7.0, 7.0),
        spacing=0.026,
        ring=24,
    )
    return [part.blend(1, toes) for part in (upper, sole)]
