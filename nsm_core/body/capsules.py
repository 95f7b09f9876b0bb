"""The body that is seen, as capsules: what depth inside solids is measured with, in reports and in trials
alike.

``CAPSULES`` are fitted to the bundled mannequin: its surface lies within 1.5 cm of them, standing or bent.
Every end hangs on a joint, so that they serve any proportions; a character with a skin gets capsules of its
own (``fitted``).  Takes are kept out of solids by the same set that measures them.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from nsm_core.rotations import Array, quat_to_matrix
from nsm_core.world.geometry.distance import DistanceQuery

from .contacts import Sole
from .near_spheres import near_spheres
from .skeleton import INDEX, MIRROR, OFFSETS, PARENTS, forward_kinematics
from .tree import HUMAN, Tree


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


def mirrored(c: Capsule) -> Capsule:
    """The same on the other side."""
    names = list(INDEX)
    a, b = (names[MIRROR[INDEX[name]]] for name in (c.a, c.b))
    flip = np.array((-1.0, 1.0, 1.0))
    return c._replace(a=a, b=b, from_a=tuple(flip * c.from_a), from_b=tuple(flip * c.from_b))


MIDDLE = (
    Capsule("Hips", (-0.055, 0.008, -0.02), "Hips", (0.055, 0.008, -0.02), 0.1, 0.1, (0.065, 0.065)),
    Capsule("Neck", (0, -0.003, 0), "Head", (0, 0, 0), 0.051, 0.05),
    Capsule("Head", (0, -0.045, -0.03), "Head", (0, 0.02, 0), 0.052, 0.07),
    Capsule("Head", (0, -0.035, 0.045), "Head", (0, 0.018, 0.05), 0.08, 0.08),
    Capsule("Head", (0, -0.005, 0.04), "Head", (0, 0.002, 0.072), 0.082, 0.082),
)
LEFT = (
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
CAPSULES = (*MIDDLE, *LEFT, *map(mirrored, LEFT))
_ROUGH = 0.03  # metres by which ground, which is right to a cell, may tell of a sphere falsely
_SAMPLE = 0.05  # metres between the spheres that stand for a capsule
# How level thighs are (the height of the knee under the hip, as a share of their length) where a seat begins
# to press them, and where it has pressed them in full.
_RISING, _SEATED = 0.6, 0.3
_SIDES = ("", "Right", "Left")
_WRISTS, _FOREARMS = ("RightWrist", "LeftWrist"), ("RightElbow", "LeftElbow")


class Spheres:
    """The spheres that fill ``CAPSULES``: S places that hang on a joint's frame, or between those of two.

    ``radii`` (S,) and ``pressed`` (S,) metres, full and under a sitter; ``moved`` (S, J) the share of each
    joint's turn that moves a sphere; ``groups`` of neighbours; ``middle`` the sphere nearest to the hips;
    ``hand`` (S,) is 0 for spheres of the right hand, 1 for the left, else -1; ``forearm`` the same; ``foot``
    (S,) tells those of feet; ``names`` tell the joints.
    """

    def __init__(self, capsules: Sequence[Capsule] = CAPSULES, offsets: Array = OFFSETS) -> None:
        rows, radii, pressed, side, moved = [], [], [], [], []
        names: list[str] = []
        joints = len(OFFSETS)
        above, rest = HUMAN.above, rest_joints(offsets)
        for c in capsules:
            a, b = INDEX[c.a], INDEX[c.b]
            for t in np.linspace(0, 1, 2 + int(_length(c, rest) / _SAMPLE)):
                row = np.zeros((joints, 4))
                row[a] += (1 - t) * np.array((1.0, *c.from_a))
                row[b] += t * np.array((1.0, *c.from_b))
                rows.append(row)
                full, thin = (
                    (1 - t) * r[0] + t * r[1] for r in ((c.radius_a, c.radius_b), c.pressed or (0.0, 0.0))
                )
                radii.append(full)
                pressed.append(thin if c.pressed else full)
                side.append(
                    _SIDES.index("Left" if "Left" in c.a + c.b else "Right" if "Right" in c.a + c.b else "")
                )
                moved.append(np.maximum(above[a], t * above[b]))
                names.append(f"{c.a}-{c.b}")
        self._matrix = np.array(rows).reshape(len(rows), -1)  # (S, 4 J): of positions and the axes of frames
        self.radii, self.pressed, self._side = np.array(radii), np.array(pressed), np.array(side)
        self.moved = np.array(moved)
        self.names: list[str] = names
        first = [name.split("-")[0] for name in names]
        self.hand = np.array([_WRISTS.index(n) if n in _WRISTS else -1 for n in first])
        self.forearm = np.array([_FOREARMS.index(n) if n in _FOREARMS else -1 for n in first])
        self.foot = np.array([n.endswith(("Ankle", "Toe")) for n in first])
        self.groups = [np.flatnonzero([n == one for n in first]) for one in dict.fromkeys(first)]
        self.middle = names.index("Hips-Hips")

    def only(self, index: Array) -> Spheres:
        """Those of ``index`` (N,) alone."""
        part = copy(self)
        for name in ("_matrix", "radii", "pressed", "_side", "moved", "hand", "forearm", "foot"):
            setattr(part, name, getattr(self, name)[index])
        part.names = [self.names[k] for k in index]
        first = [name.split("-")[0] for name in part.names]
        part.groups = [np.flatnonzero([n == one for n in first]) for one in dict.fromkeys(first)]
        part.middle = 0
        return part

    def of(self, positions: Array, rotations: Array) -> tuple[Array, Array]:
        """Centres (T, S, 3) world and radii (T, S), metres, of a body with joints at ``positions`` (T, J, 3)
        and world ``rotations`` (T, J, 4).
        """
        count = len(positions)
        frames = np.empty((count, len(OFFSETS), 4, 3))
        frames[:, :, 0] = positions
        frames[:, :, 1:] = np.swapaxes(quat_to_matrix(rotations.astype(np.float64)), -1, -2)
        centres = self._matrix @ frames.reshape(count, -1, 3)
        level = _level(positions)
        share = np.stack([level[side] for side in _SIDES], axis=1)[:, self._side]
        return centres, (1 - share) * self.radii + share * self.pressed


def rest_joints(offsets: Array = OFFSETS) -> Array:
    """Joints (23, 3) of a skeleton in its T-pose, the hips over the origin, metres."""
    turns = np.tile((1.0, 0.0, 0.0, 0.0), (len(OFFSETS), 1))
    offsets = np.asarray(offsets, dtype=np.float64)
    return forward_kinematics(offsets[0], turns, offsets)[0]


def _length(c: Capsule, rest: Array) -> float:
    """Length of a capsule in the T-pose, rounded, so that it has as many spheres whatever a pose's
    arithmetic.
    """
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


SPHERES = Spheres()


@dataclass(frozen=True, eq=False)
class Figure:
    """A character's own body: joint ``offsets`` (23, 3), metres, the ``spheres`` that fill it and the
    ``sole`` that it stands on.
    """

    offsets: Array = field(default_factory=lambda: OFFSETS)
    spheres: Spheres = SPHERES
    sole: Sole = field(default_factory=Sole)

    @cached_property
    def tree(self) -> Tree:
        """The skeleton as the solver sees it."""
        return Tree(PARENTS, np.asarray(self.offsets, dtype=np.float64))

    @cached_property
    def hand(self) -> float:
        """Metres from the wrist to the farthest sphere of the hand."""
        left = self._resting[self.spheres.hand == 1]
        return float(np.linalg.norm(left - rest_joints(self.offsets)[INDEX["LeftWrist"]], axis=1).max())

    @cached_property
    def width(self) -> float:
        """Metres from side to side of head, trunk and pelvis."""
        middle = np.array([n.startswith(("Hips", "Chest", "Neck", "Head")) for n in self.spheres.names])
        middle &= ~np.array(["Shoulder" in n for n in self.spheres.names])
        return 2 * float((self.spheres.radii + self._resting[:, 0])[middle].max())

    @cached_property
    def front(self) -> float:
        """Metres that trunk and pelvis reach ahead of the hip joints."""
        centres = self._resting - rest_joints(self.offsets)[INDEX["LeftHip"]]
        trunk = np.array([n.startswith(("Hips", "Chest")) for n in self.spheres.names])
        return float((self.spheres.radii - centres[:, 1])[trunk].max())

    @cached_property
    def palm(self) -> float:
        """Metres that a hand reaches from the wrist towards what lies before its palm."""
        centres = self._resting - rest_joints(self.offsets)[INDEX["LeftWrist"]]
        return float((self.spheres.radii - centres[:, 2])[self.spheres.hand == 1].max())

    @cached_property
    def little_finger(self) -> float:
        """Metres that a hand reaches from the wrist to the side away from the thumb."""
        centres = self._resting - rest_joints(self.offsets)[INDEX["LeftWrist"]]
        return float((self.spheres.radii + centres[:, 1])[self.spheres.hand == 1].max())

    @cached_property
    def tip(self) -> tuple[Array, float]:
        """The foremost sphere of the toes: its centre (3,) from the toe joint, and its radius, metres."""
        centres = self._resting - rest_joints(self.offsets)[INDEX["LeftToe"]]
        toes = np.flatnonzero([n.startswith("LeftToe") for n in self.spheres.names])
        foremost = toes[(centres[toes, 1] - self.spheres.radii[toes]).argmin()]
        return centres[foremost] * (0, 1, 1), float(self.spheres.radii[foremost])

    @cached_property
    def _resting(self) -> Array:
        """Centres (S, 3) of the spheres in the T-pose, the hips over the origin."""
        still = np.tile((1.0, 0.0, 0.0, 0.0), (1, len(OFFSETS), 1))
        return self.spheres.of(rest_joints(self.offsets)[None], still)[0][0]

    @cached_property
    def seat(self) -> tuple[float, float]:
        """Metres from the hips to the back rest behind and to the seat under a body that is pressed on it."""
        centres = self._resting - rest_joints(self.offsets)[0]
        names = np.array(self.spheres.names)
        pelvis, thigh = names == "Hips-Hips", int(np.flatnonzero(names == "LeftHip-LeftKnee")[0])
        behind = (centres[pelvis, 1] + self.spheres.pressed[pelvis]).max()
        return float(behind), float(self.spheres.pressed[thigh] - centres[thigh, 2])


BUNDLED = Figure()


@dataclass
class Body:
    """Spheres that fill a body over T frames: ``centres`` (T, S, 3) world and ``radii`` (T, S), metres.

    ``hand``, ``forearm`` and ``names`` (S,) as in ``Spheres``; ``hand_size`` times as long as the bundled
    body's hands.
    """

    centres: Array
    radii: Array
    hand: Array
    forearm: Array
    names: list[str]
    hand_size: float = 1.0

    @classmethod
    def of(cls, hips_position: Array, local_rotations: Array, figure: Figure = BUNDLED) -> Body:
        """The body in poses: hips (T, 3) world, rotations (T, 23, 4)."""
        hips, local = hips_position.astype(np.float64), local_rotations.astype(np.float64)
        spheres, offsets = figure.spheres, np.asarray(figure.offsets, dtype=np.float64)
        centres, radii = spheres.of(*forward_kinematics(hips, local, offsets))
        return cls(centres, radii, spheres.hand, spheres.forearm, spheres.names, figure.hand / BUNDLED.hand)


def penetration_depths(
    hips_position: Array, local_rotations: Array, query: DistanceQuery, figure: Figure = BUNDLED
) -> Array:
    """Depth (T,) in metres of the deepest point of the body in each frame, 0 where it touches nothing."""
    body, depth = Body.of(hips_position, local_rotations, figure), np.zeros(len(hips_position))

    def distance(_: Array, points: Array, reach: float) -> Array:
        return query.signed_distance(points.astype(np.float32), reach)

    frames, index = near_spheres(distance, body.centres, body.radii, figure.spheres, _ROUGH)
    if len(frames):
        radii = body.radii[frames, index]
        away = distance(frames, body.centres[frames, index], float(radii.max()) + 0.02)
        np.maximum.at(depth, frames, radii - away)
    return depth
