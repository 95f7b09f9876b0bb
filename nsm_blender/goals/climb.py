"""Steps to climb and low walls to step over: where one stands afterwards."""

from __future__ import annotations

import bpy
import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import Array, direction_to_heading, rotate_planar, wrap_angle
from nsm_core.world.affordances.flights import find_stairs
from nsm_core.world.affordances.standing import BEHIND_WALL
from nsm_core.world.scene.stairs import LEAST_STEPS, RISERS
from nsm_core.world.scene.terrain import FLOOR_TOP

from ..world.bodies import GoalBody, place_of
from ..world.surroundings import Surroundings
from ..world.tops import CELL, Level, find_levels, occupy, standing_room
from .finder import Finder, Place
from .looks import Looks
from .points import goal_point_of
from .spec import GoalSpec

LOWEST, HIGHEST = FLOOR_TOP, 0.65  # metres over the floor that one climbs; what is lower is walked over
DEEP_ENOUGH = 0.3  # metres of a top to stand on; what is thinner is stepped over
FROM_EDGE = 0.2  # metres from the middle of the feet to the edges of a top
# Metres from the edge over which one comes, and from the other edges, on large tops.
FARTHEST_IN, NEAR_MIDDLE = 0.4, 0.9
_LOW = 0.35  # metres: who sees a lower block thinks of a step
BEHIND_TOP = 0.6  # metres behind the highest riser where one stands who has climbed a flight of stairs
_SAME = 0.05  # metres between heights of one and the same top
_ABOVE = 1.7  # metres of air that a person needs
_ELBOWS = 0.25  # metres to keep from things behind a wall


def goal_of_climb(
    name: str,
    target: bpy.types.Object,
    point: bpy.types.Object | None,
    hold: float,
    around: Surroundings,
    here: Array,
) -> Goal:
    """Build the goal to climb ``target``, coming from ``here`` (2,); ``point`` is the animator's own empty
    for the place.

    A flight of stairs, and its landing, are walked up.  Raises GoalError where the object is too high or too
    low, or has no room.
    """
    frame = around.frame
    body = around.body(target, snug=True)
    upstairs = None if point is not None else _up_the_stairs(body, around)
    if upstairs is not None:
        position, heading = upstairs
    elif point is not None:
        position, heading = place_of(point, frame)
        if not (-0.05 <= position[2] <= HIGHEST or around.stairs.lead_to(position)):
            raise GoalError(
                f"The goal point of {target.name} is {position[2] * frame.scale:.2f} m over the character's "
                "floor; one climbs up to "
                f"{HIGHEST * frame.scale:.2f} m: move it."
            )
    else:
        own = body.to_own(np.append(np.asarray(here, dtype=np.float64), 0.0))[:2]
        level = _level(body, target, frame.scale, own)
        quarter = _side(level, own)
        heading = float(wrap_angle(body.yaw + quarter * np.pi / 2 + np.pi))
        if level.seen_from(quarter).depth() >= DEEP_ENOUGH:
            position = _on_top(level, quarter, own, body, target, around)
        else:
            position = _behind(level.seen_from(quarter), quarter, body, target, around)
    return Goal("climb", name, position, heading, hold, body.interaction(heading + np.pi))


def _up_the_stairs(body: GoalBody, around: Surroundings) -> tuple[Array, float] | None:
    """Where (3,) one stands, and the heading, at the top of the flight that an object is, or a part of, or of
    that to which it is the landing; None where it is none of these.
    """
    corners = body.to_core(body.vertices)
    low, high = corners.min(0) - _SAME, corners.max(0) + _SAME
    for flight in around.stairs.flights:
        treads = np.arange(0.5, flight.steps)
        places = np.stack([flight.at(k * flight.tread) for k in treads])
        places = np.column_stack((places, flight.base + flight.riser * (treads + 0.5)))
        if not ((low <= places) & (places <= high)).all(1).any():
            continue
        for behind in (BEHIND_TOP, flight.tread / 2):
            place = np.append(flight.at(flight.length + behind), flight.base + flight.rise)
            if abs(float(around.stairs.heights(place[None, :2])[0]) - place[2]) < _SAME:
                return place, flight.heading
    return None


def climb_onto(
    name: str, target: bpy.types.Object, place: Array, hold: float, around: Surroundings, here: Array
) -> Goal:
    """Build the goal to climb ``target`` and stand at ``place`` (3,) on its top, core frame, coming from
    ``here`` (2,).

    One stands as near to it as the edges let one.  Raises as ``goal_of_climb``.
    """
    body = around.body(target, snug=True)
    own, wish = (body.to_own(np.append(np.asarray(p, dtype=np.float64)[:2], 0.0))[:2] for p in (here, place))
    levels = [v for v in find_levels(body.vertices, body.triangles, wish) if abs(v.height - place[2]) < _SAME]
    if not levels:
        raise GeometryError(f"{target.name} has no level top there to stand on.")
    quarter = _side(levels[0], own)
    if _stands_on(levels[0], own):  # one walks on up there, facing as one goes
        quarter = int(np.rint(float(direction_to_heading(wish - own)) / (np.pi / 2) - 2)) % 4
    heading = float(wrap_angle(body.yaw + quarter * np.pi / 2 + np.pi))
    position = _on_top(levels[0], quarter, own, body, target, around, wish)
    return Goal("climb", name, position, heading, hold, body.interaction(heading + np.pi))


