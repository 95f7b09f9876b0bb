"""Where feet stand in a whole take, and their ways from one place to the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nsm_core.body.contacts import ANKLES, RESTING, Sole, foot_heading
from nsm_core.conventions import FPS
from nsm_core.rotations import Array, heading_quat, heading_to_direction, quat_mul, quat_rotate, wrap_angle
from nsm_core.signals import gaussian_smooth, intervals, smooth_step
from nsm_core.world.scene.terrain import Terrain

from .solver import Task
from .tasks import PointTask, TurnTask

FOOT, FOOT_TURN = 0.001, 0.03  # metres and radians that may be left of where feet are to be
LOCK, UNLOCK = 0.5, 0.3  # of the contact label
GLIDING, TORN = 0.7, 1.0  # m/s: a foot that moves faster is not planted; one that does is let go
LOW_TOE, HIGH_TOE = (
    0.08,
    0.14,
)  # metres over its ground at which a toe may stand: on the floor, on top of things
SHORTEST, GAP = 3, 2  # frames of a stand at least; of a lift that is none
# Metres and radians by which the pose may leave a stand; of stands longer than LONG frames, where the foot is
# then set anew, raised by STEP_LIFT in STEP_FRAMES.
SPREAD, LONG_SPREAD, LONG = 0.14, 0.06, 36
PIVOT, LONG_PIVOT = np.radians(40), np.radians(25)
STEP_FRAMES, STEP_LIFT = 12, 0.04
APART = 0.02  # metres between where a foot stood and where it is to stand from which on it steps there
FADE = 9  # frames over which a correction fades where the next stand is far
CLEARANCE, FAST = 0.03, 0.35  # metres that a swinging foot clears the floor by once it is that fast, m/s
TIP, MIDDLE, ANKLE, HEEL = 0.075, -0.08, -0.14, -0.17  # metres from the toe joint along the foot
HANGING = 0.4  # metres that a stand may be moved by for a foot that hangs over an edge whole
RISE, QUICK = 0.05, 3.0  # metres a frame by which a foot is raised at most, about; frames at least
EDGE = 0.02  # metres that a foot clears an edge by, and keeps off a riser
STEP_IN = 0.12  # metres over its sole up to which a foot stands on what is under it
_BACK = np.arange(0.0, 0.19, 0.01)
_ASIDE = np.array(sorted(np.arange(-0.28, 0.281, 0.01), key=abs))  # the least first


@dataclass
class Footsteps:
    """Where feet are to be: ``ankles`` (T, 2, 3) and ankle ``rotations`` (T, 2, 4), world; ``planted`` (T,
    2).

    ``runs`` are the half-open intervals of the right and the left foot's stands.
    """

    ankles: Array
    rotations: Array
    planted: Array
    runs: tuple[list[tuple[int, int]], ...]

    def tasks(self) -> list[Task]:
        """What they ask of the solver: a swinging foot has some play, one that stands has none."""
        tasks: list[Task] = []
        for side, ankle in enumerate(ANKLES):
            slack = np.where(self.planted[:, side], 1.0, 4.0)
            tasks.append(PointTask(ankle, self.ankles[:, side], FOOT * slack))
            tasks.append(TurnTask(ankle, self.rotations[:, side], FOOT_TURN * slack))
        return tasks


@dataclass
class FootGround:
    """Heights of what feet stand on: ``all`` of it, and ``low`` what of it one walks over, whose level the
    motion has already, ``level`` (T,) metres.
    """

    all: Terrain
    low: Terrain
    level: Array

    def height(self, places: Array) -> Array:
        """Heights (...) at floor places (..., 2)."""
        if not self.all:
            return np.zeros(places.shape[:-1])
        return self.all.height(places.reshape(-1, 2)).reshape(places.shape[:-1])


def footsteps(
    toes: Array,
    feet: Array,
    labels: Array,
    ground: FootGround,
    sole: Sole | None = None,
    first: tuple[Array, Array] | None = None,
    last: tuple[Array, Array] | None = None,
    clearance: float = CLEARANCE,
) -> Footsteps:
    """Plant the feet of a whole take: toe joints (T, 2, 3), ankle rotations (T, 2, 4), contact labels (T, 2).

    In every stand the toe joint keeps one place and the foot one heading, from landing to lift-off; between
    two stands the correction goes over from one to the other with the speed of the foot at both ends.
    ``first``: toe joints (2, 3) and ankle rotations (2, 4) of feet that stood before the first frame and
    stay; ``last``: of feet that are to stand after the last one. ``clearance``: metres of quick swinging feet
    over the floor.
    """
    sole = sole or Sole()
    toes, feet = toes.copy(), feet.copy()
    if ground.low:
        toes[..., 2] += _own_level(toes, ground)
    planted = np.zeros(toes.shape[:2], bool)
    steps: list[int] = []  # frames about which the other foot is set anew
    stands: list[list[tuple[int, int]]] = []
    for side in (0, 1):
        runs = _stands(toes[:, side], labels[:, side], ground)
        if first is not None and last is not None:
            runs = _stepped(runs, len(toes), first[0][side], last[0][side])
        runs, steps = _set_anew(toes[:, side], foot_heading(feet[:, side]), runs, steps)
        stands.append(runs)
        kept, met = (None if end is None else (end[0][side], end[1][side]) for end in (first, last))
        toes[:, side], feet[:, side] = _pinned(
            toes[:, side], feet[:, side], runs, ground, sole.toe_height, kept, met
        )
        for a, b in runs:
            planted[a:b, side] = True
    for side in (0, 1):
        toes[:, side, 2] += _raised(toes[:, side], feet[:, side], planted[:, side], ground, sole, clearance)
        toes[:, side, :2] += _held_off(toes[:, side], feet[:, side], planted[:, side], ground, sole)
    return Footsteps(toes - quat_rotate(feet, sole.toe), feet, planted, tuple(stands))


def _own_level(toes: Array, ground: FootGround) -> Array:
    """Metres (T, 2) by which feet are raised from the level of the walker to the low ground under them."""
    under = ground.low.height(toes[..., :2].reshape(-1, 2)).reshape(toes.shape[:2])
    return gaussian_smooth(_widest(under, 2), 2.0) - ground.level[:, None]


def _widest(values: Array, frames: int) -> Array:
    """The largest of (T, ...) within so many frames."""
    pad = [(frames, frames)] + [(0, 0)] * (values.ndim - 1)
    view = np.lib.stride_tricks.sliding_window_view(np.pad(values, pad, mode="edge"), 2 * frames + 1, axis=0)
    return np.asarray(view.max(-1))


def _stands(toe: Array, label: Array, ground: FootGround) -> list[tuple[int, int]]:
    """Half-open intervals of frames in which a foot stands, by its label and by how the pose moves it."""
    speed = _speed(toe)
    height = toe[:, 2] - ground.height(toe[:, :2])
    low = height < np.where(ground.height(toe[:, :2]) > 0, HIGH_TOE, LOW_TOE)
    on, stands = np.zeros(len(toe), bool), False
    for t in range(len(toe)):
        if stands:
            stands = label[t] > UNLOCK and speed[t] < TORN and height[t] < HIGH_TOE
        else:
            stands = label[t] > LOCK and speed[t] < GLIDING and bool(low[t])
        on[t] = stands
    if len(on):
        on[0] = on[0] or (low[0] and speed[0] < RESTING)
    for a, b in intervals(~on):
        if b - a <= GAP and a > 0 and b < len(on):
            on[a:b] = True
    return [(a, b) for a, b in intervals(on) if b - a >= SHORTEST or a == 0]


def _speed(toe: Array) -> Array:
    if len(toe) < 2:
        return np.zeros(len(toe))
    return np.linalg.norm(np.gradient(toe[:, :2], axis=0), axis=1) * FPS


def _stepped(runs: list[tuple[int, int]], count: int, first: Array, last: Array) -> list[tuple[int, int]]:
    """Stands of a foot that stood at ``first`` (3,) and is to stand at ``last``: one that lasts all the time
    is divided by a step from one to the other, where they are not the same.
    """
    if runs != [(0, count)] or np.linalg.norm((last - first)[:2]) < APART:
        return runs
    half = min(STEP_FRAMES // 2, max(1, (count - 2) // 2))
    return [(0, max(1, count // 2 - half)), (min(count - 1, count // 2 + half), count)]


def _set_anew(
    toe: Array, heading: Array, runs: Sequence[tuple[int, int]], other: Sequence[int]
) -> tuple[list[tuple[int, int]], list[int]]:
    """Divide stands from which the pose goes too far: the stands, and the frames at which the foot is set
    anew.

    That is put off while the ``other`` foot is set anew.
    """
    out: list[tuple[int, int]] = []
    steps: list[int] = []
    heading = np.unwrap(heading)
    for a, b in runs:
        spread, pivot = (LONG_SPREAD, LONG_PIVOT) if b - a > LONG else (SPREAD, PIVOT)
        start, t = a, a + 1
        low, high = toe[a, :2].copy(), toe[a, :2].copy()
        turned_low = turned_high = float(heading[a])
        while t < b:
            low, high = np.minimum(low, toe[t, :2]), np.maximum(high, toe[t, :2])
            turned_low, turned_high = min(turned_low, heading[t]), max(turned_high, heading[t])
            too_far = np.linalg.norm(high - low) > 2 * spread or turned_high - turned_low > 2 * pivot
            if too_far and t - start > SHORTEST:
                at = t
                while any(abs(at - o) < STEP_FRAMES for o in other) and at < b - 1:
                    at += 1
                first, last = max(start + SHORTEST, at - STEP_FRAMES // 2), min(at + STEP_FRAMES // 2, b)
                out.append((start, first))
                steps.append(at)
                start = t = last
                if start >= b:
                    break
                low, high = toe[start, :2].copy(), toe[start, :2].copy()
                turned_low = turned_high = float(heading[start])
            t += 1
        if start < b and (b - start >= SHORTEST or start == a):
            out.append((start, b))
    return out, steps


def _pinned(
    toe: Array,
    foot: Array,
    runs: Sequence[tuple[int, int]],
    ground: FootGround,
    toe_height: float,
    first: tuple[Array, Array] | None = None,
    last: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:
    """Toe joints (T, 3) and rotations (T, 4) of one foot that stands still in each of ``runs``; one that
    stands from the beginning on stays where it ``first`` was, one that stands to the end where it is
    ``last``.
    """
    heading = np.unwrap(foot_heading(foot))
    shift, turn = np.zeros((len(toe), 3)), np.zeros(len(toe))
    for a, b in runs:
        h = heading[a:b]
        middle, spread = float(np.median(h)), float(np.ptp(h))
        firm = float(np.clip((np.radians(60) - spread) / np.radians(20), 0, 1))
        place = np.median(toe[a:b, :2], axis=0)
        if a == 0 and first is not None:
            place = first[0][:2]
            middle = h[0] + float(wrap_angle(foot_heading(first[1]) - h[0]))
        elif b == len(toe) and last is not None:
            place = last[0][:2]
            middle = h[-1] + float(wrap_angle(foot_heading(last[1]) - h[-1]))
        turn[a:b] = firm * (middle - h)
        under = _stand_height(place, middle, float(np.median(toe[a:b, 2])) - toe_height, ground)
        place = place + _off_risers(place, middle, under, ground)
        shift[a:b, :2] = place - toe[a:b, :2]
        shift[a:b, 2] = under + toe_height - toe[a:b, 2]
    _bridge(shift, runs, np.gradient(toe, axis=0) if len(toe) > 1 else np.zeros_like(toe))
    _bridge(turn[:, None], runs, np.gradient(heading)[:, None] if len(toe) > 1 else np.zeros((len(toe), 1)))
    for (_, a), (b, _) in zip(runs[:-1], runs[1:], strict=True):
        if b - a <= STEP_FRAMES + 1 and np.ptp(toe[a:b, 2]) < 0.02:  # a foot that is set anew is raised
            shift[a:b, 2] += STEP_LIFT * np.sin(np.pi * (np.arange(b - a) + 1) / (b - a + 1)) ** 2
    return toe + shift, quat_mul(heading_quat(turn), foot)


def _stand_height(place: Array, heading: float, sole: float, ground: FootGround) -> float:
    """Height of what a foot stands on at a place (2,): the highest ground under its ball that is not far over
    its sole.
    """
    if not ground.all:
        return 0.0
    ahead = heading_to_direction(np.array(heading))
    heights = ground.height(np.stack((place, place + MIDDLE * ahead)))
    below = heights[heights < sole + STEP_IN]
    return float(below.max() if len(below) else heights.min())


def _off_risers(place: Array, heading: float, under: float, ground: FootGround) -> Array:
    """Metres (2,) by which a stand is moved along the foot, so that no part of it is in a riser: the least,
    but for what it hangs over an edge from ankle to ball.
    """
    if not ground.all:
        return np.zeros(2)
    ahead = heading_to_direction(np.array(heading))
    along = np.arange(HEEL - EDGE, TIP + EDGE + 1e-6, EDGE)
    heights = ground.height(place + (_ASIDE[:, None] + along)[..., None] * ahead)
    free = (heights < under + 2 * EDGE).all(1)
    if not free.any():
        return np.zeros(2)
    borne = (along > ANKLE - EDGE / 2) & (along < EDGE / 2)
    hangs = (heights[:, borne] < under - 2 * EDGE).mean(1)
    return np.asarray(_ASIDE[np.argmin(np.where(free, abs(_ASIDE) + HANGING * hangs, np.inf))] * ahead)


def _bridge(values: Array, runs: Sequence[tuple[int, int]], pace: Array) -> None:
    """Fill (T, n) corrections between stands, in place, so that what moves by ``pace`` (T, n) a frame of
    itself leaves and reaches its stands with no jump of speed.
    """
    count = len(values)
    for (_, end), (start, _) in zip([(0, 0), *runs], [*runs, (count, count)], strict=True):
        gap = start - end
        if gap <= 0:
            continue
        steps = np.arange(1, gap + 1)
        n = min(FADE, gap + 1)
        out = np.zeros((gap, values.shape[1]))
        if end > 0 and start < count and gap <= 2 * FADE:
            u = (steps / (gap + 1))[:, None]
            a, b = values[end - 1], values[start]
            va, vb = -pace[end - 1] * (gap + 1), -pace[start] * (gap + 1)
            h = 1 - smooth_step(u)
            out = h * a + (1 - h) * b + (u * (1 - u) ** 2) * va - (u**2 * (1 - u)) * vb
        else:
            if end > 0:
                u = np.clip(steps / n, 0, 1)[:, None]
                out += (1 - smooth_step(u)) * values[end - 1] - (u * (1 - u) ** 2) * pace[end - 1] * n
            if start < count:
                u = np.clip((gap + 1 - steps) / n, 0, 1)[:, None]
                out += (1 - smooth_step(u)) * values[start] + (u * (1 - u) ** 2) * pace[start] * n
        values[end:start] = out


def _raised(
    toe: Array, foot: Array, planted: Array, ground: FootGround, sole: Sole, clearance: float
) -> Array:
    """Metres (T,) by which a foot is raised: out of the ground, and over floor and edges while it swings."""
    ahead = heading_to_direction(foot_heading(foot))
    heights = ground.height(np.stack([toe[:, :2] + k * ahead for k in (0.0, MIDDLE, HEEL, TIP)], axis=1))
    under = np.where(planted, np.minimum(heights[:, 0], toe[:, 2] - sole.toe_height), heights[:, 0])
    deep = sole.depth(toe, foot, under, np.minimum(under, heights[:, 2]))
    out = gaussian_smooth(_widest(deep, 1), 1.0)
    fast = smooth_step(_speed(toe) / FAST)
    over = np.where(heights[:, 0] > 0, EDGE, clearance) * fast
    height = toe[:, 2] - sole.toe_height
    need = np.where(planted, 0.0, np.maximum(_widest(heights, 1).max(1) + over - height, 0.0))
    for a, b in intervals(~planted):
        k = np.arange(b - a)
        before = np.full(b - a, np.inf) if a == 0 else k + 1.0
        after = np.full(b - a, np.inf) if b == len(toe) else (b - a) - k
        lift = need[a:b]
        slow = max(QUICK, float(lift.max()) / RISE)  # frames in which it is raised
        lift = gaussian_smooth(_widest(lift, int(slow / 2)), slow / 4) if b - a > 2 else lift
        out[a:b] = np.maximum(out[a:b], lift * smooth_step(before / slow) * smooth_step(after / slow))
    return out


def _held_off(toe: Array, foot: Array, planted: Array, ground: FootGround, sole: Sole) -> Array:
    """Metres (T, 2) by which a swinging foot is held back before a riser that it is too low for, or
    on behind it.
    """
    out = np.zeros((len(toe), 2))
    if not ground.all:
        return out
    ahead = heading_to_direction(foot_heading(foot))
    limit = (toe[:, 2] - sole.toe_height + EDGE)[:, None]
    for part, sign in ((np.arange(0.0, TIP + EDGE, EDGE), -1.0), (np.arange(HEEL - EDGE, 0.0, EDGE), 1.0)):
        along = (part + sign * _BACK[:, None])[None, ..., None]
        free = (ground.height(toe[:, None, None, :2] + along * ahead[:, None, None]) < limit[..., None]).all(
            2
        )
        off = np.where(free.any(1), _BACK[free.argmax(1)], 0.0) * ~planted
        for a, b in intervals(~planted):
            if off[a:b].any() and b - a > 2:
                ends = smooth_step((np.minimum(np.arange(b - a), b - a - 1 - np.arange(b - a)) + 1) / 3.0)
                off[a:b] = gaussian_smooth(_widest(off[a:b], 1), 1.5) * ends
        out += sign * off[:, None] * ahead
    return out


__all__ = ["Footsteps", "FootGround", "footsteps"]
