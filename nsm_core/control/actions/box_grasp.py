"""Carrying at run time: hands take a box, the box follows the hands, and is set down at its place."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from nsm_core.body.ik.grip import Grip
from nsm_core.control.goals import Taken
from nsm_core.conventions import DT, HAND_CONTACTS
from nsm_core.distances import WRIST_BEHIND
from nsm_core.rotations import Array, heading_to_direction, rotate_planar, wrap_angle
from nsm_core.signals import smooth_step
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.berth import Berth, kept_out
from nsm_core.world.scene.props import Box

from .hold import Hold, Lead, SeenBody

# Seconds at least in which the box leaves its resting pose for the one that the hands give it; metres a
# second at most.
SETTLING, SETTLE_SPEED = 0.5, 0.45
# Setting down: from how near and how slow the box is drawn onto its place (metres, m/s), how long that takes
# at least and how fast it is on the mean (seconds, m/s), how near it then is, how long hands that do not let
# go are waited for.
DRAW_FROM, SLOW, DRAW_TIME, DRAW_SPEED, PLACED, PATIENCE = 0.2, 0.4, 0.4, 0.45, 0.01, 1.0
# A body that has come to stand and bends no further (its hands go no faster than that, m/s, for so many
# seconds) is drawn from further off (metres): a box is not held over its place for long.
BENDS, BENT, DRAW_FURTHER, LEAST_HELD = 0.15, 0.2, 0.4, 0.8
# Hands have let go where their labels are lower and the place is this near (metres); or where they are
# further apart than the box is wide by so much: for more than so many frames.
LOOSE, LOOSE_FROM, APART, LOOSE_FRAMES = 0.3, 0.5, 0.5, 6
LIFTING = 0.5  # seconds in which hands come to bear what they have taken
HELD_OFF = 0.23  # metres from the root to the near face of a box that is carried, at least
LOW = 0.65  # metres over the floor of the underside of a box at which knees may meet it
_AVERAGED = 3  # frames over which the box's place in the hands is smoothed
_RISE, _SINK = 1.5, 1.0  # m/s by which a box gives way to what is under it
_GRAVITY = 9.81
_LEAST_STEP = 0.01  # metres that a probe goes down at least: nothing is thinner
_UNDER = np.array(
    [(x, y) for x in (-0.45, 0, 0.45) for y in (-0.45, 0, 0.45)]
)  # shares of the box's size that are held up


class Carrying:
    """One box and the two hands of one character, from the reach for it to when it stands again; one call a
    frame.

    ``state`` is "reach", "held", "placed" (hands still return), "falling" (let go in the air) or "free".
    """

    forearms = True

    def __init__(
        self,
        box: Box,
        facing: float,
        goal: Array,
        solids: DistanceQuery,
        ik: bool = True,
        further: float = 0.0,
    ) -> None:
        """Prepare to carry.

        Args:
            box: is moved in place.
            facing: heading of the carrier in the box's frame, a multiple of 90 degrees.
            goal: pose (4,) at which the box is set down.
            solids: what the box may rest on, but itself and the floor.
            ik: False leaves the body as the network has it; the box then follows the hands alone.
            further: metres by which the carrier stands further from the box than the network would, see
            ``standing``.
        """
        self.prop, self.facing, self.goal, self.solids, self.ik = (
            box,
            float(facing),
            np.array(goal, dtype=np.float64),
            solids,
            ik,
        )
        self.state = "reach"
        self.kept = False  # held wherever one goes
        self.hold = Hold([0, 1], further)
        self.errors: dict[str, Any] = {}  # of the hands and of the place, in the names of GoalResult
        self._recent: list[Array] = []
        self._offset, self._since = np.zeros(4), 0
        self._draw, self._drawn, self._waited = 0.0, 0, 0
        self._draw_time, self._carried = DRAW_TIME, 0.0  # of this draw; height at which the hands had the box
        self._loose = self._apart = 0
        self._lifted, self._fall = 0.0, 0.0
        self._raw = box.pose.copy()
        # What the network's hands lack to the box where it is taken, and to its place where it is put,
        # metres.
        self._from = further * heading_to_direction(np.array(box.pose[3] + self.facing))
        self._to = np.zeros(2)
        self._taken, self._put = Berth(box, box.pose, solids), Berth(box, self.goal, solids)
        self._leaving, self._settling = True, SETTLING
        self._late = np.zeros(4)  # how far the box stays behind the hands, lest it goes into something
        self._seen = box.pose.copy()  # the box as the network has it in its hands
        self._show(self._from)

    @property
    def active(self) -> bool:
        """Whether it still has to be called."""
        return self.state in ("reach", "held", "falling") or (self.state == "placed" and self.hold.busy)

    @property
    def low(self) -> bool:
        """Whether one bends to the box or with it, so that knees may meet it."""
        at_work = self.hold.weight > 0 or self.state in ("held", "placed")
        return at_work and float(self.prop.pose[2] - self.prop.size[2] / 2) < LOW

    def holds(self, hand: int) -> float:
        """How far a hand is led by it, 0..1."""
        return self.hold.weight if self.state in ("reach", "held") else 0.0

    @property
    def bears(self) -> float:
        """Kilograms that its hands bear: as they lift it more and more, less as they put it down."""
        if self.state != "held":
            return 0.0
        return self.prop.mass * float(smooth_step(self._since * DT / LIFTING) * (1 - smooth_step(self._draw)))

    @property
    def leads(self) -> list[Lead]:
        """Where its hands are to be in this frame: palms on the sides, fingers along them."""
        heading = np.float64(self.prop.pose[3] + self.facing)
        left, ahead = rotate_planar(np.eye(3)[0], heading), np.append(heading_to_direction(heading), 0.0)
        return [replace(lead, grip=Grip((left, -left)[lead.hand], ahead)) for lead in self.hold.leads]

    def touches(self, hand: int) -> bool:
        """Whether a hand is meant to touch the prop, and so is not kept off it: one that is not yet led to it
        is.
        """
        return self.state != "reach" or self.hold.weight > 0

    def _show(self, lean: Array) -> None:
        """Show the network the box where its hands are, ``lean`` (2,) metres nearer than it is."""
        self.prop.shown = self.prop.raised - np.append(lean, 0.0)

    def grasps(self) -> Array:
        """World places (2, 3) of the wrists on the box as it is now."""
        return self.prop.to_world(self.prop.grasps(self.facing))

    def send(self, goal: Array, further: float = 0.0) -> None:
        """Change where a box that is held is set down; one stands ``further`` metres off there."""
        self.goal, self._draw, self._drawn = np.array(goal, dtype=np.float64), 0.0, 0
        self.kept = False
        self._to = further * heading_to_direction(np.array(self.goal[3] + self.facing))
        self._put = Berth(self.prop, self.goal, self.solids)

    def keep(self) -> None:
        """Hold the box wherever one goes, until it is sent somewhere."""
        self.kept, self._draw = True, 0.0

    def let_go(self) -> None:
        """End it at any time: hands return, and a box in the air falls onto what is under it."""
        self._show(np.zeros(2))
        if self.state == "held":
            self.hold.release()
            self.state, self._fall = "falling", 0.0
        elif self.state == "reach":
            if self.hold.weight > 0:
                self.hold.release()
            self.state = "placed"

    def give_way(self) -> None:
        """Leave the box to another hold of it: these hands only return."""
        self.let_go()

    def apply(self, seen: SeenBody, root: Array, contacts: Array) -> None:
        """Move the box by one frame; ``root`` (3,), network
        ``contacts`` (5,).
        """
        grasping = False
        if self.state == "reach":
            self._show(self._from)
            distances = np.linalg.norm(seen.wrists + np.append(self._from, 0.0) - self.grasps(), axis=1)
            self.hold.approach(distances, contacts[HAND_CONTACTS])
            if self.hold.complete(self.ik):
                grasping, self.state, self._since = True, "held", 0
                self._recent = []
                self._offset = self.prop.pose - self._in_hands(seen.wrists, root) - (*self._from, 0.0, 0.0)
                self._offset[3] = wrap_angle(self._offset[3])
                self._seen = self.prop.pose - (*self._from, 0.0, 0.0)
                self._settling = max(SETTLING, float(np.linalg.norm(self._from)) / SETTLE_SPEED)
        elif self.state == "held":
            self._follow(seen.wrists, root, contacts[HAND_CONTACTS])
        elif self.state == "falling":
            self._drop()
        self.hold.apply(seen, self.grasps())
        if grasping:
            self._measure_grasp(seen)

    # --- held
    # ------------------------------------------------------------------------------------------------------

    def _pose_of(self, wrists: Array) -> Array:
        """Pose (4,) of the box between two wrists (2, 3)."""
        axis = wrists[1] - wrists[0]
        heading = (
            float(np.arctan2(axis[1], axis[0]))
            if np.hypot(axis[0], axis[1]) > 0.05
            else float(self.prop.pose[3] + self.facing)
        )
        centre = wrists.mean(0) - rotate_planar(
            np.array((0.0, WRIST_BEHIND, self.prop.grip_height)), np.float64(heading)
        )
        return np.append(centre, heading - self.facing)

    def _in_hands(self, wrists: Array, root: Array) -> Array:
        """The pose (4,) that the hands give the box, smoothed as seen from the body, so that it does not lag
        behind it.
        """
        self._raw = self._pose_of(wrists)
        place = np.asarray(root, dtype=np.float64)
        seen = np.concatenate(
            (
                rotate_planar(self._raw[:2] - place[:2], -place[2]),
                self._raw[2:3],
                [wrap_angle(self._raw[3] - place[2])],
            )
        )
        if self._recent:
            seen[3] = self._recent[-1][3] + wrap_angle(seen[3] - self._recent[-1][3])
        self._recent = [*self._recent[1 - _AVERAGED :], seen]
        mean = np.mean(self._recent, axis=0)
        # Bodies of the data held smaller boxes: what the network would press to itself is held off.
        ahead = heading_to_direction(np.float64(mean[3] + self.facing))
        mean[:2] += (
            max(
                0.0, self.prop.across(self.facing)[1] / 2 + HELD_OFF + self.prop.off - float(mean[:2] @ ahead)
            )
            * ahead
        )
        return np.concatenate(
            (rotate_planar(mean[:2], place[2]) + place[:2], mean[2:3], [mean[3] + place[2]])
        )

    def _follow(self, wrists: Array, root: Array, labels: Array) -> None:
        self._since += 1
        before = self.prop.pose.copy()
        rest = 1 - float(smooth_step(self._since * DT / self._settling))
        hands = self._in_hands(wrists, root)
        carried = hands + rest * self._offset
        # What the network has in its hands goes to the place that it is shown; the box itself as much further
        # as one leans.
        gap = self.goal - (*self._to, 0.0, 0.0) - carried
        gap[3] = wrap_angle(gap[3])
        far = float(np.linalg.norm(gap[:3]))
        speed = float(np.linalg.norm(carried[:2] - self._seen[:2])) / DT if not self._draw else 0.0
        self._seen = carried.copy()
        self._waited = (
            self._waited + 1 if speed < SLOW and abs(carried[2] - self._carried) < BENDS * DT else 0
        )
        self._carried = float(carried[2])
        start = DRAW_FURTHER if self._waited * DT > BENT else DRAW_FROM
        # Hands that say they have let go near the place have missed it: the box is set down all the same.
        self._loose = self._loose + 1 if labels.max() < LOOSE else 0
        start = LOOSE_FROM if self._loose > LOOSE_FRAMES else start
        near = not self.kept and self.ik and self._since * DT > LEAST_HELD and speed < SLOW and far < start
        drawing = near if not self._draw else far < 2 * DRAW_FURTHER
        if not self._draw:
            self._draw_time = max(DRAW_TIME, (far + float(np.linalg.norm(self._to))) / DRAW_SPEED)
        self._draw = float(np.clip(self._draw + (DT if drawing else -DT) / self._draw_time, 0, 1))
        drawn = float(smooth_step(self._draw))
        lean = rest * self._from + drawn * self._to
        carried = carried + drawn * gap + (*lean, 0.0, 0.0)
        self._stay_above(carried)
        self.prop.pose[:] = kept_out(self.prop, before, carried, self._late, self.solids)
        self._late = self.prop.pose - carried
        self._show(lean)
        width = self.prop.across(self.facing)[0]
        self._apart = self._apart + 1 if float(np.linalg.norm(wrists[1] - wrists[0])) > width + APART else 0
        if self._apart > LOOSE_FRAMES and not self._draw:
            self.let_go()
            return
        if not self.ik and self._loose > LOOSE_FRAMES and self._since * DT > LEAST_HELD:
            self._put_down(wrists)  # nothing draws it to its place: it falls from where it is let go
            self.state, self._fall = "falling", 0.0
            return
        if self._draw >= 1:
            self._drawn += 1
            there = float(np.linalg.norm(self.goal[:3] - self.prop.pose[:3])) < PLACED
            waited = self._drawn * DT > PATIENCE
            if (there and labels.max() < 0.5) or waited:
                self._put_down(wrists)

    def _stay_above(self, pose: Array) -> None:
        """Raise (or lower) the box ``pose`` (4,) in place, not faster than a hand would, to where its way is
        free.
        """
        half = float(self.prop.size[2]) / 2
        berth = self._taken if self._leaving else self._put
        low, high = berth.bounds(pose, berth.free(self.prop, pose, self.solids))
        lowest = min(float(pose[2]), high) - half - 0.01
        ground = self._support(pose, max(pose[2], float(self.prop.pose[2])) - half, max(0.0, lowest))
        need = max(ground + half, low, min(float(pose[2]), high)) - float(pose[2])
        self._lifted += float(np.clip(need - self._lifted, -(_SINK if need >= 0 else _RISE) * DT, _RISE * DT))
        pose[2] += max(self._lifted, min(need, 0.02))
        if self._leaving:
            self._leaving = not berth.left(self.prop, pose, self.solids)

    def _support(self, pose: Array, bottom: float, deepest: float) -> float:
        """Height of what is under the box at ``pose`` (4,) whose underside is at ``bottom``; 0 where that is
        lower than ``deepest``.
        """
        under = rotate_planar(_UNDER * self.prop.size[:2], np.float64(pose[3])) + pose[:2]
        z = np.full(len(under), bottom + 0.12)
        falling = np.arange(len(under))
        while len(falling):
            distance = self.solids.signed_distance(
                np.column_stack((under[falling], z[falling])).astype(np.float32), 1.0
            )
            step = distance.astype(np.float64)
            moving = step > 0.002
            z[falling[moving]] -= np.maximum(
                step[moving], _LEAST_STEP
            )  # beside a wall the nearest thing is always near
            falling = falling[moving & (z[falling] > deepest)]
        # A place whose probe began inside a solid has nothing to say: that is a wall beside the box.
        z[(z >= bottom + 0.12 - 1e-9) | (z <= deepest)] = 0
        return max(0.0, float(z.max()))

    def _put_down(self, wrists: Array) -> None:
        def error(pose: Array) -> float:
            return 100 * float(np.linalg.norm(pose[:3] - self.goal[:3]))

        def turn(pose: Array) -> float:
            return float(np.degrees(abs(wrap_angle(pose[3] - self.goal[3]))))

        raw = self._pose_of(wrists)
        self.errors |= {
            "position_error_cm": error(self.prop.pose),
            "rotation_error_deg": turn(self.prop.pose),
            "network_position_error_cm": error(raw),
            "network_rotation_error_deg": turn(raw),
        }
        self.prop.pose[3] = wrap_angle(self.prop.pose[3])
        self._show(self._to)
        self.hold.release()
        self.state = "placed"

    def _drop(self) -> None:
        """Let the box fall upright onto what is under it."""
        self._fall += _GRAVITY * DT
        pose, half = self.prop.pose, float(self.prop.size[2]) / 2
        ground = self._support(pose, pose[2] - half, pose[2] - half - self._fall * DT - 0.01)
        pose[2] = max(pose[2] - self._fall * DT, ground + half)
        if pose[2] <= ground + half + 1e-6:
            self.state = "placed"

    def _measure_grasp(self, seen: SeenBody) -> None:
        taken = self.errors["taken"] = Taken([0, 1], self.prop.to_local(self.grasps()))
        network = taken.errors(seen.wrists + np.append(self._from, 0.0), self.prop.pose)
        self.errors["network_hand_error_cm"], self.errors["network_hand_rotation_deg"] = network
