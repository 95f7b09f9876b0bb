"""Where before the body a hand sets out to what it takes, and where it brings it."""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.hand_way import AMPLE, FROM, HAND, filled
from nsm_core.world.scene.props import LightThing
from nsm_core.world.scene.wrist import WristPose

from .reach import Reach, raised

_NEARER = (0.0, 0.1, 0.2, 0.28)  # metres by which a hand is held nearer to the body than with ease
_HEIGHTS = (0.95, 1.3)  # metres over the floor of a hand held there
_OVER = (0.12, 0.24)  # metres by which it is held higher where something stands there
_BETWEEN = 0.02  # metres off a line between a body and its hand within which something lies between them


def before_body(
    wrist: WristPose, reach: Reach, around: DistanceQuery, held: LightThing | None = None
) -> Array | None:
    """Where (3,) before or beside the body a hand has most room, and on from there to where its way to
    ``wrist`` begins, with what is ``held`` there; None where something lies between that and the body.
    """
    height = float(np.clip(wrist.place[2], *_HEIGHTS))
    best, most = None, -np.inf
    balls = [(np.zeros(3), HAND)]
    if held is not None:
        balls += [(place - wrist.place, radius) for place, radius in filled(held)]
    for near in _NEARER:
        for z in (height, raised(reach)[2], *(height + over for over in _OVER)):
            begin = raised(reach, near)
            begin[2] = z
            body = np.append(reach.place, z)
            out = body + np.linspace(0.3, 1, 12)[:, None] * (begin - body)
            if around.signed_distance(out.astype(np.float32), AMPLE).min() < _BETWEEN:
                continue
            way = wrist.place - begin
            length = max(float(np.linalg.norm(way)), 1e-6)
            line = np.linspace(0, max(1 - FROM / length, 0), 6)[:, None] * way + begin
            rooms = [
                float(around.signed_distance((line + off).astype(np.float32), AMPLE + radius).min()) - radius
                for off, radius in balls
            ]
            room = min(*rooms, AMPLE)
            if room > most + 0.01:
                best, most = begin, room
            if most >= AMPLE:
                return best
    return best


__all__ = ["before_body"]
