"""Where one looks: at what hands reach for, else where one goes, and into a turn before the body turns.

The network's head goes along with its trunk.  A person's leads: it is turned towards what comes within a
second, the chest follows by a part, the hips come last.  This layer turns neck, head and chest of a whole
take, eased and within what a neck can do, before the take is solved; the solver then holds the head there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nsm_core.body.ik.solver import Pose
from nsm_core.body.skeleton import INDEX
from nsm_core.conventions import FPS
from nsm_core.rotations import Array, direction_to_heading, quat_rotate, wrap_angle
from nsm_core.signals import gaussian_smooth, smooth_step

from .actions.hold import Lead

# Frames by which one looks ahead of a way, and of a turn.
AHEAD, INTO_TURN = round(0.6 * FPS), round(0.35 * FPS)
TURNS = np.radians((6, 25))  # of a turn within that, from which on to where one looks into it
GOES = (0.1, 0.35)  # metres of way within that, from which on to where one looks along it
AWAY = (0.2, 0.6)  # cosines between the way and where one will face: who goes backwards does not look behind
REACH = round(0.6 * FPS)  # frames by which one looks at a thing before hands are led, and after they hold it
SIDE, UP, DOWN = np.radians((60, 15, 35))  # of the head against the trunk, at most, beside the network's own
SHARE = 0.85  # of its way that a look goes
CHEST, NECK = 0.3, 0.35  # shares of it that the chest and the neck take
EASE, CHEST_EASE = 3.5, 4.0  # frames, standard deviations of the head's and of the chest's easing
_CHESTS = [INDEX[name] for name in ("Chest2", "Chest3", "Chest4")]
_NECK, _HEAD = INDEX["Neck"], INDEX["Head"]
_FORWARD = np.array((0.0, -1.0, 0.0))


def looking(pose: Pose, leads: Sequence[Sequence[Lead]]) -> Pose:
    """The motion with the head turned to what one looks at; ``leads``: where hands are led in each frame."""
    count = len(pose.hips)
    if count < 2:
        return pose
    trunk, face = _heading(pose, _CHESTS[-1]), _heading(pose, _HEAD)
    eyes = pose.positions[:, _HEAD]
    sight = _ahead(pose, face)
    things, firm = _things(leads, eyes)
    to = things - eyes
    flat = np.linalg.norm(to[:, :2], axis=1)
    sight = sight + firm * wrap_angle(direction_to_heading(to[:, :2]) - sight)
    # A chin that the network has lowered already is not lowered twice.
    own = _pitch(pose, _HEAD)
    pitch = firm * np.clip(np.arctan2(to[:, 2], np.maximum(flat, 0.1)) - own, -DOWN, UP)
    turned = wrap_angle(face - trunk)
    yaw = SHARE * (np.clip(wrap_angle(sight - trunk), -SIDE, SIDE) - turned)
    yaw, pitch = (gaussian_smooth(v[:, None], EASE)[:, 0] for v in (yaw, SHARE * pitch))
    calm = 1.0 - gaussian_smooth(firm[:, None], EASE)[:, 0]  # hands at work keep the chest
    chest = CHEST * calm * gaussian_smooth(yaw[:, None], CHEST_EASE)[:, 0]
    step = np.zeros((count, 3 + 3 * len(pose.tree.parents)))
    turns = step[:, 3:].reshape(count, -1, 3)
    turns[:, _CHESTS, 2] = chest[:, None] / len(_CHESTS)
    turns[:, _NECK, 2] = NECK * (yaw - chest)
    turns[:, _HEAD, 2] = (1 - NECK) * (yaw - chest)
    step[:, 3:] = turns.reshape(count, -1)
    pose = pose.moved(step)
    side = quat_rotate(pose.world[:, _HEAD], np.broadcast_to((1.0, 0.0, 0.0), (count, 3)))
    turns = np.zeros_like(turns)
    turns[:, _NECK], turns[:, _HEAD] = -NECK * pitch[:, None] * side, -(1 - NECK) * pitch[:, None] * side
    step = np.zeros_like(step)
    step[:, 3:] = turns.reshape(count, -1)
    return pose.moved(step)


def _ahead(pose: Pose, face: Array) -> Array:
    """Headings (T,) of where one goes, or turns to; the head's own, ``face`` (T,), where one does neither."""
    count = len(pose.hips)
    body = np.unwrap(_heading(pose, 0))
    later = np.minimum(np.arange(count) + INTO_TURN, count - 1)
    coming = gaussian_smooth(body[:, None], 2.0)[later, 0]
    turns = smooth_step((np.abs(coming - body) - TURNS[0]) / (TURNS[1] - TURNS[0]))
    facing = face + turns * wrap_angle(coming - face)
    there = np.minimum(np.arange(count) + AHEAD, count - 1)
    way = pose.hips[there, :2] - pose.hips[:, :2]
    length = np.linalg.norm(way, axis=1)
    along = direction_to_heading(way)
    onward = np.cos(wrap_angle(along - body[there]))
    weight = smooth_step((length - GOES[0]) / (GOES[1] - GOES[0]))
    weight = weight * smooth_step((onward - AWAY[0]) / (AWAY[1] - AWAY[0]))
    return np.asarray(facing + weight * wrap_angle(along - facing))


def _things(leads: Sequence[Sequence[Lead]], eyes: Array) -> tuple[Array, Array]:
    """Where (T, 3) hands are led to, from before to after they come to it, and how much (T,) one looks."""
    count = len(leads)
    targets, share = eyes.astype(np.float64) + _FORWARD, np.zeros(count)
    for t, now in enumerate(leads):
        if now:
            # Who has something in one hand looks at what the other one comes to.
            open_ = [lead for lead in now if not lead.closed] or now
            targets[t] = np.mean([lead.target for lead in open_], axis=0)
            share[t] = max(lead.share for lead in now)
    led = np.flatnonzero(share > 0)
    if not len(led):
        return targets, np.zeros(count)
    # Busy: hands that come to a thing or leave it; what is held for long is not looked at.
    comes = (share > 0) & (share < 0.99)
    busy = np.convolve(comes, np.ones(2 * REACH + 1))[REACH : REACH + count] > 0
    nearest = led[np.abs(np.arange(count)[:, None] - led[None]).argmin(1)]
    weight = gaussian_smooth(busy.astype(np.float64)[:, None], 3.0)[:, 0]
    return targets[nearest], weight


def _heading(pose: Pose, joint: int) -> Array:
    """Headings (T,) of a joint."""
    forward = quat_rotate(pose.world[:, joint], np.broadcast_to(_FORWARD, (len(pose.hips), 3)))
    return direction_to_heading(forward[:, :2])


def _pitch(pose: Pose, joint: int) -> Array:
    """Radians (T,) by which a joint looks up."""
    forward = quat_rotate(pose.world[:, joint], np.broadcast_to(_FORWARD, (len(pose.hips), 3)))
    return np.arcsin(np.clip(forward[:, 2], -1, 1))


__all__ = ["looking"]
