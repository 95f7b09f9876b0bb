"""Places to walk to: whether one can stand there, on the floor or on what can be climbed."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import Array, direction_to_heading, rotate_planar
from nsm_core.world.scene.terrain import FLOOR_TOP

from ..world.bodies import GoalBody, place_of
from ..world.surroundings import Surroundings
from ..world.tops import crossings
from .climb import HIGHEST, LOWEST, climb_onto
from .curves import follow_goal
from .finder import Finder, Place
from .loose_parts import is_group, seat_body
from .points import goal_point_of
from .spec import GoalSpec

# Metres that a body keeps off solids where it stands: nearer, it is in them; heights over its ground at which
# that is looked at.
_ROOM = 0.1
_BODY = np.arange(0.25, 1.7, 0.1)
# Where one stands before an object that one walks up to, metres from its front.
_STAND_OFF = 0.45
NEAR_SEAT = 0.12  # metres between a goal point to sit at and something to sit on


def walk_goal(
    action: str, name: str, place: Array, heading: float, hold: float, around: Surroundings, here: Array
) -> Goal:
    """Build the goal to walk or run to ``place`` (3,), core frame, and face ``heading`` there, coming from
    ``here`` (2,).

    A place on top of something is climbed to, one up a flight of stairs walked to.  Raises GoalError that
    names what is in the way where nobody
    can stand there: inside of something, in the air, under the floor or higher than one climbs.
    """
    s, place = around.frame.scale, np.asarray(place, dtype=np.float64)
    ground = float(around.ground.height(place[None, :2])[0])
    over = float(place[2]) - ground
    if over < -(FLOOR_TOP + ground):
        raise GoalError(
            f"The place {name} lies {-place[2] * s:.2f} m under the character's floor; move it up, or put "
            "the character on the floor there."
        )
    if over > FLOOR_TOP and around.stairs.lead_to(place):
        inside = what_stands_at(place[:2], float(place[2]), around)
        if inside is not None:
            raise GoalError(
                f"The place {name} lies inside {inside}, or too near to it to stand; move it, or {inside}."
            )
        return Goal(action, name, place, float(heading), hold)
    owner, top = _what_is_under(place, around) if over > FLOOR_TOP else ("the floor", ground)
    if place[2] - top > FLOOR_TOP:
        raise GoalError(
            f"The place {name} hangs {(place[2] - top) * s:.2f} m over {owner}; move it down to where the "
            "character is to stand."
        )
    if top <= LOWEST:
        inside = what_stands_at(place[:2], ground, around)
        if inside is not None:
            raise GoalError(
                f"The place {name} lies inside {inside}, or too near to it to stand; move it, or {inside}."
            )
        return Goal(action, name, np.array((place[0], place[1], 0.0), np.float32), float(heading), hold)
    if top > HIGHEST:
        raise GoalError(
            f"The place {name} is {top * s:.2f} m over the character's floor, on {owner}; one climbs up to "
            f"{HIGHEST * s:.2f} m: choose a "
            "lower place, or have the character start up there."
        )
    inside = what_stands_at(place[:2], top, around)
    if inside is not None:
        raise GoalError(
            f"The place {name} on {owner} lies inside {inside}, or too near to it to stand; move it, or "
            f"{inside}."
        )
    try:
        return climb_onto(name, around.scene.objects[owner], np.append(place[:2], top), hold, around, here)
    except (GoalError, GeometryError) as error:
        raise GoalError(
            f"The place {name} is {top * s:.2f} m over the character's floor and cannot be climbed to. "
            f"{error}"
        ) from error


def require_support(name: str, place: Array, around: Surroundings) -> None:
    """Raise GoalError unless there is something to sit on at ``place`` (3,), core frame, which the animator
    has set.
    """
    if (
        float(around.query.signed_distance(np.asarray(place, np.float32)[None], NEAR_SEAT + 0.1)[0])
        > NEAR_SEAT
    ):
        away = NEAR_SEAT * around.frame.scale
        raise GoalError(
            f"The goal point of {name} hangs in the air, over {away:.2f} m from anything to sit on; move it "
            "onto the seat."
        )


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
    """The object whose surface is the highest under a place (3,), or little over it, and the height of that,
    core frame.
    """
    found: tuple[str, float] = ("the floor", 0.0)
    for solid in around.standing:
        low, high = solid.bounds
        if (low[:2] <= place[:2]).all() and (place[:2] <= high[:2]).all() and high[2] > found[1]:
            for z in crossings(solid.vertices, solid.triangles, place[:2]):
                if found[1] < z <= place[2] + FLOOR_TOP:
                    found = solid.owner, float(z)
    return found


def _find(spec: GoalSpec, scene: bpy.types.Scene, around: Surroundings, before: Place) -> Goal:
    if spec.along:
        return follow_goal(spec, around, before)
    here, facing = before
    frame, name = around.frame, spec.label
    if spec.object is not None:
        point = goal_point_of(scene, spec.object, spec.action)
        if point is not None or spec.object.type == "EMPTY" and not is_group(spec.object):
            name = (point or spec.object).name
            position, heading = place_of(point or spec.object, frame)
        else:
            position, heading = _in_front_of(seat_body(spec.object, around), around)
    else:
        name = "at ({:.2f}, {:.2f})".format(*spec.location)
        position = frame.to_core(np.array(spec.location, dtype=np.float64))
        way = position[:2] - here
        heading = float(direction_to_heading(way)) if np.linalg.norm(way) > 0.2 else facing
    goal = walk_goal(spec.action, name, position, heading, spec.hold, around, here)
    goal.name = spec.label
    return goal if goal.action != spec.action else replace(goal, speed=spec.speed)


def _in_front_of(body: GoalBody, around: Surroundings) -> tuple[Array, float]:
    """Ground point (3,) before the object's front (its -Y) and the heading that looks at it, core frame.

    Where something stands there, it is the next side that is free: left, right, and last behind.
    """
    (low, high), best = body.bounds, None
    for turn, away in ((0.0, -low[1]), (np.pi / 2, high[0]), (-np.pi / 2, -low[0]), (np.pi, high[1])):
        place = rotate_planar(np.array((0.0, -away - _STAND_OFF, 0.0)), np.float64(turn))
        found = body.to_core(place), float(body.yaw + turn + np.pi)
        best = best or found
        ground = float(around.ground.height(found[0][None, :2])[0])
        if what_stands_at(found[0][:2].astype(np.float64), ground, around) is None:
            return found[0] + np.array((0, 0, ground), np.float32), found[1]
    return best


def _somewhere(body: GoalBody) -> Place:
    return body.to_core(np.array((0.0, body.bounds[0][1] - _STAND_OFF, 0.0))), float(body.yaw + np.pi)


WALK = Finder(
    _find,
    somewhere=_somewhere,
    words=("table", "desk", "shelf", "sideboard", "cabinet", "cupboard", "wardrobe"),
    likely=lambda looks: 0.5,
    anything=True,
)
RUN = Finder(_find, somewhere=_somewhere)

__all__ = ["RUN", "WALK", "require_support", "walk_goal", "what_stands_at"]
