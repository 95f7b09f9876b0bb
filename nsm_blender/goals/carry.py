"""Boxes to carry: the box as the core sees it, and where it is set down."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.control.load import by_volume
from nsm_core.distances import BODY_TO_BOX
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import Array, rotate_planar, wrap_angle
from nsm_core.world.affordances.standing import (
    BODY_TO_EDGE,
    HEAVIEST_SIDE,
    WIDEST_BOX,
    choose_side,
    further_off,
    require_room,
    standing_place,
)
from nsm_core.world.scene.props import Box, sense

from ..world.bodies import GoalBody, place_of
from ..world.frame import WorldFrame
from ..world.surroundings import Surroundings
from ..world.tops import Level, find_levels, occupy, occupy_rectangle, places_near_edge
from .finder import Finder, Place
from .looks import Looks
from .points import goal_point_of
from .spec import GoalSpec

HIGHEST_TOP = 1.3  # metres over the floor from which, and onto which, a standing person lifts a box
MARGIN = 0.03  # from the edge of a top to the near face of the box, metres
_REACH = 0.25  # how far from the edge a box may be set where its front is taken
_BESIDE = 0.2  # metres of the top that look natural on either side of the box
_BEHIND = 0.45  # metres behind the standing place that one needs to get there
_SMALLEST = 0.08  # metres: what is thinner is guessed to be no box
_STANDING, _COMING = 0.12, 0.24  # clearance of the standing place and of the place behind it, metres


@dataclass
class SetDown:
    """Where a box is set down: the centre of its base (3,) and the heading of the carrier, core frame."""

    base: Array
    facing: float


def carry_goal(
    name: str, target: bpy.types.Object, to: bpy.types.Object, point: bpy.types.Object | None, hold: float,
    around: Surroundings, here: Array, mass: float | None = None,
) -> Goal:  # fmt: skip
    """Build the goal to carry ``target`` onto or to ``to``; ``point`` is the animator's own empty for the
    place, ``here`` (2,) the start, ``mass`` kilograms of the box, by its size where None.

    Raises GoalError where hands cannot hold the box, or nothing can be set down there.
    """
    frame = around.frame
    earlier = around.left.get(target)
    box = earlier[0] if earlier else read_box(target, around)
    if not isinstance(box, Box):
        raise GoalError(
            f"{target.name} is opened as a door earlier in the take; choose another object to carry."
        )
    box.mass = by_volume(box.size) if mass is None else mass
    pose = earlier[1] if earlier else box.pose
    _require_liftable(box, pose, frame)
    if to == target or to in target.children_recursive:
        raise GoalError(f"{target.name} cannot be set down on itself; choose another destination.")
    if to in around.left:
        raise GoalError(f"{to.name} is moved earlier in the take; choose a destination that stands still.")
    facing_in_box = _side(target, box, pose, here, around)
    if point is not None or _is_place(to):
        base, facing = place_of(point or to, frame)
        if not -0.05 <= base[2] <= HIGHEST_TOP:
            raise GoalError(
                f"{(point or to).name} is {base[2] * frame.scale:.2f} m over the character's floor; boxes "
                "are set down between 0 and "
                f"{HIGHEST_TOP * frame.scale:.2f} m: move it."
            )
        spot = SetDown(base.astype(np.float64), facing)
    else:
        spot = spot_on_top(target, to, box, box.across(facing_in_box), pose[:2], around)
    centre = spot.base + (0, 0, box.size[2] / 2)
    where = f"The place on {to.name}" if to.type != "EMPTY" else f"The place at {to.name}"
    require_room(box, np.append(centre, spot.facing - facing_in_box), around.query, where)
    further_off(box, facing_in_box, centre, spot.facing, around.query, where, frame.scale)
    around.left[target] = box, np.append(centre, wrap_angle(spot.facing - facing_in_box))
    return Goal("carry", name, centre, spot.facing, hold, prop=box)


def read_box(target: bpy.types.Object, around: Surroundings) -> Box:
    """The box around an object as a prop: its frame at the centre of its upright bounding box."""
    body = around.body(target, snug=True)
    low, high = body.bounds
    size, middle = high - low, (low + high) / 2
    pose = np.append(body.to_core(middle), body.yaw)
    query = body.solid_at(pose)
    return Box(target.name, query, sense(query, -size / 2, size / 2), pose, size=size)


def _side(target: bpy.types.Object, box: Box, pose: Array, here: Array, around: Surroundings) -> float:
    """Heading in the box's frame of who lifts it, coming from ``here`` (2,)."""
    try:
        return choose_side(
            box,
            around.plan(here, pose[:2]),
            np.asarray(here, dtype=np.float64),
            pose,
            around.query,
            around.frame.scale,
        )[0]
    except GoalError as error:
        raise GoalError(f"{target.name} cannot be reached. {error}") from error


