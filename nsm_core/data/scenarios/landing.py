"""Feet between a walk and what is done standing: those that stand stay, or step to their place one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nsm_core.body.contacts import ANKLES, LEGS, TOES
from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import forward_kinematics
from nsm_core.rotations import Array, rotate_planar
from nsm_core.signals import smooth_step

if TYPE_CHECKING:
    from .motion import Motion

LANDED = 0.02  # metres from where a foot stands at last that it still is on its way to it
NEAR, AHEAD, ASIDE = 0.04, 0.16, 0.07  # metres off its place where a foot stays anyway; where it may, at most
STEP, LEAST, LIFT = 12, 8, 0.06  # frames of a step, and at least; metres that it is raised by
SOON, FARTHEST = 16, 0.3  # frames within which a foot is lifted anyway, and metres that it then may be off
FADE = 10  # frames of a swing in which a foot comes back to its way, at least


def stay(motion: Motion, start: int, settled: int, end: int) -> None:
    """Let both feet stand from ``start`` to ``end``, where the captured piece before gives way to another.

    A foot that stands at the seam and would stand a little elsewhere at frame ``settled`` stays until it
    is lifted after ``end``; one that would stand far off is set there by a step, and not while the other
    moves.  One that swings at the seam lands.
    """
    before = max(start - 1, 0)
    toes = forward_kinematics(motion.hips[before : settled + 1], motion.rotations[before : settled + 1])[0]
    toes = toes[:, TOES].astype(np.float64)
    stood = motion.feet[before].copy()
    way = toes[-1, :, :2] - toes[0, :, :2]
    away = np.linalg.norm((toes[1:] - toes[-1])[..., :2], axis=-1) > LANDED
    swings = np.maximum.accumulate(away[::-1])[::-1]  # (n, 2) from ``start`` on
    shift = np.zeros((len(motion), 2, 3))
    free = start if stood.all() else start + int(np.where(stood, 0, swings.sum(0)).max())
    leave = _lifts(motion, end)
    motion.feet[start:end] = True
    for side in np.argsort(-np.linalg.norm(way, axis=1)):
        span = slice(start, settled + 1)
        if not stood[side]:
            motion.feet[span, side] &= ~swings[:, side]
            continue
        if _stays(motion, way[side], float(motion.headings[settled])):
            shift[span, side, :2] = toes[0, side, :2] - toes[1:, side, :2]
            lift, landing = leave[side]
            shift[settled + 1 : lift, side, :2] = -way[side]
            _fade(shift[:, side], lift, landing)
            continue
        first = min(free, max(settled - LEAST, start))
        last = min(first + max(min(STEP, (settled - first) // 2), LEAST), len(motion))
        free = last
        t = np.arange(start, settled + 1)
        u = np.clip((t - first + 1) / (last - first + 1), 0, 1)
        place = toes[0, side, :2] + smooth_step(u)[:, None] * way[side]
        shift[span, side, :2] = place - toes[1:, side, :2]
        shift[span, side, 2] = LIFT * np.sin(np.pi * u) ** 2
        motion.feet[first:last, side] = False
    _move(motion, shift)


def hold(motion: Motion, seams: list[int]) -> None:
    """Let feet that stand on both sides of a seam stay where they stood, until they are lifted.

    Softening a seam would lead them over to where the next piece stands.  Far off its place, for more than
    the beginning of a step, none is held.
    """
    for seam in sorted(seams):
        if not 1 <= seam < len(motion):
            continue
        leave = _lifts(motion, seam)
        stood = motion.feet[seam - 1] & motion.feet[seam]
        last = max((leave[side][0] for side in (0, 1) if stood[side]), default=0)
        if last <= seam:
            continue
        span = slice(seam - 1, last)
        toes = forward_kinematics(motion.hips[span], motion.rotations[span])[0][:, TOES].astype(np.float64)
        shift = np.zeros((len(motion), 2, 3))
        for side in np.flatnonzero(stood):
            lift, landing = leave[side]
            off = toes[0, side, :2] - toes[1 : lift - seam + 1, side, :2]
            short = lift - seam <= SOON and float(np.linalg.norm(off[-1])) < FARTHEST
            if not (short or _stays(motion, off[-1], float(motion.headings[seam]))):
                continue
            shift[seam:lift, side, :2] = off
            _fade(shift[:, side], lift, landing)
        _move(motion, shift)


def _fade(shift: Array, lift: int, landing: int) -> None:
    """Let a foot that is off its way by ``shift`` (T, 3) as it is lifted come back to it in its swing."""
    back = slice(lift, min(max(landing, lift + FADE), len(shift)))
    n = back.stop - back.start
    shift[back] = shift[lift - 1] * (1 - smooth_step((np.arange(n) + 1) / (n + 1)))[:, None]


def _stays(motion: Motion, way: Array, heading: float) -> bool:
    """Whether a foot that is to go ``way`` (2,) before a body that faces ``heading`` may as well stay."""
    aside, ahead = np.abs(rotate_planar(way, np.float64(-heading)))
    return bool(np.hypot(aside, ahead) < NEAR or (ahead < AHEAD and aside < ASIDE))


def _lifts(motion: Motion, end: int) -> list[tuple[int, int]]:
    """For each foot the frames at which it is lifted after ``end`` and lands again."""
    found = []
    for side in (0, 1):
        off = np.flatnonzero(~motion.feet[end:, side])
        lift = end + int(off[0]) if len(off) else len(motion)
        on = np.flatnonzero(motion.feet[lift:, side])
        found.append((lift, lift + int(on[0]) if len(on) else len(motion)))
    return found


def _move(motion: Motion, shift: Array) -> None:
    """Move the feet by ``shift`` (T, 2, 3), metres; the hips stay."""
    moved = np.flatnonzero(np.abs(shift).max((1, 2)) > 1e-5)
    if not len(moved):
        return
    span = slice(int(moved[0]), int(moved[-1]) + 1)
    positions, world = forward_kinematics(motion.hips[span], motion.rotations[span])
    ankles = positions[:, ANKLES] + shift[span]
    placed = place_limbs(motion.hips[span], motion.rotations[span], LEGS, ankles, world[:, ANKLES])
    motion.rotations[span] = placed.astype(motion.rotations.dtype)
