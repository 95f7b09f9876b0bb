"""Places to walk to: whether one can stand there, on the floor or on what can be climbed."""

from __future__ import annotations

import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import Array
from nsm_core.world.scene.terrain import FLOOR_TOP

from ..world.surroundings import Surroundings
from .climb import HIGHEST, LOWEST, climb_onto

# Metres that a body keeps off solids where it stands: nearer, it is in them; heights over its ground at which that is looked at.
_ROOM = 0.1
_BODY = np.arange(0.25, 1.7, 0.1)
NEAR_SEAT = 0.12  # metres between a goal point to sit at and something to sit on


def walk_goal(action: str, name: str, place: Array, heading: float, hold: float, around: Surroundings, here: Array) -> Goal:
    """Build the goal to walk or run to ``place`` (3,), core frame, and face ``heading`` there, coming from ``here`` (2,).

    A place on top of something is climbed to.  Raises GoalError that names what is in the way where nobody can stand there:
    inside of something, in the air, under the floor or higher than one climbs.
    """
    s, place = around.frame.scale, np.asarray(place, dtype=np.float64)
    ground = float(around.ground.height(place[None, :2])[0])
    over = float(place[2]) - ground
    if over < -(FLOOR_TOP + ground):
        raise GoalError(
            f"The place {name} lies {-place[2] * s:.2f} m under the character's floor; move it up, or put the character on the floor there."
        )
    owner, top = _what_is_under(place, around) if over > FLOOR_TOP else ("the floor", ground)
    if place[2] - top > FLOOR_TOP:
        raise GoalError(
            f"The place {name} hangs {(place[2] - top) * s:.2f} m over {owner}; move it down to where the character is to stand."
        )
    if top <= LOWEST:
        inside = what_stands_at(place[:2], ground, around)
        if inside is not None:
            raise GoalError(f"The place {name} lies inside {inside}, or too near to it to stand; move it, or {inside}.")
        return Goal(action, name, np.array((place[0], place[1], 0.0), np.float32), float(heading), hold)
    if top > HIGHEST:
        raise GoalError(
            f"The place {name} is {top * s:.2f} m over the character's floor, on {owner}; one climbs up to {HIGHEST * s:.2f} m: choose a "
            "lower place, or have the character start up there."
        )
    inside = what_stands_at(place[:2], top, around)
    if inside is not None:
        raise GoalError(f"The place {name} on {owner} lies inside {inside}, or too near to it to stand; move it, or {inside}.")
    try:
        return climb_onto(name, around.scene.objects[owner], np.append(place[:2], top), hold, around, here)
    except (GoalError, GeometryError) as error:
        raise GoalError(f"The place {name} is {top * s:.2f} m over the character's floor and cannot be climbed to. {error}") from error


def require_support(name: str, place: Array, around: Surroundings) -> None:
    """Raise GoalError unless there is something to sit on at ``place`` (3,), core frame, which the animator has set."""
    if float(around.query.signed_distance(np.asarray(place, np.float32)[None], NEAR_SEAT + 0.1)[0]) > NEAR_SEAT:
        away = NEAR_SEAT * around.frame.scale
        raise GoalError(f"The goal point of {name} hangs in the air, over {away:.2f} m from anything to sit on; move it onto the seat.")


def what_stands_at(place: Array, ground: float, around: Surroundings) -> str | None:
    """The name of what fills the place (2,) where a body would stand on ``ground`` metres, or None."""
    body = np.column_stack((np.repeat(place[None], len(_BODY), 0), ground + _BODY)).astype(np.float32)
    if float(around.query.signed_distance(body, 2 * _ROOM).min()) >= _ROOM:
        return None
    for reach in (_ROOM, 2 * _ROOM):  # what is nearest is told, of what fills the place
        names = [n for n in around.query.nearest(body, reach) if n is not None]
        if names:
            return max(set(names), key=names.count)
    return "something"


def _what_is_under(place: Array, around: Surroundings) -> tuple[str, float]:
    """The object whose surface is the highest under a place (3,), or little over it, and the height of that, core frame."""
    found: tuple[str, float] = ("the floor", 0.0)
    for solid in around.standing:
        low, high = solid.bounds
        if (low[:2] <= place[:2]).all() and (place[:2] <= high[:2]).all() and high[2] > found[1]:
            for z in crossings(solid.vertices, solid.triangles, place[:2]):
                if found[1] < z <= place[2] + FLOOR_TOP:
                    found = solid.owner, float(z)
    return found


def crossings(vertices: Array, triangles: Array, place: Array) -> Array:
    """Heights (N,) at which the vertical line through ``place`` (2,) meets triangles (F, 3)."""
    if (vertices[:, :2].min(0) > place).any() or (vertices[:, :2].max(0) < place).any():
        return np.zeros(0)
    corners = vertices[triangles]
    flat = corners[..., :2]
    corners = corners[((flat.min(1) <= place) & (flat.max(1) >= place)).all(1)].astype(np.float64)
    a, b, c = (corners[:, k, :2] for k in range(3))

    def cross(p: Array, q: Array) -> Array:
        return p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]

    double = cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.stack((cross(b - place, c - place), cross(c - place, a - place)), -1) / double[:, None]
        share = np.column_stack((share, 1 - share.sum(1)))
    return (share * corners[..., 2]).sum(1)[(share >= -1e-9).all(1)]


__all__ = ["crossings", "require_support", "walk_goal", "what_stands_at"]