def spot_on_top(
    target: bpy.types.Object,
    to: bpy.types.Object,
    box: Box,
    across: tuple[float, float],
    coming_from: Array,
    around: Surroundings,
) -> SetDown:
    """Choose the place on the largest level top of ``to``: near an edge, nothing on it, and room to stand
    before it.
    """
    scale = around.frame.scale
    body = around.body(to, snug=True)
    coming_from = np.asarray(coming_from, dtype=np.float64)
    levels = find_levels(body.vertices, body.triangles, body.to_own(np.append(coming_from, 0.0))[:2])
    fitting = [level for level in levels if -0.05 <= level.height <= HIGHEST_TOP]
    if not fitting:
        if levels:
            raise GoalError(
                f"The top of {to.name} is {levels[0].height * scale:.2f} m over the character's floor; "
                "boxes are set down between 0 and "
                f"{HIGHEST_TOP * scale:.2f} m: choose another destination, or an empty."
            )
        raise GeometryError(
            f"{to.name} has no level top to set a box on; choose another object, or an empty where the box "
            "is to stand."
        )
    level = fitting[0]
    sizes = "{:.2f} by {:.2f}".format(*sorted(box.size[:2] * scale, reverse=True))
    whole = [p for q in range(4) for p in places_near_edge(level.seen_from(q), *across, MARGIN, _REACH)]
    if not whole:
        raise GoalError(
            f"The top of {to.name} is too small for {target.name} ({sizes} m); choose a larger one, or an "
            "empty beside it."
        )
    meshes = [(body.to_own(v), t) for v, t in around.meshes_but(to, target)]
    occupy(level, meshes, float(box.size[2]))
    for owner, (other, pose) in around.left.items():
        if (
            isinstance(other, Box)
            and owner != target
            and abs(pose[2] - other.size[2] / 2 - level.height) < 0.1
        ):
            occupy_rectangle(level, body.to_own(pose[:3])[:2], other.size[:2], float(pose[3] - body.yaw))
    found = _nearest(level, across, body, coming_from, around)
    if found is None:
        raise GoalError(
            f"There is no free place for {target.name} ({sizes} m) on {to.name} that can be reached from "
            "the floor before it; "
            "clear its edge, or give an empty as the destination."
        )
    return found


