"""Annotation without hand work: what a clip shows, proposed by rule, and read back after a person's edits."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.body.skeleton import HIPS, INDEX
from nsm_core.conventions import CLIMB, CONTACTS, FOOT_CONTACTS, FPS, GOAL_ACTIONS, HAND_CONTACTS, IDLE, RUN, SIT, STYLES, WALK
from nsm_core.data.captures.sidecar import SECTIONS, GoalKey, Key, Sheet, fingerprint
from nsm_core.rotations import Array
from nsm_core.signals import intervals

from .action_rules import propose_actions
from .measures import MeasuredMotion, Span, motion_of
from .other_rules import others
from .phases import phase_of_keys, rule_keys

_GAIT = [IDLE, WALK, RUN]
_HOLD_LAG = 3  # frames after which a command follows on a grasp or a release
_REST = 1.0  # seconds that an actor stands at least to count as idle between two actions
_PALM = 0.09  # metres from the wrist to the middle of the palm


@dataclass(frozen=True)
class Annotation:
    """Per-frame arrays of a clip.

    ``style`` (T, 7) and ``contact`` (T, 5) in the orders of ``conventions``; ``phase`` (T,) unwrapped, cycles, and
    ``phase_mirrored`` (T,) of the mirror image; goals in force: ``goal_action`` (T, 6), ``goal_place`` (T, 3), metres,
    ``goal_heading`` (T,), radians, ``goal_static`` (T,) bool (else the place is NaN and ``goal_ahead`` (T,), seconds, counts).
    """

    name: str
    style: Array
    contact: Array
    phase: Array
    phase_mirrored: Array
    goal_action: Array
    goal_place: Array
    goal_heading: Array
    goal_static: Array
    goal_ahead: Array

    def __len__(self) -> int:
        return len(self.phase)

    def mirrored(self) -> Annotation:
        """Annotation of ``Clip.mirrored``: left and right exchanged, with the phase of its own left landings."""
        swapped = [CONTACTS.index(_other(name)) for name in CONTACTS]
        return replace(
            self,
            name=self.name + "~",
            contact=self.contact[:, swapped],
            phase=self.phase_mirrored,
            phase_mirrored=self.phase,
            goal_place=self.goal_place * np.array((-1, 1, 1), np.float32),
            goal_heading=-self.goal_heading,
        )


def _other(name: str) -> str:
    return name.replace("Right", "Left") if "Right" in name else name.replace("Left", "Right")


def arrays_of(sheet: Sheet) -> Annotation:
    """Per-frame arrays of key frames."""
    count, frames = sheet.frames, np.arange(sheet.frames)
    style = np.stack([_lines(sheet.actions.get(name, []), frames) for name in STYLES], axis=1)
    gait = style[:, _GAIT]
    total = gait.sum(1, keepdims=True)
    gait = np.where(total > 1e-3, gait / np.maximum(total, 1e-3), np.array((1.0, 0, 0)))
    replaced = np.clip(style[:, SIT] + style[:, CLIMB], 0, 1)
    style[:, _GAIT] = gait * (1 - replaced)[:, None]
    contact = np.stack([_steps(sheet.contacts.get(name, []), frames) for name in CONTACTS], axis=1)
    action = np.zeros((count, len(GOAL_ACTIONS)), np.float32)
    place, heading = np.full((count, 3), np.nan, np.float32), np.zeros(count, np.float32)
    ahead, static = np.ones(count, np.float32), np.zeros(count, bool)
    goals = sheet.goals or [GoalKey(0, "walk")]
    # The first goal holds from the clip's first frame on, wherever its key is.
    for n, goal in enumerate(goals):
        now = slice(goal.frame if n else 0, None)
        action[now] = [float(name in goal.action.split("+")) for name in GOAL_ACTIONS]
        static[now] = goal.place is not None
        place[now] = np.nan if goal.place is None else goal.place
        heading[now], ahead[now] = np.radians(goal.facing), goal.ahead
    return Annotation(
        sheet.clip,
        style.astype(np.float32),
        contact.astype(np.float32),
        phase_of_keys(sheet.phase, count),
        phase_of_keys(sheet.phase_mirrored, count),
        action,
        place,
        heading,
        static,
        ahead,
    )


def _lines(keys: list[Key], frames: Array) -> Array:
    return np.interp(frames, *zip(*keys, strict=True)) if keys else np.zeros(len(frames))


def _steps(keys: list[Key], frames: Array) -> Array:
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

    Sections of ``kept`` that a person has changed stay as they are, and phase and goals follow from the labels so kept.
    """
    motion = motion_of(clip)
    actions, spans, contacts = propose_actions(motion)
    actions["other"] = others(motion, spans)
    on = {name: _step_keys(contacts[:, k]) if contacts[:, k].any() else [] for k, name in enumerate(CONTACTS)}
    sheet = Sheet(clip.name, len(clip), actions, on, [], [], [])
    edited = kept.edited() if kept is not None else []
    proposal = {name: fingerprint(sheet.section(name)) for name in SECTIONS[:-3]}
    for name in edited:
        sheet = sheet.with_section(name, kept.section(name))
    spans = _spans(sheet, spans, edited)
    arrays = arrays_of(sheet)
    moving = arrays.style[:, [WALK, RUN, CLIMB]].sum(1) > 0.3
    transitions = [t for s in spans if s.action in ("sit", "carry", "open") for t in ((s.start, s.full), (s.leave, s.end))]
    goals, remarks = propose_goals(motion, arrays, spans)
    feet = arrays.contact[:, FOOT_CONTACTS]
    found = {
        "phase": rule_keys(feet[:, 1], moving, transitions),
        "phase_mirrored": rule_keys(feet[:, 0], moving, transitions),
        "goals": goals,
    }
    for name, content in found.items():
        proposal[name] = fingerprint(content)
        if name not in edited:
            sheet = sheet.with_section(name, content)
    # What a person wrote keeps the mark of the old proposal, so that it is still known as theirs next time.
    marks = {n: (kept.proposal.get(n, "none") if n in edited else mark) for n, mark in proposal.items()}
    return replace(sheet, proposal=marks), {} if "goals" in edited else remarks


