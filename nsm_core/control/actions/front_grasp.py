"""A hand that opens or shuts a front of furniture: led to its handle along a planned way, with it as it
moves, off it and back.

The front moves as smoothly as can be and leads; the hand goes with its handle, and what stands in a drawer
goes with that.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from nsm_core.control.goals import Taken
from nsm_core.conventions import FPS
from nsm_core.rotations import Array
from nsm_core.signals import smooth_step
from nsm_core.world.affordances.pulling import Pulling
from nsm_core.world.planning.hand_way import paced
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import LightThing, Prop
from nsm_core.world.scene.wrist import WristPose

from .carried import FASTEST, TAKING_UP
from .hold import Lead, SeenBody
from .led_hand import lead_to
from .thing_grasp import CLOSING, DRAWN

TURN, SLIDE = 1.0, 0.5  # rad/s and m/s of a front at most
LEAST = 20  # frames in which one moves at least


class Pull:
    """One front and the hand that moves it; one call a frame.

    ``state`` is "reach", "take", "move", "leave", "back" and "free" in the end.
    """

    forearms, bears = False, 0.0

    def __init__(self, front: Front, pulling: Pulling, props: Iterable[Prop] = ()) -> None:
        """Things among ``props`` that stand in the front go along with it."""
        self.prop, self.pulling, self.hand = front, pulling, pulling.hand
        self.state = "reach"
        self.errors: dict[str, Any] = {}
        self.leads: list[Lead] = []
        self._things = [p for p in props if isinstance(p, LightThing)]
        self._riding: list[LightThing] = []
        self._weight, self._opening = 0.0, pulling.begin
        self._begin("reach", paced(pulling.to, FASTEST, TAKING_UP))

    @property
    def active(self) -> bool:
        """Whether it still has to be called."""
        return self.state != "free"

    @property
    def left(self) -> bool:
        """Whether the front is where it should be, and the hand off it."""
        return self.state in ("back", "free") and self._done

    def holds(self, hand: int) -> float:
        """How far a hand is led by it, 0..1."""
        return self._weight if hand == self.hand else 0.0

    def touches(self, hand: int) -> bool:
        """Whether a hand is meant to touch the prop, and so is not kept off it."""
        near = self.state in ("take", "move", "leave")
        return hand == self.hand and (near or self._share > 0.6)

    def let_go(self) -> None:
        """End it at any time: the hand returns, and the front stays as far open as it is."""
        if self.state in ("reach", "take", "move", "leave"):
            self._begin("back", self._way[-1:] if self.state == "reach" else self._last.place[None])

    def give_way(self) -> None:
        """Leave the front to another hold of it: this hand only returns."""
        self.let_go()

    def apply(self, seen: SeenBody, root: Array, contacts: Array) -> None:
        """Move the front and lead the hand by one frame."""
        doing, front = self.state, self.prop
        self._frame += 1
        done = self._frame >= len(self._way)
        place = self._way[min(self._frame, len(self._way) - 1)]
        draws = 1 / DRAWN
        self._weight = float(np.clip(self._weight + (-draws if doing == "back" and done else draws), 0, 1))
        if doing == "move":
            self._move(self._shares[min(self._frame, len(self._shares) - 1)])
        wrist = front.grip(self._opening)
        self._last = wrist if doing == "move" else WristPose(np.array(place), wrist.rotation)
        gripped = self._share if doing in ("reach", "back") else 1.0
        closed = doing == "move" or doing in ("take", "leave") and self._frame > CLOSING / 2
        share = float(smooth_step(self._weight))
        self.leads = [lead_to(self.hand, self._last, seen, share, gripped, closed)] if share > 0 else []
        if done:
            self._next()

    @property
    def _done(self) -> bool:
        return abs(self._opening - self.pulling.end) < 1e-6

    @property
    def _share(self) -> float:
        """How far along its way the hand is to the handle, 0..1."""
        if self.state not in ("reach", "back"):
            return 1.0
        share = min(self._frame / max(len(self._way) - 1, 1), 1.0)
        return float(smooth_step(2 * (share if self.state == "reach" else 1 - share)))

    def _begin(self, state: str, way: Array) -> None:
        self.state, self._way, self._frame = state, way, 0

    def _next(self) -> None:
        """Go on to what follows a part that is done."""
        front, pulling = self.prop, self.pulling
        if self.state == "reach":
            self._begin("take", np.repeat(self._way[-1:], CLOSING, 0))
        elif self.state == "take":
            held = front.to_local(front.grip(pulling.begin).place)
            self.errors["taken"] = Taken([self.hand], held[None])
            self._riding = [thing for thing in self._things if front.carries(thing.pose)]
            self._shares = _openings(front, pulling)
            self._begin("move", np.array([front.grip(s).place for s in self._shares]))
        elif self.state == "move":
            self._begin("leave", np.repeat(self._way[-1:], CLOSING, 0))
        elif self.state == "leave":
            self._begin("back", paced(pulling.off, FASTEST, TAKING_UP)[::-1])
        elif self.state == "back" and self._weight <= 0:
            self.state = "free"

    def _move(self, opening: float) -> None:
        front = self.prop
        for thing in self._riding:
            thing.pose[:] = front.carried(thing.pose, opening)
        front.pose[:] = front.pose_at(opening)
        self._opening = opening


def _openings(front: Front, pulling: Pulling) -> Array:
    """Openings (T,) at 30 Hz from the one to the other, at rest at both ends, as smoothly as can be (minimum
    jerk).
    """
    amount = abs(pulling.end - pulling.begin) * front.part.travel
    fastest = TURN if front.part.turns else SLIDE
    count = max(round(1.875 * amount / fastest * FPS), LEAST)
    share = np.linspace(0, 1, count + 1)
    eased = share**3 * (10 - 15 * share + 6 * share**2)
    return np.asarray(pulling.begin + (pulling.end - pulling.begin) * eased)


__all__ = ["Pull"]
