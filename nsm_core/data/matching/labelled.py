"""What the composer takes from clips with sidecars: stretches of walking and running, sit-downs and grasps,
by their labels.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nsm_core.body.clip import Clip, smoothed_root
from nsm_core.body.contacts import TOES
from nsm_core.body.skeleton import HIPS, INDEX
from nsm_core.conventions import CONTACTS, FOOT_CONTACTS, FPS, HAND_CONTACTS
from nsm_core.data.annotation.phases import phase_of_keys
from nsm_core.data.annotation.proposal import steps, straight_lines
from nsm_core.data.captures.folder import Labelled
from nsm_core.data.captures.sheet import Stretch
from nsm_core.data.captures.sidecar import SUFFIX
from nsm_core.errors import CaptureError
from nsm_core.rotations import Array, rotate_planar, wrap_angle
from nsm_core.signals import intervals

from .segment import SitDown

SHORTEST = 30  # frames of a stretch
ABOUT_RUN = round(1.5 * FPS)  # frames before and after running that belong to a run
UPRIGHT, RUNNING = 0.8, 0.6  # metres that the hips keep above the floor in walks, and in runs
LEVEL = (
    0.09  # metres: height of the lower toe joint, at its lowest within a quarter of a second, on level ground
)
AWAY = 0.3  # metres that a goal written by hand may lie from the hips that sit there
SHUFFLE = 0.15  # metres that a foot moves at most during a sit
CHEST = INDEX["Chest4"]  # whose height tells a bend
_OTHERS = ("carry", "open", "sit", "climb", "other")


def lines(labelled: Labelled, name: str) -> Array:
    """Values (T,) of a label as the sidecar has them, without the shares that labels take from one
    another.
    """
    keys, frames = labelled.sheet.actions.get(name, []), np.arange(labelled.sheet.frames)
    return straight_lines(keys, frames)


def as_told(labelled: Labelled) -> Labelled:
    """The clip with the phase and the standing feet that its sidecar says.

    What was proposed by rule is left to the rule, which sees the composed motion.
    """
    sheet, count = labelled.sheet, len(labelled.clip)
    phase = [phase_of_keys(sheet.phase, count), phase_of_keys(sheet.phase_mirrored, count)]
    told = [bool(sheet.section(name)) and sheet.says(name) for name in ("phase", "phase_mirrored")]
    feet = [steps(sheet.contacts.get(CONTACTS[k], []), np.arange(count)) for k in FOOT_CONTACTS]
    stand = [sheet.says(f"contacts.{CONTACTS[k]}") for k in FOOT_CONTACTS]
    clip = replace(labelled.clip, phase=_columns(phase, told), feet=_columns(feet, stand))
    return replace(labelled, clip=clip)


def _columns(values: list[Array], told: list[bool]) -> Array | None:
    """Columns (T, k) of ``values``, NaN in those that nobody has told; None if that are all."""
    return (
        np.stack([np.where(t, v, np.nan) for v, t in zip(values, told, strict=True)], axis=1)
        if any(told)
        else None
    )


def _around(flags: Array, reach: int) -> Array:
    """Flags (T,) spread to ``reach`` frames before and after."""
    return (
        np.convolve(flags, np.ones(2 * reach + 1), mode="same")[: len(flags)] > 0.5
        if len(flags) > 2 * reach
        else flags | flags.any()
    )


def walks_and_runs(labelled: Labelled) -> tuple[list[Clip], list[Clip]]:
    """Cut out stretches on level ground that idle or walk, and those that run with what leads to and from it.

    Frames in which another label is on, or none at all, are used for neither.  Where the sidecar says what it
    is to be used for, that is taken instead, as it is.
    """
    walks, runs = _by_labels(labelled)
    use = labelled.sheet.use
    return _as_told(labelled.clip, use.walk, walks), _as_told(labelled.clip, use.run, runs)


def _as_told(clip: Clip, told: tuple[Stretch, ...] | None, found: list[Clip]) -> list[Clip]:
    """The stretches that a person named, else those ``found``; who names a whole clip gets it under its
    name.
    """
    if told is None:
        return found
    return [clip if b - a + 1 == len(clip) else part(clip, a, b + 1) for a, b in told]


def _by_labels(labelled: Labelled) -> tuple[list[Clip], list[Clip]]:
    clip = labelled.clip
    gait = sum(lines(labelled, name) for name in ("idle", "walk", "run"))
    free = (gait > 0.5) & (np.max([lines(labelled, name) for name in _OTHERS], axis=0) < 0.01)
    positions = clip.world()[0]
    free &= _around(np.abs(positions[:, TOES, 2].min(1)) < LEVEL, FPS // 4)
    running, height = lines(labelled, "run"), positions[:, HIPS, 2]
    walks = free & (running < 0.01) & ~_around(height < UPRIGHT, 6)
    runs = free & _around(running > 0.5, ABOUT_RUN) & ~_around(height < RUNNING, 6)
    return _cut(clip, walks), [c for c in _cut(clip, runs)]


def _cut(clip: Clip, flags: Array) -> list[Clip]:
    return [part(clip, a, b) for a, b in intervals(flags) if b - a >= SHORTEST]


def part(clip: Clip, first: int, end: int) -> Clip:
    """Frames of a clip under a name that tells where they begin."""
    return replace(clip[first:end], name=f"{clip.name}@{first}")


def sit_downs(labelled: Labelled) -> list[SitDown]:
    """Cut out where the sit label rises from 0 to 1 and falls to 0, upright before and after, the feet in
    place.

    Goals that a person wrote say where the seat is and when rising is asked for; CaptureError where the hips
    sit elsewhere.
    """
    clip, value, out, found = labelled.clip, lines(labelled, "sit"), _left_out(labelled), []
    for a, b in intervals(value > 0.01):
        full = np.flatnonzero(value[a:b] > 0.99) + a
        if a == 0 or b == len(clip) or len(full) < 5:
            continue  # begins or ends seated
        if out[full].any():
            continue
        told = labelled.sheet.use.sit
        cut, down, up = part(clip, a - 1, b + 1), int(full[0]) - a + 1, int(full[-1]) - a + 1
        if _sits(cut, down, up) if told is None else any(c < a and b <= d for c, d in told):
            found.append(SitDown(cut, down, up, *_goal(labelled, a - 1, int(full[0]), int(full[-1]))))
    return found


def _goal(labelled: Labelled, first: int, full: int, leave: int) -> tuple[Array | None, int | None]:
    """What the goals of a sidecar, if they are a person's, say of the sit from ``full`` to ``leave``: see
    ``SitDown``.
    """
    goals = labelled.sheet.goals if labelled.sheet.says("goals") else []
    n = max((k for k, g in enumerate(goals) if g.frame <= full), default=-1)
    if n < 0 or "sit" not in goals[n].action.split("+") or goals[n].place is None:
        return None, None
    hips, heading = sitting(labelled.clip, full, leave)
    goal = goals[n]
    off = np.asarray(goal.place) - hips
    if np.linalg.norm(off) > AWAY:
        raise CaptureError(
            f"{labelled.clip.name}{SUFFIX}: the sit goal of frame {goal.frame} lies "
            f"{np.linalg.norm(off):.1f} m from the hips that sit, "
            f"at [{', '.join(f'{v:.2f}' for v in hips)}]; put it within {AWAY:g} m of them."
        )
    off[:2] = rotate_planar(off[:2], np.float64(-heading))
    asked = next((g.frame for g in goals[n + 1 :] if full < g.frame), leave)
    return np.append(off, wrap_angle(np.radians(goal.facing) - heading)), min(asked, leave) - first


def sitting(clip: Clip, full: int, leave: int) -> tuple[Array, float]:
    """Hips (3,), metres, and heading, radians, amid a sit that is complete from frame ``full`` to
    ``leave``.
    """
    middle = (full + leave) // 2
    positions = clip.world()[0]
    return positions[middle, HIPS].astype(np.float64), float(smoothed_root(positions)[1][middle])


def _left_out(labelled: Labelled) -> Array:
    """Frames (T,) bool that a person labelled other; a rule that does not see what is done labels them so
    too.
    """
    return (lines(labelled, "other") > 0.5) & labelled.sheet.says("actions.other")


def _sits(clip: Clip, down: int, up: int) -> bool:
    """Whether a clip begins and ends upright, sits in between and keeps its feet in place."""
    height = clip.hips_position[:, 2]
    upright = min(height[0], height[-1]) > max(UPRIGHT, float(np.median(height[down : up + 1])) + 0.15)
    toes = clip.world()[0][:, TOES]
    level = np.abs(np.median(toes[..., 2], axis=0)).max() < LEVEL
    strays = np.linalg.norm((toes - np.median(toes, axis=0))[..., :2], axis=-1).max()
    return bool(upright and len(clip) >= SHORTEST and level and strays < SHUFFLE)


def grasps(labelled: Labelled) -> list[int]:
    """Frames at which both hands take or leave something while the carry label is on; where the sidecar says
    what it is to be bent by, the lowest of each such stretch.
    """
    told = labelled.sheet.use.bend
    if told is not None:
        chest = labelled.clip.world()[0][:, CHEST, 2]
        return [a + int(chest[a : b + 1].argmin()) for a, b in told]
    frames, out = np.arange(labelled.sheet.frames), _left_out(labelled)
    held = lines(labelled, "carry") > 0.5
    for hand in HAND_CONTACTS:
        held &= steps(labelled.sheet.contacts.get(CONTACTS[hand], []), frames) > 0.5
    return [f for a, b in intervals(held) for f in (a, b - 1) if 0 < f < len(frames) - 1 and not out[f]]