def _spans(sheet: Sheet, spans: list[Span], edited: list[str]) -> list[Span]:
    """Spans of the labels in force: those found, or those that a person's key frames say."""
    mine = {name.split(".")[1] for name in edited if name.startswith("actions.")}
    found = [s for s in spans if s.action not in mine]
    for action in mine & {"sit", "carry", "open", "climb"}:
        value = _lines(sheet.actions[action], np.arange(sheet.frames))
        edges = np.diff(np.concatenate(((0,), (value > 0.01).astype(int), (0,))))
        for a, b in zip(np.flatnonzero(edges > 0), np.flatnonzero(edges < 0), strict=True):
            full = np.flatnonzero(value[a:b] > 0.99) + a
            if len(full):
                found.append(Span(action, int(a), int(full[0]), int(full[-1]), int(b - 1)))
    return sorted(found, key=lambda s: s.start)


def propose_goals(motion: MeasuredMotion, arrays: Annotation, spans: list[Span]) -> tuple[list[GoalKey], dict[int, str]]:
    """Goals by rule: an action is asked for from where the actor leaves idle on until its label starts to fall."""
    count, style = len(motion), arrays.style
    idle = style[:, IDLE] > 0.5
    asked: dict[int, tuple[GoalKey, str]] = {}
    free = np.ones(count, bool)

    def ask(frame: int, action: str, place: Array | None = None, at: int = 0, remark: str = "") -> None:
        frame = int(np.clip(frame, 0, count - 1))
        spot = None if place is None else tuple(round(float(v), 3) + 0.0 for v in place)
        facing = round(float((np.degrees(motion.heading[min(at, count - 1)]) + 180) % 360 - 180), 1) + 0.0
        asked[frame] = (GoalKey(frame, action, spot, facing if spot else 0.0), remark)

    previous = 0
    for span in spans:
        begin = min(_leaves_idle(idle, span.start, previous), span.full)
        free[begin : span.end + 1] = False
        seconds = f"{max(0, span.start - begin) / FPS:.1f} s before the {span.action} label rises"
        middle = (span.full + span.leave) // 2
        if span.action == "sit":
            ask(begin, "sit", motion.positions[middle, HIPS], middle, seconds)
            end = span.leave
        elif span.action == "carry":
            ask(begin, "carry", _between_hands(motion, span.full), span.full, seconds)
            gaits = style[span.full : span.leave + 1]
            lead = "walk" if gaits[:, [WALK, RUN]].sum(1).max() > 0.5 else "idle"
            held = span.full + _HOLD_LAG
            if lead == "walk":
                ask(held, "walk+carry", remark="both hands hold the box")
            if lead == "idle" or span.leave < count - 2:
                arrive = held if lead == "idle" else max(held, span.leave - FPS)
                ask(arrive, "idle+carry", _between_hands(motion, span.leave), span.leave, "to where the box is set down or held")
            end = span.leave + _HOLD_LAG
        elif span.action == "open":
            hand = HAND_CONTACTS[int(np.argmax(arrays.contact[span.full : span.leave + 1, HAND_CONTACTS].sum(0)))]
            wrist = motion.positions[middle, INDEX[CONTACTS[hand]]]
            ask(begin, "open", wrist, middle, seconds)
            end = span.leave
        else:
            spot = (*motion.root[span.end], _ground(motion, span.end))
            ask(begin, "idle+walk", np.array(spot), span.end, seconds)
            end = span.end
        free[end : span.end + 1] = True
        previous = span.end
        if end < count - 2:
            free[end] = True
    _ask_between(motion, style, free, ask, asked)
    keys = [asked[f] for f in sorted(asked)]
    return [g for g, _ in keys], {n: r for n, (_, r) in enumerate(keys) if r}


