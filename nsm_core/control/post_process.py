"""From the network's pose to the one that is kept: feet, hips, trunk and hands meet the scene, and props
follow the hands.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from nsm_core.body.ik.foot_plant import ContactIK, SeatTarget
from nsm_core.body.ik.hand_clearance import HandClearance
from nsm_core.body.ik.heels import Heels
from nsm_core.body.ik.leg_clearance import LegClearance
from nsm_core.body.ik.leg_paths import LegPaths
from nsm_core.body.ik.reaching import Pose
from nsm_core.body.ik.toe_clearance import ToeClearance
from nsm_core.body.ik.trunk_clearance import TrunkClearance
from nsm_core.conventions import CLIMB, SIT
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import Union
from nsm_core.world.scene.solids import Scene
from nsm_core.world.scene.terrain import Floor, Terrain

from .actions.base import Grasp
from .actions.box_grasp import Carrying
from .goals import Moment


class Finishing:
    """Corrects one character's poses, one call a frame; with ``ik`` False only props move."""

    def __init__(
        self, scene: Scene, ik: bool = True, terrain: Terrain | None = None, low: Terrain | None = None
    ) -> None:
        """``terrain`` and ``low`` as in ``ContactIK``."""
        self.scene, self.ik = scene, ik
        self._terrain, self._floor = terrain, Floor(low)
        self._locked: list[Any] = []
        self._contact = ContactIK(terrain=terrain, low=low)
        self._heels, self._legs = Heels(), LegClearance(scene.environment, terrain)
        self._toes = ToeClearance()
        self._trunk, self._hands = TrunkClearance(scene.environment), HandClearance(scene.environment)

    def apply(
        self,
        hips: Array,
        rotations: Array,
        moment: Moment,
        seat: SeatTarget | None,
        grasps: Sequence[Grasp],
        level: float = 0.0,
    ) -> tuple[Array, Array]:
        """Return new hips (3,) and local rotations (23, 4) and move the props in hand.

        ``hips``, ``rotations`` and ``moment`` are the network's of this frame, on a floor at the height
        ``level``; ``seat`` what is sat on, ``grasps`` the hands at work on props.
        """
        kept_hips, kept = hips, rotations
        if self.ik:
            kept_hips, kept = self._contact.apply(
                hips, rotations, moment.contacts, seat, moment.heading, level
            )
            low = any(isinstance(g, Carrying) and g.low for g in grasps)
            self._legs.query = self.scene.but() if low else self.scene.environment
            kept_hips, kept = self._legs.apply(
                kept_hips, kept, max(float(moment.style[CLIMB]), float(low)), self._contact.locked
            )
            carries = self._toes.back.any() or any(isinstance(g, Carrying) for g in grasps)
            kept = self._toes.apply(kept_hips, kept, self.scene.but() if carries else None)
            kept = self._heels.apply(kept_hips, kept, float(moment.style[SIT]), seat[0] if seat else None)
            self._trunk.query = self.scene.but(*(g.prop for g in grasps))
            kept = self._trunk.apply(kept_hips, kept, float(moment.style[SIT]))
        if grasps:
            pose = Pose(kept_hips.astype(np.float64), kept.astype(np.float64), moment.wrists)
            for grasp in grasps:
                grasp.apply(pose, moment.root.astype(np.float64), moment.contacts)
            kept_hips, kept = pose.hips.astype(hips.dtype), pose.local.astype(rotations.dtype)
        if self.ik:
            held = tuple(max((g.holds(side) for g in grasps), default=0.0) for side in (0, 1))
            solids = (self.scene.but(*(g.prop for g in grasps if g.touches(side))) for side in (0, 1))
            right, left = (Union((s, self._floor)) for s in solids)
            kept = self._hands.apply(kept_hips, kept, held, (right, left) if grasps else (right, right))
        self._locked.append(self._contact.locked)
        return kept_hips, kept

    def clear_legs(self, hips: Array, rotations: Array, climbing: Array) -> Iterator[None]:
        """Bend the ways of the legs of the newest T frames, in place, where a climber's still are in
        something; see ``LegPaths``.

        ``hips`` (T, 3) and ``rotations`` (T, 23, 4) as ``apply`` has returned them, ``climbing`` (T,) the
        climb label.
        """
        if self.ik:
            locked = np.array(self._locked[-len(hips) :])
            yield from LegPaths(self.scene.environment, self._terrain).clear(
                hips, rotations, locked, climbing
            )
