"""What a take goes on from: the pose and pace that a character has when it begins, in the network's terms.

The network is fed with a second of the past (section 3.1).  Of a motion that somebody else has made, labels
and phase are told by the rules that captures are labelled with: paces by the speed of the root, cycles by the
landings of the left foot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.clip import smoothed_root
from nsm_core.body.contacts import detect_foot_contacts
from nsm_core.body.skeleton import ARMS, PARENTS, J, forward_kinematics
from nsm_core.conventions import (
    CONTACTS,
    DT,
    FOOT_CONTACTS,
    FPS,
    GOAL_ACTIONS,
    HIP_CONTACT,
    IDLE,
    RUN,
    SIT,
    STYLES,
    WALK,
)
from nsm_core.distances import IDLE_PERIOD, IDLE_TO_WALK, WALK_TO_RUN
from nsm_core.errors import GoalError
from nsm_core.model.features.state import FUTURE, KEY_OFFSETS, KEYS, PIVOT, WINDOW, State
from nsm_core.rotations import (
    Array,
    quat_conjugate,
    quat_mul,
    quat_rotate,
    quat_to_matrix,
    quat_to_rotvec,
    wrap_angle,
)
from nsm_core.signals import smooth_step

from .goals import Goal

_CYCLES = {WALK: 1.1, RUN: 0.72}  # seconds of a cycle of captured walks and runs, where no landing tells it
UPRIGHT = np.cos(np.radians(65))  # of the hips' up axis against the world's
_STRANGE = np.radians(70)  # turn of an upper arm against one that hangs, past which no capture has it
_TURN = np.radians(180)  # rad/s that a start may turn by at most, as seen ahead


@dataclass(frozen=True, eq=False)
class Start:
    """The motion up to a take's first frame.

    ``hips`` (N, 3) metres and ``local`` rotations (N, 23, 4) at 30 Hz, the last of them the take's first
    frame; one alone is a pose at rest.  ``seat``: the goal of what the character sits on, None where it
    stands or moves.  GoalError where that is no motion.
    """

    hips: Array
    local: Array
    seat: Goal | None = None

    def __post_init__(self) -> None:
        sizes = self.hips.ndim == 2 and self.hips.shape[1:] == (3,) and len(self.hips) > 0
        if not sizes or self.local.shape != (len(self.hips), J, 4):
            raise GoalError("The pose to start from has no frames; start from a quiet stand instead.")
        if not (np.isfinite(self.hips).all() and np.isfinite(self.local).all()):
            raise GoalError(
                "The pose to start from has values that are no numbers; clear it, or start from a stand."
            )
        trunk = quat_rotate(self.local[-1, 0], np.array((0.0, 0.0, 1.0)))[2]
        if trunk < UPRIGHT:
            raise GoalError(
                "The character lies or hangs upside down in the pose to start from and has not learned to "
                "get up; choose a frame where it stands or sits, or start from a quiet stand."
            )

    def second(self) -> tuple[Array, Array]:
        """Hips (31, 3) and local rotations (31, 23, 4) of the last second; before the first frame it
        rests.
        """
        rows = np.maximum(np.arange(-WINDOW - 1, 0) + len(self.hips), 0)
        return self.hips[rows].astype(np.float64), self.local[rows].astype(np.float64)


@dataclass(frozen=True, eq=False)
class Trail:
    """How a take begins: its first ``state`` (a batch of one), the ``contacts`` (5,) of that frame, and what
    was wanted in the second before it: ``goal_position`` (31, 3), ``goal_heading`` (31,) and ``goal_action``
    (31, 6).  ``moving``: whether it is in the middle of a pace.
    """

    state: State
    contacts: Array
    goal_position: Array
    goal_heading: Array
    goal_action: Array
    moving: bool


def trail_of(start: Start, arms: Array, level: float = 0.0) -> Trail:
    """Begin a take with a motion, on a floor at the height ``level`` metres.

    Arms that are held as no capture has them would be flung about by the network: it begins with them as they
    hang in ``arms`` (23, 4), local rotations, and the take is eased over to that (``post_process``).
    """
    hips, local = start.second()
    hips = hips - (0, 0, level)
    for side in ARMS:
        if strangeness(local[-1], arms, side) > _STRANGE:
            chain = [PARENTS[side[0]], *side]
            local[:, chain] = arms[chain]
    positions, world = forward_kinematics(hips, local)
    place, heading = smoothed_root(positions)
    roots = np.concatenate((place, heading[:, None]), axis=1)
    feet = detect_foot_contacts(positions)
    style = _styles(roots, feet, start.seat is not None)
    phase, rate = _phase(style[-1], feet)
    pace = (roots[-1] - roots[-4]) / (3 * DT) * float(style[-1, WALK] + style[-1, RUN])
    pace[2] = np.clip(pace[2], -_TURN, _TURN)
    ahead = KEY_OFFSETS[PIVOT + 1 :] * DT
    future = roots[-1] + ahead[:, None] * pace
    velocity = (positions[-1] - positions[-2]) / DT
    wanted, action = _wanted(roots, style, start.seat)
    axes = quat_to_matrix(world[-1])
    contacts = np.zeros(len(CONTACTS), np.float32)
    contacts[FOOT_CONTACTS] = feet[-1]
    contacts[HIP_CONTACT] = style[-1, SIT]
    goals = np.repeat(wanted[-1:], KEYS, 0)
    state = State(
        positions[None, -1].astype(np.float32),
        -axes[None, ..., 1].astype(np.float32),
        axes[None, ..., 2].astype(np.float32),
        velocity[None].astype(np.float32),
        roots[None].astype(np.float32),
        style[None],
        ((phase + rate * DT * np.arange(-WINDOW, 1)) % 1.0)[None].astype(np.float32),
        future[None].astype(np.float32),
        np.repeat(style[None, -1:], FUTURE, 1),
        ((phase + rate * ahead) % 1.0)[None].astype(np.float32),
        goals[None, :, :3].astype(np.float32),
        goals[None, :, 3].astype(np.float32),
        np.repeat(action[None, -1:], KEYS, 1),
    )
    moving = float(style[-1, WALK] + style[-1, RUN]) > 0.5
    return Trail(
        state, contacts, wanted[:, :3].astype(np.float32), wanted[:, 3].astype(np.float32), action, moving
    )


def strangeness(local: Array, usual: Array, arm: tuple[int, int, int]) -> float:
    """Radians by which an upper arm is turned about its chest from where it is in ``usual`` (23, 4)."""
    collar, shoulder = PARENTS[arm[0]], arm[0]
    here, there = (quat_mul(pose[collar], pose[shoulder]) for pose in (local, usual))
    return float(np.linalg.norm(quat_to_rotvec(quat_mul(here, quat_conjugate(there)))))


def _styles(roots: Array, feet: Array, seated: bool) -> Array:
    """Labels (31, 7) by the speed of the roots (31, 3); who does not lift a foot (31, 2) does not walk."""
    style = np.zeros((len(roots), len(STYLES)), np.float32)
    if seated:
        style[:, SIT] = 1
        return style
    speed = np.linalg.norm(np.gradient(roots[:, :2], axis=0), axis=1) * FPS
    walks, runs = (smooth_step((speed - a) / (b - a)) for a, b in (IDLE_TO_WALK, WALK_TO_RUN))
    if feet.all(1).mean() > 0.8:
        walks, runs = np.zeros_like(walks), np.zeros_like(runs)
    style[:, IDLE], style[:, WALK], style[:, RUN] = 1 - walks, walks * (1 - runs), walks * runs
    return style


def _phase(style: Array, feet: Array) -> tuple[float, float]:
    """Phase now and cycles a second: a cycle ends where the left foot lands, the right one lands half a cycle
    later; ``feet`` (31, 2) stand or not, right and left.
    """
    pace = int(style.argmax())
    if pace not in _CYCLES:
        return 0.0, 1 / IDLE_PERIOD
    right, left = (np.flatnonzero(~f[:-1] & f[1:]) + 1 for f in feet.T)
    period = _CYCLES[pace]
    if len(right) and len(left):
        period = float(np.clip(2 * DT * abs(int(left[-1]) - int(right[-1])), 0.7 * period, 1.4 * period))
    landed = [(int(f[-1]), k) for f, k in ((left, 0.0), (right, 0.5)) if len(f)]
    if not landed:
        return 0.0, 1 / period
    frame, phase = max(landed)
    return (phase + min((WINDOW - frame) * DT / period, 0.49)) % 1.0, 1 / period


def _wanted(roots: Array, style: Array, seat: Goal | None) -> tuple[Array, Array]:
    """Goals (31, 4), places and headings, and goal actions (31, 6) of the last second: who moves wants to be
    where it will be a second ahead.
    """
    action = np.zeros((len(roots), len(GOAL_ACTIONS)), np.float32)
    if seat is not None:
        action[:, GOAL_ACTIONS.index("sit")] = 1
        return np.tile(np.append(seat.position, seat.heading), (len(roots), 1)), action
    names = ("idle", "walk", "run")
    for k, best in enumerate(style[:, [STYLES.index(n) for n in names]].argmax(1)):
        action[k, GOAL_ACTIONS.index(names[best])] = 1
    speed = np.gradient(roots, axis=0) / DT
    moves = (style[:, WALK] + style[:, RUN])[:, None]
    ahead = roots + moves * speed * (1, 1, 0)
    return np.stack((*ahead[:, :2].T, np.zeros(len(roots)), wrap_angle(ahead[:, 2])), axis=1), action


__all__ = ["Start", "Trail", "trail_of"]
