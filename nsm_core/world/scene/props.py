"""Things that a character moves: a box that follows its hands, the leaf of a door that turns about its hinge.

A prop stays upright: its pose is x, y, z and a heading.  Data and takes place hands by the same functions,
but on boxes that are too large to be held as in the data.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from nsm_core.distances import (
    BODY_TO_BOX,
    BOX_READS,
    WRIST_BEHIND,
    WRIST_BELOW,
    WRIST_OFF_HANDLE,
    WRIST_OFF_SIDE,
)
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, rotate_planar, wrap_angle
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.sensors.interaction import InteractionVolume, interaction_sensor

# Of a box in takes, too tall or deep to be held as in the data: how far the wrists are under its top and
# behind its near face at most, metres.
GRIP_UNDER_TOP, GRIP_IN = 0.22, 0.11


@dataclass
class Prop:
    """A thing with a frame of its own that moves as a whole.

    ``query`` its solids and ``volume`` its sensor reading, both in its own frame; ``pose`` (4,): x, y, z
    (metres) and heading (radians) of that frame in the world now.
    """

    name: str
    query: DistanceQuery
    volume: InteractionVolume
    pose: Array

    def __post_init__(self) -> None:
        """Keep a copy of the pose as float64; GoalError where it is not finite."""
        self.pose = np.array(self.pose, dtype=np.float64)
        if self.pose.shape != (4,) or not np.isfinite(self.pose).all():
            raise GoalError(f"{self.name} has no usable place; clear its transform and place it anew.")

    def to_world(self, points: ArrayLike, pose: Array | None = None) -> Array:
        """Points (..., 3) of the prop's frame in the world, at its present pose or another (4,)."""
        pose = self.pose if pose is None else pose
        return rotate_planar(np.asarray(points, dtype=np.float64), np.float64(pose[3])) + pose[:3]

    def to_local(self, points: ArrayLike, pose: Array | None = None) -> Array:
        """World points (..., 3) in the prop's frame."""
        pose = self.pose if pose is None else pose
        return rotate_planar(np.asarray(points, dtype=np.float64) - pose[:3], np.float64(-pose[3]))

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32 of world ``points`` (N, 3) to the prop where it is now; see
        ``DistanceQuery``.
        """
        return self.query.signed_distance(self.to_local(points).astype(np.float32), max_distance)

    @property
    def reach(self) -> float:
        """Metres on the floor from its place within which all of it lies."""
        v = self.volume
        return float(np.linalg.norm(v.centre[:2]) + np.linalg.norm(v.size[:2]) / 2)

    def sensed(self) -> InteractionVolume:
        """The interaction sensor's reading where the prop is now: it moves with the prop."""
        v = self.volume
        return InteractionVolume(
            self.to_world(v.centre).astype(np.float32), v.size, float(v.heading + self.pose[3]), v.occupancy
        )


def sense(query: DistanceQuery, low: Array, high: Array) -> InteractionVolume:
    """Read the interaction sensor over the box from ``low`` to ``high`` (3,) of a prop's own frame."""
    low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    return interaction_sensor(query, (low + high) / 2, high - low, 0.0)