def _leaves_idle(idle: Array, frame: int, earliest: int) -> int:
    """Frame at which the actor last left idle before ``frame``; ``frame`` itself if idle until then, and never before ``earliest``.

    Who halts for a moment before an object has not gone back to idle.
    """
    rests = [b for a, b in intervals(idle[earliest:frame]) if b - a >= _REST * FPS]
    return earliest + int(rests[-1]) if rests else earliest


def _ask_between(motion: MeasuredMotion, style: Array, free: Array, ask, asked: dict) -> None:
    """Dynamic goals of walking and running, static ones of standing, where no other goal is in force."""
    gait = np.argmax(style[:, _GAIT], axis=1)
    # A change of pace is asked for where its ramp starts.
    early = gait.copy()
    for f in np.flatnonzero(np.diff(gait)):
        start = f
        while start > 0 and style[start, _GAIT[gait[f]]] < 0.99 and gait[start - 1] == gait[f] and f - start < FPS:
            start -= 1
        early[start : f + 1] = gait[f + 1]
    last = None
    for f in range(len(free)):
        if not free[f]:
            last = None
            continue
        if early[f] == last or (f in asked and last is None):
            continue
        last = early[f]
        if last == IDLE:
            stay = f + int(np.argmax(np.append((early[f:] != IDLE) | ~free[f:], True)))
            rest = max(f, stay - 1)  # where the body has come to stand
            ask(f, "idle", np.array((*motion.root[rest], 0.0)), rest)
        else:
            ask(f, STYLES[last])


def _between_hands(motion: MeasuredMotion, frame: int) -> Array:
    """Middle between the palms: the centre of what two hands hold."""
    palms = []
    for side in ("Right", "Left"):
        elbow, wrist = (motion.positions[frame, INDEX[side + n]] for n in ("Elbow", "Wrist"))
        palms.append(wrist + _PALM * (wrist - elbow) / max(float(np.linalg.norm(wrist - elbow)), 1e-6))
    return np.mean(palms, axis=0)


def _ground(motion: MeasuredMotion, frame: int) -> float:
    """Height of the ground under the lower foot, metres."""
    toes = motion.positions[frame, [INDEX["RightToe"], INDEX["LeftToe"]], 2]
    return max(0.0, float(toes.min()) - 0.025)
