"""The leaf of a door as the core sees it: hinge, handle and swing, proposed from its mesh or set by the
animator's empties.
"""

from __future__ import annotations

import bpy
import numpy as np

from nsm_core.control.actions.door_grasp import require_room
from nsm_core.control.goals import Goal
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, rotate_planar, wrap_angle
from nsm_core.world.affordances.passage import passage
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.props import Leaf, sense

from ..world.bodies import GoalBody
from ..world.frame import WorldFrame
from ..world.surroundings import Surroundings
from .container_points import show_what_opens
from .door_board import LOWEST, NARROWEST, THICKEST, WIDEST, Board, neighbours, read_board
from .door_handles import HANDLE_HEIGHT, find_handle, fittings_of, grip_depth, stands
from .door_hinges import find_pivot
from .door_kinds import furniture_by_name, require_no_track, require_swings, require_way_through
from .door_openings import AJAR, WallOpening, earlier_headings
from .finder import Finder, Place
from .fronts import along_with, front_goal, is_front
from .furniture_parts import AXIS
from .looks import Looks
from .points import HANDLE, HINGE, SWING, goal_point_of, make_point
from .spec import GoalSpec

_TALLEST = 2.8  # metres: boards that are taller are guessed to be walls


def open_goal(
    name: str,
    target: bpy.types.Object,
    hinge: bpy.types.Object | None,
    handle: bpy.types.Object | None,
    hold: float,
    around: Surroundings,
    here: Array,
) -> Goal:
    """Build the goal to open the leaf ``target`` and pass, coming from ``here`` (2,); ``hinge`` and
    ``handle`` are the animator's empties.

    Raises GoalError where the object cannot be the leaf of a door.
    """
    earlier = around.left.get(target)
    leaf = earlier[0] if earlier else read_leaf(target, hinge, handle, around)
    if not isinstance(leaf, Leaf):
        raise GoalError(f"{target.name} is carried earlier in the take; choose another object to open.")
    for part in (target, *fittings_of(target)):
        around.left[part] = leaf, leaf.pose
    way = passage(leaf, np.asarray(here, dtype=np.float64))
    return Goal("open", name, np.append(way.middle, 0.0), way.heading, hold, prop=leaf)


def read_leaf(
    target: bpy.types.Object,
    hinge: bpy.types.Object | None,
    handle: bpy.types.Object | None,
    around: Surroundings,
) -> Leaf:
    """The leaf of a door as a prop where it stands, with the heading that shuts it; see ``open_goal``."""
    frame = around.frame
    if hinge is None:
        require_swings(target)
    board = read_board(target, around, fittings_of(target))
    body = board.body
    if hinge is None:
        ends = (
            np.array((board.low, board.faces[0], body.bounds[0][2])),
            np.array((board.high, board.faces[1], board.top)),
        )
        require_no_track(target, neighbours(target, board, around), *ends)
    pivot = board.own(hinge, frame)[:2] if hinge is not None else find_pivot(target, board, around)
    flip = abs(pivot[0] - board.high) < abs(pivot[0] - board.low)  # the hinge is at +X: turn the frame round
    heading = float(wrap_angle(body.yaw + (np.pi if flip else 0.0)))
    sign = -1.0 if flip else 1.0
    width = float(board.high - pivot[0] if not flip else pivot[0] - board.low)
    middle = sign * (board.middle - pivot[1])
    grip, thickness = (
        find_handle(board, flip) if handle is None else (board.own(handle, frame), grip_depth(board))
    )
    place = np.array((sign * (grip[0] - pivot[0]), middle, grip[2]))
    if not 0.2 < place[0] <= width + 0.05:
        raise GoalError(
            f"The handle of {target.name} is not on its leaf; move its handle point, or its hinge point to "
            "the other edge."
        )
    pose = np.append(body.to_core(np.append(pivot, 0.0)), heading)
    query = body.solid_at(pose)
    edge = width - (board.high - board.low)
    doorway = WallOpening(around.query, pose[:2].astype(np.float64), edge, width, middle, board.top)
    closed = doorway.shut(heading, *earlier_headings(target, heading))
    require_way_through(target, pose, closed, (edge, width), board.top, around.query, frame.scale)
    open_by = float(wrap_angle(heading - closed))
    if abs(open_by) > AJAR:
        swing = float(np.sign(open_by))
    elif hinge is not None and hinge.get(SWING):
        swing = float(np.sign(hinge[SWING]))
    else:
        swing = _swing(board, pivot, flip, width, closed, around.query)
    if swing * open_by < 0:
        pose[3] = closed
    vertices = np.column_stack((sign * (body.vertices[:, :2] - pivot), body.vertices[:, 2])).astype(
        np.float32
    )
    volume = sense(query, vertices.min(0), vertices.max(0))
    return Leaf(
        target.name,
        query,
        volume,
        pose,
        width=width,
        handle=place,
        thickness=float(np.clip(thickness, 0.09, 0.2)),
        swing=swing,
        closed=closed,
        upright=handle is None and stands(board, flip),
    )


