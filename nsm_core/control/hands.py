"""Where the hands of a whole take are to be, how firmly, and how they lie on what they hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from nsm_core.body.capsules import BUNDLED, Figure
from nsm_core.body.ik.grip import ACROSS, FINGERTIP, PALM, Grip, laid, twist_of, within
from nsm_core.body.ik.solver import Pose, Task
from nsm_core.body.ik.tasks import PointTask, TurnTask
from nsm_core.body.ik.two_bone import place_on
from nsm_core.body.skeleton import ARMS, INDEX
from nsm_core.body.tree import HUMAN
from nsm_core.rotations import Array, quat_conjugate, quat_from_rotvec, quat_mul, quat_rotate, quat_slerp
from nsm_core.signals import gaussian_smooth, smooth_step

from .actions.hold import Lead

HAND, TURN, LAID = 0.002, 0.25, 0.06  # standard deviations of a hand that is led, metres and radians
FIRM = 0.3  # share of its way from which on a hand is led in full
# Frames before and after a hand is led in which it is where the network has it, on any body; and what is
# left to a neck that is not to come lower, or further ahead, than the network's, metres.
AT_WORK, NECK = 20, 0.02
LONGEST = 1.6  # times as long as the network's is a trunk that has to come further ahead for arms to reach
FOREARM = 0.5  # share of a hand's turn about its forearm that the forearm does
_WRISTS = [arm[2] for arm in ARMS]
_NECK = INDEX["Neck"]
_SPINE = [INDEX[name] for name in ("Chest", "Chest2", "Chest3", "Chest4", "Neck")]


@dataclass
class Hands:
    """Of both hands, right and left: ``wrists`` (T, 2, 3) world, ``firm`` (T, 2) how firmly they are there,
    0..1, their world ``turns`` (T, 2, 4), and how far they are ``laid`` (T, 2) on what they hold; ``neck``
    (T, 3) where the network has it, and how far (T,) hands are ``at_work``, 0..1, on another body; ``beside``
    (T, 2, 3) metres by which wrists lie beside where they are led, with what they hold across the palm.
    """

    wrists: Array
    firm: Array
    turns: Array
    laid: Array
    neck: Array
    at_work: Array
    beside: Array

    def led(self, pose: Pose, firm: Array, turns: Array | None = None) -> Array:
        """Local rotations of a motion with arms that put wrists these shares ``firm`` (T, 2) of their ways on
        to where they are led; hands keep their world rotations, or have ``turns``.
        """
        local = np.array(pose.local)
        for side, arm in enumerate(ARMS):
            on = np.flatnonzero(firm[:, side] > 0)
            if len(on):
                wrist = pose.positions[on, arm[2]]
                at = wrist + firm[on, side, None] * (self.wrists[on, side] - wrist)
                turn = None if turns is None else turns[on, side, None]
                local[on] = place_on(pose.tree, pose.hips[on], local[on], (arm,), at[:, None], turn)
        return local

    def twisted(self, local: Array) -> Array:
        """Local rotations in which the forearms of hands that are laid on something turn with them."""
        local = np.array(local)
        for side, (_, elbow, wrist) in enumerate(ARMS):
            turn = FOREARM * self.laid[:, side] * twist_of(local[:, wrist])
            own = quat_from_rotvec(turn[:, None] * np.eye(3)[0])
            local[:, elbow] = quat_mul(local[:, elbow], own)
            local[:, wrist] = quat_mul(quat_conjugate(own), local[:, wrist])
        return local

    def tasks(self) -> list[Task]:
        """What the solver is asked for."""
        tasks: list[Task] = []
        for side, wrist in enumerate(_WRISTS):
            firm = self.firm[:, side]
            if firm.any():
                least = np.maximum(firm, 1e-3)
                on = firm > 0
                tasks.append(PointTask(wrist, self.wrists[:, side], np.where(on, HAND / least, np.inf)))
                turn = TURN + self.laid[:, side] * (LAID - TURN)
                tasks.append(TurnTask(wrist, self.turns[:, side], np.where(on, turn / least, np.inf)))
        return tasks

    def lack(self, pose: Pose) -> float:
        """Metres by which the arms of a motion lack at most to bring firmly led wrists to their places."""
        led = Pose(pose.tree, pose.hips, self.led(pose, self.firm)).positions[:, _WRISTS]
        return float(np.where(self.firm > 0.99, np.linalg.norm(led - self.wrists, axis=-1), 0.0).max())

    def trunk(self, pose: Pose) -> list[Task]:
        """A trunk that bends no lower and no further ahead than the network's: a longer one would bend into
        what is held.
        """
        if not self.at_work.any():
            return []
        own = pose.positions[:, _NECK]
        ways = np.stack((own - pose.hips, self.neck - pose.hips))[..., :2]
        far, most = np.linalg.norm(ways, axis=-1)
        wishes = np.stack((far > most, far > most, own[:, 2] < self.neck[:, 2]), axis=1)
        wished = NECK / np.maximum(self.at_work, 1e-3)
        deviation = np.where(wishes & (self.at_work > 0)[:, None], wished[:, None], np.inf)
        return [PointTask(_NECK, self.neck, deviation)]


def hands_of(leads: Sequence[Sequence[Lead]], pose: Pose, figure: Figure) -> Hands:
    """What the ``leads`` of every frame ask of a motion's hands."""
    count = len(leads)
    at, turns, shares = pose.positions[:, _WRISTS].copy(), pose.world[:, _WRISTS].copy(), np.zeros((count, 2))
    first: list[dict[int, Lead]] = [{} for _ in leads]
    for t, each in enumerate(leads):
        for lead in each:
            if lead.share >= shares[t, lead.hand]:
                shares[t, lead.hand], first[t][lead.hand] = lead.share, lead
    for t, frame in enumerate(first):
        for side, lead in frame.items():
            at[t, side] = lead.target
            if lead.turn is not None:
                turns[t, side] = quat_mul(lead.turn, pose.world[t, _WRISTS[side]])
    own, firm = pose.positions[:, _WRISTS], smooth_step(shares / FIRM)
    near, neck, bends = np.zeros_like(firm), pose.positions[:, _NECK], True
    if figure is not BUNDLED and shares.any():
        # Arms and trunks of other lengths would take hands into what they are about to hold.
        network = HUMAN.forward(pose.hips, pose.local)[0]
        near = _about(shares > 0)
        own = own + near[..., None] * (network[:, _WRISTS] - own)
        neck = network[:, _NECK]
        bends = figure.offsets[_SPINE, 2].sum() < LONGEST * HUMAN.offsets[_SPINE, 2].sum()
    wrists = own + firm[..., None] * (at - own)
    hands = Hands(
        wrists,
        np.maximum(firm, near),
        turns,
        np.zeros_like(firm),
        neck,
        near.max(1) * bends,
        np.zeros_like(at),
    )
    _lay(
        hands, first, shares, Pose(pose.tree, pose.hips, hands.led(pose, np.sign(hands.firm), turns)), figure
    )
    return hands


