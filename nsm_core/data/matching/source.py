"""What to compose from: the database of a capture folder, how it is searched, and its segments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from nsm_core.body.skeleton import HIPS
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.errors import CaptureError
from nsm_core.rotations import Array

from .database import Library, build_library
from .search import Matcher
from .segment import LaidSegment, Segment
from .selection import load_runs, load_walks


@dataclass
class Source:
    """What to compose from: one library of walks, runs and the episodes' segments, and how to search it.

    ``walker`` finds walking frames, ``runner`` walking and running ones; ``still`` are frames to start
    standing from; ``segments`` the captured pieces of each kind of episode by its name.
    """

    library: Library
    walker: Matcher
    runner: Matcher
    still: Array
    segments: dict[str, list[LaidSegment]]


def gather(folder: CaptureFolder, segments: dict[str, list[Segment]]) -> Source:
    """Build the source from a capture folder and the ``segments`` cut from it, all with their mirror
    images.
    """
    walks, runs = load_walks(folder), load_runs(folder)
    walks, runs = ([c for c in clips if len(c) >= 20] for clips in (walks, runs))
    if not walks:
        raise CaptureError(
            f"no level walk was found in {folder}; run `python -m nsm_core annotate` on it, whose labels "
            "say what captures are used for, "
            "or add captures that stand, walk and stand again."
        )
    walks += [c.mirrored() for c in walks]
    runs += [c.mirrored() for c in runs]
    clips = walks + runs
    laid: dict[Any, Any] = {}
    at = sum(map(len, clips))
    for name, pieces in segments.items():
        laid[name] = []
        for piece in [*pieces, *(p.mirrored() for p in pieces)]:
            laid[name].append(
                LaidSegment(at, at + len(piece.clip), {k: at + v for k, v in piece.marks.items()}, piece.goal)
            )
            clips.append(piece.clip)
            at += len(piece.clip)
    library = build_library(clips)
    n, walked, run = np.arange(len(library)), sum(map(len, walks)), sum(map(len, walks + runs))
    slow = np.linalg.norm(library.velocity[:, HIPS, :2], axis=1) < 0.06
    still = np.flatnonzero(slow & (library.end - n > 50) & (n < walked) & library.contacts.all(axis=1))
    if not len(still):
        raise CaptureError(
            f"nobody stands still for two seconds in {folder}; add a capture of a quiet stand, from which "
            "takes start."
        )
    return Source(
        library,
        Matcher(library, n < walked),
        Matcher(library, n < run) if runs else Matcher(library, n < walked),
        still,
        laid,
    )
