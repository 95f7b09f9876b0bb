"""Sitters in a manner: the network's is the mean of the captured ones, and here each seat is taken as its
goal has drawn it (``actions.seat_manner``): hands on thighs, in the lap or on arm rests, the trunk more or
less upright.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nsm_core.body.capsules import Figure
from nsm_core.body.ik.grip import Grip
from nsm_core.body.ik.solver import Pose
from nsm_core.body.ik.thighs import leant, on_thighs
from nsm_core.body.skeleton import FEET, INDEX
from nsm_core.rotations import Array
from nsm_core.signals import gaussian_smooth, smooth_step

from .actions.hold import Lead
from .actions.seat_manner import SeatedManner

# How steep thighs are, the height of the hip over the knee as a share of their length: who stands, who sits.
STEEP, LEVEL = 0.85, 0.25
HAND = 0.022  # metres from the wrist down to what the palm lies on
EASE = 3.0  # frames, standard deviation of how hands and trunk come and go


def sat(pose: Pose, manners: Sequence[SeatedManner | None], figure: Figure) -> tuple[Pose, list[list[Lead]]]:
    """The motion in which every sitter leans as its manner says, and where that leads hands in each frame.

    ``manners`` (T,) of the seats that are taken, None where none is asked for.
    """
    leads: list[list[Lead]] = [[] for _ in manners]
    seated = _seatedness(pose.positions)
    spans = [s for s in _spans(manners, seated) if seated[s[0]].max() > 0.5]
    if not spans:
        return pose, leads
    lean = np.zeros(len(manners))
    for span, manner in spans:
        lean[span] = manner.lean * seated[span] ** 2
    pose = Pose(pose.tree, pose.hips, leant(pose.local, gaussian_smooth(lean, EASE)))
    thick = _thighs(figure)
    for span, manner in spans:
        if not manner.hands:
            continue
        share = _lying(seated[span], manner)
        first, second = manner.place
        over = (1 - first) * thick[0] + first * thick[1] + HAND
        for side in (0, 1):
            part = pose.positions[span]
            lap = manner.lap and not any(rest is not None for rest in manner.rests)
            at, normal, thigh = on_thighs(part, side, (first, second), lap, over)
            ahead, rest = thigh, manner.rests[side]
            if rest is not None:
                at, normal = np.broadcast_to(rest, at.shape), np.broadcast_to((0.0, 0.0, 1.0), at.shape)
            ahead = ahead - (ahead * normal).sum(-1, keepdims=True) * normal
            ahead /= np.maximum(np.linalg.norm(ahead, axis=-1, keepdims=True), 1e-9)
            wrist = part[:, INDEX["LeftWrist" if side else "RightWrist"]]
            for n in np.flatnonzero(share > 1e-3):
                # A lead is firm long before it is complete: on its way, the way itself is what is led along.
                target = wrist[n] + share[n] * (at[n] - wrist[n])
                grip = Grip(-normal[n], ahead[n], share=float(share[n]))
                leads[span.start + n].append(Lead(side, target, float(share[n]), grip=grip))
    return pose, leads


def _seatedness(positions: Array) -> Array:
    """How far (T,) thighs are down to where a sitter's are, 0..1."""
    hips, knees = (positions[:, [leg[k] for leg in FEET]] for k in (0, 1))
    thigh = knees - hips
    steep = (-thigh[..., 2] / np.maximum(np.linalg.norm(thigh, axis=-1), 1e-9)).min(1)
    return np.asarray(np.clip((STEEP - steep) / (STEEP - LEVEL), 0, 1))


def _spans(manners: Sequence[SeatedManner | None], seated: Array) -> list[tuple[slice, SeatedManner]]:
    """The stretches in which one is at all down, about frames that ask for a seat, and its manner."""
    down = np.flatnonzero(seated > 0)
    result = []
    for run in np.split(down, np.flatnonzero(np.diff(down) > 1) + 1) if len(down) else ():
        asked = [m for t in run if (m := manners[t]) is not None]
        if asked:
            result.append((slice(int(run[0]), int(run[-1]) + 1), asked[-1]))
    return result


def _lying(seated: Array, manner: SeatedManner) -> Array:
    """How far (n,), 0..1, hands are where they lie."""
    n, full = np.arange(len(seated)), np.flatnonzero(seated > 0.9 * seated.max())
    early = n < (full[0] + full[-1]) / 2
    low, high = (np.where(early, manner.down[k], manner.up[k]) for k in (0, 1))
    return np.asarray(np.clip(gaussian_smooth(smooth_step((seated - low) / (high - low)), EASE), 0, 1))


def _thighs(figure: Figure) -> tuple[float, float]:
    """Metres from the bone to the skin of a thigh at the hip and at the knee."""
    of = np.flatnonzero([name == "LeftHip-LeftKnee" for name in figure.spheres.names])
    radii = figure.spheres.radii[of]
    return float(radii[0]), float(radii[-1])


__all__ = ["sat"]
