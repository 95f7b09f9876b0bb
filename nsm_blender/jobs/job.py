"""A job of the batch: its takes and their goals."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from nsm_core.body.key_reduction import Bound

from ..begin import STAND
from ..keys.style import HIPS


@dataclass(frozen=True)
class JobGoal:
    """A goal of a job file: an object's name or a place (3,), world; ``to`` names the destination of what is
    carried; ``curve`` is gone along, ``rounds`` times where it is closed, at ``speed`` m/s; ``by`` is the
    frame at which it is to be reached; ``mass`` kilograms of what is carried; ``close_after``: what is
    opened for it is shut again.
    """

    action: str
    object: str | None = None
    hold: float = 2.0
    location: tuple[float, float, float] | None = None
    to: str | None = None
    curve: str | None = None
    rounds: int = 1
    speed: float | None = None
    by: int | None = None
    mass: float | None = None
    close_after: bool = True


@dataclass(frozen=True)
class JobFill:
    """A gap of a job file: the frames of the pose that is left and of the one that is reached; see
    ``fill.spec.FillSpec``.
    """

    start: float
    end: float
    replace: bool
    method: str


@dataclass
class JobTake:
    """A take of a job file; ``error`` is the sentence about what is wrong with its entry, if anything."""

    name: str
    character: str = "Character"
    rig: str | Path = ""  # bone map: name of a preset, or a file; where empty, the one that it has
    seed: int = 0
    start_frame: float = 1
    start: str = STAND  # or POSE: from the pose and the pace at the start frame
    contact_ik: bool = True
    in_order: bool = False
    root_motion: str = HIPS
    reduce: Bound | None = None  # how far the motion may be off for fewer keys
    overwrite: bool = False  # whether ``out`` may take the place of the scene
    goals: list[JobGoal] = field(default_factory=list)
    # Of several that act together: their names, each with its goals, instead of ``character`` and ``goals``.
    characters: list[tuple[str, list[JobGoal]]] = field(default_factory=list)
    fill: JobFill | None = None  # instead of goals
    outputs: dict[str, Path] = field(default_factory=dict)
    error: str | None = None


@dataclass
class Job:
    """A job file that has been read: a scene, its takes, and whether the scripts in the scene may run."""

    path: Path
    scene: Path
    takes: list[JobTake]
    scripts: bool = False
