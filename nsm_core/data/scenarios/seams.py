"""How captured pieces that are laid end to end become one motion: two ways, of which one is chosen."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.body.contacts import detect_foot_contacts
from nsm_core.body.ik.between import ENDS, GLIDES, joined
from nsm_core.body.inertialization import soften_seam
from nsm_core.body.skeleton import forward_kinematics
from nsm_core.model.inference.transition_model import TransitionModel, load_transitions
from nsm_core.model.transitions.layout import PAST
from nsm_core.rotations import Array

# Changes hips (T, 3), local rotations (T, J, 4) and standing feet (T, 2) in place where pieces meet.
Join = Callable[[Array, Array, Array, list[int]], None]
AROUND = 7  # frames before a seam and from it on that are filled, fewer where the next one is near
ONE = 8  # frames under which two seams are filled as one
_VOTES = 4  # frames on either side that tell whether a foot at the end of a gap stands


def soften(hips: Array, rotations: Array, feet: Array, seams: list[int]) -> None:
    """Keep all frames and let what is lacking at a seam fade away behind it (inertialisation)."""
    for seam in seams:
        soften_seam(hips, rotations, seam)


def fill(network: TransitionModel, hips: Array, rotations: Array, feet: Array, seams: list[int]) -> None:
    """Drop the frames around every seam and let a transition network make them (papers/001) over the level
    floor; feet stand there where it lets them, as in ``between.planted``.
    """
    for first, end in gaps(seams, len(hips)):
        past, target = (
            Clip("piece", hips[part], rotations[part])
            for part in (slice(max(0, first - PAST), first), slice(end, end + ENDS))
        )
        places, turns, _ = network.poses(past, target, end - first, _floor)
        whole = slice(first - ENDS, end + ENDS)
        new_hips, new_rotations = hips[whole].astype(np.float64), rotations[whole].astype(np.float64)
        new_hips[ENDS:-ENDS], new_rotations[ENDS:-ENDS] = places, turns
        hips[whole], rotations[whole] = joined(new_hips, new_rotations)
        near = slice(max(0, first - _VOTES), end + _VOTES)
        stands = detect_foot_contacts(forward_kinematics(hips[near], rotations[near])[0], speed=GLIDES)
        feet[first:end] = stands[first - near.start : end - near.start]


def gaps(seams: list[int], length: int) -> list[tuple[int, int]]:
    """First frame, and the one after the last, of what is to be filled for the ``seams`` of a motion of
    ``length`` frames: AROUND them, with ENDS frames to the next gap.  Seams at the very ends have none, as
    nothing is softened there.
    """
    runs: list[tuple[int, int]] = []
    for seam in (seam for seam in sorted(seams) if ENDS <= seam < length - ENDS):
        if runs and seam - runs[-1][1] < ONE:
            runs[-1] = runs[-1][0], seam
        else:
            runs.append((seam, seam))
    shared = [min(AROUND, (after[0] - run[1] - ENDS) // 2) for run, after in pairwise(runs)]
    return [
        (max(run[0] - before, ENDS), min(run[1] + behind, length - ENDS))
        for run, before, behind in zip(runs, [AROUND, *shared], [*shared, AROUND], strict=False)
    ]


def _floor(places: Array) -> Array:
    return np.zeros(len(places))


SOFTENED, FILLED = "softened", "filled"
# By name; a network is loaded when its way is chosen.
JOINS: dict[str, Callable[[], Join]] = {
    SOFTENED: lambda: soften,
    FILLED: lambda: partial(fill, load_transitions()),
}

__all__ = ["FILLED", "JOINS", "SOFTENED", "Join", "fill", "gaps", "soften"]
