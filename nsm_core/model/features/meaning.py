"""What features and goals of training data mean: rates, sensors, skeleton, distances, by name, kept in
weights and compared.

``layout`` says which numbers a network is fed; this says what they are numbers of.  Weights keep what was in
force when their data were composed, with a hash, so that a program in which any of it has changed tells what
differs instead of moving oddly.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from nsm_core import distances
from nsm_core.body.clip import ROOT_SMOOTHING
from nsm_core.body.skeleton import ANKLE_HEIGHT, HIP_OVER_SEAT, JOINTS, OFFSETS, TOE_HEIGHT
from nsm_core.conventions import CONTACTS, FPS, GOAL_ACTIONS, STYLES
from nsm_core.validate import is_number, shown
from nsm_core.world.scene.furniture.piece import HIP_BEHIND_EDGE, HIP_FROM_BACK
from nsm_core.world.sensors import environment, interaction

from .state import KEY_TIMES

Value = Any  # what JSON keeps: a number, a word, or lists of them
Meaning = dict[str, dict[str, Value]]  # "features" and "distances" -> name -> value

# Units that sentences tell; what is not here is in metres.
_UNITS = {
    "FPS": "Hz", "KEY_TIMES": "s", "ROOT_SMOOTHING": "s", "IDLE_PERIOD": "s", "IDLE_TO_WALK": "m/s",
    "WALK_TO_RUN": "m/s", "WALKED": "m/s", "RUN_AT": "m/s", "OPENED": "rad", "STYLES": "", "GOAL_ACTIONS": "",
    "CONTACTS": "", "PHASE": "",
    "RINGS": "", "LAYERS": "", "CELLS_ACROSS": "", "SEAT_MEMORY": "", "WRIST_BELOW": "", "BOX_READS": "",
}  # fmt: skip
# Of ``distances``: what the network is fed by, whatever it is asked to do.
_FED = ("IDLE_PERIOD", "BOX_READS")
_MOST_TOLD = 3  # differences that a sentence names


def meaning() -> Meaning:
    """Everything by which training data and takes must agree.

    "features": how poses, time and sensors become numbers; a network that is fed by other rules cannot move.
    "distances": where bodies of the data stand, hold and turn in what they were asked for, and by which
    speeds they were labelled; under other values a network misses by as much.  Data and the weights trained
    on them also keep "draws": what was drawn at random and how (``data.scenarios.registry``).
    """
    ours = {name: value for name, value in vars(distances).items() if name.isupper()}
    features = {
        "FPS": FPS,
        "STYLES": STYLES,
        "GOAL_ACTIONS": GOAL_ACTIONS,
        "CONTACTS": CONTACTS,
        "KEY_TIMES": KEY_TIMES,
        "PHASE": "in cycles",
        "ROOT_SMOOTHING": ROOT_SMOOTHING,
        "DIAMETER": environment.DIAMETER,
        "RINGS": environment.RINGS,
        "LAYERS": environment.LAYERS,
        "CELLS_ACROSS": interaction.RESOLUTION,
        **{name: ours.pop(name) for name in _FED},
        **{f"the offset of {joint}": offset for joint, offset in zip(JOINTS, OFFSETS, strict=True)},
    }
    body = {
        "ANKLE_HEIGHT": ANKLE_HEIGHT,
        "TOE_HEIGHT": TOE_HEIGHT,
        "HIP_OVER_SEAT": HIP_OVER_SEAT,
        "HIP_BEHIND_EDGE": HIP_BEHIND_EDGE,
        "HIP_FROM_BACK": HIP_FROM_BACK,
    }
    return {
        "features": {k: _plain(v) for k, v in features.items()},
        "distances": {k: _plain(v) for k, v in {**ours, **body}.items()},
    }


def _plain(value: Any) -> Value:
    """A value as JSON keeps it; micrometres are no difference."""
    if isinstance(value, str):
        return value
    if isinstance(value, tuple | list | np.ndarray):
        return [_plain(v) for v in value]
    return value if isinstance(value, int) else round(float(value), 6)


def meaning_hash(told: Mapping[str, Any]) -> str:
    """Short fingerprint of a meaning, whatever the order of its names."""
    return hashlib.sha256(json.dumps(told, sort_keys=True, separators=(",", ":")).encode()).hexdigest()[:16]


def differences(theirs: object, part: str) -> list[str]:
    """What of a stored meaning's ``part`` is otherwise here, in words: "PULL_BACK 0.5 m where this version
    has 0.55 m".

    Names that were not kept yet when ``theirs`` was written are no difference; ``theirs`` may be anything
    that a file can hold.
    """
    told, ours = theirs.get(part) if isinstance(theirs, dict) else None, meaning()[part]
    if not isinstance(told, dict):
        return []
    found = []
    for name, value in told.items():
        if name not in ours:
            found.append(f"{shown(name)[1:-1]} {_worded(name, value)}, which this version does not know")
        elif value != ours[name]:
            found.append(f"{name} {_worded(name, value)} where this version has {_worded(name, ours[name])}")
    return found


def sentence_part(found: list[str]) -> str:
    """The first of several differences, and how many more there are."""
    more = len(found) - _MOST_TOLD
    return "; ".join(found[:_MOST_TOLD]) + (f"; and {more} more" if more > 0 else "")


def remark(metadata: Mapping[str, Any]) -> tuple[str, ...]:
    """A sentence where weights were trained under other distances than this version commands with;
    else none.
    """
    found = differences(metadata.get("meaning"), "distances")
    if not found:
        return ()
    return (
        f"These weights were trained with {sentence_part(found)}: expect bodies to be off by as much, or "
        "train the weights again.",
    )


def _worded(name: str, value: object) -> str:
    unit = _UNITS.get(name, "m")
    if isinstance(value, list) and 0 < len(value) <= 13 and all(is_number(v) for v in value):
        text = " ".join(f"{v:g}" for v in value)
    else:
        text = f"{value:g}" if is_number(value) else shown(value, 120)
    return f"{text} {unit}".rstrip()
