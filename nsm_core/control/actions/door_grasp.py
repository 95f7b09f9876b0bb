"""Doors at run time: a hand takes the handle, the leaf swings with it about its hinge, and stays open."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from nsm_core.body.ik.grip import Grip
from nsm_core.control.goals import Taken
from nsm_core.conventions import DT, HAND_CONTACTS
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, heading_to_direction, wrap_angle
from nsm_core.signals import smooth_step
from nsm_core.world.affordances.passage import Passage
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.props import Leaf

from .hold import Hold, Lead, SeenBody
from .leaf_room import NEARLY, LeafRoom, leaf_spheres

LET_GO_PUSH, LET_GO_PULL = np.radians(70), np.radians(72)  # angles of the leaf at which the hand lets go
FASTEST, EASE = 2.5, 0.5  # radians a second of the leaf; share of the way to the hand's angle in a frame
OUT_OF_REACH, OUT_FRAMES = (
    0.03,
    2,
)  # metres that arm and trunk lack to the grip, and for how many frames, until the hand lets go
SETTLING = (
    0.5  # seconds in which the leaf takes up the difference between the handle and the hand that took it
)
BODY, AHEAD = (
    0.25,
    0.34,
)  # metres about the root that a leaf in motion meets, and that it keeps off: feet reach ahead of the body
PASSED = 0.25  # metres beyond the opening at which a leaf is passed
# Radians a second squared: hinges slow a leaf that nobody moves, a stop the one that comes to it; and the
# most that speed changes by.
FRICTION, SWING_SLOWS, SWING_GAINS, SWING_BRAKES = 1.2, 3.0, 4.0, 8.0
SLIP_FRAMES, PAST_EDGE = (
    5,
    0.08,
)  # in which a hand slides off a pulled leaf, and metres beyond its free edge where it is off
# Who pulls a leaf by a handle that goes out of reach goes on by its free edge: metres from the edge, height,
# and frames to get there.
EDGE_IN, EDGE_HEIGHT, EDGE_FRAMES = 0.03, 1.1, 12
WIDE_OPEN = np.radians(95)  # where a leaf comes to rest
WIDEST = np.radians(125)
SHOVED, SHOVED_BACK = (
    5.0,
    2.0,
)  # radians a second at which a body shoves a leaf that it would else go through, open or back
NARROW = 0.2  # metres: half a body that faces the edge of a leaf swinging past it
LEAST_WIDE = np.radians(55)  # a leaf that cannot open so far lets nobody pass
PULLING, AT_PLACE = (
    0.6,
    0.3,
)  # radians a second at which a leaf comes at least once the body stands back, within so many metres
STILL = np.radians(0.2)  # radians a second below which a leaf rests
_BOARD = 0.02  # metres: half a board, about
_CLEAR = 0.02  # metres between an open leaf and what stands behind it


class Opening:
    """One leaf and the hand that opens it; one call a frame.

    ``state`` is "reach", "held", "released" (the leaf swings on) or "free".
    """

    forearms, bears = False, 0.0

    def __init__(self, leaf: Leaf, way: Passage, solids: DistanceQuery, ik: bool = True) -> None:
        """Prepare to open ``leaf``, which is moved in place, among ``solids`` (its own wall may be part of
        them).
        """
        self.prop, self.way, self.ik = leaf, way, ik
        self.state = "reach"
        self.hold = Hold([way.hand])
        self.errors: dict[str, Any] = {}
        self.widest = _widest(leaf, solids)
        self._slip, self._along = 0, 0
        self._room = LeafRoom(leaf)
        self._least, self._soft, self._most = (
            -np.inf,
            -np.inf,
            np.inf,
        )  # angles that the body leaves to the leaf
        self._speed, self._pace, self._since, self._offset, self._out = 0.0, 0.0, 0, 0.0, 0
        handle = np.asarray(leaf.handle, dtype=np.float64)
        self._grip_angle = float(np.arctan2(handle[1] + way.side * leaf.thickness / 2, handle[0]))

    @property
    def active(self) -> bool:
        """Whether it still has to be called."""
        return self.state != "free" or self.hold.busy

    @property
    def angle(self) -> float:
        """How far the leaf is open, radians."""
        return self.prop.angle

    def holds(self, hand: int) -> float:
        """How far a hand is led by it, 0..1."""
        return self.hold.weight if hand == self.way.hand else 0.0

    @property
    def leads(self) -> list[Lead]:
        """Where its hand is to be in this frame: over the handle, which lies across its palm."""
        leaf, side = self.prop, self.way.side
        ahead = leaf.to_world((0.0, -side, 0.0)) - leaf.pose[:3]
        aside = np.array((-ahead[1], ahead[0], 0.0)) * (1.0 if self.way.hand == 0 else -1.0)
        bar = leaf.to_world(np.asarray(leaf.handle) + (0.0, side * leaf.thickness / 2, 0.0))
        held = 1 - float(smooth_step(max(self._along / EDGE_FRAMES, self._slip / SLIP_FRAMES)))
        grip = Grip(aside if leaf.upright else -np.eye(3)[2], ahead, bar, leaf.thickness / 2 - _BOARD, held)
        return [replace(lead, grip=grip) for lead in self.hold.leads]

    def touches(self, hand: int) -> bool:
        """Whether a hand is meant to touch the prop, and so is not kept off it."""
        return hand == self.way.hand and (self.state in ("reach", "held") or self.hold.busy)

    def grip(self) -> Array:
        """World place (3,) of the handle now."""
        return self.prop.grip(self.way.side)

    def let_go(self) -> None:
        """End it at any time: the hand returns; a leaf that had begun to open swings on."""
        if self.state == "held":
            self._free_leaf()
        elif self.state == "reach":
            self.state = "free"
        if self.hold.weight > 0:
            self.hold.release()

    def yield_only(self) -> None:
        """Take no hand to a leaf that stands open: it only gives way to the body that passes it."""
        self.state = "released"

    def give_way(self) -> None:
        """Leave the leaf to another hold of it: this hand only returns."""
        self.let_go()
        self.state = "free"

    def apply(self, seen: SeenBody, root: Array, contacts: Array) -> None:
        """Turn the leaf by one frame and correct ``pose`` in place; ``root`` (3,), network
        ``contacts`` (5,).
        """
        hand = self.way.hand
        wrist = seen.wrists[hand]
        grasping = False
        self._feel(seen)
        if self.state == "reach":
            self.hold.approach(
                np.array([np.linalg.norm(wrist - self.grip())]), contacts[[HAND_CONTACTS[hand]]]
            )
            if self.hold.complete(self.ik):
                grasping, self.state, self._since = True, "held", 0
                self._offset = self.angle - self._angle_of(wrist)
        elif self.state == "held":
            self._since += 1
            rest = 1 - float(smooth_step(self._since * DT / SETTLING))
            wanted = self._angle_of(wrist) + rest * self._offset
            if self.ik and self._stands_back(root) and self._since * DT > SETTLING:
                self._pace = min(self._pace + PULLING * DT / SETTLING, PULLING)
                wanted = max(wanted, self.angle + self._pace * DT / EASE)
            self._turn(max(wanted, self._pushed(root)))
            if not self.way.push and (self._along or self.hold.lacking > 0 and self.angle < LET_GO_PULL):
                self._along = min(self._along + 1, EDGE_FRAMES)
            changing = 0 < self._along < EDGE_FRAMES
            self._out = self._out + 1 if self.hold.lacking > OUT_OF_REACH and not changing else 0
            enough = (
                self.angle > LET_GO_PUSH
                if self.way.push
                else self.angle > LET_GO_PULL and not self.in_way(root)
            )
            if enough or self._out >= OUT_FRAMES or self.passed(root):
                self._free_leaf()
        elif self.state == "released":
            self._swing(root)
        place = self._held_at()
        if self.state == "released" and self.hold.weight > 0:
            place = self._slipped()
        self.hold.apply(seen, place[None])
        if grasping:
            taken = self.errors["taken"] = Taken([hand], self.prop.to_local(self.grip())[None])
            self.errors["network_hand_error_cm"] = taken.errors(seen.wrists, self.prop.pose)[0]

    @property
    def _arm(self) -> int | None:
        """The arm that touches the leaf on purpose."""
        return self.way.hand if self.state in ("reach", "held") or self.hold.busy else None

    def _feel(self, seen: SeenBody) -> None:
        """See how far the body, as it is and as it was last when it had leant to the handle, lets the leaf
        turn.
        """
        whole, trunk = leaf_spheres(seen, self._arm)
        self.hold.lean_share = self._room.share_to_lean(trunk)
        if self.state in ("held", "released"):
            bodies = [whole]
            if self.hold.weight > 0:
                bodies.append(leaf_spheres(self.hold.leant(seen, self._held_at()[None]), self._arm)[0])
            limits = [self._room.limits(*body) for body in bodies]
            self._least, self._most = max(least for least, _ in limits), min(most for _, most in limits)
            self._soft = max(self._room.limits(*body, NEARLY)[0] for body in bodies)

    def passed(self, root: Array) -> bool:
        """Whether the body is through the opening."""
        return (
            float((np.asarray(root[:2]) - self.way.middle) @ heading_to_direction(np.array(self.way.heading)))
            > PASSED
        )

    def in_way(self, root: Array) -> bool:
        """Whether the body stands on the side to which the leaf opens, so that it has to go round the free
        edge first.
        """
        return np.isfinite(self._most) or self._body(root)[1] > self.angle

    def _free_leaf(self) -> None:
        """Let the leaf coast; the hand that pulled it slips off it first, lest the leaf swings through it."""
        self.state = "released"
        if self.way.push:
            self.hold.release()

    def _slipped(self) -> Array:
        """World place (3,) of a hand that slides from the handle over the free edge, where it lets go."""
        self._slip += 1
        if self._slip >= SLIP_FRAMES:
            self.hold.release()
        leaf = self.prop
        now = leaf.to_local(self._held_at())
        off = (leaf.width + PAST_EDGE - float(now[0])) * float(smooth_step(self._slip / SLIP_FRAMES))
        return leaf.to_world(now + (off, 0.0, 0.0))

    def _held_at(self) -> Array:
        """World place (3,) of the hand on the leaf: its handle, or on the way from there to its free edge."""
        leaf, handle = self.prop, self.prop.handle
        to_edge = np.array(
            (leaf.width - EDGE_IN - float(handle[0]), 0.0, max(EDGE_HEIGHT - float(handle[2]), 0.0))
        )
        share = float(smooth_step(self._along / EDGE_FRAMES))
        return leaf.to_world(leaf.to_local(self.grip()) + share * to_edge)

    # --- the leaf
    # --------------------------------------------------------------------------------------------------

    def _angle_of(self, point: Array) -> float:
        """How far the leaf is open when its handle is where a ray from the hinge through ``point`` (3,)
        leads, radians.
        """
        leaf = self.prop
        local = leaf.to_local(point, leaf.pose_at(0.0))
        return float(leaf.swing * wrap_angle(np.arctan2(local[1], local[0]) - self._grip_angle))

    def _turn(self, wanted: float) -> None:
        """Turn the leaf towards an angle: not back, and never too fast."""
        fastest = (
            FASTEST if self.way.push else min(FASTEST, self._speed + SWING_BRAKES * DT)
        )  # who pulls does not run into it
        step = float(
            np.clip(EASE * (min(max(wanted, self._soft), self.widest) - self.angle), 0, fastest * DT)
        )
        self._move(step)

    def _swing(self, root: Array) -> None:
        """Let the leaf coast, ever slower, until it is wide open or a body is in its way; only a body that
        passes moves it further.
        """
        pushed = min(self._pushed(root), self.widest)
        stop = min(max(WIDE_OPEN, pushed), self.widest, self._blocked(root))
        coasting = min(
            max(self._speed - FRICTION * DT, 0.0),
            float(np.sqrt(2 * SWING_SLOWS * max(stop - self.angle, 0.0))),
        )
        given = min(float(np.sqrt(2 * SWING_SLOWS * max(pushed - self.angle, 0.0))), FASTEST)
        wanted = max(coasting, given)
        self._speed += float(np.clip(wanted - self._speed, -SWING_BRAKES * DT, SWING_GAINS * DT))
        self._move(min(self._speed * DT, max(stop - self.angle, 0.0)))
        if pushed <= self.angle and self._speed < STILL:
            self._speed = 0.0
            if self.passed(root) and not np.isfinite(self._soft):
                self.state = "free"

    def _move(self, step: float) -> None:
        """Turn the leaf by ``step`` radians: less, or back, where the body is in its way, and more where the
        body shoves it.
        """
        angle = self.angle
        if self._most < angle + step:
            step = (
                max(self._most - angle, -SHOVED_BACK * DT, -angle)
                if self._least < self._most
                else min(step, 0.0)
            )
        step = max(step, min(self._least - angle, SHOVED * DT, self.widest - angle))
        self._speed = max(step, 0.0) / DT
        self._set(angle + step)

    def _stands_back(self, root: Array) -> bool:
        """Whether a leaf is pulled and the body has come to where it waits for it: what lacks is the arm's to
        do.
        """
        return not self.way.push and float(np.linalg.norm(np.asarray(root[:2]) - self.way.back)) < AT_PLACE

    def _set(self, angle: float) -> None:
        self.prop.pose[3] = self.prop.closed + self.prop.swing * angle

    def _body(self, root: Array) -> tuple[float, float]:
        """Distance of the root from the hinge and the angle of the leaf at which it would lie on it."""
        local = self.prop.to_local(
            np.append(np.asarray(root[:2], dtype=np.float64), 0.0), self.prop.pose_at(0.0)
        )
        return float(np.hypot(local[0], local[1])), float(
            self.prop.swing * wrap_angle(np.arctan2(local[1], local[0]))
        )

    def _pushed(self, root: Array) -> float:
        """How far the leaf is open so that a body on its closing side has room; 0 where that asks for
        nothing.
        """
        away, beside = self._body(root)
        if away > self.prop.width + BODY or away < 1e-3 or beside > self.angle:
            return max(self._soft, 0.0)
        return max(beside + float(np.arcsin(min(1.0, AHEAD / away))), self._soft)

    def _blocked(self, root: Array) -> float:
        """How far the leaf may swing until it meets a body that stands in its way."""
        away, beside = self._body(root)
        if away > self.prop.width + NARROW or away < 1e-3 or beside <= self.angle:
            return max(self.angle, min(WIDEST, self._most))
        return max(self.angle, min(beside - float(np.arcsin(min(1.0, NARROW / away))), self._most))


def require_room(leaf: Leaf, solids: DistanceQuery) -> None:
    """Raise GoalError where ``solids`` let a leaf open too little for anyone to pass."""
    widest = _widest(leaf, solids)
    if widest < LEAST_WIDE:
        raise GoalError(
            f"{leaf.name} opens by only {np.degrees(widest):.0f} degrees before it meets what stands about "
            "it, too little to pass; "
            "make room for it, turn its swing round on its hinge point, or cut its opening in the wall "
            "wider."
        )


def _widest(leaf: Leaf, solids: DistanceQuery) -> float:
    """How far the leaf can open before its outer half meets what stands about, radians."""
    along = np.linspace(0.5, 1.0, 5) * leaf.width
    points = np.array([(x, 0.0, z) for x in along for z in (0.1, 0.5, 1.0, 1.5, 1.9)])
    widest = 0.0
    for angle in np.radians(np.arange(10, 126, 5)):
        world = leaf.to_world(points, leaf.pose_at(float(angle))).astype(np.float32)
        if float(solids.signed_distance(world, 0.2).min()) < _CLEAR:
            break
        widest = float(angle)
    return max(widest, leaf.angle)