def _swing(
    board: Board, pivot: Array, flip: bool, width: float, heading: float, query: DistanceQuery
) -> float:
    """+1 where the leaf opens towards +Y of its frame, -1 towards -Y.

    A leaf opens to the side of the wall on which it sits, else to the side of its hinge's pin, else to the
    side that is free.
    """
    sign = -1.0 if flip else 1.0
    at = board.body.to_core(np.append(pivot, 0.0)).astype(np.float64)

    def distance(x: Array, y: Array, z: float, reach: float) -> Array:
        points = rotate_planar(np.column_stack((x, y)), np.float64(heading)) + at[:2]
        return np.asarray(query.signed_distance(np.insert(points, 2, z, axis=1).astype(np.float32), reach))

    middle = sign * (board.middle - pivot[1])
    across = np.linspace(-0.4, 0.4, 81) + middle
    solid = np.zeros(81, bool)
    for x in (-0.06, width + 0.06):
        for z in (0.7, 1.4):
            solid |= distance(np.full(81, x), across, z, 0.02) < 0
    if solid.any() and not solid[[0, -1]].all():
        wall = across[solid]
        aside = middle - (wall.min() + wall.max()) / 2
        if abs(aside) > 0.01:
            return float(np.sign(aside))
    if abs(middle) > 0.005:
        return -float(np.sign(middle))
    angle, radius = (
        g.ravel() for g in np.meshgrid(np.radians(np.arange(20, 81, 10)), np.linspace(0.25, 1.0, 6) * width)
    )
    blocked = [
        int((distance(radius * np.cos(angle), s * radius * np.sin(angle), 1.0, 0.05) < 0.03).sum())
        for s in (1.0, -1.0)
    ]
    if blocked[0] != blocked[1]:
        return -1.0 if blocked[0] > blocked[1] else 1.0
    # Nothing tells: to one side of the wall whichever way the leaf is turned, lest the leaves of a double
    # door part.
    across = np.array((-np.sin(heading), np.cos(heading)))
    return -1.0 if across[int(np.abs(across).argmax())] < 0 else 1.0


def _find(spec: GoalSpec, scene: bpy.types.Scene, around: Surroundings, before: Place) -> Goal:
    if is_front(spec.object):
        return front_goal(spec.label, spec.object, spec.hold, around, before[0])
    hinge, handle = (goal_point_of(scene, spec.object, part) for part in (HINGE, HANDLE))
    return open_goal(spec.label, spec.object, hinge, handle, spec.hold, around, before[0])


def _after(goal: Goal, before: Place, around: Surroundings) -> Place:
    """Beyond the opening, on the other side than one comes from; of furniture, where one stands."""
    if goal.pulling is not None:
        return goal.pulling.reach.place.astype(np.float32), goal.pulling.reach.heading
    way = passage(goal.prop, np.asarray(before[0], dtype=np.float64))
    return way.beyond.astype(np.float32), way.heading


def _require(spec: GoalSpec, scene: bpy.types.Scene) -> None:
    """Raise GoalError where it moves in another way than a leaf swings, unless the animator gave it a
    hinge.
    """
    door = spec.object is not None and not is_front(spec.object)
    if door and goal_point_of(scene, spec.object, HINGE) is None:
        require_swings(spec.object)


def _room(goal: Goal, solids: DistanceQuery) -> None:
    if isinstance(goal.prop, Leaf):
        require_room(goal.prop, solids)


def _parts(target: bpy.types.Object) -> list[bpy.types.Object]:
    return along_with(target) if is_front(target) else fittings_of(target)


def _show(
    spec: GoalSpec,
    goal: Goal | None,
    body: GoalBody,
    reason: str,
    scene: bpy.types.Scene,
    frame: WorldFrame,
    told: list[str] | None,
) -> bpy.types.Object:
    """The points of the leaf of a ``goal``, or of what was found to be none for some ``reason``: at its
    edges; the hinge is returned.  A front of furniture has those of its axis and its handle.
    """
    if is_front(spec.object):
        show_what_opens(scene, [spec.object])
        if reason and told is not None:
            told.append(reason)
        bpy.context.view_layer.update()
        return goal_point_of(scene, spec.object, AXIS) or spec.object
    (low, high), heading = body.bounds, body.yaw
    target, leaf = spec.object, goal.prop if goal is not None else None
    hinge, handle = goal_point_of(scene, target, HINGE), goal_point_of(scene, target, HANDLE)
    if leaf is not None:
        pin, grip, heading = leaf.pose[:3], leaf.to_world(leaf.handle), float(leaf.pose[3])
    else:
        pin, grip = body.to_core(np.array(((low[0], 0.0, 0.0), (0.9 * high[0], 0.0, HANDLE_HEIGHT))))
    if reason and told is not None:
        told.append(
            reason
            if hinge and handle
            else f"{reason} Points of its hinge and handle were put on it all the same: move them."
        )
    if hinge is None:
        hinge = make_point(f"NSM Hinge {target.name}", target, HINGE, pin, heading, frame, target)
        hinge[SWING] = int(leaf.swing) if leaf is not None else 1
        hinge.id_properties_ui(SWING).update(
            min=-1,
            max=1,
            description="1: seen from above, the leaf turns counter-clockwise as it opens; -1: clockwise",
        )
    if handle is None:
        make_point(f"NSM Handle {target.name}", target, HANDLE, grip, heading, frame, target)
    bpy.context.view_layer.update()
    return hinge


def _likely(looks: Looks) -> float:
    if is_front(looks.target):
        return 2.0
    along, across, up = looks.size.tolist()
    leaf = NARROWEST <= along <= WIDEST and up >= max(LOWEST, along) and across <= min(THICKEST, along / 3)
    if not leaf or not -0.3 < looks.base < 0.4 or up > _TALLEST or furniture_by_name(looks.target):
        return 0.0
    return 2.0


FINDER = Finder(
    _find,
    after=_after,
    require=_require,
    room=_room,
    parts=_parts,
    swings=True,
    show=_show,
    words=("door", "leaf", "gate", "drawer"),
    likely=_likely,
)
