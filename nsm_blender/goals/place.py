"""Light things to pick up and put down: the thing as the core sees it, and where on a table, a shelf or at an
empty it is put.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import bpy
import numpy as np

from nsm_core.control.actions.place import planned
from nsm_core.control.goals import Goal
from nsm_core.errors import GeometryError, GoalError
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.affordances.picking import LOWEST
from nsm_core.world.affordances.reach import REACHED
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import LightThing
from nsm_core.world.scene.small_things import LARGEST

from ..world.bodies import place_of
from ..world.surroundings import Surroundings
from ..world.tops import Level, boards_of, occupy, places_near_edge
from .aside import put_aside_first
from .closing import shut_again, stands_open
from .finder import Finder, Place
from .fronts import along_with, but_moved, front_goal, shut_away
from .light_things import read_thing
from .looks import Looks
from .points import goal_point_of
from .spec import GoalSpec

MARGIN, BESIDE = 0.02, 0.03  # metres of a board before a thing, and free on either side of it
DEEPEST = 0.25  # metres from the edge at which a thing is put down where its front is taken
BEFORE = 0.45  # metres before an edge at which one stands, about
EASY = 1.0  # metres over the floor of a board that is reached with most ease
TRIES = 4  # places for which ways are looked for, the nearest first
_SMALL = 0.03  # metres: what is smaller is guessed to be a part of something


def _find(spec: GoalSpec, scene: bpy.types.Scene, around: Surroundings, before: Place) -> Goal:
    """Build the goal to take an object and put it on or at ``spec.to``; GoalError where no hand can."""
    target, to = spec.object, spec.to
    if to == target or to in target.children_recursive:
        raise GoalError(f"{target.name} cannot be put down on itself; choose another destination.")
    earlier = around.left.get(target)
    first: tuple[Goal, ...] = ()
    if earlier is None or isinstance(earlier[0], Front):
        first = opened_first(target, around, before[0])
        earlier = around.left.get(target)
    if earlier is None or isinstance(earlier[0], Front):
        thing, pose = read_thing(target, around, spec.mass), None
        if earlier is not None:  # in a drawer that has been opened
            front, end = earlier
            pose = front.carried(thing.pose, replace(front, pose=end).opening)
    else:
        thing, pose = earlier
    if not isinstance(thing, LightThing):
        raise GoalError(f"{target.name} is moved in another way earlier in the take; choose another object.")
    there = thing if pose is None else thing.put(pose)
    solids = but_moved(around, thing.name)
    point = goal_point_of(scene, target, spec.action, to)
    marker = point or (to if to.type == "EMPTY" and not any(c.type == "MESH" for c in to.children) else None)
    here = np.asarray(before[0] if not first else first[-1].pulling.reach.place, dtype=np.float64)
    if marker is not None:
        spots = [place_of(marker, around.frame)[0].astype(np.float64)]
    else:
        spots = list(spots_on(to, there, here, around))[:TRIES]
    plan = around.plan(there.pose[:2], spots[0][:2], here)
    refused: GoalError | None = None
    for spot in spots:
        goal = Goal(spec.action, spec.label, spot, 0.0, spec.hold, prop=thing, first=first)
        try:
            picking = planned(goal, solids, plan, here[:2], there.pose)
            require_ways(picking.pick.reach.place, picking.put.reach.place, here, plan)
        except GoalError as error:
            refused = refused or error
            continue
        around.left[target] = thing, picking.pose
        return shut_again(goal, spec, around)
    assert refused is not None
    goal = Goal(spec.action, spec.label, spots[0], 0.0, spec.hold, prop=thing, first=first)
    goal = put_aside_first(goal, target, there, around, plan, here[:2], refused)
    assert goal.picking is not None
    around.left[target] = thing, goal.picking.pose
    return shut_again(goal, spec, around)


def opened_first(target: bpy.types.Object, around: Surroundings, here: Array) -> tuple[Goal, ...]:
    """The goals to open what shuts an object away, one after the other, as far as earlier goals have not."""
    goals: list[Goal] = []
    for front in shut_away(target):
        if not stands_open(front, around):
            here = here if not goals else goals[-1].pulling.reach.place
            goals.append(front_goal(front.name, front, 0.0, around, here))
            around.opened.append(front)
    return tuple(goals)


def _parts(target: bpy.types.Object) -> list[bpy.types.Object]:
    """What opens before a hand gets at an object, with what goes along with that."""
    return [o for front in shut_away(target) for o in (front, *along_with(front)) if o != target]


def require_ways(pick: Array, put: Array, here: Array, plan: FloorPlan) -> None:
    """Raise GoalError unless one can walk from ``here`` (2,) to where a thing is taken and put down."""
    plan.require_way(here, pick)
    plan.require_way(pick, put)


def spots_on(to: bpy.types.Object, thing: LightThing, here: Array, around: Surroundings) -> Iterator[Array]:
    """Free places (3,) on the boards of ``to`` where a thing can stand, those first that one comes to with
    the least trouble.  Raises GoalError where there is none.
    """
    scale, body = around.frame.scale, around.body(to, snug=True)
    boards = boards_of(body.vertices, body.triangles, body.to_own(np.append(here, 0.0))[:2])
    if not boards:
        raise GeometryError(
            f"{to.name} has no level board to put {thing.name} on; choose another object, or an empty where "
            "it is to stand."
        )
    low, high = LOWEST, REACHED[1]
    within = [b for b in boards if low - 0.1 <= b.height <= high - 0.1]
    if not within:
        heights = ", ".join(f"{b.height * scale:.2f}" for b in boards)
        raise GoalError(
            f"The boards of {to.name} are {heights} m over the floor, and one hand puts things between "
            f"{low * scale:.2f} and {high * scale:.2f} m; choose another destination, or an empty."
        )
    wide = float(np.linalg.norm(thing.size[:2])) + 2 * BESIDE
    meshes = [(body.to_own(v), t) for v, t in around.meshes_but()]
    meshes += [(body.to_own(v), t) for v, t in _left(around, thing)]
    found = []
    for board in within:
        occupy(board, meshes, float(thing.size[2]) + 0.04)
        found += list(_places(board, wide))
    if not found:
        raise GoalError(
            f"There is no free place for {thing.name} on {to.name} ({wide * scale:.2f} m are needed); clear "
            "it, or give an empty as the destination."
        )
    spots, stands = (body.to_core(np.array([f[k] for f in found])).astype(np.float64) for k in (0, 1))
    room = around.plan(stands.min(0)[:2], stands.max(0)[:2], here).clearance(stands[:, :2])
    cost = np.linalg.norm(stands[:, :2] - here, axis=1) + 2 * np.abs(spots[:, 2] - EASY)
    cost += np.array([f[2] for f in found]) + np.where(room > 0.2, 0.0, 100.0)
    taken: list[Array] = []
    for k in np.argsort(cost):
        if all(np.linalg.norm(spots[k] - other) > 0.2 for other in taken):
            taken.append(spots[k])
            yield spots[k]


def _left(around: Surroundings, thing: LightThing) -> Iterator[tuple[Array, Array]]:
    """Corners of what stands elsewhere by now, as meshes, core frame."""
    for prop, pose in around.left.values():
        if isinstance(prop, LightThing) and prop.name != thing.name:
            x, y, z = np.meshgrid(*np.stack((prop.low, prop.high), 1), indexing="ij")
            corners = np.stack((x, y, z), -1).reshape(-1, 3)
            yield prop.to_world(corners, pose), np.array(((0, 1, 3), (0, 3, 2), (4, 5, 7), (4, 7, 6)))


def _places(board: Level, wide: float) -> Iterator[tuple[Array, Array, float]]:
    """Middles (3,) of free places on a board, where one stands before them (3,) and how awkward that is."""
    for quarter in range(4):
        turn = np.float64(quarter * np.pi / 2)
        for x, y, gap, beside in places_near_edge(board.seen_from(quarter), wide, wide, MARGIN, DEEPEST):
            middle, stand = np.array((x, y + wide / 2, board.height)), np.array((x, y - gap - BEFORE, 0.0))
            awkward = 2 * gap + max(0.0, 0.15 - beside)
            yield rotate_planar(middle, turn), rotate_planar(stand, turn), awkward


def _after(goal: Goal, before: Place, around: Surroundings) -> Place:
    """Before the place where the thing stands then, or before what is shut last."""
    assert goal.picking is not None
    shut = goal.then[-1].pulling if goal.then else None
    reach = goal.picking.put.reach if shut is None else shut.reach
    return reach.place.astype(np.float32), reach.heading


def _likely(looks: Looks) -> float:
    small = _SMALL <= looks.size.min() and looks.size.max() <= LARGEST
    return 0.5 if small and REACHED[0] <= looks.base <= REACHED[1] else 0.0


FINDER = Finder(
    _find,
    after=_after,
    parts=_parts,
    words=("mug", "cup", "glass", "bowl", "plate", "jar", "bottle", "can", "tin", "teapot", "vase", "book"),
    likely=_likely,
)
