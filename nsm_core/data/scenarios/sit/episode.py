"""Sitting: a captured sit-down stitched to the end of a walk, and the seat put under the hips that came to
rest.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np

from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import FEET, HIP_OVER_SEAT, HIPS, INDEX, forward_kinematics, root_of
from nsm_core.body.thin_capsules import thin_depths
from nsm_core.conventions import FPS, HIP_CONTACT, SIT
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.matching.search import ON_THE_MOVE
from nsm_core.data.matching.segment import LaidSegment, Segment
from nsm_core.data.matching.selection import load_sits
from nsm_core.data.scenarios.motion import Motion
from nsm_core.data.scenarios.session import Session
from nsm_core.data.scenarios.take import Placed, Thing, TimedCommand
from nsm_core.distances import STAND_AHEAD
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.signals import gaussian_smooth
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene import furniture
from nsm_core.world.scene.furniture import Furniture

from .draws import SITS
from .fit import bring_to_rest, keep_off
from .manner import SitManner, act_out, draw_manner
from .turn import swivel, turn_about_hips

NAME = "sit"
TUCKS = (0.0, 0.12, 0.24)  # shares by which feet may be drawn in while one turns on the seat
SLIDES = (0.0, 0.05, 0.09)  # metres by which one may slide back on the seat in that turn
# Metres that the body may go into the table; of leg joints to the seat's surface.
IN_TABLE, BRUSH = 0.028, -0.012
ALL_BUT_UP = 0.97  # share of the standing height from which on one may set off
_WALKERS = [
    INDEX[side + name] for side in ("Right", "Left") for name in ("Hip", "Knee", "Ankle", "Toe", "Wrist")
]


def segments(folder: CaptureFolder) -> list[Segment]:
    """Captured sit-downs: stand at 0, seat reached at "down", left at "up", stand at the end; without any,
    nobody sits.

    "asked" is where a sidecar lets rising be asked for.
    """
    found = []
    for s in load_sits(folder):
        asked = {} if s.asked is None else {"asked": s.asked}
        found.append(Segment(s.clip, {"down": s.down, "up": s.up, **asked}, s.goal))
    return found


@dataclass
class SitEpisode:
    """One sit: frames of its parts on the tape, the seat, and the command that asks for it."""

    piece: Furniture
    stand: Array  # (2,) where one stands before it
    mark: int
    manner: SitManner
    start: int = 0
    reached: int = 0
    leaving: int = 0
    rise: int = 0
    risen: int = 0
    position: Array = field(default_factory=lambda: np.zeros(2))
    heading: float = 0.0
    places: list[tuple[Array, float]] = field(default_factory=list)
    turn: float = 0.0  # from the way one sits down to the way one sits, radians
    table: Placed | None = None  # where it was meant to stand
    edge: float = 0.0  # from the hips to the table's edge, metres
    back: int = 0  # frames in which one turns back before rising
    still: int = 0  # from here to ``leaving`` one rests
    goal: Array = field(default_factory=lambda: np.zeros(3))
    # Where the goal lies from the hips and their heading, see ``Segment``.
    aim: Array = field(default_factory=lambda: np.zeros(4))
    facing: float = 0.0
    solid: Cuboids = field(default_factory=Cuboids)  # the seat in the world

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
        if inside.any() or self.table is not None and _inside(roots, self.table, 0.15).any():
            return False
        return self._legs_pass(
            session,
            np.flatnonzero(np.linalg.norm(roots - self.position, axis=1) < np.abs((lo, hi)).max() + 0.7),
        )

    def _legs_pass(self, session: Session, frames: Array) -> bool:
        """Whether legs stay out of the seat in ``frames``, but for calves that brush its edge and the sit
        itself.
        """
        tape, lib = session.tape, session.lib
        frames = frames[(frames < self.start + 5) | (frames > self.risen - 5)]
        poses = lib.pose[np.minimum(np.array(tape.frames)[frames].astype(int), len(lib) - 1)][:, _WALKERS]
        roots = np.insert(np.array(tape.roots)[frames], 2, 0.0, axis=1)
        world = rotate_planar(poses, np.array(tape.headings)[frames, None]) + roots[:, None]
        solid = furniture.cuboids([(self.piece, self.position, self.heading)])
        return bool(
            solid.signed_distance(world.reshape(-1, 3).astype(np.float32), 0.1).min(initial=1.0) > BRUSH
        )

    def fit(self, motion: Motion) -> None:
        """Label the sit, bring it to its seat's height and to rest, and put the seat under it; the
        feet stay.
        """
        motion.ramp(SIT, self.start, self.reached, self.rise, self.risen)
        motion.contacts[self.reached : self.rise, HIP_CONTACT] = 1
        motion.land(self.start, self.reached, self.risen)
        motion.phase_keys += [self.start, self.reached, self.rise, self.risen]
        weight = self._fit_height(motion)
        bring_to_rest(motion, self.reached, slice(self.still, self.leaving), self.rise)
        settled = slice(self.still, self.leaving)
        if self.turn:
            settled = self._turn_on_the_seat(motion)
        goal = motion.hips[settled].mean(axis=0).astype(np.float32)
        heading = self._heading(motion, settled)
        goal += self._aimed(heading)
        heading += float(self.aim[3])
        frame = motion.commands[self.mark].frame
        motion.commands[self.mark] = TimedCommand(frame, "sit", goal, heading, len(motion.things))
        thing = self._stand(goal, heading, motion.rng.normal(0, SITS.off_place, 2))
        motion.things.append(thing)
        self.goal, self.facing, self.solid = (
            goal,
            heading,
            furniture.cuboids([(self.piece, thing.poses[:3], float(thing.poses[3]))]),
        )
        span = slice(self.start, self.risen)
        act_out(motion, span, self.still - self.start, weight, self.manner, self.piece, goal, heading)

    def finish(self, motion: Motion) -> None:
        """Keep the body out of the seat, and push the table as far over it as the motion lets it."""
        assert self.solid is not None
        near = slice(max(self.start - 30, 0), min(self.risen + 30, len(motion)))
        keep_off(motion, near, self.solid)
        if self.table is not None:
            motion.obstacles.append(self._push_table(motion))

    def _aimed(self, heading: float) -> Array:
        """From the hips that face ``heading`` to the goal, (3,) metres, world."""
        return np.append(rotate_planar(self.aim[:2], np.float64(heading)), self.aim[2]).astype(np.float32)

    def estimate(self, root: Array, heading: float) -> None:
        """Where the seat will stand, before anything is fitted, under a body whose ``root`` (2,) faces
        ``heading``.
        """
        seat = self.piece.require_seat()
        self.heading = heading + self.aim[3] - seat.heading
        self.position = (
            root + self._aimed(heading)[:2] - rotate_planar(seat.point[:2], np.float64(self.heading))
        )

    def _stand(self, goal: Array, heading: float, off: Array) -> Thing:
        """The seat under hips at ``goal`` (3,) that face ``heading``, ``off`` (2,) metres from where they
        should be on it.
        """
        seat = self.piece.require_seat()
        turned = heading - seat.heading
        return Thing.standing(self.piece, goal[:2] - rotate_planar(seat.point[:2] + off, turned), turned)

    def _heading(self, motion: Motion, frames: slice) -> float:
        headings = root_of(forward_kinematics(motion.hips[frames], motion.rotations[frames])[0])[1]
        return float(np.mean(np.unwrap(headings)))

    def _turn_on_the_seat(self, motion: Motion) -> slice:
        """Turn to the table once seated, and back before rising, feet drawn in as far as the seat and the
        table ask for.

        Before a back rest one sits down a little ahead, where it leaves room for the shoulder, and slides
        back with the turn. Returns the frames in between.
        """
        there = (self.reached + 8, int(motion.rng.integers(*SITS.turn_frames)))
        last = self.leaving - self.back
        span = slice(self.reached, self.risen)
        before = [a[span].copy() for a in (motion.hips, motion.rotations, motion.headings, motion.feet)]
        hips = motion.hips[self.still].copy()
        facing = self._heading(motion, slice(self.still, self.leaving)) + self.turn
        ahead = np.append(heading_to_direction(np.array(facing)), 0)

        def turn(way: tuple[float, float]) -> float:
            tuck, back = way
            slide = -back * ahead
            for array, kept in zip(
                (motion.hips, motion.rotations, motion.headings, motion.feet), before, strict=True
            ):
                array[span] = kept
            turn_about_hips(motion, sum(there), self.leaving, self.turn, slide)
            swivel(motion, *there, self.turn, tuck, slide)
            swivel(motion, last, self.back, -self.turn, tuck, -slide)
            thing = self._stand(hips + slide, facing, np.zeros(2))
            at = [
                (self.piece, thing.poses[:3], float(thing.poses[3])),
                self._table_at((hips + slide)[:2], facing, self.edge),
            ]
            seen = slice(self.reached - 10, self.rise + 10, 3)
            return float(thin_depths(motion.hips[seen], motion.rotations[seen], furniture.cuboids(at)).mean())

        turn(min(product(TUCKS, SLIDES if self.piece.require_seat().back else (0.0,)), key=turn))
        motion.phase_keys += [there[0], sum(there), last, self.leaving]
        return slice(sum(there) + 2, last)

    def _table_at(self, hips: Array, facing: float, edge: float) -> tuple[Furniture, Array, float]:
        """The table, its edge ``edge`` metres before hips (2,) that face ``facing``: piece, place and
        heading.
        """
        assert self.table is not None
        away = edge + 0.5 * float(self.table.furniture.size[1])
        return self.table.furniture, hips + away * heading_to_direction(np.array(facing)), facing

    def _push_table(self, motion: Motion) -> Placed:
        near = slice(max(self.start - 90, 0), min(self.risen + 60, len(motion)), 2)
        for edge in self.edge + np.arange(0, 0.25, 0.02):
            at = self._table_at(self.goal[:2].astype(np.float64), self.facing, float(edge))
            solid = furniture.cuboids([at])
            if thin_depths(motion.hips[near], motion.rotations[near], solid).max() < IN_TABLE:
                break
        keep_off(motion, slice(near.start, near.stop), self.solid, solid)
        return Placed(*at)

    def _fit_height(self, motion: Motion) -> Array:
        """Raise or lower the sit to its seat; returns how far it is seated, (n,) from ``start`` to
        ``risen``.
        """
        positions, world = forward_kinematics(motion.hips, motion.rotations)
        ankles = [leg[2] for leg in FEET]
        seated = motion.hips[self.still : self.leaving].mean(axis=0)
        rise_by = self.piece.require_seat().height + HIP_OVER_SEAT - seated[2] - float(self.aim[2])
        forward = heading_to_direction(np.array(motion.headings[self.leaving - 1]))
        shift = np.append(forward * motion.rng.uniform(*SITS.further_on), rise_by).astype(np.float32)
        span = slice(self.start, self.risen)
        height = gaussian_smooth(motion.hips[span, 2], 2.0)
        top = np.maximum(height[0], height[-1])
        weight = np.clip((0.96 * top - height) / (0.96 * top - seated[2]), 0, 1)
        weight = gaussian_smooth(weight * weight * (3 - 2 * weight), 3.0).clip(0, 1)
        motion.hips[span] += weight[:, None] * shift
        legs = [leg[:3] for leg in FEET]
        placed = place_limbs(
            motion.hips[span],
            motion.rotations[span],
            legs,
            positions[span][:, ankles],
            world[span][:, ankles],
        )
        motion.rotations[span] = placed
        return weight


def _inside(roots: Array, placed: Placed, margin: float) -> Array:
    """Which roots (T,) lie over a piece's footprint widened by ``margin``, metres."""
    local = rotate_planar(roots - placed.position, np.full(len(roots), -placed.heading))
    lo, hi = placed.furniture.mins[:, :2].min(0) - margin, placed.furniture.maxs[:, :2].max(0) + margin
    return ((local > lo) & (local < hi)).all(axis=1)


