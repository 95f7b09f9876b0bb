"""The editable file beside a clip, where it lies and how it is read: labels, contacts, phase and goals as key
frames, what the clip is used for, and what of it a person has changed.

What may stand in it says the header that ``sidecar_writer`` puts over it.  The program brings such files for
the captures that its own weights were trained with (``nsm_core/labels``), see ``shipped``.
"""

from __future__ import annotations

import os
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

from nsm_core.conventions import CONTACTS, GOAL_ACTIONS
from nsm_core.errors import CaptureError
from nsm_core.validate import is_number, listed, number, read_toml, shown, table, text, whole

from .sheet import LABELS, USES, GoalKey, Key, Sheet, Stretch, Use

SUFFIX = ".nsm.toml"
MOST_FRAMES = 2_000_000  # of a clip at 30 Hz, 18 hours
LEAST_STRETCH = 20  # frames that are used as one piece
MOST_FAR = 1000.0  # metres that a goal lies from the clip's origin
MOST_TURN = 3600.0  # degrees of a goal's facing
MOST_AHEAD = 60.0  # seconds
_GOAL_KEYS = {"static": ("place", "facing"), "dynamic": ("ahead",)}
LABELS_FOLDER = Path(__file__).parents[2] / "labels"


def sidecar_of(clip: str | Path) -> Path:
    """Path of the sidecar of a clip's file."""
    path = Path(clip)
    return path if path.name.endswith(SUFFIX) else path.with_name(path.stem + SUFFIX)


def shipped(clip: str | Path) -> Path:
    """Path of the sidecar that the program brings for a capture: by its name and that of its folder.

    There need be none; the capture of that name is the one it speaks of where the number of frames is the
    same.
    """
    own = sidecar_of(os.path.abspath(clip))
    return LABELS_FOLDER / own.parent.name / own.name


def read_sheet(path: str | Path) -> Sheet:
    """Read a sidecar; CaptureError says which section or line is wrong, and which is not known or
    said twice.
    """
    path = Path(path)
    found = read_toml(
        path,
        CaptureError,
        "run `python -m nsm_core annotate` on its folder",
        "mend that line or delete the file",
    )
    frames = found.get("frames")
    if isinstance(frames, bool) or not isinstance(frames, int) or not 1 <= frames <= MOST_FRAMES:
        raise CaptureError(
            f"{path.name}: `frames` must say how many frames the clip has, from 1 to {MOST_FRAMES}."
        )
    table(
        found,
        path.name,
        CaptureError,
        ("clip", "frames", "use", "actions", "contacts", "phase", "phase_mirrored", "goals", "proposal"),
    )
    present: set[str] = {k for k in ("phase", "phase_mirrored", "goals") if k in found}
    groups: dict[str, dict[str, list[Key]]] = {}
    for group, names in (("actions", LABELS), ("contacts", CONTACTS)):
        parts = table(found.get(group, {}), f"{path.name}, [{group}]", CaptureError)
        for part in parts:
            if part not in names:
                raise CaptureError(
                    f"{path.name}: [{group}.{shown(part)[1:-1]}] is not known; use one of {', '.join(names)}."
                )
        groups[group] = {
            part: _keys(parts.get(part, {}), f"{path.name}, [{group}.{part}]", frames) for part in names
        }
        present |= {f"{group}.{part}" for part in parts}
    phase, mirrored = (
        _keys(found.get(k, {}), f"{path.name}, [{k}]", frames) for k in ("phase", "phase_mirrored")
    )
    listed_goals = listed(found.get("goals", []), f"{path.name}, [[goals]]", CaptureError)
    goals = sorted(
        (_goal(g, f"{path.name}, goal {n + 1}", frames) for n, g in enumerate(listed_goals)),
        key=lambda g: g.frame,
    )
    for one, other in pairwise(goals):
        if one.frame == other.frame:
            raise CaptureError(f"{path.name}: two goals begin at frame {one.frame}; keep one of them.")
    marks = table(found.get("proposal", {}), f"{path.name}, [proposal]", CaptureError)
    proposal = {k: text(v, f"{path.name}, [proposal]: {shown(k)}", CaptureError) for k, v in marks.items()}
    clip = text(found.get("clip", path.name), f"{path.name}: clip", CaptureError)
    use = _use(found.get("use", {}), f"{path.name}, [use]", frames)
    return Sheet(
        clip,
        frames,
        groups["actions"],
        groups["contacts"],
        phase,
        mirrored,
        goals,
        proposal,
        frozenset(present),
        use,
    )


