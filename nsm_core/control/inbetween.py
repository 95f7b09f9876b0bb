"""Fill: the missing frames of a motion, from what stands before them to what stands after (papers/001).

Past and target are the animator's and stay as they are.  What is between comes from a transition
network, or without one from interpolation; then it is made to leave and reach both without a pop, and its
feet to stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nsm_core.body.capsules import BUNDLED, Figure
from nsm_core.body.clip import Clip
from nsm_core.body.contacts import RESTING, TOES
from nsm_core.body.ik.between import ENDS, GLIDES, Ground, joined, planted
from nsm_core.body.ik.clearance import Obstacle
from nsm_core.body.ik.pose_fit import pose_from_places
from nsm_core.body.interpolation import interpolated, target_blend
from nsm_core.body.skeleton import HIPS
from nsm_core.conventions import FPS
from nsm_core.errors import GapError
from nsm_core.model.inference.transition_model import TransitionModel
from nsm_core.model.transitions.layout import PAST
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery

MIN_FRAMES, MAX_FRAMES = 3, 90  # that can be filled at 30 a second
MISSED = 0.1  # metres from its target, mean over joints, from which on a network's miss is told
FASTEST = 5.0  # m/s of the hips: who is asked for more is told


@dataclass(frozen=True)
class Gap:
    """What stands on both sides of missing frames, at 30 Hz.

    ``past``: 1 to PAST frames before the gap, the last of them the last that is kept; ``target``: the first
    that is kept after it and the one behind it, for its speed.  ``ground`` gives heights (N,) at world places
    (N, 2), metres; None where none is known, then it is level under the lowest foot.  ``seed`` 0 is the mean,
    others are variations.  ``figure``: the character's own body, whose feet are to stand; ``solids``:
    what it keeps out of, but for what it touches before the gap and after it.  ``told_fps``: frames a second
    of the animator, in whose frames sentences count.
    """

    past: Clip
    target: Clip
    frames: int
    ground: Ground | None = None
    seed: int = 0
    figure: Figure = BUNDLED
    solids: Sequence[DistanceQuery] = ()
    told_fps: float = FPS

    def told(self, steps: int) -> int:
        """Frames of the animator in so many steps at 30 Hz."""
        return round(steps * self.told_fps / FPS)


@dataclass(frozen=True)
class Filled:
    """The missing frames.

    ``gap_before_blend``: metres, mean over joints, by which the method itself missed the target frame, before
    anything was corrected.  ``notes`` are sentences.
    """

    clip: Clip
    gap_before_blend: float
    notes: tuple[str, ...]


def check(gap: Gap) -> tuple[str, ...]:
    """Sentences on what is unusual about a gap; GapError where it cannot be filled."""
    if not len(gap.past):
        raise GapError("There is no frame before the gap; begin it after a key.")
    if not len(gap.target):
        raise GapError("There is no key after the gap to reach; set one, or end the gap before one.")
    if not MIN_FRAMES <= gap.frames <= MAX_FRAMES:
        raise GapError(
            f"{gap.frames} frames are missing, and from {MIN_FRAMES} to {MAX_FRAMES} at {FPS} a second can "
            "be filled; choose other keys, or set one in between."
        )
    notes = []
    if len(gap.past) < PAST:
        known, read = (gap.told(count - 1) + 1 for count in (len(gap.past), PAST))
        notes.append(
            f"{known} {'frame is' if known == 1 else 'frames are'} known before the gap and {read} are read; "
            "they are extended to the front."
        )
    if len(gap.target) < 2:
        notes.append("There is one frame after the gap alone; the motion comes to rest in it.")
    way = float(np.linalg.norm(gap.target.hips_position[0] - gap.past.hips_position[-1]))
    speed = way * FPS / (gap.frames + 1)
    if speed > FASTEST:
        missing = gap.told(gap.frames + 1) - 1
        notes.append(
            f"The hips have {way:.1f} m to go in {missing} frames, {speed:.1f} m/s; more frames or a "
            "nearer target would let the character move as people do."
        )
    return tuple(notes)


def fill(gap: Gap, network: TransitionModel | None) -> Filled:
    """Fill a gap by a network, or by interpolation where there is none; GapError as of ``check``."""
    notes = check(gap)
    past, target, count = gap.past, gap.target, gap.frames
    level = 0.0 if gap.ground is not None else min(level_under(side, gap.figure) for side in (past, target))
    if network is None:
        hips, local = interpolated(
            (past.hips_position[-1], target.hips_position[0]),
            (past.local_rotations[-1], target.local_rotations[0]),
            count,
        )
        hips, local, missed = hips[:-1], local[:-1], 0.0
        if gap.seed:
            notes += ("Interpolation has no variations.",)
    else:
        hips, local, missed = _transition(gap, network, level)
    hips = np.concatenate((_before(past.hips_position), hips, _after(target.hips_position)))
    local = np.concatenate((_before(past.local_rotations), local, _after(target.local_rotations)))
    up = np.array((0.0, 0.0, level))
    # Solids stand as much lower as the motion is put for a floor at z = 0.
    lowered = np.repeat([(0.0, 0.0, -level, 0.0)], len(hips), axis=0)
    solids = [Obstacle(query, lowered) for query in gap.solids]
    motion = joined(hips.astype(np.float64) - up, local.astype(np.float64))
    # Interpolation means no foot to stand that does not rest.
    slow = RESTING if network is None else GLIDES
    hips, local = planted(*motion, gap.ground, gap.figure, solids, slow)
    kept = slice(ENDS, ENDS + count)
    clip = Clip("fill", (hips[kept] + up).astype(np.float32), local[kept].astype(np.float32))
    filled = Filled(clip, missed, notes)
    if filled.gap_before_blend > MISSED:
        told = f"The network came to {100 * missed:.0f} cm from the target; the rest was blended."
        return replace(filled, notes=(*notes, told))
    return filled


def _transition(gap: Gap, network: TransitionModel, level: float) -> tuple[Array, Array, float]:
    """Hips (frames, 3) and local rotations (frames, 23, 4) as a network tells them, with the target blend
    (section 5.1) over all of them; and metres that it missed the target by.
    """
    goal = gap.target.world()[0][:2].astype(np.float64)
    ground = gap.ground or (lambda places: np.full(len(places), level))
    told = network.predict(gap.past.world()[0][-PAST:], goal, gap.frames, ground, gap.seed)
    missed = float(np.linalg.norm(told[-1] - goal[0], axis=-1).mean())
    places = target_blend(told, goal[0], gap.frames + 1)[:-1]
    ends = gap.past.local_rotations[-1], gap.target.local_rotations[0]
    near = interpolated((places[0, HIPS], places[-1, HIPS]), ends, gap.frames)[1][:-1]
    return places[:, HIPS], pose_from_places(places, near), missed


def level_under(clip: Clip, figure: Figure = BUNDLED) -> float:
    """Height of a floor on which the lower foot of a figure stands, metres."""
    positions, _ = figure.tree.forward(clip.hips_position, clip.local_rotations)
    return float(positions[:, TOES, 2].min()) - figure.sole.toe_height


def _before(values: Array) -> Array:
    """The last ENDS of (T, ...) frames; one alone is at rest."""
    return values[-ENDS:] if len(values) >= ENDS else np.repeat(values, ENDS, axis=0)


def _after(values: Array) -> Array:
    """The first ENDS of (T, ...) frames; one alone is at rest."""
    return values[:ENDS] if len(values) >= ENDS else np.repeat(values, ENDS, axis=0)


__all__ = ["MAX_FRAMES", "MIN_FRAMES", "Filled", "Gap", "check", "fill", "level_under"]
