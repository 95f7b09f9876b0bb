"""Takes that are captured pieces on their own, furnished but stitched to nothing: what training goes without
stitching on.

A level clip from its beginning to its end, a captured sit-down on a seat, a captured bend to a box and up
again: no walk leads to an action, and doors and climbs are not in the captures at all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nsm_core.conventions import FPS, IDLE, RUN, STYLES, WALK
from nsm_core.data.matching.segment import LaidSegment
from nsm_core.rotations import Array, heading_to_direction
from nsm_core.world.scene.furniture import Furniture

from .carry import episode as carry_episode
from .carry.carried import CarryEpisode
from .carry.draws import CARRIES
from .carry.supports import draw_support
from .draws import PERFORMANCES
from .session import Session
from .sit import episode as sit_episode
from .sit.draws import SITS
from .sit.episode import SitEpisode
from .sit.manner import draw_manner
from .take import TimedCommand, styles_of

SHORTEST, LONGEST = 60, 12 * FPS  # frames of a level piece; of longer ones a stretch is drawn
_LEAST_STRETCH = 4 * FPS
_SPAN = 15  # frames that a gait lasts at least to be asked for
_MOSTLY = 0.2  # share of running frames from which on a clip is a run
_FURTHEST = 4.0  # metres of the longest walk to a stand that is asked for by its end
_GAITS = ("idle", "walk", "run")


# --- level clips ---


def walk_clip(session: Session) -> bool:
    """Play a level clip that hardly runs."""
    return _stroll(session, False)


def run_clip(session: Session) -> bool:
    """Play a clip that runs."""
    return _stroll(session, True)


def _stroll(session: Session, runs: bool) -> bool:
    """Play a level clip, whole or, of a long one, a stretch; longer clips are drawn more often, so that
    frames are equally likely.
    """
    rng = session.rng
    clips = [(a, b) for a, b in _level(session) if ((_gaits(session, a, b) == RUN).mean() > _MOSTLY) == runs]
    if not clips:
        return False
    lengths = np.array([min(b - a, LONGEST) for a, b in clips])
    first, last = clips[int(rng.choice(len(clips), p=lengths / lengths.sum()))]
    if last - first > LONGEST:
        count = int(rng.integers(_LEAST_STRETCH, LONGEST))
        first = int(rng.integers(first, last - count))
        last = first + count
    _begin(session, first)
    session.tape.run_on(np.arange(first + 1, last), seam=False)
    _ask(session, _settled(_gaits(session, first, last)))
    return True


def _level(session: Session) -> list[tuple[int, int]]:
    """First and one past the last frames of the library's level clips: all that are no episode's segment."""
    lib = session.lib
    segments = {s.first for pieces in session.source.segments.values() for s in pieces}
    starts = [int(s) for s in np.unique(lib.start) if s not in segments]
    return [(s, int(lib.end[s])) for s in starts if lib.end[s] - s >= SHORTEST]


def _gaits(session: Session, first: int, last: int) -> Array:
    """The gait (n,) of each frame of a stretch of the library, an index of ``_GAITS``."""
    root = session.lib.root[first:last]
    return styles_of(root, np.zeros((len(root), len(STYLES))))[:, [IDLE, WALK, RUN]].argmax(axis=1)


def _settled(gaits: Array) -> list[tuple[int, int, int]]:
    """Spans (gait, first, one past the last frame) of gaits (n,); shorter ones than ``_SPAN`` go to what is
    before them.
    """
    spans: list[tuple[int, int, int]] = []
    edges = [0, *(np.flatnonzero(np.diff(gaits)) + 1), len(gaits)]
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        gait = int(gaits[a])
        if spans and (b - a < _SPAN or gait == spans[-1][0]):
            spans[-1] = (spans[-1][0], spans[-1][1], int(b))
        else:
            spans.append((gait, int(a), int(b)))
    return spans


def _ask(session: Session, spans: list[tuple[int, int, int]]) -> None:
    """Ask for the gaits of the tape: dynamic goals while it moves, to stand where it stands; some walks are
    sent to their end.
    """
    rng, tape = session.rng, session.tape
    roots = np.array(tape.roots)
    for n, (gait, first, last) in enumerate(spans):
        frame = max(first - session.lead(), session.commands[-1].frame + 1) if session.commands else 0
        if gait:
            stops = n + 1 < len(spans) and spans[n + 1][0] == IDLE
            near = stops and np.linalg.norm(roots[first:last] - roots[last], axis=1).max() < _FURTHEST
            if not (gait == WALK and near and rng.random() < PERFORMANCES.sent):
                session.commands.append(TimedCommand(frame, _GAITS[gait]))
                continue
            first, last = spans[n + 1][1:]
        elif session.commands and session.commands[-1].position is not None:
            continue  # sent here already
        slow = np.linalg.norm(np.diff(roots[first:last], axis=0), axis=1)
        # A clip may begin with a single frame of standing.
        rest = first + (int(slow.argmin()) if len(slow) else 0)
        place = np.append(roots[rest], 0).astype(np.float32)
        session.commands.append(TimedCommand(frame, "idle", place, tape.headings[rest]))


# --- actions ---


def sit(session: Session) -> bool:
    """Play a captured sit-down, asked for from its first frame on, stay as composed sits do, and rise to
    stand.

    Legs of some captures stand where some seats would be: a seat is tried with several of them, lest wide
    ones get rare.
    """
    pieces = _from_both_feet(session, sit_episode.NAME)
    piece = session.draw(str(session.rng.choice(SITS.kinds)))
    if not pieces or piece.seat is None:
        return False
    for _ in range(SITS.tries):
        saved = session.save()
        session.episodes.append(_sit_on(session, piece, pieces))
        if session.clear():
            return True
        session.restore(saved)
    return False


def _sit_on(session: Session, piece: Furniture, pieces: list[LaidSegment]) -> SitEpisode:
    rng, tape = session.rng, session.tape
    segment = pieces[int(rng.integers(len(pieces)))]
    up = segment.marks["up"]
    mark = session.command("sit")
    _begin(session, segment.first)
    tape.hold(segment.first, session.lead(), 1, seam=False)
    manner = draw_manner(rng, piece, False)
    episode = SitEpisode(piece, tape.roots[-1], mark, manner)
    sit_episode.play(session, episode, segment, seam=False)
    episode.estimate(tape.roots[episode.leaving - 1], tape.headings[episode.leaving - 1])
    # Room to stand in before the seat, which nobody walks to here.
    ahead = heading_to_direction(np.array(tape.headings[episode.leaving - 1]))
    episode.places.append((tape.roots[episode.leaving - 1] + 0.5 * ahead, 1.0))
    lead = session.lead() + episode.rise - episode.leaving
    rising = session.command("idle", sit_episode.rise_asked(segment, lead))
    tape.run_on(np.linspace(up, segment.last - 2, round(manner.rises * FPS)), seam=False)
    episode.risen = len(tape)
    _stand(session, rising, segment.last - 2)
    return episode


def carry(session: Session) -> bool:
    """Bend to a box as captured, lift it, hold it for a while, put it back and stand; the same bend leads
    down and up.
    """
    rng, tape = session.rng, session.tape
    pieces = _from_both_feet(session, carry_episode.NAME)
    if not pieces:
        return False
    half = pieces[int(rng.integers(len(pieces)))]
    # One bend for all: no other one is stitched to it.
    session.source = replace(session.source, segments={**session.source.segments, carry_episode.NAME: [half]})
    box, piece = carry_episode.draw_box(session)
    face = float(rng.integers(4) * np.pi / 2)
    fetch = session.command("carry")
    _begin(session, half.first)
    tape.hold(half.first, session.lead(), 1, seam=False)
    taken = carry_episode.bend_to(session, box, face, draw_support(session, box.across(face)))
    if taken is None:
        return False
    session.command("walk+carry", len(tape) - taken.bend.touch - int(rng.integers(*CARRIES.answer)))
    tape.stay(rng.uniform(*CARRIES.held_for))
    bring = [session.command("idle+carry", session.lead())]
    put = carry_episode.bend_to(session, box, face, taken.support, taken.centre)
    if put is None:
        return False
    tape.seams.clear()  # between frames of one piece there is none
    episode = CarryEpisode(box, piece, face, taken, put, fetch, bring, [(taken.centre[:2], 0.9)])
    _stand(
        session,
        session.command("idle", len(tape) - put.bend.touch - int(rng.integers(*CARRIES.answer))),
        half.first,
    )
    session.episodes.append(episode)
    return session.clear()


def _from_both_feet(session: Session, name: str) -> list[LaidSegment]:
    """Captured pieces of an action that begin on both feet, and all where none does: their upright ends are
    held for a while.
    """
    pieces = session.source.segments.get(name, [])
    return [s for s in pieces if session.lib.contacts[s.first].all()] or pieces


def _begin(session: Session, frame: int) -> None:
    """Lay a piece's first frame at the origin, facing anywhere."""
    session.tape.lay(np.array([frame]), np.zeros((1, 2)), [float(session.rng.uniform(-np.pi, np.pi))])


def _stand(session: Session, mark: int, frame: int) -> None:
    """Let command ``mark`` ask to stand where the piece ends, and hold its last ``frame``."""
    session.stand_here(mark)
    session.tape.hold(frame, int(session.rng.uniform(*PERFORMANCES.stands_last) * FPS), 1, seam=False)
