"""Heads look where one goes: they lead the body into a turn."""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import INDEX, forward_kinematics
from nsm_core.conventions import FPS
from nsm_core.data.scenarios.motion import Motion
from nsm_core.rotations import (
    direction_to_heading,
    heading_quat,
    quat_conjugate,
    quat_mul,
    quat_rotate,
    wrap_angle,
)
from nsm_core.signals import gaussian_smooth

AHEAD = round(0.45 * FPS)  # frames by which the head knows where the body will face
MOST = np.radians(60)  # by which a head turns off the body
_NECK, _HEAD = INDEX["Neck"], INDEX["Head"]
_FORWARD = np.array((0.0, -1.0, 0.0))


def look_ahead(motion: Motion) -> None:
    """Turn heads of a motion, in place, to where the body faces a little later, as far as they do not yet.

    What a captured head does of it already, or in other ways, stays; neck and head turn by half each.
    """
    _, world = forward_kinematics(motion.hips, motion.rotations)
    headings = np.unwrap(motion.headings)
    later = headings[np.minimum(np.arange(len(headings)) + AHEAD, len(headings) - 1)]
    wanted = gaussian_smooth(np.clip(later - headings, -MOST, MOST), 4.0)
    looks = quat_rotate(world[:, _HEAD], np.broadcast_to(_FORWARD, (len(headings), 3)))
    own = gaussian_smooth(wrap_angle(direction_to_heading(looks[:, :2]) - headings), 4.0)
    lacking = wanted - np.clip(own, np.minimum(wanted, 0), np.maximum(wanted, 0))
    turn = heading_quat(gaussian_smooth(lacking, 2.0) / 2)
    for joint, parent in ((_NECK, INDEX["Chest4"]), (_HEAD, _NECK)):
        inside = quat_mul(quat_conjugate(world[:, parent]), quat_mul(turn, world[:, parent]))
        turned = quat_mul(inside, motion.rotations[:, joint])
        motion.rotations[:, joint] = turned.astype(motion.rotations.dtype)


__all__ = ["look_ahead"]
