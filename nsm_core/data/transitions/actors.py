"""Whose motion a capture is, and which actors are kept out of training whole."""

from __future__ import annotations

import re
from collections.abc import Mapping

# Kept out of training, so that what a network is judged by is people whom it has never seen.
HELD_OUT = ("accad_male2", "cmu_03", "cmu_07", "cmu_08", "cmu_09", "uiprmd_s01", "uiprmd_s02", "uiprmd_s03")
LEAST = 0.2  # share of all frames that is held out at least


def actor_of(name: str) -> str:
    """Actor of a capture called "folder/clip": the folder, and the number of the subject where clips of the
    folder say one, as "cmu/cmu_07_01" does.
    """
    folder, _, clip = name.rpartition("/")
    folder = folder.rpartition("/")[2]
    subject = re.match(r"s?\d+(?=_)", clip.removeprefix(folder + "_")) if folder else None
    return f"{folder}_{subject[0]}" if subject and clip.startswith(folder + "_") else folder or clip


def held_out(frames: Mapping[str, int]) -> tuple[str, ...]:
    """Actors to keep out of training, of the numbers of ``frames`` by actor: those of HELD_OUT, and as many
    more, the last by name first, as make up a fifth of all frames.
    """
    total = sum(frames.values())
    out = [actor for actor in HELD_OUT if actor in frames]
    for actor in sorted(frames, reverse=True):
        if sum(frames[a] for a in out) >= LEAST * total or len(out) == len(frames) - 1:
            break
        if actor not in out:
            out.append(actor)
    return tuple(sorted(out))


__all__ = ["HELD_OUT", "actor_of", "held_out"]
