"""How natural motion is: gait, poses and the spread of them, beside captures, by figures that need no model.

The Frechet distance compares windows of motion: joint positions about the hips in their heading, and their
change from frame to frame, each number in units of its own spread over the captures, in the captures'
``COMPONENTS`` principal components.  It is that between the normal distributions of two sets of windows, as a
share of the captures' variance in these components: 0 for the same motion, about 1 for motion that is as far
off as captured windows are from their mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nsm_core.body.skeleton import ARMS, FEET, HIPS, INDEX, J, root_of
from nsm_core.conventions import CLIMB, FPS, SIT
from nsm_core.data.captures.gait import crossings
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.signals import intervals

from .motion import hips_speed, jerk

COMPONENTS = 20  # principal components of captured windows
LENGTHS = {"0.5 s": (15, 5), "2 s": (60, 5)}  # frames of a window, and from one to the next
FEW = 30  # windows from which on a distance is told
WALKS = 0.5  # m/s of the hips, on average over a window
BENT = 1.1  # metres of Chest4 over the floor under which somebody who does not sit bends
_MOST_FITTED = 1500  # windows that the components are found from
_CHEST = INDEX["Chest4"]
_HANDS = [joint for arm in ARMS for joint in arm[1:]]
_BODY = [j for j in range(1, J)]
_NO_HANDS = [j for j in _BODY if j not in _HANDS]
KINDS = ("walks", "sits", "bends", "climbs")


@dataclass(frozen=True)
class WatchedMotion:
    """A motion that is looked at: ``positions`` (T, 23, 3), metres, ``labels`` (T, 7), and whose it is."""

    name: str
    group: str
    person: str
    positions: Array
    labels: Array


def shown(motion: WatchedMotion, kind: str) -> Array:
    """How much (T,) each frame shows of ``kind``, of ``KINDS`` or "all"; a window counts where it is over 0.5
    on average.
    """
    if kind == "all":
        return np.ones(len(motion.positions))
    sits, climbs = motion.labels[:, SIT], motion.labels[:, CLIMB]
    if kind == "sits":
        return np.asarray(sits)
    if kind == "climbs":
        return np.asarray(climbs)
    free = (sits < 0.1) & (climbs < 0.1)
    if kind == "bends":
        return np.asarray(free & (motion.positions[:, _CHEST, 2] < BENT), float)
    # Half of the speed, so that the mean over a window tells its mean speed.
    return np.asarray(np.where(free, hips_speed(motion.positions) / (2 * WALKS), 0.0))


def windows(motion: WatchedMotion, kind: str, length: str) -> Array:
    """Windows (N, F) of a motion that show ``kind``.

    In sits and bends elbows and wrists are left out: some captures hold them up by protocol.
    """
    count, step = LENGTHS[length]
    joints = _NO_HANDS if kind in ("sits", "bends") else _BODY
    if len(motion.positions) <= count:
        return np.zeros((0, 2 * count * len(joints) * 3), np.float32)
    _, heading = root_of(motion.positions)
    about = rotate_planar(motion.positions[:, joints] - motion.positions[:, :1], -heading[:, None])
    change = np.diff(about, axis=0)
    mean = np.convolve(shown(motion, kind), np.ones(count) / count, mode="valid")
    first = [a for a in range(0, len(about) - count, step) if mean[a] > 0.5]
    found = [np.concatenate((about[a : a + count].ravel(), change[a : a + count].ravel())) for a in first]
    return np.array(found, np.float32).reshape(len(found), 2 * count * len(joints) * 3)


@dataclass(frozen=True)
class Space:
    """The principal components of captured windows: ``mean`` and ``scale`` (F,), ``axes`` (F, k), and the
    ``variance`` in them.
    """

    mean: Array
    scale: Array
    axes: Array
    variance: float

    @classmethod
    def of(cls, captured: Array) -> Space:
        """Fit to windows (N, F)."""
        mean, scale = captured.mean(0), np.maximum(captured.std(0), 1e-5)
        some = (captured[:: max(1, len(captured) // _MOST_FITTED)] - mean) / scale
        _, vectors = np.linalg.eigh(some @ some.T)  # of the windows: there are fewer of them than numbers
        axes, _ = np.linalg.qr(some.T @ vectors[:, -min(COMPONENTS, len(some)) :])
        return cls(mean, scale, axes, float((((captured - mean) / scale) @ axes).var(0).sum()))

    def distance(self, one: Array, other: Array) -> float:
        """Frechet distance of two sets of windows (N, F), as the module says; not a number for fewer than
        ``FEW``.
        """
        if min(len(one), len(other)) < FEW:
            return float("nan")
        a, b = (((w - self.mean) / self.scale).astype(np.float64) @ self.axes for w in (one, other))
        return frechet(a, b) / self.variance


def frechet(one: Array, other: Array) -> float:
    """Squared Frechet distance of the normal distributions of two samples (N, k)."""
    away = one.mean(0) - other.mean(0)
    ours, theirs = np.cov(one, rowvar=False), np.cov(other, rowvar=False)
    values, vectors = np.linalg.eigh(ours)
    root = vectors * np.sqrt(np.maximum(values, 0)) @ vectors.T
    shared = np.sqrt(np.maximum(np.linalg.eigvalsh(root @ theirs @ root), 0)).sum()
    return float(away @ away + np.trace(ours) + np.trace(theirs) - 2 * shared)


def spread(motions: Sequence[WatchedMotion], kind: str) -> float:
    """How far the mean poses of ``kind`` lie apart over motions: root mean square over joints, cm, about the
    hips.
    """
    poses = []
    for motion in motions:
        on = shown(motion, kind) > 0.9
        if on.sum() >= FPS // 2:
            _, heading = root_of(motion.positions[on])
            about = motion.positions[on] - motion.positions[on][:, :1]
            poses.append(rotate_planar(about, -heading[:, None]).mean(0))
    return float(100 * np.sqrt(np.var(poses, axis=0).sum(-1).mean())) if len(poses) > 1 else float("nan")


def gait(motions: Sequence[WatchedMotion]) -> dict[str, float]:
    """Medians over strides: cadence, steps a minute; stride, m; arm swing and hip rise, cm; and the mean jerk
    of what walks, m/s^3.
    """
    found: dict[str, list[float]] = {k: [] for k in ("cadence", "stride_m", "arm_swing_cm", "hip_rise_cm")}
    jerks: list[tuple[float, int]] = []
    for motion in motions:
        for a, b in intervals(shown(motion, "walks") > 0.5):
            if b - a < FPS:
                continue
            p = motion.positions[a:b]
            jerks.append((jerk(p), b - a))
            _, heading = root_of(p)
            ahead = heading_to_direction(heading)
            ankles = p[:, [leg[2] for leg in FEET], :2]
            steps = crossings(((ankles[:, 0] - ankles[:, 1]) * ahead).sum(-1))
            wrists = ((p[:, [arm[2] for arm in ARMS], :2] - p[:, :1, :2]) * ahead[:, None]).sum(-1)
            for first, last in zip(steps, steps[2:], strict=False):
                stride = slice(int(first), int(last) + 1)
                found["cadence"].append(2 * 60 * FPS / (last - first))
                found["stride_m"].append(float(np.linalg.norm(p[last, HIPS, :2] - p[first, HIPS, :2])))
                found["arm_swing_cm"].append(float(100 * np.ptp(wrists[stride], axis=0).mean()))
                found["hip_rise_cm"].append(float(100 * np.ptp(p[stride, HIPS, 2])))
    medians = {k: float(np.median(v)) if v else float("nan") for k, v in found.items()}
    whole = sum(n for _, n in jerks)
    return medians | {"jerk_m_s3": sum(v * n for v, n in jerks) / whole if whole else float("nan")}
