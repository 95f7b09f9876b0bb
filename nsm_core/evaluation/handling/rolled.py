"""Roll-outs of the controller over reaches that it has not learnt from, as bodies to be looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nsm_core.body.contacts import LEGS
from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import ARMS, HIPS, forward_kinematics, local_from_world
from nsm_core.data.handling.tracks import HandlingTracks
from nsm_core.model.handling.state import KeySchedule
from nsm_core.model.handling.tasks import APPROACHES, FREE, HOLDS, LEAVES, TASKS
from nsm_core.model.inference.handling_model import HandlingModel, Rolled
from nsm_core.rotations import Array, matrix_from_forward_up, quat_from_matrix
from nsm_core.signals import intervals

HELD = 30  # frames of a performance before anything begins
BEFORE, AFTER = 60, 15  # frames of a trial before a hand sets out, and after it is back
LONGER = 30  # frames by which a roll-out may take longer than its performance
_LIMBS = (*LEGS, *ARMS)


@dataclass(frozen=True)
class HandMove:
    """Frames ``span`` in which hand ``side`` goes to a thing or back, and how far, metres, its wrist has
    ``missed`` its goal as it begins to hold (NaN on the way back).
    """

    side: int
    span: slice
    missed: float


@dataclass(frozen=True)
class MovedBody:
    """One motion: ``positions`` (T, 23, 3) of a body with rigid bones, standing ``feet`` (T, 2), and the
    moves of its hands.
    """

    positions: Array
    feet: Array
    moves: tuple[HandMove, ...]


def trials_of(tracks: HandlingTracks) -> list[tuple[int, int]]:
    """First and last frame of every reach of performances: from BEFORE it to AFTER the hand is back."""
    found = []
    for _, task, a, _ in _spans(tracks.label):
        if task != APPROACHES:
            continue
        first, last = int(tracks.first[a]), int(tracks.last[a])
        side = int(tracks.label[a, 1 + TASKS + APPROACHES] > 0.5)
        back = np.flatnonzero(tracks.label[a : last + 1, 1 + side * TASKS + FREE] > 0.5)
        end = min(last, a + int(back[0]) + AFTER) if len(back) else last
        found.append((max(first + HELD, a - BEFORE), end))
    return found


def captured_bodies(tracks: HandlingTracks) -> list[MovedBody]:
    """What the performances show of their trials."""
    found = []
    for first, last in trials_of(tracks):
        span = np.arange(first, last + 1)
        moves = tuple(
            HandMove(side, slice(a, b), float("nan")) for side, _, a, b in _spans(tracks.label[span])
        )
        found.append(MovedBody(tracks.position[span], tracks.feet[span] > 0.5, moves))
    return found


def rolled_bodies(model: HandlingModel, tracks: HandlingTracks, goal_phase: str) -> list[MovedBody]:
    """Roll-outs over all trials of performances; each may take LONGER than its performance did."""
    trials = trials_of(tracks)
    firsts = np.array([first for first, _ in trials])
    lengths = np.array([last - first for first, last in trials])
    schedules = [tracks.schedule(int(f)) for f in firsts]
    rolled = model.roll(tracks.state(firsts), schedules, int(lengths.max()) + LONGER, goal_phase)
    return [_body(rolled, n, schedules[n], int(lengths[n])) for n in range(len(firsts))]


def rigid(position: Array, forward: Array, up: Array) -> Array:
    """Joints (T, 23, 3) of a body with the skeleton's bones whose turns are those told by axes, and whose
    ankles and wrists are where they are told.
    """
    world = quat_from_matrix(matrix_from_forward_up(forward, up).astype(np.float64))
    hips = position[:, HIPS].astype(np.float64)
    ends = [limb[2] for limb in _LIMBS]
    local = place_limbs(hips, local_from_world(world), _LIMBS, position[:, ends], world[:, ends])
    return forward_kinematics(hips, local)[0].astype(np.float32)


def _body(rolled: Rolled, n: int, schedule: KeySchedule, length: int) -> MovedBody:
    count = min(length + LONGER, int(np.searchsorted(rolled.clock[:, n], length)) + 1)
    positions = rigid(rolled.position[:count, n], rolled.forward[:count, n], rolled.up[:count, n])
    clock = rolled.clock[:count, n]
    passed = np.searchsorted(schedule.times, clock, side="right")
    label = np.concatenate((schedule.first[None], schedule.label))[passed]
    moves = []
    for side, task, a, b in _spans(label):
        key = passed[min(b, count - 1)] - 1
        wrist = ARMS[side][2]
        holds = task == APPROACHES and b < count and label[b, 1 + side * TASKS + HOLDS] > 0.5
        missed = np.linalg.norm(positions[b, wrist] - schedule.joints[key, 1 + side, :3]) if holds else np.nan
        moves.append(HandMove(side, slice(a, b), float(missed)))
    return MovedBody(positions, rolled.contact[:count, n] > 0.5, tuple(moves))


def _spans(label: Array) -> Sequence[tuple[int, int, int, int]]:
    return [
        (side, task, a, b)
        for side in (0, 1)
        for task in (APPROACHES, LEAVES)
        for a, b in intervals(label[:, 1 + side * TASKS + task] > 0.5)
    ]


__all__ = ["HandMove", "MovedBody", "captured_bodies", "rigid", "rolled_bodies", "trials_of"]
