"""Who stands and works with a hand stays there: the network, which has not learned to reach, drifts close to
furniture, and what it drifts by is taken back.  Who goes there is kept off what he would brush.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nsm_core.model.features.state import State
from nsm_core.rotations import Array, rotate_planar, wrap_angle
from nsm_core.world.planning.floor_plan import FloorPlan

SHARE = 0.2  # of what one is off, that is taken back in a frame
MOST, MOST_TURN = 0.006, np.radians(0.8)  # metres and radians in a frame: stands of feet follow no faster


# Metres to solids that who goes by is kept at, the share of what lacks that is made good in a frame, and
# metres at most; metres about a standing place within which that has as much room as is asked for.
OFF, OFF_SHARE, MOST_OFF, AT_PLACE = 0.32, 0.25, 0.012, 0.4
_PROBE = 0.05  # metres to either side at which it is asked which way room grows


def kept_off(state: State, plan: FloorPlan, place: Array) -> State:
    """The state of one character who goes to a ``place`` (2,), moved as a whole a little off what stands
    closer than he should pass it; where he has been stays.

    The network swings wide where it turns from a stand, into furniture beside it.
    """
    root = state.root[0, :2].astype(np.float64)
    probes = np.concatenate((np.zeros((1, 2)), _PROBE * np.eye(2), -_PROBE * np.eye(2))) + root
    room = plan.clearance(probes).astype(np.float64)
    wish = OFF
    if np.linalg.norm(root - place) < AT_PLACE:
        wish = min(OFF, float(plan.clearance(np.asarray(place, dtype=np.float64)[None])[0]))
    way = room[1:3] - room[3:]
    steep = float(np.linalg.norm(way))
    lack = wish - float(room[0])
    if lack <= 0 or steep < 1e-6:
        return state
    return _shifted(state, min(OFF_SHARE * lack, MOST_OFF) * way / steep, np.float64(0.0))


def kept_at(state: State, place: Array, heading: float) -> State:
    """The state of one character, moved and turned as a whole a little nearer to a ``place`` (2,) and a
    ``heading``; where it has been stays.
    """
    root = state.root[0].astype(np.float64)
    way = SHARE * (np.asarray(place, dtype=np.float64) - root[:2])
    way *= min(1.0, MOST / max(float(np.linalg.norm(way)), 1e-9))
    turn = np.float64(np.clip(SHARE * wrap_angle(heading - root[2]), -MOST_TURN, MOST_TURN))
    return _shifted(state, way, turn)


def _shifted(state: State, way: Array, turn: np.float64) -> State:
    """The state of one character, moved by a ``way`` (2,) and turned about its root; where it has been
    stays.
    """
    root = state.root[0].astype(np.float64)

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


__all__ = ["kept_at", "kept_off"]
