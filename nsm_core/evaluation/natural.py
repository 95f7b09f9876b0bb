"""Takes beside captures: gait, share of time in each label, spread over seeds, and how far windows of walks,
sits, bends and climbs lie from what was captured.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.body.skeleton import forward_kinematics
from nsm_core.control.take import TakeResult
from nsm_core.conventions import STYLES
from nsm_core.data.annotation.proposal import arrays_of, propose
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.errors import CaptureError, NsmError
from nsm_core.model.inference.model import Model

from .measures.naturalness import FEW, KINDS, LENGTHS, Space, WatchedMotion, gait, spread, windows
from .trials.suite import PARTS
from .trials.together import together

SEEDS = (0, 1)  # of every trial's takes
_PARTS = ("travel", "sit", "carry", "climb")
_PERSON = re.compile(r"(?:^|_)(s?\d\d)_")  # in the names of captures, of those folders that hold several


def captured(folder: str | Path) -> list[WatchedMotion]:
    """All captures of a folder, labelled by rule; CaptureError where there is none.  What cannot be read is
    left out.
    """
    index, found = CaptureFolder(folder), []
    for capture in index.captures:
        try:
            clip = index.read(capture)
        except NsmError:
            continue
        group = capture.path.parent.name
        person = _PERSON.search(capture.path.stem)
        sheet, _ = propose(clip)
        found.append(
            WatchedMotion(
                capture.path.stem,
                group,
                f"{group} {person[1]}" if person else group,
                clip.world()[0],
                arrays_of(sheet).style,
            )
        )
    if not found:
        raise CaptureError(
            f"no BVH file that can be read lies in {folder}; name the folder with the captures."
        )
    return found


def taken(model: Model, starts: int) -> list[WatchedMotion]:
    """Takes of ``starts`` trials of each setting of the parts, each by every one of ``SEEDS``: ways between
    furniture, sits, carries and climbs.  What breaks off is left out.
    """
    jobs = []
    for part in _PARTS:
        trials = PARTS[part].trials(starts, None)
        if part == "travel":
            trials = [t for t in trials if t.name == "room"]
        jobs += [(part, n, trial, seed) for n, trial in enumerate(trials) for seed in SEEDS]
    made = together(PARTS[part].run(model, trial, seed=seed) for part, _, trial, seed in jobs)
    return [
        as_seen(one[0], part, f"{part} {n}")
        for (part, n, _, _), one in zip(jobs, made, strict=True)
        if not isinstance(one, Exception)
    ]


def as_seen(take: TakeResult, group: str, person: str) -> WatchedMotion:
    """A take to be looked at; ``person`` is the same for all seeds of a trial."""
    positions, _ = forward_kinematics(take.hips_position, take.local_rotations)
    return WatchedMotion(person, group, person, positions, np.asarray(take.action))


def figures(takes: Sequence[WatchedMotion], captures: Sequence[WatchedMotion]) -> dict[str, Any]:
    """All figures of takes beside captures, as JSON holds them; see ``measures.naturalness``."""
    both = {"takes": takes, "captures": captures}
    found: dict[str, Any] = {name: gait(motions) for name, motions in both.items()}
    for name, motions in both.items():
        labels = np.concatenate([m.labels for m in motions]) if motions else np.zeros((1, len(STYLES)))
        found[name]["labels"] = dict(zip(STYLES, labels.mean(0).tolist(), strict=True))
        found[name]["spread_cm"] = {kind: spread(motions, kind) for kind in KINDS}
    trials = list(dict.fromkeys(m.person for m in takes))
    found["spread_over_seeds_cm"] = {
        kind: _mean([spread([m for m in takes if m.person == trial], kind) for trial in trials])
        for kind in KINDS
    }
    found["distances"] = {
        f"{kind}, {length}": _distances(takes, captures, kind, length) for kind in KINDS for length in LENGTHS
    }
    return found


def _mean(values: Sequence[float]) -> float:
    told = [v for v in values if np.isfinite(v)]
    return float(np.mean(told)) if told else float("nan")


def _distances(
    takes: Sequence[WatchedMotion], captures: Sequence[WatchedMotion], kind: str, length: str
) -> dict[str, Any]:
    """How far takes lie from captures, and every captured group and person from all others."""
    theirs = [windows(m, kind, length) for m in captures]
    ours = [windows(m, kind, length) for m in takes]
    count = sum(map(len, theirs))
    if count < FEW:
        return {}
    every = np.concatenate(theirs)
    space = Space.of(every)
    own = np.concatenate(ours) if ours else every[:0]

    def apart(names: list[str]) -> dict[str, float]:
        result = {}
        for name in dict.fromkeys(names):
            mine = np.concatenate([w for w, n in zip(theirs, names, strict=True) if n == name])
            others = np.concatenate(
                [w for w, n in zip(theirs, names, strict=True) if n != name] or [every[:0]]
            )
            value = space.distance(mine, others)
            if np.isfinite(value):
                result[name] = value
        return result

    return {
        "windows": len(own),
        "captured": count,
        "takes": space.distance(own, every),
        "groups": apart([m.group for m in captures]),
        "people": apart([m.person for m in captures]),
    }


def table(found: dict[str, Any]) -> str:
    """The figures as tables."""
    lines = ["| naturalness | takes | captures |", "|---|---|---|"]

    def row(name: str, *values: float, digits: int = 1) -> None:
        lines.append(f"| {name} | " + " | ".join("" if v != v else f"{v:.{digits}f}" for v in values) + " |")

    a, b = found["takes"], found["captures"]
    for key, name, digits in (
        ("cadence", "cadence, steps a minute", 0),
        ("stride_m", "stride, m", 2),
        ("arm_swing_cm", "arm swing, cm", 1),
        ("hip_rise_cm", "hip rise, cm", 1),
        ("jerk_m_s3", "jerk of walks, m/s^3", 0),
    ):
        row(name, a[key], b[key], digits=digits)
    for style in STYLES:
        row(f"share of time: {style}, %", 100 * a["labels"][style], 100 * b["labels"][style])
    for kind in KINDS:
        row(f"spread of {kind}, cm", a["spread_cm"][kind], b["spread_cm"][kind])
        row(f"spread of {kind} over seeds, cm", found["spread_over_seeds_cm"][kind], float("nan"))
    lines += ["", "| Frechet distance | takes from captures | captured groups from the others | people |"]
    lines.append("|---|---|---|---|")
    for name, d in found["distances"].items():
        if not d:
            lines.append(f"| {name} | too few captured windows | | |")
            continue
        groups = ", ".join(f"{g} {v:.2f}" for g, v in sorted(d["groups"].items(), key=lambda g: g[1]))
        people = sorted(d["people"].values())
        of = f"{len(people)}: {np.median(people):.2f} ({people[0]:.2f} to {people[-1]:.2f})" if people else ""
        ours = f"{d['takes']:.2f}" if d["takes"] == d["takes"] else "too few"
        lines.append(f"| {name} | {ours} ({d['windows']} windows) | {groups} | {of} |")
    return "\n".join(lines)


__all__ = ["as_seen", "captured", "figures", "table", "taken"]
