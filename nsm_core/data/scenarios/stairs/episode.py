"""Stairs: a level walk whose steps are shortened to the treads of a flight, and raised along it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from nsm_core.body.clip import smoothed_root
from nsm_core.body.skeleton import forward_kinematics
from nsm_core.body.thin_capsules import thin_depths
from nsm_core.conventions import CLIMB
from nsm_core.data.scenarios.climb.episode import holds_of
from nsm_core.data.scenarios.climb.footholds import HEEL, TIPS, Foothold
from nsm_core.data.scenarios.motion import Motion
from nsm_core.data.scenarios.session import Session
from nsm_core.data.scenarios.take import Placed, TimedCommand
from nsm_core.rotations import Array, heading_to_direction, wrap_angle
from nsm_core.signals import gaussian_smooth, smooth_step
from nsm_core.world.scene.furniture import cuboids
from nsm_core.world.scene.furniture.flight import flight_piece
from nsm_core.world.scene.stairs import BLEND, Flight

from .draws import LANDINGS, STAIRS
from .gait import raised, shortened

LEVEL_STEP = 0.66  # metres of a step on level ground, about
LEAST_STEP = 0.3  # metres of one that is shortened to a tread, at least
ASKEW, ASIDE = 0.3, 0.3  # radians and metres by which the walk may leave the line of the flight
# The longest steps before and behind a flight, nearest to it first, metres.
SHORT = (0.42, 0.55)
OFF_RISER = 0.015  # metres that a heel keeps from the riser behind it
DEEPEST = 0.06  # metres that a body may be in a flight or its landing
CROWD = 0.45  # metres that ways keep from the sides of a flight


@dataclass
class StairEpisode:
    """One flight that is gone up or down.

    ``first`` and one past the ``last`` frame in which steps are shortened, ``lift`` and ``both`` those of
    leaving the one floor and of having both feet on the other; ``walked`` (n, 2) the roots of the level walk
    from ``first`` on, and ``knots`` (2, K): metres along the flight at which feet stood there, and stand now.
    Hips are ``taller`` and the trunk ``lean``s over the flight, metres and radians.
    ``base`` is the height of the ground at its foot, once it is fitted.
    """

    flight: Flight
    up: bool
    first: int
    last: int
    lift: int
    both: int
    walked: Array
    knots: Array
    lean: float
    taller: float
    plate: float | None
    end: int = 0
    base: float = 0.0
    places: list[tuple[Array, float]] = field(default_factory=list)

    def clear(self, session: Session) -> bool:
        """Whether all other ways keep off the flight."""
        roots = np.array(session.tape.roots)
        other = np.ones(len(roots), bool)
        other[self.first : self.end] = False
        own = self.flight.local(roots)
        beside = np.abs(own[:, 1]) < self.flight.width / 2 + CROWD
        along = (own[:, 0] > -CROWD) & (own[:, 0] < self.flight.length + CROWD)
        return not (beside & along & other).any()

    def fit(self, motion: Motion) -> None:
        """Shorten the steps to the treads, on level ground, and label the flight."""
        span = slice(self.first, self.last)
        back = self.walked[: self.last - self.first] - motion.roots[span]
        motion.rotations[span] = shortened(
            motion.hips[span], motion.rotations[span], back, self.flight, self.up, self.knots
        )
        motion.ramp(CLIMB, self.lift - 6, self.lift + 6, max(self.both - 4, self.lift + 7), self.both + 6)

    def finish(self, motion: Motion) -> None:
        """Raise feet and hips along the flight, and tell all over the floor that rises with it."""
        span = slice(self.first, min(self.last + 15, len(motion)))
        hips, rotations = motion.hips[span], motion.rotations[span]
        root = smoothed_root(forward_kinematics(hips, rotations)[0])[0]
        start = float(motion.level[self.first])
        base = start if self.up else start - self.flight.rise
        rising = self.flight.level(self.flight.local(root)[:, 0])
        on = smooth_step((np.arange(len(hips)) + self.first - self.lift) / 12.0)
        on = on * smooth_step((self.both - self.first - np.arange(len(hips))) / 12.0 + 0.5)
        hips, rotations, stands = raised(
            hips,
            rotations,
            motion.feet[span],
            self.flight,
            self.up,
            rising + self.taller * on,
            self.lean * on,
        )
        motion.hips[span], motion.rotations[span] = hips - rising[:, None] * (0, 0, 1), rotations
        motion.feet[span] = stands
        motion.level[span] = base + rising
        motion.level[span.stop :] = base + (self.flight.rise if self.up else 0.0)
        self.base = base

    def placed(self, motion: Motion) -> Placed | None:
        """The solids of the flight with the largest landing that nobody walks through; None where there is
        none.
        """
        hips = motion.hips[::2] + motion.level[::2, None] * (0, 0, 1)
        for landing in LANDINGS:
            piece = flight_piece(self.flight, landing, self.plate)
            place = np.append(self.flight.foot, self.base)
            found = Placed(piece, place, self.flight.heading + np.pi)
            solid = cuboids([(found.furniture, found.position, found.heading)])
            if thin_depths(hips, motion.rotations[::2], solid).max() < DEEPEST:
                return found
        return None


def lay(session: Session) -> StairEpisode | None:
    """Walk straight on, and put a flight of stairs where the feet allow it."""
    rng, tape = session.rng, session.tape
    up = rng.random() < STAIRS.up
    steps = int(rng.integers(*STAIRS.steps))
    riser, tread, width = (float(rng.uniform(*r)) for r in (STAIRS.riser, STAIRS.tread, STAIRS.width))
    plate = float(rng.uniform(*STAIRS.plate)) if rng.random() < STAIRS.plates else None
    heading = float(tape.headings[-1] + rng.normal(0, STAIRS.off_ahead))
    ahead = heading_to_direction(np.array(heading))
    before, beyond = rng.uniform(*STAIRS.before), rng.uniform(*STAIRS.beyond)
    distance = before + LEVEL_STEP * steps + beyond
    start, base = len(tape), tape.roots[-1].copy()
    mark = session.command("walk", session.lead())
    if not session.go(
        base + distance * ahead,
        heading,
        straight_end=distance - 0.5 * before,
        speed=float(rng.uniform(*STAIRS.speed)),
    ):
        return None
    holds = holds_of(session, start)
    at = np.array([(h.place - base) @ ahead for h in holds])
    k = _fits(session, holds, at, steps, heading, ahead)
    if k is None:
        return None
    rate = np.ones(len(tape) - start)
    slow = rng.uniform(*(STAIRS.rate_up if up else STAIRS.rate_down))
    rate[max(holds[k - 1].first - start, 0) : holds[k + steps - 1].first + 4 - start] = slow
    when = tape.stretch(start, gaussian_smooth(rate, 4.0).clip(0.5, 1))

    def now(frame: int) -> int:
        """A frame of the walk as it was laid, after it was slowed down."""
        return start + int(np.ceil(when[min(max(frame - start, 0), len(when) - 1)]))

    first, last = now(holds[k - 3].last), now(holds[k + steps + 1].first)
    knots, foot = _knots(session, at, k, steps, tread, up)
    walked = np.array(tape.roots[first:])
    along = (walked - base) @ ahead
    new = gaussian_smooth(along + _moved(along, knots), 4.0)
    on = smooth_step((np.arange(len(new)) + first - now(holds[k - 1].last)) / 15.0) * smooth_step(
        (now(holds[k + steps].first) - first - np.arange(len(new))) / 15.0
    )
    new = new + on * rng.uniform(*(STAIRS.ahead_up if up else STAIRS.ahead_down))
    moved = walked + (new - along)[:, None] * ahead
    tape.roots[first:] = list(moved)
    side = np.array((-ahead[1], ahead[0]))
    within = slice(now(holds[k].first) - first, now(holds[k + steps - 1].first) - first)
    slack = max(0.0, width / 2 - STAIRS.from_sides)
    lateral = float(np.median((walked[within] - base) @ side)) + rng.uniform(-slack, slack)
    place = base + foot * ahead + lateral * side
    own = heading if up else heading + np.pi
    flight = Flight(place, float(own + rng.normal(0, STAIRS.off_square)), width, tread, riser, steps)
    ends = flight.local(moved[[0, -1]])[:, 0]
    low, high = (ends[0], ends[1]) if up else (ends[1], ends[0])
    room = tread / 2 + BLEND
    if low > -room or high < flight.length + room:
        return None
    sides = [h.last for h in holds[:k] if h.side == holds[k].side]
    lean = float(rng.uniform(*(STAIRS.lean_up if up else STAIRS.lean_down)))
    taller = float(rng.uniform(*(STAIRS.taller_up if up else STAIRS.taller_down)))
    result = StairEpisode(
        flight,
        up,
        first,
        last,
        now(sides[-1]),
        now(holds[k + steps].first),
        walked,
        np.stack((at_of(flight, base, ahead, knots[0], up), at_of(flight, base, ahead, knots[1], up))),
        lean,
        taller,
        plate,
    )
    result.places = [(flight.at(s), 0.5 * width + 0.3) for s in np.arange(-0.3, flight.length + 0.6, 0.4)]
    _command(session, mark, now(holds[k + steps - 1].first), distance)
    tape.stand(rng.uniform(*STAIRS.stands))
    result.end = len(tape)
    return result


def at_of(flight: Flight, base: Array, ahead: Array, along: Array, up: bool) -> Array:
    """Metres from the end of the flight where it is begun, at metres ``along`` (K,) the way from ``base``."""
    begin = flight.foot if up else flight.top
    return along - float((begin - base) @ ahead)


def _command(session: Session, mark: int, landed: int, distance: float) -> None:
    """Say what is asked for: to be led along, to go to the end, or the one and then the other."""
    rng, tape = session.rng, session.tape
    at, facing = np.append(tape.roots[-1], 0.0).astype(np.float32), tape.headings[-1]
    if distance < STAIRS.farthest and rng.random() > STAIRS.led:
        session.stand_here(mark)
    elif rng.random() < STAIRS.sent:
        session.commands.append(TimedCommand(landed, "idle", at, facing))


def _fits(
    session: Session, holds: list[Foothold], at: Array, steps: int, heading: float, ahead: Array
) -> int | None:
    """Which hold is the first on the flight, so that it and the next ones take turns, straight ahead; None
    where none is.
    """
    roots, headings = np.array(session.tape.roots), np.array(session.tape.headings)
    side = np.array((-ahead[1], ahead[0]))
    good = []
    for k in range(3, len(holds) - steps - 1):
        part = range(k - 3, k + steps + 2)
        turns = all(holds[i].side != holds[i + 1].side for i in part[:-1])
        gaps = np.diff(at[part])
        frames = slice(holds[k - 2].first, holds[k + steps].first)
        askew = np.abs(wrap_angle(headings[frames] - heading)).max()
        aside = np.ptp((roots[frames]) @ side)
        strides = (gaps[1:-1] > LEAST_STEP).all() and (gaps[[0, -1]] > 0.1).all()
        if turns and strides and askew < ASKEW and aside < ASIDE:
            good.append(k)
    good = good[: STAIRS.first_hold]
    return int(session.rng.choice(good)) if good else None


def _knots(session: Session, at: Array, k: int, steps: int, tread: float, up: bool) -> tuple[Array, float]:
    """Where feet stood along the way and where they stand now (2, K), and where the foot of the flight is,
    metres.
    """
    rng, part = session.rng, np.arange(k - 3, k + steps + 2)
    gaps = np.diff(at[part])
    new = np.zeros(len(part))
    new[0] = at[part[0]]
    new[1] = new[0] + min(gaps[0], SHORT[1])
    new[2] = new[1] + min(gaps[1], SHORT[0])
    edge = new[2] + TIPS + rng.uniform(*(STAIRS.short_of_riser if up else STAIRS.short_of_edge))
    # Up, toes come to the next riser; down, to the edge, with the heel off the riser behind.
    on = tread - TIPS - 0.03 if up else max(HEEL + OFF_RISER, tread - TIPS - OFF_RISER)
    places = edge + tread * np.arange(steps) + on + rng.normal(0, STAIRS.off_place, steps).clip(-0.02, 0.02)
    if not up:
        places = np.maximum(places, edge + tread * np.arange(steps) + HEEL + OFF_RISER)
    places[-1] = edge + tread * (steps - 1) + max(rng.uniform(*STAIRS.landing), on if not up else 0.0)
    new[3 : 3 + steps] = places
    new[3 + steps] = places[-1] + min(gaps[-2], SHORT[0])
    new[4 + steps] = new[3 + steps] + min(gaps[-1], SHORT[1])
    return np.stack((at[part], new)), edge if up else edge + tread * (steps - 1)


def _moved(along: Array, knots: Array) -> Array:
    """Metres (...) by which what was ``along`` (...) the level walk has moved on."""
    return np.interp(along, knots[0], knots[1] - knots[0])
