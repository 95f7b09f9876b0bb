"""Sitting: a captured sit-down stitched to the end of a walk, and the seat put under the hips that came to rest."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .. import furniture
from ..control.goals import STAND_AHEAD
from ..conventions import HIP_CONTACT, SIT
from ..furniture import Furniture
from ..limbs import place_limbs
from ..rotations import Array, heading_to_direction, rotate_planar
from ..skeleton import FEET, HIP_OVER_SEAT, HIPS, forward_kinematics
from .fitting import hands_on_arm_rests
from .library import gaussian_smooth, load_sits
from .motion import Motion
from .session import LaidSegment, Segment, Session
from .swivel import swivel, turn_about_hips
from .take import Command, Placed, Thing

SEATS = ("chair", "chair", "armchair", "stool", "bench", "sofa")
NAME = "sit"
SIDEWAYS = 0.12  # share of the seats that stand partly under a table and are taken from the side
_AT_TABLE = ("chair", "chair", "stool")


def segments(folder: str | Path) -> list[Segment]:
    """Captured sit-downs: stand at 0, seat reached at "down", left at "up", stand at the end; without any, nobody sits."""
    return [Segment(s.clip, {"down": s.down, "up": s.up}) for s in load_sits(folder)]


@dataclass
class Sit:
    """One sit: frames of its parts on the tape, the seat, and the command that asks for it."""

    piece: Furniture
    stand: Array  # (2,) where one stands before it
    mark: int
    start: int = 0
    reached: int = 0
    leaving: int = 0
    rise: int = 0
    risen: int = 0
    position: Array = field(default_factory=lambda: np.zeros(2))
    heading: float = 0.0
    places: list[tuple[Array, float]] = field(default_factory=list)
    turn: float = 0.0  # from the way one sits down to the way one sits, radians
    table: Placed | None = None
    back: int = 0  # frames in which one turns back before rising

    def clear(self, session: Session) -> bool:
        """Whether nobody walks through the seat: roots stay off its boxes but for the sit itself."""
        roots = np.array(session.tape.roots)
        local = rotate_planar(roots - self.position, np.full(len(roots), -self.heading))
        lo, hi = self.piece.mins[:, :2].min(0), self.piece.maxs[:, :2].max(0)
        # Turning before the seat brings the hips to its edge; walking past keeps further off.
        near = np.zeros(len(roots), bool)
        near[max(self.start - 60, 0) : self.risen + 40] = True
        margin = np.where(near, -0.02, 0.15)[:, None]
        inside = ((local > lo - margin) & (local < hi + margin)).all(axis=1)
        inside[self.start : self.risen] = False
        return not inside.any() and (self.table is None or not _inside(roots, self.table, 0.2).any())

    def fit(self, motion: Motion) -> None:
        """Label the sit, raise or lower it to its seat's height and put the seat under it; the feet stay."""
        motion.ramp(SIT, self.start, self.reached, self.rise, self.risen)
        motion.contacts[self.reached : self.rise, HIP_CONTACT] = 1
        motion.feet[self.start : self.risen] = True
        motion.phase_keys += [self.start, self.reached, self.rise, self.risen]
        self._fit_height(motion)
        settled = slice(self.reached + 3, self.rise)
        if self.turn:
            settled = self._turn_on_the_seat(motion)
        goal = motion.hips[settled].mean(axis=0).astype(np.float32)
        heading = float(np.mean(motion.headings[settled]))
        turned = heading - self.piece.seat.heading
        offset = self.piece.seat.point[:2] + motion.rng.normal(0, 0.01, 2)
        frame = motion.commands[self.mark].frame
        motion.commands[self.mark] = Command(frame, "sit", goal, heading, len(motion.things))
        motion.things.append(Thing.standing(self.piece, goal[:2] - rotate_planar(offset, turned), turned))

    def finish(self, motion: Motion) -> None:
        """Nothing is left to do once the feet stand."""

    def _turn_on_the_seat(self, motion: Motion) -> slice:
        """Turn to the table once seated, and back before rising; returns the frames in between."""
        there = (self.reached + 4, int(motion.rng.integers(34, 48)))
        last = self.leaving - self.back
        turn_about_hips(motion, sum(there), self.leaving, self.turn)
        swivel(motion, *there, self.turn)
        swivel(motion, last, self.back, -self.turn)
        motion.phase_keys += [there[0], sum(there), last, self.leaving]
        if self.table is not None:
            motion.obstacles.append(self.table)
        return slice(sum(there) + 2, last)

    def _fit_height(self, motion: Motion) -> None:
        positions, world = forward_kinematics(motion.hips, motion.rotations)
        ankles = [leg[2] for leg in FEET]
        seated = motion.hips[self.reached : self.rise].mean(axis=0)
        rise_by = self.piece.seat.height + HIP_OVER_SEAT - seated[2]
        forward = heading_to_direction(np.array(motion.headings[self.leaving - 1]))
        shift = np.append(forward * motion.rng.uniform(-0.06, 0.05), rise_by).astype(np.float32)
        span = slice(self.start, self.risen)
        height = gaussian_smooth(motion.hips[span, 2], 2.0)
        top = np.maximum(height[0], height[-1])
        weight = np.clip((0.96 * top - height) / (0.96 * top - seated[2]), 0, 1)
        weight = gaussian_smooth(weight * weight * (3 - 2 * weight), 3.0).clip(0, 1)
        motion.hips[span] += weight[:, None] * shift
        if self.piece.seat.arms:
            goal = motion.hips[self.reached : self.rise].mean(axis=0)
            facing = float(np.mean(motion.headings[self.reached : self.rise]))
            motion.rotations = hands_on_arm_rests(motion.hips, motion.rotations, weight, span, self.piece, goal, facing)
        legs = [leg[:3] for leg in FEET]
        placed = place_limbs(motion.hips[span], motion.rotations[span], legs, positions[span][:, ankles], world[span][:, ankles])
        motion.rotations[span] = placed


