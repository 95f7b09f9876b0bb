"""A performance in the making: ways to free places, commands given on the way, and episodes with objects."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from nsm_core.body.skeleton import FEET
from nsm_core.data.matching.search import AT_REST, Arrival
from nsm_core.data.matching.segment import LaidSegment
from nsm_core.data.matching.source import Source
from nsm_core.data.matching.timeline import Tape
from nsm_core.rotations import Array, heading_to_direction, wrap_angle
from nsm_core.signals import gaussian_smooth
from nsm_core.world.assets.pool import Pool
from nsm_core.world.planning.path import Course
from nsm_core.world.scene.furniture import Furniture

from .draws import PERFORMANCES, WAYS
from .motion import Motion
from .take import TimedCommand

_LEGS = [joint for leg in FEET for joint in leg]


class Episode(Protocol):
    """One action of a performance, from the way there to its end.

    A module of an action has a function ``lay(session) -> Episode | None`` that lays frames on the session's
    tape and gives commands; None where the draw did not work out (the session then takes everything back).
    """

    # Planar places (2,) and radii, metres, that later ways and objects keep off.
    places: list[tuple[Array, float]]

    def clear(self, session: Session) -> bool:
        """Whether the way walked so far, all of ``session.tape``, keeps off the episode's objects."""
        ...

    def fit(self, motion: Motion) -> None:
        """Fit the body before feet are locked on the floor: hips, foot contacts, labels, phase keys,
        commands, things.
        """
        ...

    def finish(self, motion: Motion) -> None:
        """Fit what comes after the feet: hands, objects in hands, feet on things that are not the floor."""
        ...


