"""What a sidecar says of a clip: labels, contacts, phase and goals as key frames, and what it is used for."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

from nsm_core.conventions import CONTACTS, STYLES

Key = tuple[int, float]
Stretch = tuple[int, int]  # first and last frame


@dataclass(frozen=True)
class GoalKey:
    """What is asked for from ``frame`` on; ``place`` (metres) and ``facing`` (degrees) if static, else
    ``ahead`` seconds.
    """

    frame: int
    action: str
    place: tuple[float, float, float] | None = None
    facing: float = 0.0
    ahead: float = 1.0


@dataclass(frozen=True)
class Use:
    """What a person wants a clip used for, whatever its labels and measures say.

    Stretches to ``walk`` and to ``run`` by, in which one ``sit``s down as the label says, whatever the feet
    do, and in each of which one ``bend``s, whatever the hands do; None where labels and measures decide, ()
    for none of it.  ``stand`` is a frame of a quiet stand with hanging arms.
    """

    walk: tuple[Stretch, ...] | None = None
    run: tuple[Stretch, ...] | None = None
    sit: tuple[Stretch, ...] | None = None
    bend: tuple[Stretch, ...] | None = None
    stand: int | None = None


@dataclass(frozen=True)
class Sheet:
    """The content of a sidecar: key frames by style, by contact, of the phase, of the mirrored clip's phase,
    goals, and what a person wants it used for.
    """

    clip: str
    frames: int
    actions: dict[str, list[Key]]
    contacts: dict[str, list[Key]]
    phase: list[Key]
    phase_mirrored: list[Key]
    goals: list[GoalKey]
    proposal: dict[str, str] = field(default_factory=dict)
    present: frozenset[str] = frozenset()
    use: Use = Use()

    def section(self, name: str) -> Any:
        """Content of a section: "actions.walk", "contacts.Hips", "phase", "phase_mirrored" or "goals"."""
        kind, _, part = name.partition(".")
        return getattr(self, kind).get(part, []) if part else getattr(self, kind)

    def with_section(self, name: str, content: object) -> Sheet:
        """Return the sheet with one section exchanged."""
        kind, _, part = name.partition(".")
        exchanged: dict[str, Any] = {kind: {**getattr(self, kind), part: content} if part else content}
        return replace(self, **exchanged)

    def edited(self) -> list[str]:
        """Names of the sections that a person changed, added or wrote since they were proposed."""
        return [
            n
            for n in SECTIONS
            if self.proposal.get(n) != fingerprint(self.section(n))
            and (n in self.proposal or n in self.present)
        ]

    def says(self, name: str) -> bool:
        """Whether a section says what the rules would not: a person's, or measured."""
        return f"{name}.by" in self.proposal or name in self.edited()


LABELS = (*STYLES, "other")  # of [actions]
USES = ("walk", "run", "sit", "bend")  # of [use], those that name stretches
SECTIONS = (
    *(f"actions.{s}" for s in LABELS),
    *(f"contacts.{c}" for c in CONTACTS),
    "phase",
    "phase_mirrored",
    "goals",
)


def fingerprint(content: Iterable[object]) -> str:
    """Eight letters that change when the content of a section does; formatting and comments do not count."""
    plain = [vars(g) if isinstance(g, GoalKey) else g for g in content]
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()[:8]
