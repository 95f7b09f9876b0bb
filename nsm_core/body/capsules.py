"""The body that is seen, as capsules: what depth inside solids is measured with, in reports and in trials
alike.

They are fitted to the bundled mannequin: its surface lies within 1.5 cm of them, standing or bent.  Every end
hangs on a joint of its own, so that a character of other proportions has a body of its own.  (The hands' and
legs' corrections during a take keep the clearances that they need; this set is for measuring alone.)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from nsm_core.rotations import Array, quat_rotate
from nsm_core.world.geometry.distance import DistanceQuery

from .skeleton import INDEX, MIRROR, OFFSETS, forward_kinematics


class Capsule(NamedTuple):
    """Two ends, each a joint and a place (3,) from it in the T-pose, and a radius at each; metres.

    ``pressed`` are the radii of what gives way under a sitter, who touches the seat and is not inside it.
    """

    a: str
    from_a: tuple[float, float, float]
    b: str
    from_b: tuple[float, float, float]
    radius_a: float
    radius_b: float
    pressed: tuple[float, float] | None = None


def _mirrored(c: Capsule) -> Capsule:
    """The same on the other side."""
    names = list(INDEX)
    a, b = (names[MIRROR[INDEX[name]]] for name in (c.a, c.b))
    flip = np.array((-1.0, 1.0, 1.0))
    return c._replace(a=a, b=b, from_a=tuple(flip * c.from_a), from_b=tuple(flip * c.from_b))


_MIDDLE = (
    Capsule("Hips", (-0.055, 0.008, -0.02), "Hips", (0.055, 0.008, -0.02), 0.1, 0.1, (0.065, 0.065)),
    Capsule("Neck", (0, -0.003, 0), "Head", (0, 0, 0), 0.051, 0.05),
    Capsule("Head", (0, -0.045, -0.03), "Head", (0, 0.02, 0), 0.052, 0.07),
    Capsule("Head", (0, -0.035, 0.045), "Head", (0, 0.018, 0.05), 0.08, 0.08),
    Capsule("Head", (0, -0.005, 0.04), "Head", (0, 0.002, 0.072), 0.082, 0.082),
)
_LEFT = (
    Capsule("Hips", (0.045, 0.006, 0.04), "Chest2", (0.045, -0.003, 0), 0.09, 0.092),
    Capsule("Chest2", (0.045, -0.003, 0), "Chest3", (0.052, -0.005, 0.06), 0.092, 0.112),
    Capsule("Chest3", (0.052, -0.005, 0.06), "Chest4", (0.055, 0, 0.02), 0.112, 0.107),
    Capsule("Chest4", (0.05, 0.003, 0.03), "Chest4", (0.03, 0.006, 0.075), 0.095, 0.066),
    Capsule("Chest4", (0.07, 0.006, 0.06), "LeftShoulder", (0, 0, 0), 0.068, 0.0535),
    Capsule("LeftShoulder", (0, 0, 0), "LeftElbow", (0, 0, 0), 0.0535, 0.04),
    Capsule("LeftElbow", (0, 0, 0), "LeftWrist", (0, 0, 0), 0.043, 0.027),
    Capsule("LeftWrist", (0.02, -0.02, 0), "LeftWrist", (0.15, -0.022, -0.012), 0.022, 0.013),
    Capsule("LeftWrist", (0.02, 0.016, 0), "LeftWrist", (0.15, 0.024, -0.014), 0.022, 0.013),
    Capsule("LeftWrist", (0.036, -0.026, -0.006), "LeftWrist", (0.085, -0.057, -0.02), 0.015, 0.014),
    Capsule("LeftHip", (0, -0.008, 0), "LeftKnee", (0, -0.002, 0.02), 0.076, 0.05, (0.04, 0.05)),
    Capsule("LeftKnee", (0, 0, 0), "LeftKnee", (0, 0.012, -0.15), 0.051, 0.054),
    Capsule("LeftKnee", (0, 0.012, -0.15), "LeftAnkle", (0, 0.003, 0.02), 0.054, 0.035),
    Capsule("LeftAnkle", (0, 0.005, 0), "LeftAnkle", (0, -0.06, -0.035), 0.04, 0.036),
    *(
        Capsule(
            "LeftAnkle",
            (s * 0.007, 0.04, -0.048),
            "LeftAnkle",
            (s * 0.026 + 0.004, -0.115, -0.055),
            0.037,
            0.03,
        )
        for s in (-1, 1)
    ),
    *(
        Capsule(
            "LeftToe",
            (s * 0.026 + 0.005, 0, 0.002),
            "LeftToe",
            (s * 0.02 + 0.003, -0.05, -0.005),
            0.027,
            0.02,
        )
        for s in (-1, 1)
    ),
)
CAPSULES = (*_MIDDLE, *_LEFT, *map(_mirrored, _LEFT))
_SAMPLE = 0.05  # metres between the spheres that stand for a capsule
# How level thighs are (the height of the knee under the hip, as a share of their length) where a seat begins
# to press them, and where it has pressed them in full.
_RISING, _SEATED = 0.6, 0.3
_WRISTS, _FOREARMS = ("RightWrist", "LeftWrist"), ("RightElbow", "LeftElbow")


@dataclass
class Body:
    """Spheres that fill a body over T frames: ``centres`` (T, S, 3) world and ``radii`` (T, S), metres.

    ``hand`` (S,) is 0 for spheres of the right hand, 1 for the left, else -1; ``forearm`` the same.
    ``names`` (S,) tells the joints between which each lies.
    """

    centres: Array
    radii: Array
    hand: Array
    forearm: Array
    names: list[str]

    @classmethod
    def of(cls, hips_position: Array, local_rotations: Array, offsets: Array = OFFSETS) -> Body:
        """The body in poses: hips (T, 3) world, rotations (T, 23, 4), ``offsets`` (23, 3) of the character's
        joints.
        """
        hips, local = hips_position.astype(np.float64), local_rotations.astype(np.float64)
        positions, rotations = forward_kinematics(hips, local, np.asarray(offsets, dtype=np.float64))
        level = _level(positions)
        centres, radii, hand, forearm, names = [], [], [], [], []
        for c in CAPSULES:
            ends = []
            for joint, place in ((c.a, c.from_a), (c.b, c.from_b)):
                away = np.broadcast_to(np.array(place, dtype=np.float64), hips.shape)
                ends.append(positions[:, INDEX[joint]] + quat_rotate(rotations[:, INDEX[joint]], away))
            side = "Left" if "Left" in c.a + c.b else "Right" if "Right" in c.a + c.b else ""
            pressed = level[side] if c.pressed else np.zeros(len(hips))
            for t in np.linspace(0, 1, 2 + int(_length(c) / _SAMPLE)):
                full, thin = (
                    (1 - t) * r[0] + t * r[1] for r in ((c.radius_a, c.radius_b), c.pressed or (0.0, 0.0))
                )
                centres.append((1 - t) * ends[0] + t * ends[1])
                radii.append((1 - pressed) * full + pressed * thin)
                hand.append(_WRISTS.index(c.a) if c.a in _WRISTS else -1)
                forearm.append(_FOREARMS.index(c.a) if c.a in _FOREARMS else -1)
                names.append(f"{c.a}-{c.b}")
        return cls(
            np.stack(centres, axis=1), np.stack(radii, axis=1), np.array(hand), np.array(forearm), names
        )


@cache
def _length(c: Capsule) -> float:
    """Length of a capsule in the T-pose, rounded, so that it has as many spheres whatever a pose's
    arithmetic.
    """
    rest = forward_kinematics(
        OFFSETS[0].astype(np.float64), np.tile((1.0, 0, 0, 0), (len(OFFSETS), 1)), OFFSETS.astype(np.float64)
    )[0]
    return round(float(np.linalg.norm(rest[INDEX[c.b]] + c.from_b - rest[INDEX[c.a]] - c.from_a)), 3)


def _level(positions: Array) -> dict[str, Array]:
    """How far (T,) a seat may press the thighs, 0..1, by the side's name; "" for the pelvis, which takes
    both.
    """
    level = {}
    for side in ("Right", "Left"):
        thigh = positions[:, INDEX[f"{side}Knee"]] - positions[:, INDEX[f"{side}Hip"]]
        drop = -thigh[:, 2] / np.maximum(np.linalg.norm(thigh, axis=-1), 1e-6)
        level[side] = np.clip((_RISING - drop) / (_RISING - _SEATED), 0, 1)
    return {**level, "": np.minimum(level["Right"], level["Left"])}


def penetration_depths(
    hips_position: Array, local_rotations: Array, query: DistanceQuery, offsets: Array = OFFSETS
) -> Array:
    """Depth (T,) in metres of the deepest point of the body in each frame, 0 where it touches nothing."""
    body = Body.of(hips_position, local_rotations, offsets)
    reach = float(body.radii.max(initial=0.0)) + 0.02
    distance = query.signed_distance(body.centres.reshape(-1, 3).astype(np.float32), reach).reshape(
        body.radii.shape
    )
    return np.maximum(0, body.radii - distance).max(axis=1)