def lay(session: Session) -> SitEpisode | None:
    """Walk to a free place, sit there, stay, and rise; half of the time the next command comes while rising.

    Some seats stand partly under a table: they are taken from the side, with a turn on the seat.  Many ways
    lead through the seat that is to be; the same seat is tried at several places, lest wide ones get rare.
    """
    rng = session.rng
    if not session.source.segments.get(NAME):
        return None
    sideways = rng.random() < SITS.sideways
    piece = session.draw(str(rng.choice(SITS.kinds_at_table if sideways else SITS.kinds)))
    if piece.seat is None:
        return None
    saved = session.save()
    for _ in range(SITS.tries):
        sit = _lay(session, piece, sideways)
        if sit is not None and sit.clear(session) and session.clear():
            return sit
        session.restore(saved)
    return None


def _lay(session: Session, piece: Furniture, sideways: bool) -> SitEpisode | None:
    rng, tape, size = session.rng, session.tape, piece.size
    hips = session.free_place(*SITS.place, 0.5 + 0.5 * float(max(size[:2])))
    if hips is None:
        return None
    heading = float(rng.uniform(-np.pi, np.pi))
    away, chance = hips - tape.roots[-1], rng.random()
    if size[0] > SITS.wide and chance < SITS.wide_from_the_front:
        heading = float(np.arctan2(-away[0], away[1]) + rng.uniform(-SITS.off_the_front, SITS.off_the_front))
    elif chance < SITS.from_behind:
        heading = float(np.arctan2(away[0], -away[1]) + rng.uniform(-SITS.off_the_back, SITS.off_the_back))
    target = hips + STAND_AHEAD * heading_to_direction(np.array(heading))
    manner = draw_manner(rng, piece, sideways)
    sit = SitEpisode(piece, target, session.command("sit", session.lead()), manner, places=[(target, 1.5)])
    around = (float(size[0]), float(size[1]))
    if not session.go(target, heading, around, speed=manner.speed, arrival=ON_THE_MOVE):
        return None
    segment = session.nearest_segment(NAME)
    play(session, sit, segment, seam=True, longer=SITS.rests_longer_at_table if sideways else 0.0)
    if sideways:
        sit.back = int(rng.integers(*SITS.turn_frames))
        sit.turn = float(rng.choice((-1, 1)) * rng.uniform(*SITS.turn))
        sit.edge = float(rng.uniform(*SITS.table_edge))
        table = furniture.make(
            "table",
            rng,
            width=rng.uniform(*SITS.table_width),
            depth=rng.uniform(*SITS.table_depth),
            legs="posts",
        )
        sit.table = Placed(table, tape.roots[sit.leaving - 1], 0.0)
        sit.table = Placed(
            *sit._table_at(tape.roots[sit.leaving - 1], tape.headings[sit.leaving - 1] + sit.turn, sit.edge)
        )
        sit.places.append((sit.table.position, 1.2))
    sit.estimate(tape.roots[sit.leaving - 1], tape.headings[sit.leaving - 1] + sit.turn)
    _rise(session, sit, segment)
    return sit