def _about(led: Array) -> Array:
    """How far (T, 2), 0..1, a hand is about to be led or has just been, with an ease."""
    near = np.array(led, dtype=np.float64)
    wide = 2 * AT_WORK + 1
    view = np.lib.stride_tricks.sliding_window_view(np.pad(near, ((AT_WORK, AT_WORK), (0, 0))), wide, axis=0)
    return np.asarray(smooth_step(gaussian_smooth(view.max(-1), AT_WORK / 4) * 1.1))


def _lay(hands: Hands, leads: Sequence[dict[int, Lead]], shares: Array, pose: Pose, figure: Figure) -> None:
    """Turn hands that hold something as they lie on it, as far as they are led; ``pose`` has arms where they
    are led.
    """
    for side, (_, elbow, wrist) in enumerate(ARMS):
        grips: list[tuple[int, Grip]] = []
        for t, each in enumerate(leads):
            grip = each[side].grip if side in each else None
            grips += [(t, grip)] if grip is not None else []
        if not grips:
            continue
        on = np.array([t for t, _ in grips])
        palm, ahead = (np.stack([getattr(g, name) for _, g in grips]) for name in ("palm", "ahead"))
        forearm = pose.positions[on, wrist] - pose.positions[on, elbow]
        forearm /= np.maximum(np.linalg.norm(forearm, axis=1, keepdims=True), 1e-9)
        over = pose.positions[on, wrist, 2] - figure.little_finger
        most = np.array([np.inf if grip.bar is None else grip.swivel for _, grip in grips])
        turned = laid(palm, ahead, forearm, side, over / figure.hand, most)
        turned = within(turned, pose.world[on, elbow])
        held = smooth_step(shares[on, side]) * [grip.share for _, grip in grips]
        hands.laid[on, side] = held
        hands.turns[on, side] = quat_slerp(hands.turns[on, side], turned, held)
        fingers = quat_rotate(turned, np.broadcast_to(np.eye(3)[0] * (1.0 if side else -1.0), palm.shape))
        facing = quat_rotate(turned, np.broadcast_to((0.0, 0.0, -1.0), palm.shape))
        for n, (t, grip) in enumerate(grips):
            if grip.bar is not None:
                # A hand whose fingers do not bend keeps them before the board.
                back = max(ACROSS, figure.hand + FINGERTIP - grip.room)
                wrist_at = grip.bar - back * fingers[n] - PALM * facing[n]
                hands.beside[t, side] = held[n] * (wrist_at - leads[t][side].target)
    hands.wrists += hands.beside


__all__ = ["Hands", "hands_of"]
