"""Where before the body a hand sets out to what it takes, and where it brings it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.hand_way import AMPLE, FROM, HAND, Ball, filled
from nsm_core.world.scene.props import LightThing
from nsm_core.world.scene.wrist import WristPose

from .reach import Reach, raised

_NEARER = (0.0, 0.1, 0.2, 0.28)  # metres by which a hand is held nearer to the body than with ease
_HEIGHTS = (0.95, 1.3)  # metres over the floor of a hand held there
_OVER = (0.12, 0.24)  # metres by which it is held higher where something stands there
_BETWEEN = 0.02  # metres off a line between a body and its hand within which something lies between them


def before_body(
    wrist: WristPose, reach: Reach, around: DistanceQuery, held: LightThing | None = None
) -> list[Array]:
    """Where (3,) before or beside the body a hand may set out to where its way to ``wrist`` begins, with what
    is ``held`` there: the place with most room on and the one with most at another height, from which there
    may be a way where there is none from the first, as into a niche; none where something lies between all
    places and the body.
    """
    height = float(np.clip(wrist.place[2], *_HEIGHTS))
    balls = [(np.zeros(3), HAND)]
    if held is not None:
        balls += [(place - wrist.place, radius) for place, radius in filled(held)]
    heights = (height, raised(reach)[2], *(height + over for over in _OVER))
    level, over = (-np.inf, np.zeros(3)), (-np.inf, np.zeros(3))
    for near in _NEARER:
        for k, z in enumerate(heights):
            begin = raised(reach, near)
            begin[2] = z
            room = _room(begin, wrist, reach, around, balls)
            if k < 2 and room > level[0] + 0.01:
                level = room, begin
            elif k >= 2 and room > over[0] + 0.01:
                over = room, begin
            if room >= AMPLE:
                return [begin]
    best = (level, over) if level[0] >= over[0] - 0.01 else (over, level)
    return [begin for room, begin in best if room > -np.inf]


def _room(
    begin: Array, wrist: WristPose, reach: Reach, around: DistanceQuery, balls: Sequence[Ball]
) -> float:
    """Metres that ``balls`` about a hand have between them and what is ``around`` on a straight way from
    ``begin`` (3,) to where that into ``wrist`` begins; minus infinity where something lies before the body.
    """
    body = np.append(reach.place, begin[2])
    out = body + np.linspace(0.3, 1, 12)[:, None] * (begin - body)
    if around.signed_distance(out.astype(np.float32), AMPLE).min() < _BETWEEN:
        return -np.inf
    way = wrist.place - begin
    length = max(float(np.linalg.norm(way)), 1e-6)
    line = np.linspace(0, max(1 - FROM / length, 0), 6)[:, None] * way + begin
    rooms = [
        float(around.signed_distance((line + off).astype(np.float32), AMPLE + radius).min()) - radius
        for off, radius in balls
    ]
    return min(*rooms, AMPLE)


__all__ = ["before_body"]