def play(session: Session, sit: SitEpisode, segment: LaidSegment, seam: bool, longer: float = 0.0) -> None:
    """Lay a captured sit-down, a rest on the seat, ``longer`` by so many seconds, and the way up to where the
    seat is left.
    """
    rng, lib, tape = session.rng, session.lib, session.tape
    down, up = segment.marks["down"], segment.marks["up"]
    sit.aim = np.zeros(4) if segment.goal is None else segment.goal
    sit.start = len(tape)
    tape.run_on(np.linspace(segment.first, down, round(sit.manner.sinks * FPS), endpoint=False), seam=seam)
    sit.reached = len(tape)
    middle = down + int(np.argmin(np.linalg.norm(lib.velocity[down:up, HIPS], axis=1)))
    tape.run_on(np.linspace(down, middle, max(2, abs(middle - down))), seam=False)
    sit.still = len(tape)
    tape.hold(middle, int((rng.uniform(*SITS.rests) + longer) * FPS), 3, seam=False)
    sit.leaving = len(tape)
    tape.run_on(np.linspace(middle, up, max(2, abs(up - middle))), seam=False)
    sit.rise = len(tape)


def rise_asked(segment: LaidSegment, drawn: int) -> int:
    """Frames before a seat is left at which rising is asked for: as a sidecar says it, else as ``drawn``."""
    return max(segment.marks["up"] - segment.marks["asked"], 0) if "asked" in segment.marks else drawn


def _rise(session: Session, sit: SitEpisode, segment: LaidSegment) -> None:
    rng, tape = session.rng, session.tape
    # Turning back to rise answers to the command that ends the sit.
    lead = rise_asked(segment, int(rng.integers(*SITS.rise_lead))) + (
        sit.rise - sit.leaving + sit.back if sit.back else 0
    )
    mark = session.command("idle", lead)
    up = segment.marks["up"]
    stands = rng.random() < SITS.stands
    end = segment.last - 1
    rate = (end - up) / (sit.manner.rises * FPS)
    if not stands:  # who goes on sets off while the last of the way up is still to come
        height = session.lib.hips[up : segment.last, 2]
        nearly = up + int((height > ALL_BUT_UP * height.max()).argmax())
        end -= int(rng.uniform(*SITS.sets_off) * max(end - nearly, 0))
    tape.run_on(np.arange(up, end, rate), seam=False)
    sit.risen = len(tape)
    if stands:
        session.stand_here(mark)
        tape.stand(rng.uniform(*SITS.stands_for))
    else:
        session.leave_early(mark)
