"""Compose goal-directed performances: stand, walk, turn, sit, stay, rise, walk on, in a furnished scene.

The captures hold sit-downs without an approach and walks without a goal.  A course is drawn to a place where
nothing stands, captured frames walk it (``matching``), a captured sit-down is stitched to its end and the seat is
put where the hips came to rest.  Everything else is furnished around the path that was walked.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np

from .. import furniture
from ..control.course import Course
from ..control.foot_lock import lock_feet
from ..control.goals import STAND_AHEAD
from ..conventions import CONTACTS, FOOT_CONTACTS, HIP_CONTACT
from ..limbs import place_limbs
from ..rotations import (
    Array,
    heading_to_direction,
    quat_conjugate,
    quat_from_rotvec,
    quat_mul,
    quat_normalize,
    quat_to_rotvec,
    rotate_planar,
    wrap_angle,
)
from ..skeleton import FEET, HIP_OVER_SEAT, HIPS, forward_kinematics
from .fitting import hands_on_arm_rests, lift_swinging_feet
from .library import Library, SitDown, build, gaussian_smooth, load_sits, load_walks
from .matching import Matcher
from .scene import furnish, keep_clear
from .stitching import place, soften_seam
from .take import Command, Placed, Take
from .tape import Tape

SEATS = ("chair", "chair", "armchair", "stool", "bench", "sofa")


@dataclass
class Source:
    """The library to compose from: searchable walks first, then the sit-downs and their mirror images."""

    library: Library
    matcher: Matcher
    sits: list[tuple[int, int, int, int]]  # first frame, seated, leaving, one past the last; library indices
    still: Array  # frames to start standing from


def load(folder: str) -> Source:
    """Read the capture folder; CaptureError or SkeletonError where a file is unusable."""
    walks = load_walks(folder)
    walks += [c.mirrored() for c in walks]
    downs = load_sits(folder)
    downs += [SitDown(s.clip.mirrored(), s.down, s.up) for s in downs]
    library = build(walks + [s.clip for s in downs])
    first_sit = sum(len(c) for c in walks if len(c) >= 20)
    sits, at = [], first_sit
    for s in downs:
        sits.append((at, at + s.down, at + s.up, at + len(s.clip)))
        at += len(s.clip)
    n = np.arange(len(library))
    slow = np.linalg.norm(library.velocity[:, HIPS, :2], axis=1) < 0.06
    still = np.flatnonzero(slow & (library.end - n > 50) & (n < first_sit) & library.contacts.all(axis=1))
    return Source(library, Matcher(library, searchable=n < first_sit), sits, still)


class Composer:
    """Composes takes from a source; one seed, one take."""

    def __init__(self, source: Source) -> None:
        self.source = source

    def compose(self, seed: int) -> Take | None:
        """Return the take of ``seed``, or None where the draw did not work out."""
        return _Session(self.source, np.random.default_rng(seed)).run()


class _Session:
    def __init__(self, source: Source, rng: np.random.Generator) -> None:
        self.source, self.lib, self.rng = source, source.library, rng
        self.tape = Tape(self.lib, rng)
        self.commands: list[Command] = []
        self.sat: list[dict] = []
        self.detours: list[Array] = []

    # --- parts of a performance --------------------------------------------------------------------------------

    def _course(self, target: Array, heading: float, seat_size: tuple[float, float] | None) -> Course:
        """A smooth path from here to ``target`` (2,); around the seat behind it, now and then by a detour."""
        rng, start = self.rng, self.tape.roots[-1]
        ahead = heading_to_direction(np.array(heading))
        side = np.array((-ahead[1], ahead[0]))
        straight = target - start
        distance = float(np.linalg.norm(straight))
        points = [start]
        travel = wrap_angle(np.arctan2(straight[0], -straight[1]) - heading)
        tangent = float(np.sign(travel) * min(abs(travel), np.radians(rng.uniform(60, 130))))
        if seat_size is not None:
            width, depth = seat_size
            clear = 0.5 * width + 0.42
            # Seen from the standing place: how far behind it and to which side the start lies.
            back, lateral = -float((start - target) @ ahead), float((start - target) @ side)
            if back > 0.05 and abs(lateral) < clear + 0.25 * back:
                toward = 1.0 if lateral > 0 else -1.0
                if back > depth + 0.3:
                    points.append(target + side * toward * clear - ahead * (depth + 0.2))
                points.append(target + side * toward * clear - ahead * 0.1)
                tangent = toward * np.radians(rng.uniform(60, 110))
        elif distance > 1.0:
            tangent = float(np.clip(travel, -1.2, 1.2))
        if distance > 2.0 and len(points) == 1 and rng.random() < 0.4:
            normal = np.array((-straight[1], straight[0])) / distance
            middle = start + straight * rng.uniform(0.35, 0.65)
            points.append(middle + normal * rng.choice((-1, 1)) * rng.uniform(0.5, 1.1))
            self.detours.append(middle)
        end_direction = heading_to_direction(np.array(heading + tangent))
        reach = min(0.45, 0.35 * distance)
        points += [target - end_direction * reach, target]
        corners = np.array(points)
        steps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
        length = np.concatenate(([0], np.cumsum(steps)))
        fine = np.arange(0, length[-1] + 0.03, 0.03)
        path = np.stack([np.interp(fine, length, corners[:, k]) for k in range(2)], axis=1)
        path = gaussian_smooth(path, 7.0)
        return Course(path, heading, speed=rng.uniform(0.85, 1.4), turn_distance=rng.uniform(0.35, 0.9), deceleration=rng.uniform(0.7, 1.1))

    def _go(self, target: Array, heading: float, seat_size: tuple[float, float] | None = None) -> bool:
        course = self._course(target, heading, seat_size)
        last = int(round(self.tape.frames[-1]))
        passage = self.source.matcher.follow(course, last, self.tape.roots[-1], self.tape.headings[-1], self.rng)
        if passage is None:
            return False
        self.tape.lay(passage.frames[1:], passage.root[1:], passage.heading[1:], tuple(s - 1 for s in passage.seams), seam=False)
        return True

    def _command(self, action: str, lead: int, **kw: object) -> None:
        frame = max(len(self.tape) - lead, self.commands[-1].frame + 1 if self.commands else 0)
        self.commands.append(Command(frame, action, **kw))  # type: ignore[arg-type]

    def _free_place(self, low: float, high: float, clearance: float) -> Array | None:
        here, walked = self.tape.roots[-1], np.array(self.tape.roots)
        for _ in range(30):
            angle, distance = self.rng.uniform(-np.pi, np.pi), self.rng.uniform(low, high)
            spot = here + distance * np.array((np.cos(angle), np.sin(angle)))
            if np.linalg.norm(walked - spot, axis=1).min() > min(clearance, distance - 0.05) and all(
                np.linalg.norm(s["stand"] - spot) > 1.5 for s in self.sat
            ):
                return spot
        return None

    def _stroll(self) -> bool:
        """Walk to a free place: half of the time led along (dynamic goal), else sent there (static goal).

        Some are a step or a turn on the spot; some of those led along are interrupted by what is asked next.
        """
        rng = self.rng
        near = rng.random() < 0.3
        target = self._free_place(0.1, 0.9, 0.05) if near else self._free_place(0.9, 4.0, 0.3)
        if target is None:
            return False
        straight = target - self.tape.roots[-1]
        heading = float(np.arctan2(straight[0], -straight[1]) + rng.normal(0, 0.8))
        if near:
            heading = float(self.tape.headings[-1] + rng.uniform(-np.pi, np.pi))
        led = rng.random() < 0.5
        lead = int(rng.integers(2, 9))
        self._command("walk" if led else "idle", lead)
        mark, before = len(self.commands) - 1, len(self.tape)
        if not self._go(target, heading):
            return False
        if not led:
            at, facing = self.tape.roots[-1], self.tape.headings[-1]
            self.commands[mark] = Command(self.commands[mark].frame, "idle", np.append(at, 0.0).astype(np.float32), facing)
        elif len(self.tape) - before > 60 and rng.random() < 0.6:
            self.tape.trim(int(rng.integers(before + 25, len(self.tape) - 15)))
            return True
        self.tape.stand(rng.uniform(0.3, 1.5))
        return True

    def _sit(self) -> bool:
        """Walk to a free place, sit there, stay, and leave the tape seated."""
        rng, lib = self.rng, self.lib
        piece = furniture.make(str(rng.choice(SEATS)), rng)
        seat = piece.seat
        size = piece.size
        hips = self._free_place(0.9, 4.5, 0.5 + 0.5 * float(max(size[:2])))
        if hips is None or seat is None:
            return False
        heading = float(rng.uniform(-np.pi, np.pi))
        if rng.random() < 0.3:
            # From behind the seat the way is long and often fails; draw it more often.
            away = hips - self.tape.roots[-1]
            heading = float(np.arctan2(away[0], -away[1]) + rng.uniform(-1.2, 1.2))
        target = hips + STAND_AHEAD * heading_to_direction(np.array(heading))
        self._command("sit", int(rng.integers(2, 9)), seat=len(self.sat))
        mark = len(self.commands) - 1
        if not self._go(target, heading, (float(size[0]), float(size[1]))):
            return False
        pose = lib.pose[int(round(self.tape.frames[-1]))]
        costs = [float(np.linalg.norm(lib.pose[s[0]] - pose, axis=-1).sum()) + rng.exponential(1.0) for s in self.source.sits]
        first, down, up, end = self.source.sits[int(np.argmin(costs))]
        stretch = rng.uniform(0.85, 1.25)
        start = len(self.tape)
        self.tape.run_on(np.arange(first, down, 1 / stretch), seam=True)
        reached = len(self.tape)
        middle = int(lib.start[first]) + int(np.argmin(np.linalg.norm(lib.velocity[down:up, HIPS], axis=1))) + down - first
        self.tape.run_on(np.linspace(down, middle, max(2, abs(middle - down))), seam=False)
        self.tape.hold(middle, int(rng.uniform(0.6, 3.0) * 30), 3, seam=False)
        leaving = len(self.tape)
        self.tape.run_on(np.linspace(middle, up, max(2, abs(up - middle))), seam=False)
        rise_start = len(self.tape)
        facing = self.tape.headings[leaving - 1] - seat.heading
        placed = (self.tape.roots[leaving - 1] - rotate_planar(seat.point[:2] + rng.normal(0, 0.01, 2), facing), facing)
        frames = {"start": start, "reached": reached, "leaving": leaving, "rise": rise_start}
        self.sat.append({"placed": placed, "piece": piece, "stand": target, "sit": (first, down, up, end), "mark": mark, **frames})
        return True

    def _rise(self) -> None:
        first, _, up, end = self.sat[-1]["sit"]
        self.tape.run_on(np.arange(up, end - 1, 1 / self.rng.uniform(0.85, 1.2)), seam=False)
        self.sat[-1]["risen"] = len(self.tape)

    # --- the whole ---------------------------------------------------------------------------------------------

    def run(self) -> Take | None:
        rng = self.rng
        f = int(rng.choice(self.source.still))
        self.tape.lay([f], [np.zeros(2)], [float(rng.uniform(-np.pi, np.pi))])
        self._command("idle", 0, position=np.zeros(3, np.float32), heading=self.tape.headings[0])
        self.tape.stand(rng.uniform(0.3, 1.2))
        wanted, done = int(rng.integers(2, 5)), 0
        for _ in range(4 * wanted):
            if done == wanted:
                break
            complete = (len(self.tape), len(self.commands), len(self.tape.seams), len(self.detours), len(self.sat))
            if rng.random() < 0.7:
                ok = self._sit() and self._clear()
                if ok:
                    # Rising belongs to whatever is asked next; a bare stop is asked for here.
                    mark = len(self.commands)
                    self._command("idle", int(rng.integers(3, 9)))
                    self._rise()
                    at, facing = self.tape.roots[-1], self.tape.headings[-1]
                    self.commands[mark] = Command(self.commands[mark].frame, "idle", np.append(at, 0).astype(np.float32), facing)
                    if rng.random() < 0.5:
                        self.tape.stand(rng.uniform(0.2, 1.2))
                    else:
                        # The next command comes while rising: drop the stop.
                        self.commands[mark] = Command(self.commands[mark].frame, "next")
            else:
                ok = self._stroll() and self._clear()
            if ok:
                done += 1
            else:
                self._cut(*complete)
        return self._finish()

    def _cut(self, length: int, commands: int, seams: int, detours: int, sat: int) -> None:
        tape = self.tape
        del tape.frames[length:], tape.roots[length:], tape.headings[length:], tape.seams[seams:]
        del self.commands[commands:], self.detours[detours:], self.sat[sat:]

    def _finish(self) -> Take | None:
        lib, tape, rng = self.lib, self.tape, self.rng
        if len(tape) < 90:
            return None
        f = np.array(tape.frames)
        i = np.minimum(f.astype(int), len(lib) - 2)
        w = (f - i).astype(np.float32)
        hips = lib.hips[i] + w[:, None] * (lib.hips[i + 1] - lib.hips[i])
        step = quat_to_rotvec(quat_mul(lib.rotations[i + 1], quat_conjugate(lib.rotations[i])))
        rotations = quat_normalize(quat_mul(quat_from_rotvec(w[:, None, None] * step), lib.rotations[i]))
        root = lib.root[i] + w[:, None] * (lib.root[i + 1] - lib.root[i])
        heading = lib.heading[i] + w * (lib.heading[i + 1] - lib.heading[i])
        hips, rotations = place(hips, rotations, root, heading, np.array(tape.roots), np.array(tape.headings))
        for seam in tape.seams:
            soften_seam(hips, rotations, seam)
        feet = lib.contacts[i].copy()
        sitting = np.zeros(len(tape), np.float32)
        contacts = np.zeros((len(tape), len(CONTACTS)), np.float32)
        phase_keys, seats = [], []
        for s in self.sat:
            start, reached, rise, risen = s["start"], s["reached"], s["rise"], s["risen"]
            ramp = np.zeros(len(tape), np.float32)
            ramp[start:reached] = np.linspace(0, 1, reached - start)
            ramp[reached:rise] = 1
            ramp[rise:risen] = np.linspace(1, 0, risen - rise)
            sitting = np.maximum(sitting, ramp)
            contacts[reached:rise, HIP_CONTACT] = 1
            feet[start:risen] = True
            phase_keys += [start, reached, rise, risen]
        hips, rotations = self._fit_seats(hips, rotations)
        rotations = lift_swinging_feet(hips, rotations, feet)
        hips, rotations = lock_feet(hips, rotations, feet, place="median")
        contacts[:, FOOT_CONTACTS] = feet
        commands = self._resolved(hips, rotations, seats)
        take = Take(hips.astype(np.float32), rotations.astype(np.float32), contacts, sitting, commands, seats, phase_keys=phase_keys)
        take.provenance = self._provenance(i)
        if not np.isfinite(hips).all():
            return None
        furnish(take, np.array(tape.roots), self.detours, rng)
        return take if keep_clear(take) else None

    def _fit_seats(self, hips: Array, rotations: Array) -> tuple[Array, Array]:
        """Raise or lower every sit to its seat's height and move it along its depth; the feet stay (contact-preserving IK)."""
        positions, world = forward_kinematics(hips, rotations)
        ankles, toes = [leg[2] for leg in FEET], [leg[:3] for leg in FEET]
        targets, feet = positions[:, ankles], world[:, ankles]
        moved = hips.copy()
        for s in self.sat:
            reached, rise = s["reached"], s["rise"]
            seated = moved[reached:rise].mean(axis=0)
            rise_by = s["piece"].seat.height + HIP_OVER_SEAT - seated[2]
            forward = heading_to_direction(np.array(self.tape.headings[s["leaving"] - 1]))
            shift = np.append(forward * self.rng.uniform(-0.06, 0.05), rise_by).astype(np.float32)
            span = slice(s["start"], s["risen"])
            height = gaussian_smooth(hips[span, 2], 2.0)
            top = np.maximum(height[0], height[-1])
            weight = np.clip((0.96 * top - height) / (0.96 * top - seated[2]), 0, 1)
            weight = gaussian_smooth(weight * weight * (3 - 2 * weight), 3.0).clip(0, 1)
            moved[span] += weight[:, None] * shift
            if s["piece"].seat.arms:
                goal = moved[s["reached"] : s["rise"]].mean(axis=0)
                facing = float(np.mean(self.tape.headings[reached:rise]))
                rotations = hands_on_arm_rests(moved, rotations, weight, span, s["piece"], goal, facing)
        return moved, place_limbs(moved, rotations, toes, targets, feet).astype(np.float32)

    def _resolved(self, hips: Array, rotations: Array, seats: list[Placed]) -> list[Command]:
        """Put the seats under the hips that came to rest, and the seats' goals into the commands."""
        commands = list(self.commands)
        for number, s in enumerate(self.sat):
            settled = slice(s["reached"] + 3, s["rise"])
            goal = hips[settled].mean(axis=0).astype(np.float32)
            heading = float(np.mean(self.tape.headings[s["reached"] + 3 : s["rise"]]))
            turned = heading - s["piece"].seat.heading
            offset = s["piece"].seat.point[:2] + self.rng.normal(0, 0.01, 2)
            seats.append(Placed(s["piece"], goal[:2] - rotate_planar(offset, turned), turned))
            c = commands[s["mark"]]
            commands[s["mark"]] = Command(c.frame, "sit", goal, heading, number)
        kept: list[Command] = []
        for c in commands:
            if c.action == "next":
                continue
            if kept and c.frame <= kept[-1].frame:
                c = Command(kept[-1].frame + 1, c.action, c.position, c.heading, c.seat)
            kept.append(c)
        return self._early(commands, kept)

    def _early(self, commands: list[Command], kept: list[Command]) -> list[Command]:
        """Where a stop was dropped, the next command takes its frame, so that rising answers to it."""
        result = list(kept)
        for a, c in enumerate(commands[:-1]):
            if c.action == "next":
                following = commands[a + 1]
                for k, r in enumerate(result):
                    if r.action == following.action and r.seat == following.seat and r.frame >= c.frame:
                        result[k] = Command(c.frame, r.action, r.position, r.heading, r.seat)
                        break
        # A dropped stop at the very end leaves its sit in force although the body rises: ask to stand there.
        if commands and commands[-1].action == "next":
            at, facing = self.tape.roots[-1], self.tape.headings[-1]
            result.append(Command(commands[-1].frame, "idle", np.append(at, 0).astype(np.float32), facing))
        return result

    def _clear(self) -> bool:
        """Whether nobody walks through a seat: roots stay off its boxes but for the sit itself."""
        roots = np.array(self.tape.roots)
        for s in self.sat:
            position, heading = s["placed"]
            piece = s["piece"]
            local = rotate_planar(roots - position, np.full(len(roots), -heading))
            lo, hi = piece.mins[:, :2].min(0), piece.maxs[:, :2].max(0)
            # Turning before the seat brings the hips to its edge; walking past keeps further off.
            near = np.zeros(len(roots), bool)
            risen = s.get("risen", len(roots))
            near[max(s["start"] - 60, 0) : risen + 40] = True
            margin = np.where(near, -0.02, 0.15)[:, None]
            inside = ((local > lo - margin) & (local < hi + margin)).all(axis=1)
            inside[s["start"] : risen] = False
            if inside.any():
                return False
        return True

    def _provenance(self, i: Array) -> list[tuple[str, int, int]]:
        lib, result = self.lib, []
        clip = lib.clip_of[i]
        jumps = np.flatnonzero((np.abs(np.diff(i)) > 2) | (np.diff(clip) != 0)) + 1
        for a, b in zip([0, *jumps], [*jumps, len(i)], strict=True):
            result.append((lib.names[clip[a]], int(i[a] - lib.start[i[a]]), int(i[b - 1] - lib.start[i[a]] + 1)))
        return result


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core compose``: write training data and say what it covers."""
    from .coverage import report  # both need this module
    from .export import export

    parser = argparse.ArgumentParser(prog="compose", description="Stitch goal-directed performances from a capture folder.")
    parser.add_argument("captures", help="folder with clips/ of 23-joint BVH files")
    parser.add_argument("--out", default="runs/data")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    a = parser.parse_args(arguments)
    folder = export(a.captures, a.out, a.minutes, a.seed, progress=lambda n, of: print(f"\r{min(n / of, 1):6.1%}", end="", flush=True))
    print()
    print(report(folder))
    return 0
