"""The editable file beside a clip: labels, contacts, phase and goals as key frames, and what of it a person has changed."""

from __future__ import annotations

import hashlib
import json
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..conventions import CONTACTS, GOAL_ACTIONS, STYLES
from ..errors import CaptureError, OutputError

Key = tuple[int, float]
SUFFIX = ".nsm.toml"
_HEADER = """\
# What {clip} shows: proposed by `python -m nsm_core annotate`, yours to change.  {frames} frames, 30 a second, from 0.
# Lines are `frame = value`.  Run the command again and it keeps every section you changed and proposes the others anew
# (from your labels and contacts); --overwrite proposes everything anew.  Leave [proposal] as it is: it tells which are yours.
#
# actions   0..1, straight lines between key frames.  carry and open are on besides idle, walk and run; sit and climb take their
#           share away from them when the file is read.  other is none of these (a hop, a gesture).  No lines: never.
#           Training data is composed from what these labels say: walks of idle and walk, runs, sit-downs that rise again, and
#           bends where both hands take a box; where other is on, or nothing is, the clip is not used.
# contacts  0 or 1, kept until the next key frame.
# phase     1 where a cycle ends (the left foot lands, a transition is over), even growth in between; phase_mirrored is for the clip
#           mirrored left to right, where the right foot's landings count.
# goals     what is asked for from `frame` on.  dynamic: to be where the root is `ahead` seconds later.  static: `place` in metres
#           (x, y, z; for sit the hips, for carry the box's centre, for open the grip) and `facing` in degrees
#           (0 faces -Y, counter-clockwise).  Actions of goals: {actions}, or two joined by +.
"""


@dataclass(frozen=True)
class GoalKey:
    """What is asked for from ``frame`` on; ``place`` (metres) and ``facing`` (degrees) if static, else ``ahead`` seconds."""

    frame: int
    action: str
    place: tuple[float, float, float] | None = None
    facing: float = 0.0
    ahead: float = 1.0


@dataclass(frozen=True)
class Sheet:
    """The content of a sidecar: key frames by style, by contact, of the phase, of the mirrored clip's phase, and goals."""

    clip: str
    frames: int
    actions: dict[str, list[Key]]
    contacts: dict[str, list[Key]]
    phase: list[Key]
    phase_mirrored: list[Key]
    goals: list[GoalKey]
    proposal: dict[str, str] = field(default_factory=dict)
    present: frozenset[str] = frozenset()

    def section(self, name: str) -> object:
        """Content of a section: "actions.walk", "contacts.Hips", "phase", "phase_mirrored" or "goals"."""
        kind, _, part = name.partition(".")
        return getattr(self, kind).get(part, []) if part else getattr(self, kind)

    def with_section(self, name: str, content: object) -> Sheet:
        """Return the sheet with one section exchanged."""
        kind, _, part = name.partition(".")
        return replace(self, **{kind: {**getattr(self, kind), part: content} if part else content})

    def edited(self) -> list[str]:
        """Names of the sections that a person changed, added or wrote since they were proposed."""
        return [n for n in SECTIONS if self.proposal.get(n) != fingerprint(self.section(n)) and (n in self.proposal or n in self.present)]


LABELS = (*STYLES, "other")  # of [actions]
SECTIONS = (*(f"actions.{s}" for s in LABELS), *(f"contacts.{c}" for c in CONTACTS), "phase", "phase_mirrored", "goals")


def fingerprint(content: object) -> str:
    """Eight letters that change when the content of a section does; formatting and comments do not count."""
    plain = [vars(g) if isinstance(g, GoalKey) else g for g in content]  # type: ignore[attr-defined]
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()[:8]


def sidecar_of(clip: str | Path) -> Path:
    """Path of the sidecar of a clip's file."""
    path = Path(clip)
    return path if path.name.endswith(SUFFIX) else path.with_name(path.stem + SUFFIX)


def write(path: Path, sheet: Sheet, comments: dict[int, str] | None = None) -> None:
    """Write a sidecar; ``comments`` explain goals by their index.  OutputError where that cannot be done."""
    lines = [_HEADER.format(clip=sheet.clip, frames=sheet.frames, actions=", ".join(GOAL_ACTIONS))]
    lines += [f'clip = "{sheet.clip}"', f"frames = {sheet.frames}"]
    for name in SECTIONS[:-1]:
        lines += ["", f"[{name}]", *(f"{frame} = {_number(value)}" for frame, value in sheet.section(name))]
    for n, goal in enumerate(sheet.goals):
        remark = f"  # {comments[n]}" if comments and n in comments else ""
        lines += ["", "[[goals]]", f"frame = {goal.frame}{remark}", f'action = "{goal.action}"']
        if goal.place is None:
            lines += ['kind = "dynamic"', f"ahead = {_number(goal.ahead)}"]
        else:
            lines += ['kind = "static"', f"place = [{', '.join(map(_number, goal.place))}]", f"facing = {_number(goal.facing)}"]
    lines += ["", "[proposal]", *(f'"{name}" = "{mark}"' for name, mark in sheet.proposal.items()), ""]
    try:
        path.write_text("\n".join(lines), encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path} cannot be written ({error.strerror}); choose a folder you may write to.") from error


