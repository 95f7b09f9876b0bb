"""Compose goal-directed performances from captures: stand, walk, act on objects, walk on, in a furnished
scene.

The captures hold actions without an approach and walks without a goal.  A course is drawn to a place where
nothing stands, captured frames walk it (``search``), the action is stitched to its end and its objects are
put where the body needs them.  Everything else is furnished around the path that was walked.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nsm_core.body.contacts import ANKLES, LEGS, RESTING, TOES
from nsm_core.body.ik.footsteps import FootGround, footsteps
from nsm_core.body.ik.reach import into_reach, sinking
from nsm_core.body.ik.two_bone import leg_reach, place_limbs
from nsm_core.body.inertialization import soften_seam
from nsm_core.body.skeleton import FEET, forward_kinematics
from nsm_core.conventions import FOOT_CONTACTS, FPS
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.matching.placing import put_on_roots
from nsm_core.data.matching.source import Source, gather
from nsm_core.rotations import (
    Array,
    quat_conjugate,
    quat_from_rotvec,
    quat_mul,
    quat_normalize,
    quat_to_rotvec,
)
from nsm_core.signals import intervals
from nsm_core.world.assets.pool import Pool
from nsm_core.world.scene.terrain import Terrain

from . import single_clips
from .draws import PERFORMANCES
from .furnishing import furnish, keep_clear
from .gaze import look_ahead
from .landing import hold
from .motion import Motion
from .registry import SCENARIOS
from .session import Session
from .stairs.episode import StairEpisode
from .take import ComposedTake, Piece, TimedCommand

SHORTEST = 90  # frames of a take
SWING = 0.045  # metres of quick swinging feet over the floor: what is learnt of them is a mean, and lower
SEAM = 4  # frames before and after a seam in which the phase of the one clip goes over into that of the next
_SLOWEST, _FASTEST = 0.5, 2.0  # of the captured pace


def load(captures: str | Path | CaptureFolder) -> Source:
    """Read a capture folder, or what its index names; CaptureError or SkeletonError where a file is
    unusable.
    """
    folder = captures if isinstance(captures, CaptureFolder) else CaptureFolder(captures)
    kinds = sorted(SCENARIOS.items(), key=lambda kind: kind[1].order)
    return gather(
        folder, {name: scenario.segments(folder) for name, scenario in kinds if scenario.segments is not None}
    )


class Composer:
    """Composes takes from a source; one seed, one take.

    ``shares`` overrides how often each part is drawn; furniture comes from ``pool`` (default: the parametric
    generator alone).  Without ``stitch`` a take is one captured piece on its own (see ``single_clips``), to
    show what stitching brings.
    """

    def __init__(
        self,
        source: Source,
        shares: dict[str, float] | None = None,
        pool: Pool | None = None,
        stitch: bool = True,
    ) -> None:
        self.source, self.pool, self.stitch = source, pool, stitch
        shares = {name: scenario.share for name, scenario in SCENARIOS.items()} if shares is None else shares
        self.shares = {name: share for name, share in shares.items() if share > 0}

    def compose(self, seed: int) -> ComposedTake | None:
        """Return the take of ``seed``, or None where the draw did not work out."""
        rng = np.random.default_rng(seed)
        session = Session(self.source, rng, self.pool)
        if not self.stitch:
            return _finish(session, single_clips.SHORTEST) if _play_alone(session, self.shares) else None
        _perform(session, self.shares)
        return _finish(session, SHORTEST)


def _perform(session: Session, shares: dict[str, float]) -> None:
    """Lay a performance of several parts."""
    rng, tape = session.rng, session.tape
    tape.lay([int(rng.choice(session.source.still))], [np.zeros(2)], [float(rng.uniform(-np.pi, np.pi))])
    session.command("idle", 0, position=np.zeros(3, np.float32), heading=tape.headings[0])
    tape.stand(rng.uniform(*PERFORMANCES.stands_first))
    names, weights = list(shares), np.array(list(shares.values()))
    wanted, done = int(rng.integers(*PERFORMANCES.parts)), 0
    for _ in range(PERFORMANCES.attempts * wanted):
        if done == wanted:
            break
        saved = session.save()
        if _part(session, str(rng.choice(names, p=weights / weights.sum()))):
            done += 1
        else:
            session.restore(saved)


def _part(session: Session, name: str) -> bool:
    return SCENARIOS[name].lay(session) and session.clear()


def _play_alone(session: Session, shares: dict[str, float]) -> bool:
    """Lay one captured piece with its commands; shares of what the captures do not hold (doors, climbs) do
    not count.
    """
    pieces = [
        (share, alone)
        for share, alone in ((share, SCENARIOS[name].alone) for name, share in shares.items())
        if alone is not None
    ]
    if not pieces:
        return False
    weights = np.array([share for share, _ in pieces])
    return pieces[int(session.rng.choice(len(pieces), p=weights / weights.sum()))][1](session)


def _finish(session: Session, shortest: int) -> ComposedTake | None:
    """Turn the tape into motion, fit the episodes and furnish the scene; None where it is of no use or
    ``shortest`` frames are more.
    """
    tape, rng = session.tape, session.rng
    if len(tape) < shortest:
        return None
    hips, rotations, feet, frames = played(session)
    for seam in tape.seams:
        soften_seam(hips, rotations, seam)
    motion = Motion(
        hips, rotations, np.array(tape.roots), np.array(tape.headings), feet, list(session.commands), rng
    )
    for episode in session.episodes:
        episode.fit(motion)
    hold(motion, tape.seams)
    look_ahead(motion)
    plant(motion)
    for episode in session.episodes:
        episode.finish(motion)
        if not np.isfinite(motion.hips).all():  # spoilt by this one: nothing for the others to fit
            return None
    flights = [episode.placed(motion) for episode in session.episodes if isinstance(episode, StairEpisode)]
    motion.contacts[:, FOOT_CONTACTS] = motion.feet & _slow(motion)
    if not (np.isfinite(motion.hips).all() and np.isfinite(motion.rotations).all()):
        return None
    standing = [flight for flight in flights if flight is not None]
    if len(standing) < len(flights):
        return None
    take = ComposedTake(
        motion.hips.astype(np.float32),
        motion.rotations.astype(np.float32),
        motion.contacts,
        motion.labels,
        _ordered(motion.commands, session),
        motion.things,
        motion.obstacles,
        motion.phase_keys,
        _provenance(session, frames),
        _told_phase(session),
        motion.level if flights else None,
        standing,
    )
    fixed = len(take.obstacles)
    furnish(take, motion.roots, session, rng)
    return take if keep_clear(take, fixed) else None


def plant(motion: Motion) -> None:
    """Let feet stand still from landing to lift-off and swing clear of the floor; hips come down where
    legs are too short.
    """
    positions, world = forward_kinematics(motion.hips.astype(np.float64), motion.rotations.astype(np.float64))
    floor = FootGround(Terrain(), Terrain(), np.zeros(len(motion)))
    labels = motion.feet.astype(np.float64)
    feet = footsteps(positions[:, TOES], world[:, ANKLES], labels, floor, clearance=SWING)
    away = np.linalg.norm(positions[:, ANKLES] - positions[:, [leg[0] for leg in LEGS]], axis=-1)
    reach = np.maximum(away, leg_reach())
    hips, rotations = into_reach(motion.hips, motion.rotations, LEGS, feet.ankles, reach, sinking())
    motion.hips, motion.feet = hips, feet.planted
    motion.rotations = place_limbs(hips, rotations, LEGS, feet.ankles, feet.rotations).astype(np.float32)


def _slow(motion: Motion) -> Array:
    """Which toes (T, 2) rest: a label of a foot that a seam or an object has set moving would teach
    sliding.
    """
    toes = forward_kinematics(motion.hips, motion.rotations)[0][:, [leg[3] for leg in FEET]]
    toes[..., 2] += motion.level[:, None]
    speed = np.linalg.norm(np.gradient(toes, axis=0), axis=-1) * FPS
    return speed < RESTING


def played(session: Session) -> tuple[Array, Array, Array, Array]:
    """Hips (T, 3), rotations (T, J, 4), standing feet (T, 2) and library frames (T,) of a tape, between
    frames interpolated.
    """
    lib, tape = session.lib, session.tape
    f = np.array(tape.frames)
    i = np.minimum(f.astype(int), len(lib) - 2)
    w = (f - i).astype(np.float32)
    hips = lib.hips[i] + w[:, None] * (lib.hips[i + 1] - lib.hips[i])
    step = quat_to_rotvec(quat_mul(lib.rotations[i + 1], quat_conjugate(lib.rotations[i])))
    rotations = quat_normalize(quat_mul(quat_from_rotvec(w[:, None, None] * step), lib.rotations[i]))
    root = lib.root[i] + w[:, None] * (lib.root[i + 1] - lib.root[i])
    heading = lib.heading[i] + w * (lib.heading[i + 1] - lib.heading[i])
    hips, rotations = put_on_roots(
        hips, rotations, root, heading, np.array(tape.roots), np.array(tape.headings)
    )
    return hips, rotations, lib.contacts[i].copy(), i


def _told_phase(session: Session) -> Array | None:
    """Phase (T,), cycles, as sidecars say it of the frames that are played on as captured; NaN elsewhere,
    None if nowhere.

    About seams, and where a frame is held or played slowly or backward, the rule leads from one to the next.
    """
    lib, f = session.lib, np.array(session.tape.frames)
    i = np.minimum(f.astype(int), len(lib) - 2)
    phase = lib.phase[i] + (f - i) * (lib.phase[i + 1] - lib.phase[i])
    if not np.isfinite(phase).any():
        return None
    step = np.diff(f)
    played = (step > _SLOWEST) & (step < _FASTEST) & (np.diff(lib.clip_of[i]) == 0) & (np.diff(phase) > 0)
    told = np.full(len(f), np.nan)
    for a, b in intervals(played):
        first, end = a + SEAM * (a > 0), b + 1 - SEAM * (b < len(played))
        told[first:end] = phase[first:end]
    return told


def _ordered(commands: list[TimedCommand], session: Session) -> list[TimedCommand]:
    """Commands in strictly rising frames; one after a dropped stop takes the stop's frame."""
    result: list[TimedCommand] = []
    early: int | None = None
    for c in commands:
        if c.action == "next":
            early = c.frame
            continue
        frame = c.frame if early is None else early
        early = None
        if result and frame <= result[-1].frame:
            frame = result[-1].frame + 1
        result.append(TimedCommand(frame, c.action, c.position, c.heading, c.thing))
    if early is not None:
        # A dropped stop at the very end leaves the action before in force although the body leaves it: ask to
        # stand there.
        at, facing = session.tape.roots[-1], session.tape.headings[-1]
        result.append(TimedCommand(early, "idle", np.append(at, 0).astype(np.float32), facing))
    return result


def _provenance(session: Session, i: Array) -> list[Piece]:
    """Which frames of which clip follow one another."""
    lib, result = session.lib, []
    clip = lib.clip_of[i]
    jumps = np.flatnonzero((np.abs(np.diff(i)) > 2) | (np.diff(clip) != 0)) + 1
    for a, b in zip([0, *jumps], [*jumps, len(i)], strict=True):
        result.append(
            Piece(
                lib.names[clip[a]],
                int(i[a] - lib.start[i[a]]),
                int(i[b - 1] - lib.start[i[a]] + 1),
                int(b - a),
            )
        )
    return result