class Session:
    """One performance: a tape of captured frames, the commands it answers, and the episodes that shape it."""

    def __init__(self, source: Source, rng: np.random.Generator, pool: Pool | None = None) -> None:
        """``pool`` gives the furniture (default: the parametric generator alone)."""
        self.source, self.lib, self.rng = source, source.library, rng
        self.pool = pool or Pool()
        self.tape = Tape(self.lib, rng)
        self.commands: list[TimedCommand] = []
        self.episodes: list[Episode] = []
        self.detours: list[Array] = []

    def draw(self, kind: str) -> Furniture:
        """A piece of furniture of a kind from the pool."""
        return self.pool.draw(kind, self.rng)

    # --- commands and the way back ---

    def command(self, action: str, lead: int = 0, position: Array | None = None, heading: float = 0.0) -> int:
        """Ask for ``action`` from ``lead`` frames before the tape's end on; returns the command's number."""
        frame = max(len(self.tape) - lead, self.commands[-1].frame + 1 if self.commands else 0)
        self.commands.append(TimedCommand(frame, action, position, heading))
        return len(self.commands) - 1

    def stand_here(self, mark: int) -> None:
        """Let command ``mark`` ask to stand where the tape ends."""
        at, facing = self.tape.roots[-1], self.tape.headings[-1]
        self.commands[mark] = TimedCommand(
            self.commands[mark].frame, "idle", np.append(at, 0.0).astype(np.float32), facing
        )

    def leave_early(self, mark: int) -> None:
        """Drop the stop that command ``mark`` asks for: whatever is asked next is asked from its frame on."""
        self.commands[mark] = TimedCommand(self.commands[mark].frame, "next")

    def lead(self) -> int:
        """A random number of frames by which a command precedes its answer."""
        return int(self.rng.integers(*PERFORMANCES.lead))

    def save(self) -> tuple[int, ...]:
        """Where everything ends now, for ``restore``."""
        return (
            len(self.tape),
            len(self.tape.seams),
            len(self.commands),
            len(self.episodes),
            len(self.detours),
        )

    def restore(self, saved: tuple[int, ...]) -> None:
        """Take back what was laid, asked and planned since ``save``."""
        length, seams, commands, episodes, detours = saved
        del (
            self.tape.frames[length:],
            self.tape.roots[length:],
            self.tape.headings[length:],
            self.tape.seams[seams:],
        )
        del self.commands[commands:], self.episodes[episodes:], self.detours[detours:]

    def clear(self) -> bool:
        """Whether the way walked so far keeps off every episode's objects."""
        return all(e.clear(self) for e in self.episodes)

    # --- ways ---

    def free_place(self, low: float, high: float, clearance: float, radius: float = 1.5) -> Array | None:
        """A place (2,) between ``low`` and ``high`` metres from here, off the way walked and off the
        episodes' places.
        """
        here, walked = self.tape.roots[-1], np.array(self.tape.roots)
        for _ in range(30):
            angle, distance = self.rng.uniform(-np.pi, np.pi), self.rng.uniform(low, high)
            spot = here + distance * np.array((np.cos(angle), np.sin(angle)))
            if np.linalg.norm(walked - spot, axis=1).min() > min(clearance, distance - 0.05) and all(
                np.linalg.norm(place - spot) > max(radius, r) for e in self.episodes for place, r in e.places
            ):
                return spot
        return None

    def course(
        self,
        target: Array,
        heading: float,
        around: tuple[float, float] | None = None,
        speed: float | None = None,
        straight_end: float = 0.0,
    ) -> Course:
        """A smooth path from here to ``target`` (2,), ending at ``heading``.

        ``around`` (width, depth): a seat stands behind the target and is walked around.  ``straight_end``:
        metres at the end that lead straight along ``heading``.  Now and then there is a detour, about which
        furniture may be put.
        """
        rng, start = self.rng, self.tape.roots[-1]
        ahead = heading_to_direction(np.array(heading))
        side = np.array((-ahead[1], ahead[0]))
        end = target - straight_end * ahead
        straight = end - start
        distance = float(np.linalg.norm(straight))
        points = [start]
        travel = wrap_angle(np.arctan2(straight[0], -straight[1]) - heading)
        tangent = float(np.sign(travel) * min(abs(travel), np.radians(rng.uniform(*WAYS.arrives))))
        if straight_end:
            tangent = 0.0
        elif around is not None:
            width, depth = around
            clear = 0.5 * width + 0.42
            # Seen from the standing place: how far behind it and to which side the start lies.
            back, lateral = -float((start - target) @ ahead), float((start - target) @ side)
            if back > 0.05 and abs(lateral) < clear + 0.25 * back:
                toward = 1.0 if lateral > 0 else -1.0
                if back > depth + 0.3:
                    points.append(target + side * toward * clear - ahead * (depth + 0.2))
                points.append(target + side * toward * clear - ahead * 0.1)
                tangent = toward * np.radians(rng.uniform(*WAYS.around_seat))
        elif distance > 1.0:
            tangent = float(np.clip(travel, -1.2, 1.2))
        if distance > WAYS.detour_from and len(points) == 1 and rng.random() < WAYS.detours:
            normal = np.array((-straight[1], straight[0])) / distance
            middle = start + straight * rng.uniform(*WAYS.detour_at)
            points.append(middle + normal * rng.choice((-1, 1)) * rng.uniform(*WAYS.detour_by))
            self.detours.append(middle)
        end_direction = heading_to_direction(np.array(heading + tangent))
        reach = min(0.45, 0.35 * distance)
        points += [end - end_direction * reach, end]
        if straight_end:
            points.append(target)
        corners = np.array(points)
        steps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
        length = np.concatenate(([0], np.cumsum(steps)))
        fine = np.arange(0, length[-1] + 0.03, 0.03)
        path = np.stack([np.interp(fine, length, corners[:, k]) for k in range(2)], axis=1)
        path = gaussian_smooth(path, 7.0)
        return Course(
            path,
            heading,
            speed=rng.uniform(*WAYS.speed) if speed is None else speed,
            turn_distance=rng.uniform(*WAYS.turn_distance),
            deceleration=rng.uniform(*WAYS.deceleration),
        )

    def follow(self, course: Course, runs: bool = False, arrival: Arrival = AT_REST) -> bool:
        """Walk a course to its end with captured frames; False where that failed (nothing is laid then)."""
        matcher = self.source.runner if runs else self.source.walker
        last = int(round(self.tape.frames[-1]))
        passage = matcher.follow(course, last, self.tape.roots[-1], self.tape.headings[-1], self.rng, arrival)
        if passage is None:
            return False
        self.tape.lay(
            passage.frames[1:],
            passage.root[1:],
            passage.heading[1:],
            tuple(s - 1 for s in passage.seams),
            seam=False,
        )
        return True

    def go(
        self,
        target: Array,
        heading: float,
        around: tuple[float, float] | None = None,
        arrival: Arrival = AT_REST,
        **kw: float,
    ) -> bool:
        """Walk to ``target`` (2,) and stand there at ``heading``; see ``course`` and ``search.Arrival``."""
        return self.follow(self.course(target, heading, around, **kw), arrival=arrival)

    def nearest_segment(self, name: str, spread: float = 0.3) -> LaidSegment:
        """The segment whose legs are at first most like the tape's last ones, give or take chance of size
        ``spread``.
        """
        pose = self.lib.pose[int(round(self.tape.frames[-1]))][_LEGS]
        pieces = self.source.segments[name]
        costs = [
            float(np.linalg.norm(self.lib.pose[s.first][_LEGS] - pose, axis=-1).sum())
            + self.rng.exponential(spread)
            for s in pieces
        ]
        return pieces[int(np.argmin(costs))]