def _number(value: float) -> str:
    return f"{value:.3f}".rstrip("0").rstrip(".") if value != round(value) else f"{round(value)}"


def read(path: str | Path) -> Sheet:
    """Read a sidecar; CaptureError says which section or line is wrong."""
    path = Path(path)
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise CaptureError(f"{path.name} cannot be read ({error.strerror}); run `python -m nsm_core annotate` on its folder.") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise CaptureError(f"{path.name} is not valid TOML: {error}; mend that line or delete the file.") from error
    frames = table.get("frames")
    if not isinstance(frames, int) or frames < 1:
        raise CaptureError(f"{path.name}: `frames` must say how many frames the clip has.")
    present = {k for k in ("phase", "phase_mirrored", "goals") if k in table}
    groups: dict[str, dict[str, list[Key]]] = {}
    for group, names in (("actions", LABELS), ("contacts", CONTACTS)):
        parts = table.get(group, {})
        for part in parts:
            if part not in names:
                raise CaptureError(f"{path.name}: [{group}.{part}] is not known; use one of {', '.join(names)}.")
        groups[group] = {part: _keys(parts.get(part, {}), f"{path.name}, [{group}.{part}]", frames) for part in names}
        present |= {f"{group}.{part}" for part in parts}
    phases = {k: _keys(table.get(k, {}), f"{path.name}, [{k}]", frames) for k in ("phase", "phase_mirrored")}
    goals = [_goal(g, f"{path.name}, goal {n + 1}", frames) for n, g in enumerate(table.get("goals", []))]
    proposal = {str(k): str(v) for k, v in table.get("proposal", {}).items()}
    goals = sorted(goals, key=lambda g: g.frame)
    return Sheet(str(table.get("clip", path.name)), frames, **groups, **phases, goals=goals, proposal=proposal, present=frozenset(present))


def _keys(table: object, where: str, frames: int) -> list[Key]:
    keys = []
    if not isinstance(table, dict):
        raise CaptureError(f"{where}: expected lines such as `12 = 1`.")
    for text, value in table.items():
        if not text.isdigit() or int(text) >= frames:
            raise CaptureError(f"{where}: '{text}' is no frame of this clip; frames run from 0 to {frames - 1}.")
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1:
            raise CaptureError(f"{where}: frame {text} has the value {value!r}; it must be from 0 to 1.")
        keys.append((int(text), float(value)))
    return sorted(keys)


def _goal(table: object, where: str, frames: int) -> GoalKey:
    if not isinstance(table, dict) or not isinstance(table.get("frame"), int) or not 0 <= table["frame"] < frames:
        raise CaptureError(f"{where}: `frame` must be from 0 to {frames - 1}.")
    action = str(table.get("action", ""))
    unknown = [a for a in action.split("+") if a not in GOAL_ACTIONS]
    if unknown:
        raise CaptureError(f"{where}: '{unknown[0]}' is no action of a goal; use {', '.join(GOAL_ACTIONS)}, or two joined by +.")
    ahead, facing = table.get("ahead", 1.0), table.get("facing", 0.0)
    kind = table.get("kind", "static" if "place" in table else "dynamic")
    if kind not in ("static", "dynamic"):
        raise CaptureError(f"{where}: kind must be static or dynamic, not '{kind}'.")
    if not all(isinstance(v, int | float) and np.isfinite(v) for v in (ahead, facing)):
        raise CaptureError(f"{where}: ahead and facing must be numbers.")
    if kind == "dynamic":
        return GoalKey(table["frame"], action, ahead=float(ahead))
    place = table.get("place")
    if not isinstance(place, list) or len(place) != 3 or not all(isinstance(v, int | float) and np.isfinite(v) for v in place):
        raise CaptureError(f"{where}: a static goal needs `place = [x, y, z]`, metres.")
    return GoalKey(table["frame"], action, tuple(float(v) for v in place), float(facing))