def _inside(roots: Array, placed: Placed, margin: float) -> Array:
    """Which roots (T,) lie over a piece's footprint widened by ``margin``, metres."""
    local = rotate_planar(roots - placed.position, np.full(len(roots), -placed.heading))
    lo, hi = placed.furniture.mins[:, :2].min(0) - margin, placed.furniture.maxs[:, :2].max(0) + margin
    return ((local > lo) & (local < hi)).all(axis=1)


def lay(session: Session) -> Sit | None:
    """Walk to a free place, sit there, stay, and rise; half of the time the next command comes while rising.

    Some seats stand partly under a table: they are taken from the side, with a turn on the seat.
    """
    rng, lib, tape = session.rng, session.lib, session.tape
    if not session.source.segments.get(NAME):
        return None
    sideways = rng.random() < SIDEWAYS
    piece = session.draw(str(rng.choice(_AT_TABLE if sideways else SEATS)))
    seat, size = piece.seat, piece.size
    hips = session.free_place(0.9, 4.5, 0.5 + 0.5 * float(max(size[:2])))
    if hips is None or seat is None:
        return None
    heading = float(rng.uniform(-np.pi, np.pi))
    if rng.random() < 0.3:
        # From behind the seat the way is long and often fails; draw it more often.
        away = hips - tape.roots[-1]
        heading = float(np.arctan2(away[0], -away[1]) + rng.uniform(-1.2, 1.2))
    target = hips + STAND_AHEAD * heading_to_direction(np.array(heading))
    sit = Sit(piece, target, session.command("sit", session.lead()), places=[(target, 1.5)])
    if sideways:
        sit.back = int(rng.integers(34, 48))
        sit.turn = float(rng.choice((-1, 1)) * rng.uniform(np.radians(75), np.radians(100)))
        ahead = heading_to_direction(np.array(heading + sit.turn))
        table = furniture.make("table", rng, width=rng.uniform(0.9, 1.6), depth=rng.uniform(0.6, 0.8), legs="posts")
        edge = rng.uniform(0.26, 0.36) + 0.5 * float(table.size[1])
        sit.table = Placed(table, hips + edge * ahead, heading + sit.turn)
        sit.places.append((sit.table.position, 1.2))
    if not session.go(target, heading, (float(size[0]), float(size[1]))):
        return None
    segment = session.nearest_segment(NAME)
    down, up = segment.marks["down"], segment.marks["up"]
    sit.start = len(tape)
    tape.run_on(np.arange(segment.first, down, 1 / rng.uniform(0.85, 1.25)), seam=True)
    sit.reached = len(tape)
    middle = down + int(np.argmin(np.linalg.norm(lib.velocity[down:up, HIPS], axis=1)))
    tape.run_on(np.linspace(down, middle, max(2, abs(middle - down))), seam=False)
    tape.hold(middle, int((rng.uniform(0.6, 3.0) + (3.4 if sideways else 0)) * 30), 3, seam=False)
    sit.leaving = len(tape)
    tape.run_on(np.linspace(middle, up, max(2, abs(up - middle))), seam=False)
    sit.rise = len(tape)
    sit.heading = tape.headings[sit.leaving - 1] + sit.turn - seat.heading
    sit.position = tape.roots[sit.leaving - 1] - rotate_planar(seat.point[:2] + rng.normal(0, 0.01, 2), sit.heading)
    _rise(session, sit, segment)
    return sit


def _rise(session: Session, sit: Sit, segment: LaidSegment) -> None:
    rng, tape = session.rng, session.tape
    # Turning back to rise answers to the command that ends the sit.
    mark = session.command("idle", int(rng.integers(3, 9)) + (sit.rise - sit.leaving + sit.back if sit.back else 0))
    tape.run_on(np.arange(segment.marks["up"], segment.last - 1, 1 / rng.uniform(0.85, 1.2)), seam=False)
    sit.risen = len(tape)
    if rng.random() < 0.5:
        session.stand_here(mark)
        tape.stand(rng.uniform(0.2, 1.2))
    else:
        session.leave_early(mark)
