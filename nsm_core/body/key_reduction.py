"""Fewer keys for a motion that has one in every frame, with a bound on how far anything moves for it.

Between the keys that stay, a channel runs along a cubic, as Bézier keys do whose handles span a third of the
way; its slopes at the keys are those that fit the motion best.  Keys are set where a bone misses the motion
most, first bone by bone, each within its share of the bound; then all bones are judged together, as they add
up along the chains, and keys are added where a joint is off by more than the bound, until none is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from nsm_core.body.contacts import ANKLES, TOES
from nsm_core.rotations import Array, quat_conjugate, quat_mul, quat_normalize, quat_rotate

_SHARE = 0.9  # of the bound for one bone alone: of those tried, what leaves the fewest keys
_FAINT = 1e-6  # by which slopes that the motion leaves open lean to its own
_STANDS = 0.03  # m/s of a foot's joint under which it stands, and keeps to _STANDING of the bound
_STANDING = 0.4
_AXES = {"X": 1, "Y": 2, "Z": 3}


@dataclass(frozen=True)
class Bound:
    """How far a joint may be from where it was, millimetres of the character, and how far a bone may be
    turned from how it was, degrees.
    """

    mm: float = 5.0
    degrees: float = 1.0


@dataclass(frozen=True)
class KeyedChannels:
    """The keyed channels of one bone, over T frames.

    ``turns`` (T, 3 or 4): its rotation in ``mode`` (QUATERNION, AXIS_ANGLE or an Euler order), without jumps;
    ``places`` (T, 3) or None: its location, and ``axes`` (T or 1, 3, 3) what that moves in the world, metres.
    """

    turns: Array
    mode: str = "QUATERNION"
    places: Array | None = None
    axes: Array | None = None

    @property
    def together(self) -> Array:
        """All of them, (T, 3 to 7)."""
        return self.turns if self.places is None else np.concatenate((self.turns, self.places), axis=1)


@dataclass(frozen=True)
class KeyedBody:
    """Bones that carry each other, each after what carries it.

    ``carriers`` of N bones, -1 for none; ``positions`` (T, N, 3), metres, and ``rotations`` (T, N, 4), both
    in the world; ``channels`` of those that have keys; ``free``: bones that do not turn with their carriers.
    ``feet``: bones that keep closer to the motion while they stand.
    """

    carriers: Sequence[int]
    positions: Array
    rotations: Array
    channels: dict[int, KeyedChannels]
    free: frozenset[int] = frozenset()
    feet: Sequence[int] = (*ANKLES, *TOES)
    fps: float = 30.0


@dataclass
class Reduced:
    """The keys that stay: rows (K,) of the frames of each bone with channels, the slopes (K, C) of all its
    channels at them, a frame, and what this does to the motion.

    ``before`` and ``after`` count keys of bones; ``mm`` and ``degrees`` are the largest deviations, at the
    rows ``worst``.
    """

    rows: dict[int, Array]
    slopes: dict[int, Array]
    before: int
    after: int
    mm: float
    degrees: float
    worst: tuple[int, int] = field(default=(0, 0))


def reduce_keys(body: KeyedBody, bound: Bound) -> Reduced:
    """Find the keys that keep every joint and bone of ``body`` within ``bound``; the ends keep theirs."""
    return _Reduction(body, bound).run()


class _Reduction:
    """One try: the rows that each bone keeps, and how each then misses the motion."""

    def __init__(self, body: KeyedBody, bound: Bound) -> None:
        self.body, self.count = body, len(body.positions)
        self.metres, self.radians = bound.mm / 1000, np.radians(bound.degrees)
        self.values = {n: channels.together.astype(np.float64) for n, channels in body.channels.items()}
        self.slopes = {n: _gradient(values) for n, values in self.values.items()}
        self.fitted: dict[int, Array] = {}  # (K, C) slopes at the keys
        self.true = {n: _quats(c.turns.astype(np.float64), c.mode) for n, c in body.channels.items()}
        self.kept = {n: np.zeros(self.count, bool) for n in body.channels}
        self.turned: dict[int, Array] = {}  # (T, 4) by which a bone's own channels miss, in the world
        self.moved: dict[int, Array] = {}  # (T, 3) metres, likewise
        self.allowed = np.full(body.positions.shape[:2], self.metres)
        stands = np.linalg.norm(_gradient(body.positions), axis=-1) * body.fps < _STANDS
        for foot in body.feet:
            self.allowed[stands[:, foot], foot] *= _STANDING

    def run(self) -> Reduced:
        """Keys within their share of the bound bone by bone, then as many more as the whole body asks for."""
        for n in self.body.channels:
            self._alone(n)
        while True:
            off, turned = self.missed()
            over = np.maximum(off / self.allowed, turned / self.radians)
            if not self._add(over):
                break
        after = sum(int(kept.sum()) for kept in self.kept.values())
        worst = (int(off.max(1).argmax()), int(turned.max(1).argmax()))
        return Reduced(
            {n: np.flatnonzero(kept) for n, kept in self.kept.items()},
            self.fitted,
            self.count * len(self.kept),
            after,
            1000 * float(off.max()),
            float(np.degrees(turned.max())),
            worst,
        )

    def missed(self) -> tuple[Array, Array]:
        """Metres and radians (T, N) by which joints and bones miss the motion."""
        body = self.body
        off, turns = np.zeros(body.positions.shape), np.zeros(body.rotations.shape)
        turns[..., 0] = 1
        for n, carrier in enumerate(body.carriers):
            if carrier >= 0:
                arm = body.positions[:, n] - body.positions[:, carrier]
                off[:, n] = off[:, carrier] + quat_rotate(turns[:, carrier], arm) - arm
                turns[:, n] = turns[:, carrier]
            if n in self.moved:
                off[:, n] += quat_rotate(turns[:, n], self.moved[n])
            if n in self.turned:
                turns[:, n] = self.turned[n] if n in body.free else quat_mul(turns[:, n], self.turned[n])
        return np.linalg.norm(off, axis=-1), angles(turns)

    def _alone(self, n: int) -> None:
        """Set keys of one bone until it alone keeps to its share of the bound, with all that it carries."""
        reach = self._reach(n)
        self.kept[n][[0, -1]] = True
        while True:
            self._judge(n)
            turned = angles(self.turned[n])
            error = np.maximum(turned / self.radians, turned * reach / self.metres)
            if n in self.moved:
                error = np.maximum(error, np.linalg.norm(self.moved[n], axis=1) / self.metres)
            rows = _peaks(error, self.kept[n], _SHARE)
            if not len(rows):
                return
            self.kept[n][rows] = True

    def _judge(self, n: int) -> None:
        """See how the channels of one bone miss with the keys that it has now."""
        channels, rows = self.body.channels[n], np.flatnonzero(self.kept[n])
        values, self.fitted[n] = _fitted(rows, self.values[n], self.slopes[n])
        width = channels.turns.shape[1]
        own = quat_mul(quat_conjugate(self.true[n]), _quats(values[:, :width], channels.mode))
        world = self.body.rotations[:, n].astype(np.float64)
        self.turned[n] = quat_mul(quat_mul(world, own), quat_conjugate(world))
        if channels.places is not None and channels.axes is not None:
            gap = values[:, width:] - self.values[n][:, width:]
            axes = np.broadcast_to(channels.axes, (self.count, 3, 3))
            self.moved[n] = np.einsum("nij,nj->ni", axes, gap)

    def _add(self, over: Array) -> bool:
        """Add keys where joints miss by more than they may (``over`` (T, N) above 1), to the bone above them
        that has most to do with it; False where nothing is missed.
        """
        touched = set()
        for joint in np.flatnonzero(over.max(0) > 1):
            rows = _peaks(over[:, joint], np.zeros(self.count, bool), 1.0)
            chain = self._chain(int(joint))
            blame = np.stack([self._blame(n, int(joint), rows) for n in chain])
            for row, guilty, most in zip(rows, blame.argmax(0), blame.max(0), strict=True):
                if most > 0:
                    self.kept[chain[guilty]][row] = True
                    touched.add(chain[guilty])
        for n in touched:
            self._judge(n)
        return bool(touched)

    def _blame(self, n: int, joint: int, rows: Array) -> Array:
        """How much bone ``n`` alone has to do with what a joint misses in ``rows``, in bounds; -1 where it
        has a key.
        """
        arm = np.linalg.norm(self.body.positions[rows, joint] - self.body.positions[rows, n], axis=1)
        turned = angles(self.turned[n][rows])
        share = np.maximum(turned / self.radians, turned * arm / self.allowed[rows, joint])
        if n in self.moved:
            share += np.linalg.norm(self.moved[n][rows], axis=1) / self.allowed[rows, joint]
        return np.where(self.kept[n][rows], -1.0, share)

    def _chain(self, joint: int) -> list[int]:
        """The bones with channels that move a joint, itself first."""
        chain = []
        while joint >= 0:
            if joint in self.body.channels:
                chain.append(joint)
            joint = self.body.carriers[joint]
        return chain

    def _reach(self, n: int) -> Array:
        """How far (T,) what a bone carries reaches from it, metres."""
        carried = {n}
        for k, carrier in enumerate(self.body.carriers):
            if carrier in carried:
                carried.add(k)
        arms = self.body.positions[:, sorted(carried)] - self.body.positions[:, n : n + 1]
        return np.linalg.norm(arms, axis=-1).max(1)


def _peaks(error: Array, kept: Array, limit: float) -> Array:
    """The worst row between any two keys, or in any stretch without them, where ``error`` (T,) is over the
    limit.
    """
    over = (error > limit) & ~kept
    if not over.any():
        return np.zeros(0, int)
    # Stretches: rows between the same keys, or rows that follow on each other where there is none.
    stretch = np.cumsum(kept) if kept.any() else np.cumsum(~over)
    rows = np.flatnonzero(over)
    order = np.lexsort((-error[rows], stretch[rows]))
    first = np.concatenate(([True], np.diff(stretch[rows][order]) != 0))
    return rows[order][first]


def _fitted(rows: Array, motion: Array, slope: Array) -> tuple[Array, Array]:
    """The curves (T, C) with keys of ``motion`` (T, C) at ``rows`` (K,) that miss it least, and their slopes
    (K, C) at these.

    ``slope`` (T, C) is the motion's own: that of keys in each frame, where nothing else tells.
    """
    if len(rows) < 2:
        return motion[rows[np.zeros(len(motion), int)]], slope[rows]
    at = np.arange(len(motion))
    i = np.clip(np.searchsorted(rows, at, side="right") - 1, 0, len(rows) - 2)
    span = (rows[i + 1] - rows[i]).astype(np.float64)
    u = (at - rows[i]) / span
    v = 1 - u
    held = (v * v * (1 + 2 * u))[:, None] * motion[rows[i]] + (u * u * (1 + 2 * v))[:, None] * motion[
        rows[i + 1]
    ]
    by_slope = np.zeros((len(at), len(rows)))
    by_slope[at, i], by_slope[at, i + 1] = span * u * v * v, -span * u * u * v
    normal = by_slope.T @ by_slope + _FAINT * np.eye(len(rows))
    best = np.linalg.solve(normal, by_slope.T @ (motion - held) + _FAINT * slope[rows])
    return held + by_slope @ best, best


def _gradient(values: Array) -> Array:
    """Change of values (T, ...) a frame, of the same shape."""
    return np.gradient(values, axis=0) if len(values) > 1 else np.zeros_like(values)


def _quats(values: Array, mode: str) -> Array:
    """Quaternions (T, 4) of rotation channels (T, 3 or 4)."""
    if mode == "QUATERNION":
        return quat_normalize(values)
    if mode == "AXIS_ANGLE":
        axis = values[:, 1:] / np.maximum(np.linalg.norm(values[:, 1:], axis=1, keepdims=True), 1e-12)
        return np.column_stack((np.cos(values[:, 0] / 2), np.sin(values[:, :1] / 2) * axis))
    total = np.zeros((len(values), 4))
    total[:, 0] = 1
    for letter in mode:  # the first letter turns first
        turn = np.zeros_like(total)
        angle = values[:, _AXES[letter] - 1] / 2
        turn[:, 0], turn[:, _AXES[letter]] = np.cos(angle), np.sin(angle)
        total = quat_mul(turn, total)
    return total


def angles(turns: Array) -> Array:
    """Angles (...), radians, of turns (..., 4); exact for small ones."""
    return 2 * np.arctan2(np.linalg.norm(turns[..., 1:], axis=-1), np.abs(turns[..., 0]))
