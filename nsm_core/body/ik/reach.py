"""Bring hips and trunk to where limbs reach their places: the solver's part before limbs are put
there exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from nsm_core.body.skeleton import HIPS, INDEX
from nsm_core.body.tree import HUMAN
from nsm_core.rotations import Array

from .solver import Pose, Stiffness, solved
from .stiffness import stiffness
from .tasks import ReachTask

# Frames by which rounds smooth: so that neighbours come and go with what a frame needs, who may come a
# little short;
# and so that every frame gets all it needs.
SMOOTH, EXACT = (5.0, 4.0, 3.0, 2.5, 2.0), (3.0, 2.0, 1.0, 0.0, 0.0, 0.0)
TRUNK = [HIPS, *(INDEX[name] for name in ("Chest", "Chest2", "Chest3", "Chest4"))]
ASIDE = 0.4  # share of its pitch by which a trunk leans aside or turns as one bends over
_ACROSS = np.array((1.0, 0.0, 0.0))  # the axis about which a trunk bends forward
FURTHEST = 0.5  # metres that hips leave the motion by


def bending() -> Stiffness:
    """A body that bends over: the trunk pitches forward, rather than aside or about itself, over hips that
    sink, and hardly go anywhere.
    """
    own = stiffness()
    hinges = own.hinges | {j: (_ACROSS, ASIDE * float(own.turns[j])) for j in TRUNK}
    return replace(own, hinges=hinges, hips=np.array((0.01, 0.01, 0.08)))


def shifting() -> Stiffness:
    """A body that goes where its limbs are to be."""
    return replace(stiffness(), hips=np.array((0.1, 0.1, 0.15)))


def sinking() -> Stiffness:
    """Hips that come down, no more."""
    own = stiffness()
    return replace(own, hips=np.array((0.0, 0.0, 0.08)), turns=np.zeros_like(own.turns), hinges={})


def leaning() -> Stiffness:
    """A trunk that leans over hips that stay."""
    own = stiffness()
    return replace(own, hips=np.zeros(3), turns=np.where(np.arange(len(own.turns)) == HIPS, 0.0, own.turns))


def into_reach(
    hips: Array,
    rotations: Array,
    limbs: Sequence[Sequence[int]],
    targets: Array,
    reach: Array,
    gives: Stiffness,
    rounds: Sequence[float] = SMOOTH,
) -> tuple[Array, Array]:
    """Move a motion the least, as it ``gives``, until the first joints of ``limbs`` are within ``reach`` (T,
    L) metres of ``targets`` (T, L, 3): new hips (T, 3) and local rotations (T, 23, 4).

    Limbs go along as they are; a motion that reaches is returned as it is.
    """
    task = ReachTask([limb[0] for limb in limbs], targets, np.broadcast_to(reach, targets.shape[:2]))
    pose = Pose(HUMAN, hips.astype(np.float64), rotations.astype(np.float64))
    if not task.rows(pose, slice(0, len(hips))).error.any():
        return hips, rotations
    pose = solved(pose, [task], gives, rounds, FURTHEST)
    return pose.hips.astype(hips.dtype), pose.local.astype(rotations.dtype)


__all__ = ["EXACT", "SMOOTH", "bending", "into_reach", "leaning", "shifting", "sinking"]