def _nearest(
    level: Level, across: tuple[float, float], body: GoalBody, coming_from: Array, around: Surroundings
) -> SetDown | None:
    """The free place whose standing place is nearest and can be walked to."""
    candidates = []
    for quarter in range(4):
        turn = quarter * np.pi / 2
        for x, y, gap, beside in places_near_edge(level.seen_from(quarter), *across, MARGIN, _REACH):
            before = y - max(BODY_TO_BOX, gap + BODY_TO_EDGE)
            view = np.array(((x, y + across[1] / 2), (x, before), (x, before - _BEHIND)))
            base, stand, behind = body.to_core(
                np.insert(rotate_planar(view, np.float64(turn)), 2, 0.0, axis=1)
            ).astype(np.float64)
            awkward = 2 * gap + 4 * max(0.0, _BESIDE - beside)
            candidates.append((stand, behind, base, body.yaw + turn + np.pi, awkward))
    if not candidates:
        return None
    stands, behinds = (np.array([c[k][:2] for c in candidates]) for k in (0, 1))
    plan = around.plan(*stands, coming_from)
    free = (plan.clearance(stands) > _STANDING) & (plan.clearance(behinds) > _COMING)
    # Middles of edges look natural, so a little of the way is worth it.
    middle = np.array([np.linalg.norm(c[2][:2] - body.origin) for c in candidates])
    cost = np.linalg.norm(stands - coming_from, axis=1) + np.array([c[4] for c in candidates]) + 0.3 * middle
    refused: set[float] = set()
    for k in np.argsort(cost):
        _, behind, base, facing, _ = candidates[k]
        if not free[k] or round(facing, 3) in refused:
            continue
        if around.can_walk(coming_from, behind[:2]):
            return SetDown(np.array((base[0], base[1], level.height)), float(wrap_angle(facing)))
        refused.add(round(facing, 3))  # one side of a top is reached as a whole, or not at all
    return None


def _is_place(to: bpy.types.Object) -> bool:
    """Whether a destination is an empty that marks a place, and not one that holds a table's parts."""
    return (
        to.type == "EMPTY"
        and to.instance_type == "NONE"
        and not any(c.type == "MESH" for c in to.children_recursive)
    )


def _require_liftable(box: Box, pose: Array, frame: WorldFrame) -> None:
    if (
        float(max(box.size[:2])) > min(WIDEST_BOX, HEAVIEST_SIDE) + 1e-3
        or float(box.size[2]) > HIGHEST_TOP / 2
    ):
        size = " x ".join(f"{s * frame.scale:.2f}" for s in box.size)
        raise GoalError(
            f"{box.name} measures {size} m; two hands hold boxes up to "
            f"{min(WIDEST_BOX, HEAVIEST_SIDE) * frame.scale:.2f} m wide and "
            f"{HIGHEST_TOP / 2 * frame.scale:.2f} m high: choose a smaller one."
        )
    base = pose[2] - box.size[2] / 2
    if base > HIGHEST_TOP:
        raise GoalError(
            f"{box.name} stands {base * frame.scale:.2f} m over the character's floor, higher than the "
            f"{HIGHEST_TOP * frame.scale:.2f} m "
            "from which one lifts a box; put it lower."
        )
    if base < -0.05:
        raise GoalError(f"{box.name} is below the character's floor; put it on the floor or on a table.")


def _find(spec: GoalSpec, scene: bpy.types.Scene, around: Surroundings, before: Place) -> Goal:
    point = goal_point_of(scene, spec.object, spec.action, spec.to)
    return carry_goal(spec.label, spec.object, spec.to, point, spec.hold, around, before[0], spec.mass)


def _after(goal: Goal, before: Place, around: Surroundings) -> Place:
    """Before the place where the box stands then."""
    pose = next(left for prop, left in around.left.values() if prop is goal.prop)
    facing = goal.heading - pose[3]
    further = further_off(goal.prop, facing, goal.position, goal.heading, around.query)
    return standing_place(goal.prop, facing, goal.position, goal.heading, further).astype(
        np.float32
    ), goal.heading


def _likely(looks: Looks) -> float:
    along, across, up = looks.size.tolist()
    fits = along <= min(WIDEST_BOX, HEAVIEST_SIDE) and _SMALLEST <= across and _SMALLEST <= up
    if not fits or up > HIGHEST_TOP / 2 or not -0.05 <= looks.base <= HIGHEST_TOP:
        return 0.0
    return 1.2 if looks.massive else 0.4


FINDER = Finder(
    _find,
    after=_after,
    under=lambda goal: goal.prop.size[2] / 2,
    words=("box", "crate", "carton", "parcel", "package", "case", "suitcase", "basket", "bucket", "bin"),
    likely=_likely,
)
