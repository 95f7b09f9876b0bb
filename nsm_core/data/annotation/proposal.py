"""Annotation without hand work: what a clip shows, proposed by rule, and read back after a person's edits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.body.skeleton import HIPS
from nsm_core.conventions import CLIMB, CONTACTS, FOOT_CONTACTS, IDLE, RUN, SIT, STYLES, WALK
from nsm_core.data.captures.sheet import SECTIONS, GoalKey, Key, Sheet, Use, fingerprint
from nsm_core.rotations import Array

from .action_rules import propose_actions
from .measures import MeasuredMotion, Span, motion_of
from .other_rules import others
from .phases import phase_of_keys, rule_keys

_GAIT = [IDLE, WALK, RUN]


@dataclass(frozen=True)
class Annotation:
    """Per-frame arrays of a clip.

    ``style`` (T, 7) and ``contact`` (T, 5) in the orders of ``conventions``; ``phase`` (T,) unwrapped,
    cycles, and ``phase_mirrored`` (T,) of the mirror image; ``goals`` in the order of their frames.
    """

    name: str
    style: Array
    contact: Array
    phase: Array
    phase_mirrored: Array
    goals: tuple[GoalKey, ...]

    def __len__(self) -> int:
        return len(self.phase)

    def mirrored(self) -> Annotation:
        """Annotation of ``Clip.mirrored``: left and right exchanged, with the phase of its own left
        landings.
        """
        swapped = [CONTACTS.index(_other(name)) for name in CONTACTS]
        return replace(
            self,
            name=self.name + "~",
            contact=self.contact[:, swapped],
            phase=self.phase_mirrored,
            phase_mirrored=self.phase,
            goals=tuple(
                replace(
                    g,
                    facing=-g.facing,
                    place=None if g.place is None else (-g.place[0], g.place[1], g.place[2]),
                )
                for g in self.goals
            ),
        )


def _other(name: str) -> str:
    return name.replace("Right", "Left") if "Right" in name else name.replace("Left", "Right")


def arrays_of(sheet: Sheet) -> Annotation:
    """Per-frame arrays of key frames."""
    count, frames = sheet.frames, np.arange(sheet.frames)
    style = np.stack([straight_lines(sheet.actions.get(name, []), frames) for name in STYLES], axis=1)
    gait = style[:, _GAIT]
    total = gait.sum(1, keepdims=True)
    gait = np.where(total > 1e-3, gait / np.maximum(total, 1e-3), np.array((1.0, 0, 0)))
    replaced = np.clip(style[:, SIT] + style[:, CLIMB], 0, 1)
    style[:, _GAIT] = gait * (1 - replaced)[:, None]
    contact = np.stack([steps(sheet.contacts.get(name, []), frames) for name in CONTACTS], axis=1)
    return Annotation(
        sheet.clip,
        style.astype(np.float32),
        contact.astype(np.float32),
        phase_of_keys(sheet.phase, count),
        phase_of_keys(sheet.phase_mirrored, count),
        tuple(sheet.goals),
    )


def straight_lines(keys: list[Key], frames: Array) -> Array:
    """Values (T,) of action keys: straight lines between them, 0 where there are none."""
    if not keys:
        return np.zeros(len(frames))
    at, values = zip(*keys, strict=True)
    return np.interp(frames, at, values)


def steps(keys: list[Key], frames: Array) -> Array:
    """Values (T,) of contact keys: each holds until the next, 0 before the first."""
    if not keys:
        return np.zeros(len(frames))
    found = np.searchsorted([k for k, _ in keys], frames, side="right") - 1
    return np.where(found >= 0, np.array([v for _, v in keys])[np.maximum(found, 0)], 0.0)


def _step_keys(on: Array) -> list[Key]:
    """Key frames of (T,) flags."""
    edges = np.flatnonzero(np.diff(on.astype(int))) + 1
    return [(int(f), float(on[f])) for f in (0, *edges)]


def propose(clip: Clip, kept: Sheet | None = None) -> tuple[Sheet, dict[int, str]]:
    """Propose a sheet for a clip, and remarks on its goals by index.

    Sections of ``kept`` that a person has changed stay as they are, what it is used for too, and phase and
    goals follow from the labels so kept.
    """
    motion = motion_of(clip)
    actions, spans, contacts = propose_actions(motion)
    actions["other"] = others(motion, spans)
    on = {name: _step_keys(contacts[:, k]) if contacts[:, k].any() else [] for k, name in enumerate(CONTACTS)}
    use = kept.use if kept is not None else Use()
    sheet = Sheet(clip.name, len(clip), actions, on, [], [], [], use=use)
    before = kept if kept is not None else sheet
    edited = before.edited()
    proposal = {name: fingerprint(sheet.section(name)) for name in SECTIONS[:-3]}
    for name in edited:
        sheet = sheet.with_section(name, before.section(name))
    spans = _spans(sheet, spans, edited)
    arrays = arrays_of(sheet)
    moving = arrays.style[:, [WALK, RUN, CLIMB]].sum(1) > 0.3
    transitions = [
        t
        for s in spans
        if s.action in ("sit", "carry", "open")
        for t in ((s.start, s.full), (s.leave, s.end))
    ]
    goals, remarks = propose_goals(motion, spans)
    feet = arrays.contact[:, FOOT_CONTACTS]
    found: dict[str, Sequence[object]] = {
        "phase": rule_keys(feet[:, 1], moving, transitions),
        "phase_mirrored": rule_keys(feet[:, 0], moving, transitions),
        "goals": goals,
    }
    for name, content in found.items():
        proposal[name] = fingerprint(content)
        if name not in edited:
            sheet = sheet.with_section(name, content)
    # What a person wrote keeps the mark of the old proposal, so that it is still known as theirs next time.
    marks = {n: (before.proposal.get(n, "none") if n in edited else mark) for n, mark in proposal.items()}
    return replace(sheet, proposal=marks), {} if "goals" in edited else remarks


def _spans(sheet: Sheet, spans: list[Span], edited: list[str]) -> list[Span]:
    """Spans of the labels in force: those found, or those that a person's key frames say."""
    mine = {name.split(".")[1] for name in edited if name.startswith("actions.")}
    found = [s for s in spans if s.action not in mine]
    for action in mine & {"sit", "carry", "open", "climb"}:
        value = straight_lines(sheet.actions[action], np.arange(sheet.frames))
        edges = np.diff(np.concatenate(((0,), (value > 0.01).astype(int), (0,))))
        for a, b in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
            full = np.flatnonzero(value[a:b] > 0.99) + a
            if len(full):
                found.append(Span(action, int(a), int(full[0]), int(full[-1]), int(b - 1)))
    return sorted(found, key=lambda s: s.start)


def propose_goals(motion: MeasuredMotion, spans: list[Span]) -> tuple[list[GoalKey], dict[int, str]]:
    """Goals that composing reads: where one sits and faces, asked for as the sit begins, and when one is
    asked to rise.
    """
    goals: list[GoalKey] = []
    remarks: dict[int, str] = {}
    for span in (s for s in spans if s.action == "sit"):
        middle = (span.full + span.leave) // 2
        x, y, z = (round(float(v), 3) + 0.0 for v in motion.positions[middle, HIPS])
        facing = round(float((np.degrees(motion.heading[middle]) + 180) % 360 - 180), 1) + 0.0
        if goals and goals[-1].frame >= span.start:
            goals.pop()  # asked to sit again at once
        remarks[len(goals)] = "to sit with the hips there"
        goals.append(GoalKey(span.start, "sit", (x, y, z), facing))
        if span.leave < len(motion) - 2:
            remarks[len(goals)] = "to rise"
            goals.append(GoalKey(span.leave, "idle"))
    return goals, remarks