def _use(found: object, where: str, frames: int) -> Use:
    words = table(found, where, CaptureError, (*USES, "stand"))
    stretches = {word: _stretches(words[word], f"{where}: {word}", frames) for word in USES if word in words}
    stand = words.get("stand")
    if stand is not None:
        stand = whole(stand, f"{where}: stand", CaptureError, 0, frames - 1)
    return Use(**stretches, stand=stand)


def _stretches(found: object, where: str, frames: int) -> tuple[Stretch, ...]:
    stretches: list[Stretch] = []
    for pair in listed(found, where, CaptureError):
        if not isinstance(pair, list) or len(pair) != 2:
            raise CaptureError(
                f"{where}: {shown(pair)} is no stretch; write it as [first, last], two frames."
            )
        first, last = (whole(frame, f"{where}: a frame", CaptureError, 0, frames - 1) for frame in pair)
        if last - first < LEAST_STRETCH - 1:
            raise CaptureError(
                f"{where}: [{first}, {last}] is shorter than {LEAST_STRETCH} frames; lengthen it."
            )
        if stretches and first <= stretches[-1][1]:
            raise CaptureError(
                f"{where}: [{first}, {last}] begins before the stretch ahead of it ends; "
                "write stretches in order, none over another."
            )
        stretches.append((first, last))
    return tuple(stretches)


def _keys(found: object, where: str, frames: int) -> list[Key]:
    keys: dict[int, float] = {}
    if not isinstance(found, dict):
        raise CaptureError(f"{where}: expected lines such as `12 = 1`.")
    for name, value in found.items():
        if not re.fullmatch(r"[0-9]{1,9}", name) or int(name) >= frames:
            raise CaptureError(
                f"{where}: {shown(name)} is no frame of this clip; frames run from 0 to {frames - 1}."
            )
        if not is_number(value, 0, 1):
            raise CaptureError(f"{where}: frame {name} has the value {shown(value)}; it must be from 0 to 1.")
        if int(name) in keys:
            raise CaptureError(f"{where}: frame {int(name)} stands twice; keep one of the lines.")
        keys[int(name)] = float(value)
    return sorted(keys.items())


def _goal(found: object, where: str, frames: int) -> GoalKey:
    found = table(found, where, CaptureError)
    frame = found.get("frame")
    if isinstance(frame, bool) or not isinstance(frame, int) or not 0 <= frame < frames:
        raise CaptureError(f"{where}: `frame` must be from 0 to {frames - 1}.")
    action = text(found.get("action", ""), f"{where}: action", CaptureError)
    parts = action.split("+")
    unknown = [a for a in parts if a not in GOAL_ACTIONS]
    if unknown or len(parts) > 2 or len(set(parts)) < len(parts):
        wrong, known = shown((unknown or [action])[0]), ", ".join(GOAL_ACTIONS)
        raise CaptureError(f"{where}: {wrong} is no action of a goal; use {known}, or two joined by +.")
    kind = text(
        found.get("kind", "static" if "place" in found else "dynamic"), f"{where}: kind", CaptureError
    )
    if kind not in _GOAL_KEYS:
        raise CaptureError(f"{where}: kind must be static or dynamic, not {shown(kind)}.")
    place: Any = found.get("place")
    if kind == "static" and not (
        isinstance(place, list) and len(place) == 3 and all(is_number(v, -MOST_FAR, MOST_FAR) for v in place)
    ):
        raise CaptureError(
            f"{where}: a static goal needs `place = [x, y, z]`, metres, each from {-MOST_FAR:g} to "
            f"{MOST_FAR:g}."
        )
    table(found, where, CaptureError, ("frame", "action", "kind", "place", "facing", "ahead"))
    for key in ("place", "facing", "ahead"):
        if key in found and key not in _GOAL_KEYS[kind]:
            belongs = " and ".join(_GOAL_KEYS[kind])
            raise CaptureError(
                f"{where}: {key} stands in a {kind} goal, which has {belongs}; change the one or the other."
            )
    if kind == "dynamic":
        return GoalKey(
            frame,
            action,
            ahead=number(found.get("ahead", 1.0), f"{where}: ahead", CaptureError, 0, MOST_AHEAD),
        )
    facing = number(found.get("facing", 0.0), f"{where}: facing", CaptureError, -MOST_TURN, MOST_TURN)
    x, y, z = (float(v) for v in place)
    return GoalKey(frame, action, (x, y, z), facing)