@dataclass
class Box(Prop):
    """A thing to carry; its frame lies at the centre of its bounding box of ``size`` (3,), metres.

    ``shown`` (3,) metres by which it is shown to the network beside its place: a box that one leans to is
    shown as far off as one that is not leant to, and lean and arms do the rest.  ``off`` and ``palm``:
    metres by which body and wrists of its carrier keep further off it than those of the bundled body.
    ``mass`` kilograms, 0 weighs nothing.
    """

    size: Array = None  # type: ignore[assignment]
    shown: Array = field(default_factory=lambda: np.zeros(3))
    off: float = 0.0
    palm: float = 0.0
    mass: float = 0.0

    def sensed(self) -> InteractionVolume:
        """The interaction sensor's reading: hands hold the bounding box, so a bin or a basket reads as one
        that is full.
        """
        read = super().sensed()
        centre = (read.centre + self.shown).astype(np.float32)
        return replace(read, centre=centre, occupancy=np.full_like(self.volume.occupancy, BOX_READS))

    def across(self, facing: float) -> tuple[float, float]:
        """Width and depth as seen by a carrier whose heading is ``facing`` in the box's frame (a multiple of
        90 degrees).
        """
        sideways = abs(np.sin(facing)) > 0.5
        return (
            (float(self.size[1]), float(self.size[0]))
            if sideways
            else (float(self.size[0]), float(self.size[1]))
        )

    def grasps(self, facing: float) -> Array:
        """Places (2, 3) of the right and the left wrist, box frame, for a carrier of heading ``facing`` in
        that frame.

        Large boxes are held higher and nearer their front than in the data: the network is shown them
        ``raised`` for that.
        """
        return self._places(facing, max(WRIST_BEHIND, self.across(facing)[1] / 2 - GRIP_IN), self.grip_height)

    def learned_grasps(self, facing: float) -> Array:
        """Places (2, 3) as ``grasps``, where all bodies of the data hold boxes, and so the network's hands on
        the one it is shown.
        """
        return self._places(facing, WRIST_BEHIND, -WRIST_BELOW * float(self.size[2]))

    def _places(self, facing: float, behind: float, height: float) -> Array:
        places = [
            (sign * (self.across(facing)[0] / 2 + WRIST_OFF_SIDE + self.palm), behind, height)
            for sign in (-1.0, 1.0)
        ]
        return rotate_planar(np.array(places), np.float64(facing))

    @property
    def grip_height(self) -> float:
        """Metres from its centre up to where wrists hold it."""
        return max(-WRIST_BELOW * float(self.size[2]), float(self.size[2]) / 2 - GRIP_UNDER_TOP)

    @property
    def raised(self) -> Array:
        """How much (3,) higher it is shown, so that the network's hands come to where a tall box is held."""
        return np.array((0.0, 0.0, self.grip_height + WRIST_BELOW * float(self.size[2])))

    def stand_off(self, facing: float) -> float:
        """Metres from the box's centre to the root of a carrier of heading ``facing`` in its frame."""
        return self.across(facing)[1] / 2 + BODY_TO_BOX


@dataclass
class LightThing(Prop):
    """A light thing that one hand holds; it stays upright, and its frame lies under the middle of its foot.

    ``low``, ``high`` (3,) corners of its bounding box, own frame; ``mass`` kilograms; ``handle`` (2, 3) the
    corners of a box around its handle, own frame, None without.
    """

    low: Array = None  # type: ignore[assignment]
    high: Array = None  # type: ignore[assignment]
    mass: float = 0.0
    handle: Array | None = None

    @property
    def size(self) -> Array:
        """Size (3,) of its bounding box, metres."""
        return self.high - self.low

    @property
    def middle(self) -> Array:
        """The middle (3,) of its bounding box, world."""
        return self.to_world((self.low + self.high) / 2)

    def put(self, pose: Array) -> LightThing:
        """The same thing at another ``pose`` (4,)."""
        return replace(self, pose=pose)


@dataclass
class Openable(Prop):
    """What a hand opens: the leaf of a door, or a front of furniture."""


@dataclass
class Leaf(Openable):
    """The leaf of a door; its frame lies on the floor under the hinge, +X towards the free edge when closed.

    ``width`` metres from hinge to free edge; ``handle`` (3,) own frame, on the leaf's middle plane;
    ``thickness`` metres between the places where a hand holds the handle from either side; ``swing`` +1 or
    -1: the sense in which the heading changes as it opens; ``closed`` its heading when shut; ``upright``
    tells that its handle is a bar that stands.
    """

    width: float = 0.85
    handle: Array = None  # type: ignore[assignment]
    thickness: float = 0.12
    swing: float = 1.0
    closed: float = 0.0
    upright: bool = False

    @property
    def angle(self) -> float:
        """How far it is open, radians, 0 when closed."""
        return float(self.swing * wrap_angle(self.pose[3] - self.closed))

    def pose_at(self, angle: float) -> Array:
        """Its pose (4,) when open by ``angle``."""
        return np.append(self.pose[:3], self.closed + self.swing * angle)

    def grip(self, side: float, angle: float | None = None) -> Array:
        """World place (3,) of a wrist at the handle on the side towards +Y (``side`` 1) or -Y (-1) of its
        frame, when open by ``angle``.
        """
        point = np.asarray(self.handle, dtype=np.float64) + (
            0.0,
            side * (self.thickness / 2 + WRIST_OFF_HANDLE),
            0.0,
        )
        return self.to_world(point, None if angle is None else self.pose_at(angle))
