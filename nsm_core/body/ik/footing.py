"""What feet stand on and swing over where the ground is not flat: rugs and kerbs, steps and low walls."""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import ANKLE_HEIGHT, TOE_HEIGHT
from nsm_core.rotations import Array, heading_to_direction
from nsm_core.world.scene.terrain import Terrain

TIP, MIDDLE, HEEL = 0.075, -0.08, -0.17  # metres from the toe joint along the foot
# A foot stands on the highest ground under it that is not further than this over its sole, metres; else it
# stands beside it.
STEP_IN = 0.12
AHEAD = 0.2  # seconds that a swinging foot looks ahead
CLEAR = 0.02  # metres over an edge
_TOUCHING = 0.04  # metres over the ground that a tip meets before it is against a riser
_LOW_EDGE = 0.01  # the same of low ground, whose heights are known exactly
BEFORE = 0.02  # metres that a tip keeps off a riser
SOON = 0.1  # seconds after which a foot that nears a riser would be in it: it is held back from now on
_BACK = np.arange(0.0, 0.19, 0.01)
# How fast a foot is raised to the low ground that it comes to, and lowered to what it goes down to, m/s; and
# m/s2 and 1/s of that.
_RAISE, _LOWER, _GATHER, _FOLLOW = 1.2, 0.8, 15.0, 15.0


class Footing:
    """The ground under two feet; without terrain it is flat and costs nothing.

    ``terrain`` is all of it, ``low`` what of it the pose that comes in does not know, as ``relief`` says.
    """

    def __init__(self, terrain: Terrain | None = None, low: Terrain | None = None) -> None:
        self.terrain = Terrain() if terrain is None else terrain
        self.low = Terrain() if low is None else low
        self.ground = np.zeros(2)  # height of what each foot stands on, or would
        self.under = np.zeros(2)  # the share of the low ground in that
        self.raised: Array | None = None  # by how much a foot of the pose is raised for it, smoothly
        self._pace = np.zeros(2)
        self.heel = np.zeros(2)  # the same under its heel, where that is lower
        self.over = np.full(2, -np.inf)  # by how much a swinging foot must be raised to clear an edge
        self.stay = np.full(
            2, -np.inf
        )  # by how much a raised foot must stay raised, for there is a step under its tip, ball or heel
        self.pace = np.zeros((2, 2))  # how feet move over the floor, m/s
        self._before: Array | None = None

    def look(
        self,
        toes: Array,
        headings: Array,
        ankle_heights: Array,
        raised: Array,
        locked: tuple[bool, bool],
        dt: float,
    ) -> None:
        """See what is under feet whose toe joints come in at ``toes`` (2, 3), world, the floor plan
        corrected.

        ``headings`` (2,), ``ankle_heights`` (2,) as they come in; ``raised`` (2,) metres by which they are
        corrected so far; a ``locked`` foot keeps its ground.
        """
        if not self.terrain:
            return
        ahead = heading_to_direction(headings)
        ball = toes[:, :2]
        pace = np.zeros((2, 2)) if self._before is None else (ball - self._before) / dt
        self._before, self.pace = ball.copy(), pace
        places = [ball, ball + MIDDLE * ahead, ball + HEEL * ahead, ball + TIP * ahead]
        places += [places[k] + share * AHEAD * pace for k in (0, 3) for share in (0.5, 1.0)]
        heights = self.terrain.height(np.concatenate(places)).reshape(len(places), 2)
        lows = (
            self.low.height(np.concatenate(places)).reshape(len(places), 2)
            if self.low
            else np.zeros_like(heights)
        )
        for side in (0, 1):
            h, sole = heights[:, side], toes[side, 2] - TOE_HEIGHT
            if not locked[side]:
                # What is under the heel alone does not bear: such a foot is brought on until its heel is off
                # it.
                below = h[:2][h[:2] < sole + raised[side] + STEP_IN]
                self.ground[side] = below.max() if len(below) else h[:2].min()
                self.under[side] = min(lows[:2, side].max(), self.ground[side])
            self.heel[side] = min(self.ground[side], h[2])
            low = lows[:, side]
            edge = (
                h.max() > min(self.ground[side], min(h)) + _TOUCHING
                or low.max() > min(self.under[side], min(low)) + _LOW_EDGE
            )
            front, rear = max(h[0], h[3:].max()) - sole, h[2] - (ankle_heights[side] - ANKLE_HEIGHT)
            under = max(h[0], h[3])
            step = under > self.ground[side] + _TOUCHING or max(low[0], low[3]) > self.under[side] + _LOW_EDGE
            self.stay[side] = under - sole + CLEAR if step else -np.inf
            if (
                h[2] > self.ground[side] + _TOUCHING
            ):  # nor does it come down while its heel would land on an edge
                self.stay[side] = max(self.stay[side], rear + CLEAR)
            self.over[side] = max(front, rear) + CLEAR if edge else -np.inf

    @property
    def climbs(self) -> bool:
        """Whether there is ground that is climbed."""
        return len(self.terrain.maps) > len(self.low.maps)

    def raise_to_low(self, level: float, dt: float) -> Array:
        """Metres (2,) by which the feet of a pose that stands on a floor ``level`` metres high are raised to
        their own low ground.
        """
        if not self.low:
            return self.under
        if self.raised is None:  # one starts on the level on which one stands
            self.raised, self.under = np.full(2, level), np.full(2, level)
        gap = self.under - self.raised
        pace = np.clip(_FOLLOW * gap, -_LOWER, _RAISE)
        self._pace += np.clip(pace - self._pace, -2 * _GATHER * dt, _GATHER * dt)
        self.raised = self.raised + np.clip(self._pace * dt, -np.abs(gap), np.abs(gap))
        return self.raised - level

    def off_risers(
        self, side: int, toe: Array, heading: float, sole: float = -np.inf, pace: Array | None = None
    ) -> float:
        """Metres by which a foot whose toe joint is at ``toe`` (2,) must go along ``heading`` so that it is
        in no riser.

        Back (less than 0) from one before its tip, on from one behind its heel.  ``sole`` is how high its
        sole is, world: what is lower is no riser to it; the foot of a leg that moves by ``pace`` (2,), m/s,
        is seen where it is and where it will soon be.
        """
        if not self.terrain:
            return 0.0
        ahead = heading_to_direction(np.array(heading))
        back = self._way_off(side, toe + (TIP + BEFORE) * ahead, -ahead, sole, pace)
        return -back if back else self._way_off(side, toe + (HEEL - BEFORE) * ahead, ahead, sole, None)

    def _way_off(self, side: int, end: Array, way: Array, sole: float, pace: Array | None) -> float:
        """Metres along ``way`` (2,) after which an ``end`` (2,) of a foot is over no riser; 0 where none is
        near enough.
        """
        limit = max(self.ground[side] + _TOUCHING, sole + CLEAR)
        places = end + _BACK[:, None] * way
        if pace is not None:
            places = np.concatenate((places, places + SOON * pace))
        free = self.terrain.height(places) < limit
        if self.low:
            free &= self.low.height(places) < max(self.under[side] + _LOW_EDGE, sole + CLEAR)
        free = free.reshape(-1, len(_BACK)).all(0)
        return float(_BACK[np.argmax(free)]) if free.any() else 0.0