def _stands_on(level: Level, here: Array) -> bool:
    """Whether ``here`` (2,), own frame, is over the top."""
    cell = np.floor((here - level.corner) / CELL).astype(int)
    return bool((cell >= 0).all() and (cell < level.top.shape).all() and level.top[tuple(cell)])


def _level(body: GoalBody, target: bpy.types.Object, scale: float, here: Array) -> Level:
    levels = find_levels(body.vertices, body.triangles, here)
    if not levels:
        raise GeometryError(f"{target.name} has no level top to step on; choose a step or a low wall.")
    fitting = [level for level in levels if LOWEST <= level.height <= HIGHEST]
    if fitting:
        return fitting[0]
    height = levels[0].height * scale
    limits = f"between {LOWEST * scale:.2f} and {HIGHEST * scale:.2f} m"
    if levels[0].height > HIGHEST:
        raise GoalError(
            f"{target.name} is {height:.2f} m high; one climbs what is {limits} high: put a step before it, "
            "or lower it."
        )
    raise GoalError(
        f"{target.name} is {height:.2f} m high; one climbs what is {limits} high: choose walk for lower "
        "things."
    )


def _side(level: Level, here: Array) -> int:
    """The quarter turn in whose axes one who comes from ``here`` (2,) comes from -Y: across a thin top, else
    over the nearest edge.
    """
    ways = rotate_planar(np.array((0.0, 1.0)), np.arange(4) * np.pi / 2)
    depths = np.array([level.seen_from(q).depth() for q in range(4)])
    half = np.array(level.top.shape) * CELL / 2
    outside = ways @ (level.corner + half - here) - half[[1, 0, 1, 0]]  # how far before each edge one is
    thin = depths < DEEP_ENOUGH
    if thin.any():
        outside = np.where(thin & (depths <= depths.min() + 0.05), outside, -np.inf)
    return int(outside.argmax())


def _on_top(
    level: Level,
    quarter: int,
    here: Array,
    body: GoalBody,
    target: bpy.types.Object,
    around: Surroundings,
    wish: Array | None = None,
) -> Array:
    """The free place nearest to ``wish`` (2,), own frame of ``body``; core frame.

    Without a wish it is the middle of the top, of a large one near the edge over which one comes.
    """
    occupy(level, [(body.to_own(v), t) for v, t in around.meshes_but(target)], _ABOVE)
    seen, turn = level.seen_from(quarter), np.float64(quarter * np.pi / 2)
    cells = np.argwhere(seen.top)
    low, high = seen.corner + CELL * cells.min(0), seen.corner + CELL * (cells.max(0) + 1)
    middle = (low + high) / 2
    aside = max(0.0, (high[0] - low[0]) / 2 - NEAR_MIDDLE)
    usual = (
        np.clip(rotate_planar(here, -turn)[0], middle[0] - aside, middle[0] + aside),
        min(middle[1], low[1] + FARTHEST_IN),
    )
    wish = np.array(usual) if wish is None else rotate_planar(wish, -turn)
    for margin in (FROM_EDGE + 0.05, FROM_EDGE, DEEP_ENOUGH / 2 - 0.02):
        places = standing_room(seen, margin)
        if len(places):
            best = places[np.linalg.norm(places - wish, axis=1).argmin()]
            return body.to_core(np.append(rotate_planar(best, turn), level.height))
    raise GoalError(
        f"There is no free place to stand on {target.name}; clear its top, or move its goal point."
    )


def _behind(
    level: Level, quarter: int, body: GoalBody, target: bpy.types.Object, around: Surroundings
) -> Array:
    """The place on the floor behind a low wall, core frame; ``level`` as seen from ``quarter``."""
    cells = np.argwhere(level.top)
    x, y = level.corner + CELL * np.array(
        ((cells[:, 0].min() + cells[:, 0].max() + 1) / 2, cells[:, 1].max() + 1.0)
    )
    place = body.to_core(
        np.append(rotate_planar(np.array((x, y + BEHIND_WALL)), np.float64(quarter * np.pi / 2)), 0.0)
    )
    if around.plan(place).clearance(place[None, :2])[0] < _ELBOWS:
        away = BEHIND_WALL * around.frame.scale
        raise GoalError(
            f"There is no room to stand {away:.1f} m behind {target.name}; clear it, or move its goal point."
        )
    return place


def _find(spec: GoalSpec, scene: bpy.types.Scene, around: Surroundings, before: Place) -> Goal:
    return goal_of_climb(
        spec.label, spec.object, goal_point_of(scene, spec.object, spec.action), spec.hold, around, before[0]
    )


def _likely(looks: Looks) -> float:
    """A flight of stairs, or a massive thing with a level top as high as a step; the lower, the less anything
    else.
    """
    if looks.size[2] > LEAST_STEPS * RISERS[0] and find_stairs(looks.vertices[looks.triangles]):
        return 1.4
    if not LOWEST < looks.bounds[1][2] <= HIGHEST + _SAME or looks.base > LOWEST:
        return 0.0
    if looks.size[0] < 2 * DEEP_ENOUGH or not looks.massive:
        return 0.0
    fitting = [level for level in looks.levels if LOWEST < level.height <= HIGHEST]
    if not fitting:
        return 0.0
    return 1.3 if fitting[0].height < _LOW else 1.0


FINDER = Finder(
    _find,
    words=("podium", "step", "stair", "platform", "pedestal", "stage", "plinth", "ledge", "kerb", "dais"),
    likely=_likely,
)
