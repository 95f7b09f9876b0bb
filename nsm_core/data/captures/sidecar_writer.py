"""Write the editable file beside a clip, with the header that says what may stand in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nsm_core.errors import OutputError
from nsm_core.files import atomic_path

from .sheet import SECTIONS, USES, Sheet, Use

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
#           and feet do.  `walk`, `run`, `sit` and `bend` are lists of stretches [first, last], for
#           example `walk = [[0, 120]]`, and [] for nothing of it; the sit label tells when the seat is
#           reached and left in a stretch of `sit`; in one of `bend`, a squat say, one goes down and up
#           again once.  `stand` is a frame of a quiet stand with hanging arms: takes start
#           from it, and its arms are given to those who sit down and bend.
"""


def write_sheet(path: Path, sheet: Sheet, comments: dict[int, str] | None = None) -> None:
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
    found = {word: getattr(use, word) for word in USES if getattr(use, word) is not None}
    lines = [f"{word} = [{', '.join(f'[{a}, {b}]' for a, b in v)}]" for word, v in found.items()]
    if use.stand is not None:
        lines.append(f"stand = {use.stand}")
    return ["", "[use]", *lines] if lines else []


def _quoted(text: str) -> str:
    """A text as TOML has it, in quotes on one line, whatever a file may be called."""
    plain = text.encode("utf-8", "replace").decode()  # what is no text in a file's name has no place in TOML
    return '"' + "".join(_ESCAPES.get(c) or _plain(c) for c in plain) + '"'


def _plain(letter: str) -> str:
    return f"\\u{ord(letter):04x}" if ord(letter) < 32 or ord(letter) == 127 else letter


def _number(value: float) -> str:
    if not np.isfinite(value):
        raise OutputError(
            f"The value {value} is no number and is not written to a sidecar; read the capture again."
        )
    return f"{value:.3f}".rstrip("0").rstrip(".") if value != round(value) else f"{round(value)}"
