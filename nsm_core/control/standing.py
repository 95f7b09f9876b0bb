"""Who stands and works with a hand stays there: the network, which has not learned to reach, drifts close to
furniture, and what it drifts by is taken back.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nsm_core.model.features.state import State
from nsm_core.rotations import Array, rotate_planar, wrap_angle

SHARE = 0.2  # of what one is off, that is taken back in a frame
MOST, MOST_TURN = 0.006, np.radians(0.8)  # metres and radians in a frame: stands of feet follow no faster


def kept_at(state: State, place: Array, heading: float) -> State:
    """The state of one character, moved and turned as a whole a little nearer to a ``place`` (2,) and a
    ``heading``; where it has been stays.
    """
    root = state.root[0].astype(np.float64)
    way = SHARE * (np.asarray(place, dtype=np.float64) - root[:2])
    way *= min(1.0, MOST / max(float(np.linalg.norm(way)), 1e-9))
    turn = np.float64(np.clip(SHARE * wrap_angle(heading - root[2]), -MOST_TURN, MOST_TURN))

    def moved(points: Array) -> Array:
        out = np.array(points, dtype=np.float64)
        out[..., :2] -= root[:2]
        out = rotate_planar(out, turn)
        out[..., :2] += root[:2] + way
        return out.astype(points.dtype)

    def turned(ways: Array) -> Array:
        return np.asarray(rotate_planar(ways.astype(np.float64), turn)).astype(ways.dtype)

    ahead = np.array(state.root_future)
    ahead[..., :2] = moved(ahead[..., :2])
    ahead[..., 2] += turn
    past = np.array(state.root_past)
    past[:, -1, :2] += way
    past[:, -1, 2] += turn
    return replace(
        state,
        joint_position=moved(state.joint_position),
        joint_forward=turned(state.joint_forward),
        joint_up=turned(state.joint_up),
        joint_velocity=turned(state.joint_velocity),
        root_past=past,
        root_future=ahead,
    )


__all__ = ["kept_at"]
