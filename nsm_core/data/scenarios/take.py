"""An annotated take: motion with roots, labels, phase, contacts, goals and the scene it happens in."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from nsm_core.body.clip import smoothed_root
from nsm_core.body.skeleton import forward_kinematics
from nsm_core.conventions import CLIMB, DT, FOOT_CONTACTS, FPS, GOAL_ACTIONS, IDLE, RUN, SIT, WALK
from nsm_core.distances import IDLE_TO_WALK, WALK_TO_RUN
from nsm_core.model.features.state import KEY_OFFSETS, KEYS
from nsm_core.rotations import Array, quat_to_matrix
from nsm_core.signals import gaussian_smooth
from nsm_core.world.scene.furniture import Furniture


@dataclass(frozen=True)
class TimedCommand:
    """What the animator asks for from ``frame`` on.

    ``action`` is a goal action, or several that hold together, such as "idle+carry".  A static goal has a
    ``position`` (3,) and ``heading``; a dynamic one (``position`` None) is the root itself one second ahead
    (section 3.1, low-level control).
    ``thing`` indexes the take's things, -1 for none.
    """

    frame: int
    action: str
    position: Array | None = None
    heading: float = 0.0
    thing: int = -1

    def hot(self) -> Array:
        """The goal action as (6,) ones and zeros."""
        return np.isin(GOAL_ACTIONS, self.action.split("+")).astype(np.float32)


@dataclass(frozen=True)
class Placed:
    """A piece of furniture in the world: ``position`` (2,), or (3,) where it does not stand on the floor of
    the walker beside it, metres, and ``heading``.
    """

    furniture: Furniture
    position: Array
    heading: float


@dataclass(frozen=True)
class Thing:
    """What an action of a take is done with, and where its frame is: ``poses`` (4,) or, where it moves, (T,
    4), x, y, z, heading.

    ``held`` (T,) tells when it moves with the body that holds it; None for never.
    """

    furniture: Furniture
    poses: Array
    held: Array | None = None

    @classmethod
    def standing(cls, furniture: Furniture, position: Array, heading: float) -> Thing:
        """A thing that stays on the floor at ``position`` (2,), metres."""
        return cls(furniture, np.array((*position, 0.0, heading), dtype=np.float64))

    @property
    def position(self) -> Array:
        """Where it stands at first, (2,)."""
        return self.poses[0, :2] if self.moves else self.poses[:2]

    @property
    def heading(self) -> float:
        """Its heading at first."""
        return float(self.poses[0, 3] if self.moves else self.poses[3])

    @property
    def moves(self) -> bool:
        """Whether its pose changes at all."""
        return self.poses.ndim == 2

    def track(self, count: int) -> Array:
        """Poses (T, 4) in all ``count`` frames."""
        return self.poses if self.moves else np.repeat(self.poses[None], count, axis=0)


class Piece(NamedTuple):
    """What captured frames a stretch of a take shows: ``first`` to one past ``last`` of a ``clip``, in so
    many of the take's ``frames``.
    """

    clip: str
    first: int
    last: int
    frames: int


@dataclass
class ComposedTake:
    """One performance of T frames.

    ``hips`` (T, 3), ``rotations`` (T, J, 4), ``contacts`` (T, 5); ``labels`` (T, 7): ramps 0..1 of the
    actions with an object (``conventions.INTERACTIONS``), the other columns are filled by rule; ``things``
    are sensed, ``obstacles`` only in the way.
    ``phase`` (T,), cycles, where the captures' sidecars say it, NaN where it goes by rule; None: nowhere.
    Everything is told over the floor of the walker, which lies ``level`` (T,) metres over that of the world:
    it rises along ``flights`` of stairs, whose places (3,) are in the world.  None: it is level.
    """

    hips: Array
    rotations: Array
    contacts: Array
    labels: Array
    commands: list[TimedCommand]
    things: list[Thing] = field(default_factory=list)
    obstacles: list[Placed] = field(default_factory=list)
    phase_keys: list[int] = field(default_factory=list)
    provenance: list[Piece] = field(default_factory=list)
    phase: Array | None = None
    level: Array | None = None
    flights: list[Placed] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.hips)

    def rises(self) -> Array:
        """Frames (T,) within a second of which the floor of the walker rises or sinks."""
        if self.level is None:
            return np.zeros(len(self), bool)
        changes = np.abs(np.gradient(self.level)) > 1e-4
        return np.convolve(changes, np.ones(2 * FPS + 1), mode="same") > 0.5


_SHORTEST_CYCLE = 10  # frames


def styles_of(root: Array, labels: Array) -> Array:
    """Action labels (T, 7) by rule: idle, walk and run by root speed, shared by what sitting and climbing
    leave over.
    """
    speed = gaussian_smooth(np.linalg.norm(np.gradient(root, axis=0), axis=1) * FPS, 4.0)
    free = np.clip(1 - labels[:, SIT] - labels[:, CLIMB], 0, 1)
    moving, running = (np.clip((speed - a) / (b - a), 0, 1) for a, b in (IDLE_TO_WALK, WALK_TO_RUN))
    styles = labels.astype(np.float32)
    styles[:, IDLE] = (1 - moving) * free
    styles[:, WALK] = moving * (1 - running) * free
    styles[:, RUN] = moving * running * free
    return styles


def phase_of(
    contacts: Array, walking: Array, transition_keys: list[int], count: int, told: Array | None = None
) -> Array:
    """Unwrapped phase (T,) in cycles (section 5.1).

    A cycle ends at every left landing while walking and at the ends of acyclic transitions; in between the
    idle phase runs at about 1 Hz.  ``contacts`` (T, 2) right and left foot, ``walking`` (T,) label.  Where a
    sidecar has ``told`` the phase (T,), NaN elsewhere, that is it, and the rule fills what is left.
    """
    told = np.full(count, np.nan) if told is None else told
    known = np.isfinite(told)
    near = np.convolve(known, np.ones(2 * _SHORTEST_CYCLE - 1), mode="same") > 0.5
    left = contacts[:, 1].astype(int)
    landings = [int(f) + 1 for f in np.flatnonzero(np.diff(left) > 0) if walking[f + 1] > 0.3]
    keys = sorted(k for k in {k for k in transition_keys if 0 <= k < count} | set(landings) if not near[k])
    merged: list[int] = []
    for k in keys:
        # Two landings within a third of a second are one stumble of the label, not two steps.
        if merged and k - merged[-1] < _SHORTEST_CYCLE:
            continue
        merged.append(k)
    anchors = [(k, 0.0) for k in merged] + [(int(k), float(told[k] % 1)) for k in np.flatnonzero(known)]
    at, phase = [-FPS], [0.0]
    for frame, value in [*sorted(anchors), (count + FPS, 0.0)]:
        # From value to value, and as many whole cycles more as the time between them holds.
        part = (value - phase[-1]) % 1.0
        whole = max(0 if part else 1, round((frame - at[-1]) / FPS / 1.25 - part))
        pieces = max(whole, 1) + 1
        frames, values = (
            np.linspace(at[-1], frame, pieces),
            np.linspace(phase[-1], phase[-1] + part + whole, pieces),
        )
        at += list(np.round(frames).astype(int)[1:])
        phase += list(values[1:])
    return np.interp(np.arange(count), at, phase).astype(np.float32)


@dataclass(frozen=True)
class Annotated:
    """Per-frame arrays of a take, ready to be cut into states; shapes as in ``state.State`` without the
    batch.
    """

    joint_position: Array
    joint_forward: Array
    joint_up: Array
    joint_velocity: Array
    root: Array  # (T, 3)
    style: Array  # (T, 7)
    phase: Array  # (T,) unwrapped
    contact: Array  # (T, 5)
    command: Array  # (T,) index of the command in force


def annotate(take: ComposedTake) -> Annotated:
    """Compute roots, axes, velocities, labels and phase of a take by rule."""
    positions, rotations = forward_kinematics(take.hips, take.rotations)
    matrices = quat_to_matrix(rotations)
    velocity = np.zeros_like(positions)
    velocity[1:] = (positions[1:] - positions[:-1]) / DT
    velocity[0] = velocity[1]
    root, heading = smoothed_root(positions)
    style = styles_of(root, take.labels)
    feet = take.contacts[:, FOOT_CONTACTS]
    phase = phase_of(feet, style[:, [WALK, RUN, CLIMB]].sum(axis=1), take.phase_keys, len(take), take.phase)
    command = np.searchsorted([c.frame for c in take.commands], np.arange(len(take)), side="right") - 1
    return Annotated(
        positions.astype(np.float32),
        (-matrices[..., 1]).astype(np.float32),
        matrices[..., 2].astype(np.float32),
        velocity.astype(np.float32),
        np.concatenate((root, heading[:, None]), axis=1).astype(np.float32),
        style,
        phase,
        take.contacts.astype(np.float32),
        np.maximum(command, 0).astype(np.int32),
    )


def goal_tables(take: ComposedTake, annotated: Annotated) -> tuple[Array, Array, Array]:
    """Goals at all keys of all frames: positions (T, 13, 3), headings (T, 13) and actions (T, 13, 6).

    Past keys keep the command of their time; from now on the command in force holds for every key ahead.
    """
    count = len(take)
    frames = np.arange(count)
    when = np.clip(frames[:, None] + KEY_OFFSETS[None], 0, count - 1)
    in_force = annotated.command[np.minimum(when, frames[:, None])]
    position = np.zeros((count, KEYS, 3), np.float32)
    heading = np.zeros((count, KEYS), np.float32)
    action = np.zeros((count, KEYS, len(GOAL_ACTIONS)), np.float32)
    ahead = np.minimum(when + FPS, count - 1)
    for number, command in enumerate(take.commands):
        mask = in_force == number
        if command.position is None:
            position[mask, :2] = annotated.root[ahead[mask], :2]
            heading[mask] = annotated.root[ahead[mask], 2]
            moves = annotated.style[ahead[mask]][:, [WALK, RUN, CLIMB]].sum(axis=1) > 0.5
            resting = TimedCommand(0, command.action.replace("walk", "idle").replace("run", "idle"))
            action[mask] = np.where(moves[:, None], command.hot(), resting.hot())
        else:
            position[mask] = command.position
            heading[mask] = command.heading
            action[mask] = command.hot()
    return position, heading, action
