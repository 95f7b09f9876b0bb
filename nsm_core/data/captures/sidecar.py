"""The editable file beside a clip: labels, contacts, phase and goals as key frames, what the clip is used
for, and what of it a person has changed.

Its header, below, says what may stand in it.  The program brings such files for the captures that its own
weights were trained with (``nsm_core/labels``), see ``shipped``.
"""

from __future__ import annotations

import os
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.conventions import CONTACTS, GOAL_ACTIONS
from nsm_core.errors import CaptureError, OutputError
from nsm_core.files import atomic_path
from nsm_core.validate import is_number, listed, number, read_toml, shown, table, text, whole

from .sheet import LABELS, SECTIONS, GoalKey, Key, Sheet, Stretch, Use

SUFFIX = ".nsm.toml"
MOST_FRAMES = 2_000_000  # of a clip at 30 Hz, 18 hours
LEAST_STRETCH = 20  # frames that are used as one piece
MOST_FAR = 1000.0  # metres that a goal lies from the clip's origin
MOST_TURN = 3600.0  # degrees of a goal's facing
MOST_AHEAD = 60.0  # seconds
_GOAL_KEYS = {"static": ("place", "facing"), "dynamic": ("ahead",)}
_USES = ("walk", "run", "sit")  # words of [use] that name stretches
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\r": "\\r", "\t": "\\t"}
_HEADER = """\
# What {clip} shows: proposed by `python -m nsm_core annotate`, yours to change.
# {frames} frames, 30 a second, from 0.
# Lines are `frame = value`.  Run the command again and it keeps every section you changed and proposes the
# others anew (from your labels and contacts); --overwrite proposes everything anew.  Leave [proposal] as it
# is: it tells which are yours.
#
# actions   0..1, straight lines between key frames.  carry and open are on besides idle, walk and run; sit
#           and climb take their share away from them when the file is read.  other is none of these (a hop,
#           a gesture).  No lines: never.
#           Training data is composed from what these labels say: walks of idle and walk, runs, sit-downs
#           that rise again, and bends where both hands take a box; where other is on, or nothing is, the
#           clip is not used.
# contacts  0 or 1, kept until the next key frame.  Feet that you changed stand where you say, instead of
#           where the rule sees them stand; hands take and leave a box where carry is on; the hips' contact
#           is composed from the sit label.
# phase     1 where a cycle ends (the left foot lands, a transition is over), even growth in between;
#           phase_mirrored is for the clip mirrored left to right, where the right foot's landings count.
#           Changed, or measured (--phase pae), it is the phase of these frames wherever they are played on;
#           else the rule finds it anew in what was composed.
# goals     of sit-downs.  sit: `place` in metres (x, y, z) is where the seat asks for the hips, `facing` in
#           degrees (0 faces -Y, counter-clockwise) which way; the seat is put there.  The goal after it, at
#           its `frame`: from when on one is asked to rise.  Other actions' goals are drawn with the objects
#           and ways that takes are composed of.
# use       yours alone, never proposed: what training data takes of the clip as it is, whatever its labels
#           and feet do.  `walk`, `run` and `sit` are lists of stretches [first, last], for example
#           `walk = [[0, 120]]`, and [] for nothing of it; the sit label tells when the seat is reached and
#           left in a stretch of `sit`.  `stand` is a frame of a quiet stand with hanging arms: takes start
#           from it, and its arms are given to those who sit down and bend.
"""
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


def write(path: Path, sheet: Sheet, comments: dict[int, str] | None = None) -> None:
    """Write a sidecar, whole or not at all; ``comments`` explain goals by their index.  OutputError where
    that cannot be done.
    """
    clip = _quoted(sheet.clip)
    lines = [_HEADER.format(clip=clip[1:-1], frames=sheet.frames)]
    lines += [f"clip = {clip}", f"frames = {sheet.frames}"]
    lines += _lines_of(sheet.use)
    for name in SECTIONS[:-1]:
        lines += ["", f"[{name}]", *(f"{frame} = {_number(value)}" for frame, value in sheet.section(name))]
    for n, goal in enumerate(sheet.goals):
        remark = f"  # {_quoted(comments[n])[1:-1]}" if comments and n in comments else ""
        lines += ["", "[[goals]]", f"frame = {goal.frame}{remark}", f"action = {_quoted(goal.action)}"]
        if goal.place is None:
            lines += ['kind = "dynamic"', *([f"ahead = {_number(goal.ahead)}"] if goal.ahead != 1 else [])]
        else:
            lines += [
                'kind = "static"',
                f"place = [{', '.join(map(_number, goal.place))}]",
                f"facing = {_number(goal.facing)}",
            ]
    lines += [
        "",
        "[proposal]",
        *(f"{_quoted(name)} = {_quoted(mark)}" for name, mark in sheet.proposal.items()),
        "",
    ]
    try:
        with atomic_path(path) as temporary:
            temporary.write_text("\n".join(lines), encoding="utf-8")
    except OSError as error:
        raise OutputError(
            f"{path} cannot be written ({error.strerror}); choose a folder you may write to."
        ) from error


def _lines_of(use: Use) -> list[str]:
    found = {word: getattr(use, word) for word in _USES if getattr(use, word) is not None}
    lines = [f"{word} = [{', '.join(f'[{a}, {b}]' for a, b in v)}]" for word, v in found.items()]
    if use.stand is not None:
        lines.append(f"stand = {use.stand}")
    return ["", "[use]", *lines] if lines else []


def _quoted(text: str) -> str:
    """A text as TOML has it, in quotes on one line, whatever a file may be called."""
    plain = text.encode(
        "utf-8", "replace"
    ).decode()  # bytes of a file's name that are no text have no place in TOML
    return (
        '"'
        + "".join(
            _ESCAPES.get(c) or (f"\\u{ord(c):04x}" if ord(c) < 32 or ord(c) == 127 else c) for c in plain
        )
        + '"'
    )


def _number(value: float) -> str:
    if not np.isfinite(value):
        raise OutputError(
            f"The value {value} is no number and is not written to a sidecar; read the capture again."
        )
    return f"{value:.3f}".rstrip("0").rstrip(".") if value != round(value) else f"{round(value)}"


def read(path: str | Path) -> Sheet:
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
    words = table(found, where, CaptureError, (*_USES, "stand"))
    stretches = {word: _stretches(words[word], f"{where}: {word}", frames) for word in _USES if word in words}
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
