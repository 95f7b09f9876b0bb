"""A light thing in one hand: led to it along a planned way, out with it, before the body while one walks, to
its place, and back.

The thing stays upright and leads, the wrist goes with it; all that is noted is where the hand is to be.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nsm_core.control.goals import Taken
from nsm_core.conventions import DT
from nsm_core.rotations import (
    Array,
    rotate_planar,
    wrap_angle,
)
from nsm_core.signals import smooth_step
from nsm_core.world.affordances.picking import Picking
from nsm_core.world.affordances.reach import LEFT, RIGHT
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.hand_way import paced
from nsm_core.world.scene.props import LightThing
from nsm_core.world.scene.wrist import WristPose

from .carried import FASTEST, KEEPS, LADEN, TAKING_UP, beside, carried, held_aside, in_world, over
from .hold import Lead, SeenBody
from .led_hand import lead_to

DRAWN = 20  # frames in which a hand is drawn onto its way, and given back
CLOSING = 8  # frames for which a hand stays where it takes or leaves a thing
# Metres from where a thing was taken, and from where it is left, over which it comes before the body and off.
LEAVES, COMES = (0.15, 0.6), (0.12, 0.5)
# Radians by which one has turned from where it was taken, and is still to turn to where it is left, over
# which the same happens.
TURNS_OFF, TURNS_ON = (np.radians(5), np.radians(40)), (np.radians(50), np.radians(20))
# Metres by which what is held is drawn to the body at most to keep off what stands about, and in a frame.
DRAWN_IN, DRAWS = 0.18, 0.02
RISES = 0.012  # metres in a frame by which it is raised over what stands about
# Metres and radians off the beginning of its way in at which it goes that way, and frames that it waits.
SETTLED, STRAIGHT, SETTLES = 0.015, np.radians(3), 30
# Share of the way of the hips, up and down, that what is held goes along with, and metres at most.
BOBS, MOST_BOB = 0.7, 0.04
# Share of what the body goes down by that what is held goes along with, and how fast, m/s.
GOES_DOWN, LOWERS = 0.6, 0.8
_GRAVITY = 9.81


class Holding:
    """One thing and the hand that takes it, brings it and leaves it; one call a frame.

    ``state`` is "reach", "take", "out", "carry" until ``put_down``, then "in", "leave" and "back"; "free" in
    the end, or "falling" where it was let go in the air.
    """

    forearms = False

    def __init__(
        self, thing: LightThing, picking: Picking, solids: DistanceQuery, wide: bool = False
    ) -> None:
        """``solids`` are what the thing falls onto where it is let go; ``wide``: the other hand carries
        something as well.
        """
        self.prop, self.picking, self.hand, self.solids = thing, picking, picking.hand, solids
        self.state = "reach"
        self.errors: dict[str, Any] = {}
        self.leads: list[Lead] = []
        self._side = (RIGHT, LEFT)[picking.hand]
        self.comes = not wide  # whether it is on its way to where it is put down
        self.low = 0.0  # metres that the body goes down, for what the other hand comes to
        self._lower = 0.0
        found = held_aside(picking, thing, solids) if wide else None
        self._aside = found is not None
        self._held_at = carried(picking) if found is None else found
        self._taken_at = beside(picking.pick, picking.at)
        self._left_at = beside(picking.put, picking.pose)
        for pose in (self._taken_at, self._left_at):
            pose[2] = max(pose[2], self._held_at[2])
        self._gone = self._come = 0.0  # how far, 0..1, from where it was taken, and to where it is left
        self._off = np.zeros(4)  # of the thing, from where it is to be; fades
        self._hips: float | None = None
        self._fall, self._weight = 0.0, 0.0
        self._drawn, self._due = 0.0, -1  # metres drawn to the body; frames that it waits to be put down
        self._over = 0.0  # metres raised over what stands about
        self._last = picking.pick.wrist
        self._begin("reach", paced(picking.pick.empty, FASTEST, TAKING_UP))

    @property
    def active(self) -> bool:
        """Whether it still has to be called."""
        return self.state != "free"

    @property
    def bears(self) -> float:
        """Kilograms that its hand bears."""
        return self.prop.mass if self.state in ("out", "carry", "in") else 0.0

    @property
    def carries(self) -> bool:
        """Whether the thing is in its hand, and not being put down."""
        return self.state in ("out", "carry")

    @property
    def puts(self) -> bool:
        """Whether it is putting the thing down, or has done so."""
        return self.state in ("in", "leave") or "position_error_cm" in self.errors

    @property
    def brought(self) -> bool:
        """Whether the thing is before the body, so that one may go."""
        return self.state == "carry" and self._frame >= TAKING_UP

    @property
    def left(self) -> bool:
        """Whether the thing stands and the hand has come away from it, out of what it stands in."""
        gone = self.state == "free" or self.state == "back" and self._frame >= len(self._way)
        return gone and "position_error_cm" in self.errors

    def holds(self, hand: int) -> float:
        """How far a hand is led by it, 0..1."""
        return self._weight if hand == self.hand else 0.0

    def touches(self, hand: int) -> bool:
        """Whether a hand is meant to touch the prop, and so is not kept off it."""
        near = self.state in ("take", "out", "carry", "in", "leave")
        return hand == self.hand and (near or self.state == "reach" and self._share > 0.6)

    def put_down(self) -> None:
        """Bring the thing to its place, as soon as who has come there stands still."""
        self._due = 0

    def _go_in(self) -> None:
        """Begin the way to its place once the thing is where that begins, or has been waited for."""
        off = self.prop.pose - self._placed(self.picking.put.laden[0])
        self._due += 1
        if np.hypot(*off[:2]) < SETTLED and abs(wrap_angle(off[3])) < STRAIGHT or self._due > SETTLES:
            self._begin("in", paced(self.picking.put.laden, LADEN, TAKING_UP))
            off[3] = wrap_angle(off[3])
            self._off = off

    def let_go(self) -> None:
        """End it at any time: the hand returns, and a thing in the air falls."""
        if self.state in ("out", "carry", "in"):
            self._begin("falling", self._way[-1:])
            self._fall = 0.0
        elif self.state in ("reach", "take", "leave"):
            self._begin("back", self._way[-1:])

    def give_way(self) -> None:
        """Leave the thing to another hold of it: this hand only returns."""
        if self.state != "free":
            self._begin("back", self._way[-1:])

    def apply(self, seen: SeenBody, root: Array, contacts: Array) -> None:
        """Move the thing and lead the hand by one frame; ``root`` (3,)."""
        doing = self.state
        self._frame += 1
        place = self._way[min(self._frame, len(self._way) - 1)]
        done = self._frame >= len(self._way)
        draws = DT / (DRAWN * DT)
        returns = doing in ("back", "falling") and done
        self._weight = float(np.clip(self._weight + (-draws if returns else draws), 0, 1))
        fade = 1 - float(smooth_step(self._frame / TAKING_UP))
        if doing == "out":
            self.prop.pose[:3] = self._from[:3] + place - self._way[0]
        elif doing == "carry":
            self._carry(root, float(seen.hips[2]))
        elif doing == "in":
            self.prop.pose[:] = self._placed(place) + fade * self._off
        elif doing == "falling":
            self._drop()
        rotation = self.picking.pick.wrist.rotation
        if doing in ("out", "carry", "in"):
            wrist = self.picking.wrist(self.prop.pose)
            place, rotation = wrist.place, wrist.rotation
        elif doing in ("leave", "back", "falling"):
            rotation = self._last.rotation
        self._last = WristPose(np.array(place), rotation)
        gripped = self._share if doing in ("reach", "back") else 1.0
        share = float(smooth_step(self._weight))
        closed = doing in ("out", "carry", "in") or doing in ("take", "leave") and self._frame > CLOSING / 2
        self.leads = [lead_to(self.hand, self._last, seen, share, gripped, closed)] if share > 0 else []
        if doing == "carry" and self._due >= 0:
            self._go_in()
        elif done:
            self._next(root, float(seen.hips[2]))

    @property
    def _share(self) -> float:
        """How far along its way the hand is to the thing, 0..1."""
        share = min(self._frame / max(len(self._way) - 1, 1), 1.0)
        return float(smooth_step(2 * (share if self.state == "reach" else 1 - share)))

    def _begin(self, state: str, way: Array) -> None:
        self.state, self._way, self._frame, self._from = state, way, 0, self.prop.pose.copy()

    def _next(self, root: Array, hips: float) -> None:
        """Go on to what follows a part that is done."""
        pick, put = self.picking.pick, self.picking.put
        if self.state == "reach":
            self._begin("take", np.repeat(self._way[-1:], CLOSING, 0))
        elif self.state == "take":
            self.errors["taken"] = Taken([self.hand], self.prop.to_local(pick.wrist.place)[None])
            self._begin("out", paced(pick.laden, LADEN, TAKING_UP)[::-1])
        elif self.state == "out":
            self._hips = hips
            self._off = self._seen_by(root) - self._taken_at
            self._off[3] = wrap_angle(self._off[3])
            self._begin("carry", np.repeat(self._way[-1:], TAKING_UP, 0))
        elif self.state == "in":
            self._begin("leave", np.repeat(self._way[-1:], CLOSING, 0))
        elif self.state == "leave":
            off = self.prop.pose - self.picking.pose
            self.errors |= {
                "position_error_cm": 100 * float(np.linalg.norm(off[:3])),
                "rotation_error_deg": float(np.degrees(abs(wrap_angle(off[3])))),
            }
            self._begin("back", paced(put.empty, FASTEST, TAKING_UP)[::-1])
        elif self.state in ("back", "falling") and self._weight <= 0:
            self.state = "free"

    def _placed(self, wrist: Array) -> Array:
        """The thing's pose (4,) with its hand at a place (3,) of the way to where it is put down."""
        pose = self.picking.pose.copy()
        pose[:3] += wrist - self.picking.put.wrist.place
        return pose

    def _carry(self, root: Array, hips: float) -> None:
        """Hold the thing before the body, and as it was or will be held where it is taken and left."""
        (off, away), (on, aside) = (
            (float(np.linalg.norm(root[:2] - reach.place)), abs(float(wrap_angle(root[2] - reach.heading))))
            for reach in (self.picking.pick.reach, self.picking.put.reach)
        )
        step = 1 / TAKING_UP
        gone = float(np.clip(max(_share(off, LEAVES), _share(away, TURNS_OFF)), self._gone, 1))
        if self._aside:
            gone = 1.0
        come = min(_share(on, COMES[::-1]), _share(aside, TURNS_ON))
        come = float(np.clip(come, self._come, 1)) if gone > 0 and self.comes else self._come
        self._gone, self._come = min(gone, self._gone + step), min(come, self._come + step)
        held = self._held_at.copy()
        self._lower += float(np.clip(GOES_DOWN * self.low - self._lower, -LOWERS * DT, LOWERS * DT))
        if not self._aside:
            held[:2] *= 1 - self._drawn_in(root, held)
        held[2] += float(np.clip(BOBS * (hips - (self._hips or hips)), -MOST_BOB, MOST_BOB))
        for pose, share in ((self._taken_at, 1 - self._gone), (self._left_at, self._come)):
            way = pose - held
            way[3] = wrap_angle(way[3])
            held += float(smooth_step(share)) * way
        held[2] -= self._lower
        held += (1 - float(smooth_step(self._frame / TAKING_UP))) * self._off
        there = in_world(held, root)
        self._over += float(np.clip(over(self.prop.put(there), self.solids) - self._over, -RISES, RISES))
        there[2] += self._over
        turned = self.prop.pose[3] + wrap_angle(there[3] - self.prop.pose[3])
        self.prop.pose[:] = np.append(there[:3], turned)

    def _drawn_in(self, root: Array, held: Array) -> float:
        """Share of its way from the body by which what is ``held`` (4,), seen from the root, is nearer to it,
        so that it can be turned with the body whichever way among what stands about.
        """
        heights = held[2] + np.linspace(0.0, float(self.prop.size[2]), 4)
        about = np.column_stack((np.tile(root[:2], (4, 1)), heights)).astype(np.float32)
        far = float(np.linalg.norm(held[:2]))
        reach = far + float(self.prop.size[:2].max()) / 2 + KEEPS
        lack = reach - float(self.solids.signed_distance(about, reach).min())
        wanted = float(np.clip(lack, 0.0, min(DRAWN_IN, far)))
        self._drawn += float(np.clip(wanted - self._drawn, -DRAWS, DRAWS))
        return self._drawn / max(far, 1e-6)

    def _seen_by(self, root: Array) -> Array:
        """The thing's pose (4,) seen from a body at ``root`` (3,)."""
        place = rotate_planar(self.prop.pose[:3] - (root[0], root[1], 0.0), np.float64(-root[2]))
        return np.append(place, wrap_angle(self.prop.pose[3] - root[2]))

    def _drop(self) -> None:
        """Let the thing fall upright onto what is under it."""
        self._fall += _GRAVITY * DT
        pose = self.prop.pose
        corners = np.array([(x, y) for x in (-0.4, 0, 0.4) for y in (-0.4, 0, 0.4)]) * self.prop.size[:2]
        under = np.column_stack((rotate_planar(corners, np.float64(pose[3])) + pose[:2], np.zeros(9)))
        left = self._fall * DT
        while left > 0:
            under[:, 2] = pose[2] - 0.002
            if pose[2] <= 0 or (self.solids.signed_distance(under.astype(np.float32), 0.1) < 0).any():
                break
            pose[2], left = max(pose[2] - min(left, 0.004), 0.0), left - 0.004


def _share(value: float, span: Sequence[float]) -> float:
    """How far, 0..1, a value is from the one end of a span to the other."""
    return float(np.clip((value - span[0]) / (span[1] - span[0]), 0.0, 1.0))


__all__ = ["Holding"]
