"""Opening doors: walk to the handle, take it, push or pull the leaf and walk through the opening.

No captured door is used: the ways are captured walks and steps, the hand is led by inverse kinematics, the
trunk leans where the arm is too short, and the leaf turns as the hand moves it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from nsm_core.body.ik.reach import into_reach, leaning
from nsm_core.body.skeleton import ARMS, forward_kinematics
from nsm_core.body.thin_capsules import thin_spheres
from nsm_core.conventions import HAND_CONTACTS, OPEN
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.matching.segment import Segment
from nsm_core.data.scenarios.hands import ARM, lead_hand
from nsm_core.data.scenarios.motion import Motion
from nsm_core.data.scenarios.session import Session
from nsm_core.data.scenarios.take import Placed, Thing, TimedCommand
from nsm_core.distances import OPENED
from nsm_core.rotations import Array, direction_to_heading, heading_to_direction, rotate_planar
from nsm_core.signals import ease
from nsm_core.world.affordances.passage import Passage, passage
from nsm_core.world.scene.door import Door, make_door
from nsm_core.world.scene.furniture import cuboids
from nsm_core.world.scene.props import Leaf

from .draws import OPENS
from .leaf_motion import Doorway, Turning, turn
from .ways import joints_from, step_back, straight_on

NAME = "open"
# Metres that roots keep off the wall and the leaf on the way, and in the doorway.
KEEP_OFF, SQUEEZE = 0.32, 0.2
OTHERS_OFF = 0.8  # metres between the wall and the middle of what other actions are done with
RETURN = 16  # frames in which a hand comes back
DEEPEST, ASTRAY = 0.02, 0.01  # metres: of the body in leaf or wall, and of the wrist from the handle it holds


def segments(folder: CaptureFolder) -> list[Segment]:
    """None: doors are composed from walks."""
    return []


@dataclass
class OpenEpisode:
    """One passage of a door: its frames on the tape and the commands that ask for it (``pull`` -1 for a
    push).
    """

    door: Door
    leaf: Leaf
    way: Passage
    doorway: Doorway
    ask: int = -1
    pull: int = -1
    through: int = -1
    start: int = 0
    grip: int = 0
    passed: int = 0
    backed: int = 0
    plan: Turning | None = None
    back: Array = field(default_factory=lambda: np.zeros(2))
    beyond: Array = field(default_factory=lambda: np.zeros(2))
    places: list[tuple[Array, float]] = field(default_factory=list)

    def clear(self, session: Session) -> bool:
        """Whether nobody walks into wall or leaf: roots keep off but in the doorway while it is passed."""
        at = self.doorway.local(np.array(session.tape.roots))
        n = np.arange(len(at))
        narrow = (n >= self.start) & (n < self.passed + 45)
        margin = np.where(narrow, SQUEEZE, KEEP_OFF)
        others = [place for e in session.episodes if e is not self for place, _ in e.places]
        if (self._off_wall(at) < margin).any() or (
            others and (self._off_wall(self.doorway.local(np.array(others))) < OTHERS_OFF).any()
        ):
            return False
        shut, wide, left = at[: self.start], at[self.passed :], self._signed(self.turning.angles[-1])
        return not (
            (_off_leaf(shut, 0.0, self.door.width) < KEEP_OFF).any()
            or (_off_leaf(wide, left, self.door.width) < margin[self.passed :]).any()
        )

    def _off_wall(self, at: Array) -> Array:
        """Metres (N,) between places (N, 2), u and v, and the wall beside the opening."""
        own = at * (1, -self.way.side)  # the wall lies in the door's own frame, whose +Y may face who comes
        lo, hi = self.door.wall.mins[:2, None, :2], self.door.wall.maxs[:2, None, :2]
        return np.linalg.norm(np.maximum(np.maximum(lo - own, own - hi), 0), axis=-1).min(axis=0)

    def opens(self, joints: Array, pressed: int, backed: int, rng: np.random.Generator) -> bool:
        """Plan how the leaf turns from frame ``pressed`` after the start on; False where ``joints`` (T, 23,
        3) do not fit the door.
        """
        at = self.doorway.local(joints[..., :2])
        beyond = np.flatnonzero(at[:, 0, 1] > 0.35)
        if not len(beyond):
            return False
        self.passed = self.start + int(beyond[0])
        x0, x1, _ = self.door.wall.require_opening()
        y = self.door.wall.maxs[0, 1] + 0.05
        across = at[np.abs(at[..., 1]) < y][:, 0]
        if across.min() < x0 + 0.04 or across.max() > x1 - 0.04:
            return False
        panel = float(self.door.piece.maxs[0, 1] - self.door.piece.mins[0, 1])
        self.plan = turn(self.doorway, joints, pressed, panel, backed, rng)
        return self.plan is not None

    @property
    def turning(self) -> Turning:
        """How the leaf turns, once ``opens`` has planned it."""
        assert self.plan is not None
        return self.plan

    def _signed(self, angle: float) -> float:
        return angle if self.way.push else -angle

    @property
    def released(self) -> int:
        """The frame in which the hand lets go."""
        return self.start + self.turning.released

    def angles(self, count: int) -> Array:
        """How far the leaf is open in each of ``count`` frames of the take."""
        a = self.turning.angles
        return np.concatenate((np.zeros(self.start), a, np.full(max(count - self.start - len(a), 0), a[-1])))[
            :count
        ]

    def fit(self, motion: Motion) -> None:
        """Label the passage, put wall and leaf there and tell the commands; the body stays."""
        motion.ramp(OPEN, self.start, self.grip, self.released, self.released + RETURN)
        motion.contacts[self.grip : self.released, HAND_CONTACTS[self.way.hand]] = 1
        motion.phase_keys += [
            self.start,
            self.grip,
            *([self.backed] if self.pull >= 0 else []),
            self.released,
            self.released + RETURN,
        ]
        motion.obstacles.append(Placed(self.door.wall, self.leaf.pose[:2].copy(), self.leaf.closed))
        count, heading, number = len(motion), self.way.heading, len(motion.things)
        poses = np.repeat(self.leaf.pose[None], count, axis=0)
        poses[:, 3] = self.leaf.closed + self.leaf.swing * self.angles(count)
        held = np.zeros(count, bool)
        held[self.grip : self.released] = True
        motion.things.append(Thing(self.door.piece, poses, held))
        grip = self.leaf.grip(self.way.side, 0.0).astype(np.float32)
        motion.commands[self.ask] = TimedCommand(
            motion.commands[self.ask].frame, "open", grip, heading, number
        )
        for mark, action, place in (
            (self.pull, "idle+open", self.back),
            (self.through, "walk+open", self.beyond),
        ):
            if mark >= 0:
                there = np.append(place, 0).astype(np.float32)
                motion.commands[mark] = TimedCommand(
                    motion.commands[mark].frame, action, there, heading, number
                )

    def finish(self, motion: Motion) -> None:
        """Lead the hand to the handle, with it and back; a take in which it slips or the body touches the
        door is spoilt.
        """
        end = min(self.released + RETURN, len(motion))
        span = slice(self.start, end)
        hips, rotations = motion.hips[span].astype(np.float64), motion.rotations[span].astype(np.float64)
        angles = self.angles(len(motion))
        grips = np.stack([self.leaf.grip(self.way.side, a) for a in angles[span]])
        t = np.arange(self.start, end)
        weight = ease((t - self.start) / (self.grip - self.start)) * (
            1 - ease((t - self.released + 1) / RETURN)
        )
        target = self._let_go(motion, grips, span)
        rotations = lean_to(hips, rotations, self.way.hand, grips, weight)
        turned = self.leaf.closed + self.leaf.swing * angles[span]
        normal, along = (
            rotate_planar(np.broadcast_to(v, grips.shape), turned)
            for v in ((0, self.way.side, 0.0), (-0.5, 0, 0))
        )
        rotations = lead_hand(hips, rotations, self.way.hand, target, weight, normal, along)
        motion.rotations[span] = rotations
        if np.isfinite(motion.hips).all() and not self._sound(motion, angles, grips):
            motion.hips[:] = np.nan  # the composer drops what is not finite

    def _let_go(self, motion: Motion, grips: Array, span: slice) -> Array:
        """Where the hand goes (T, 3): with the grip while it holds; afterwards it stays where it was as seen
        by the body.
        """
        target = grips.copy()
        last = self.released - 1 - self.start
        if last + 1 < len(target):
            root, heading = motion.roots[span], motion.headings[span]
            n = len(target) - last - 1
            held = rotate_planar(grips[last] - np.append(root[last], 0), np.float64(-heading[last]))
            before = rotate_planar(
                grips[last - 1] - np.append(root[last - 1], 0), np.float64(-heading[last - 1])
            )
            drift = (held - before) * 6 * (1 - np.exp(-np.arange(1, n + 1) / 6))[:, None]
            after = rotate_planar(held + drift, heading[last + 1 :])
            target[last + 1 :] = after + np.concatenate((root[last + 1 :], np.zeros((n, 1))), axis=1)
        return target

    def _sound(self, motion: Motion, angles: Array, grips: Array) -> bool:
        """Whether the wrist keeps to the handle while it holds and the rest of the body out of leaf
        and wall.
        """
        span = slice(self.start, min(self.passed + 30, len(motion)))
        hips, rotations = motion.hips[span], motion.rotations[span]
        centres, radii = thin_spheres(hips, rotations)
        wrist = forward_kinematics(hips, rotations)[0][:, ARMS[self.way.hand][2]]
        held = slice(self.grip - self.start, self.released - self.start)
        if np.linalg.norm(wrist[held] - grips[held], axis=1).max() > ASTRAY:
            return False
        wall = cuboids([(self.door.wall, self.leaf.pose[:2], self.leaf.closed)])
        panel = cuboids([(self.door.piece, np.zeros(2), 0.0)])
        local = centres - self.leaf.pose[:3]
        turned = self.leaf.closed + self.leaf.swing * angles[span]
        local = rotate_planar(local, -np.repeat(turned[:, None], local.shape[1], axis=1))
        near = np.linalg.norm(centres - wrist[:, None], axis=-1) < 0.2
        for query, points in ((wall, centres), (panel, local)):
            distance = query.signed_distance(points.reshape(-1, 3).astype(np.float32), 0.3).reshape(
                near.shape
            )
            depth = np.where(near & (query is panel), 0, radii - distance)
            if depth.max() > DEEPEST:
                return False
        return True


def lean_to(hips: Array, rotations: Array, side: int, target: Array, weight: Array) -> Array:
    """Lean a trunk (T, ...) so that the shoulder of ``side`` comes within reach of ``target`` (T, 3), as
    far as ``weight`` (T,) 0..1 asks for it: new local rotations.
    """
    away = np.linalg.norm(forward_kinematics(hips, rotations)[0][:, ARMS[side][0]] - target, axis=-1)
    reach = ARM + (1 - weight) * np.maximum(away - ARM, 0)
    return into_reach(hips, rotations, ARMS[side : side + 1], target[:, None], reach[:, None], leaning())[1]


def _off_leaf(at: Array, angle: float, width: float) -> Array:
    """Metres (T,) between places (T, 2), u and v, and a leaf open by ``angle``."""
    d = np.array((np.cos(angle), np.sin(angle)))
    return np.linalg.norm(at - np.clip(at @ d, 0, width)[:, None] * d, axis=1)


def lay(session: Session) -> OpenEpisode | None:
    """Walk to a free place, put a door before it, open it and pass; at the end stand on the far side or be
    led on.
    """
    rng, tape = session.rng, session.tape
    target = session.free_place(*OPENS.place, 0.3)
    if target is None:
        return None
    away = tape.roots[-1] - target
    heading = float(direction_to_heading(-away) + rng.uniform(-OPENS.off_the_way, OPENS.off_the_way))
    ask = session.command("open", session.lead())
    if not session.go(target, heading):
        return None
    if rng.random() < OPENS.pauses:
        tape.stand(rng.uniform(*OPENS.pauses_for))
    start = len(tape) - int(rng.integers(*OPENS.reach_before))
    tape.stand(rng.uniform(*OPENS.reaches_for))
    grip = len(tape)
    tape.stand(float(rng.integers(*OPENS.grip_frames)) / 30)
    pressed = len(tape)
    tape.stand(float(rng.integers(*OPENS.press_frames)) / 30)
    push, pull, backed, heading = rng.random() < OPENS.pushes, -1, 0, float(tape.headings[start])
    if not push:
        pull = session.command("idle+open", 0)
        if not step_back(session, heading):
            return None
        backed = len(tape)
        tape.stand(rng.uniform(*OPENS.waits_back))
    through = session.command("walk+open", 0)
    opened = len(tape) - start
    if not straight_on(session, tape.roots[start], heading):
        return None
    joints = joints_from(session, start)
    drawn = session.pool.door_like(rng)
    measures = drawn or {
        "width": float(rng.uniform(*OPENS.width)),
        "handle_height": float(rng.uniform(*OPENS.handle_height)),
    }
    measures["handle_height"] = max(measures["handle_height"], OPENS.handle_height[0])
    for attempt in range(OPENS.doors):
        episode = _door_before(session, start, push, measures if attempt < OPENS.insists else None)
        episode.ask, episode.pull, episode.through, episode.start, episode.grip = (
            ask,
            pull,
            through,
            start,
            grip,
        )
        if not episode.opens(joints, pressed - start, backed - start, rng):
            continue
        if push or episode.turning.angles[opened] > OPENED:
            episode.backed, episode.back, episode.beyond = (
                backed,
                tape.roots[backed - 1].copy(),
                tape.roots[-1].copy(),
            )
            early = max(
                episode.passed + int(rng.integers(*OPENS.led_on_after)), episode.released + RETURN + 2
            )
            if rng.random() < OPENS.led_on:
                tape.trim(min(early, len(tape)))  # what is asked next is asked before one stands
            return episode
    return None


def _door_before(session: Session, start: int, push: bool, measures: dict[str, float] | None) -> OpenEpisode:
    """Put a door, of ``measures`` or any of the pool, so that its handle is reached from where frame
    ``start`` stands, about.
    """
    rng, tape = session.rng, session.tape
    walls = {name: float(rng.uniform(*OPENS.wall)) for name in ("near", "far")}
    door = session.pool.draw_door(rng, **walls) if measures is None else make_door(rng, **measures | walls)
    heading = tape.headings[start] + rng.normal(0, OPENS.off_square)
    go = heading_to_direction(np.array(heading))
    side = float(rng.choice((-1, 1)))
    leaf = door.leaf((0, 0, 0, heading if side > 0 else heading + np.pi), -side if push else side)
    stand = tape.roots[start] + rng.normal(0, OPENS.off_place, 2)
    leaf.pose[:2] = stand - passage(leaf, -go).reach
    way = passage(leaf, leaf.pose[:2] - go)
    return OpenEpisode(door, leaf, way, Doorway(leaf, way), places=[(way.middle, 1.2)])
