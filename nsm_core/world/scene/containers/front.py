"""The front of a piece of furniture in a take: a door, a drawer or a slide that a hand opens and shuts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.errors import GoalError
from nsm_core.rotations import Array, quat_from_axis_angle, quat_to_matrix, rotate_planar, wrap_angle
from nsm_core.world.geometry.distance import Cuboids, Union
from nsm_core.world.scene.props import Openable, Prop
from nsm_core.world.scene.wrist import WristPose, wrist_at

from .moving_part import MovingPart

UPRIGHT = 0.98  # cosine to the vertical of an axis that a front in a take turns about, and of level ways
# Share of a door's turn that a hand about its bar goes along with: fingers hook it, and the arm stays.
TURNS_WITH = 0.25
_IN = 0.03  # metres beside a drawer's box, and under it, within which things are in it


@dataclass
class Front(Openable):
    """A ``part`` of furniture whose ``pose`` (4,) is where the frame of the shut part is now: the furniture's
    own, turned or moved along.  ``part.pose`` is the furniture's.
    """

    part: MovingPart = None  # type: ignore[assignment]

    @classmethod
    def of(cls, part: MovingPart, name: str = "", holds: Cuboids | None = None) -> Front:
        """The front that a part is, as open as that is now, under a ``name`` (its own); what it ``holds``, in
        its frame, goes along.  GoalError of what tilts, as lids and flaps do.
        """
        up = abs(float(part.axis[2]))
        if up < UPRIGHT if part.turns else up > 1 - UPRIGHT:
            raise GoalError(
                f"{part.name} opens upwards or downwards, as a lid or a flap does; a hand opens doors on "
                "upright hinges, drawers and slides alone: leave it open, or choose another object."
            )
        query = part.query if holds is None else Union([part.query, holds])
        made = cls(name or part.name, query, part.volume, part.pose, part=part)
        made.pose = made.pose_at(part.opening)
        return made

    @property
    def opening(self) -> float:
        """How far it is open, 0..1."""
        part = self.part
        if part.turns:
            turned = float(wrap_angle(self.pose[3] - part.pose[3])) * np.sign(part.axis[2])
            return float(turned / part.travel)
        along = rotate_planar(part.axis, np.float64(part.pose[3]))
        return float((self.pose[:3] - part.pose[:3]) @ along / part.travel)

    def pose_at(self, opening: float) -> Array:
        """Its pose (4,) when it is open by a share of its travel."""
        part = self.part
        _, shift = part.motion(opening)
        turn = opening * part.travel * float(np.sign(part.axis[2])) if part.turns else 0.0
        return np.append(Prop.to_world(part, shift), part.pose[3] + turn)

    def at(self, opening: float) -> Front:
        """The same front, open by a share of its travel."""
        return Front(self.name, self.query, self.volume, self.pose_at(opening), part=self.part)

    def grip(self, opening: float) -> WristPose:
        """The wrist's pose, world, of a hand at the handle of the front when it is open so far: about the bar
        of a door it turns by ``TURNS_WITH`` of the door's turn.
        """
        held = self.part.grip(opening)
        if not self.part.turns:
            return held
        back = -(1 - TURNS_WITH) * opening * self.part.travel
        turn = quat_to_matrix(quat_from_axis_angle(self.part.axis, back))
        way, thumb = (turn @ ahead for ahead in (held.towards, held.rotation[:, 2]))
        return wrist_at(held.held, way, thumb)

    def carries(self, pose: Array) -> bool:
        """Whether a thing at its ``pose`` (4,) stands in this drawer, and so goes along with it."""
        if self.part.kind != "drawer":
            return False
        foot, v = self.to_local(pose[:3]), self.volume
        off = foot - v.centre
        inside = (np.abs(off[:2]) < v.size[:2] / 2 + _IN).all()
        return bool(inside and -v.size[2] / 2 - _IN < off[2] < v.size[2] / 2)

    def carried(self, pose: Array, opening: float) -> Array:
        """Where what stands in it at ``pose`` (4,) comes to as it opens so far."""
        there, local = self.pose_at(opening), self.to_local(pose[:3])
        return np.append(Prop.to_world(self, local, there), pose[3] + there[3] - self.pose[3])


__all__ = ["Front"]
