"""The leaf of a door as the core sees it: hinge, handle and swing, proposed from its mesh or set by the animator's empties."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector

from nsm_core.control.goals import Goal
from nsm_core.control.props import Leaf, passage, sense
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, rotate_planar, wrap_angle
from nsm_core.sensors.query import DistanceQuery

from .bodies import Body
from .points import POINT_LINK, SWING
from .scene import WorldFrame
from .surroundings import Surroundings

NARROWEST, WIDEST, LOWEST = 0.5, 1.6, 1.2  # leaves that one walks through: width and height, metres
THICKEST = 0.25
LEAST_FILLED = 0.4  # of its outline: a frame is no leaf
HANDLE_HEIGHT, HANDLE_FROM_EDGE = 1.0, 0.06  # where there is no handle to be seen, metres
_HANDLE_HEIGHTS = (0.75, 1.3)  # between which a handle is looked for
_HANDLE_WITHIN = 0.3  # of the free edge
_STICKS_OUT = 0.02  # from the board, at least
_ALONG_LEVER = 0.04  # from its end at the free edge, a lever is held at most
_HAND = 0.04  # from the board to where a hand holds the handle
_NEAR_EDGE = 0.1  # an origin this near to a vertical edge is the hinge
_REACH = 0.5  # metres around the leaf in which its frame is looked for


@dataclass
class _Board:
    """A leaf along X: ``low`` and ``high`` x of its vertical edges, ``faces`` the two y of its board, own frame of ``body``."""

    body: Body
    low: float
    high: float
    faces: tuple[float, float]

    @property
    def middle(self) -> float:
        return (self.faces[0] + self.faces[1]) / 2

    @property
    def thickness(self) -> float:
        return self.faces[1] - self.faces[0]


def open_goal(
    name: str, target: bpy.types.Object, hinge: bpy.types.Object | None, handle: bpy.types.Object | None, hold: float,
    around: Surroundings, here: Array,
) -> Goal:  # fmt: skip
    """Build the goal to open the leaf ``target`` and pass, coming from ``here`` (2,); ``hinge`` and ``handle`` are the animator's empties.

    Raises GoalError where the object cannot be the leaf of a door.
    """
    earlier = around.left.get(target.name)
    leaf = earlier[0] if earlier else read_leaf(target, hinge, handle, around)
    if not isinstance(leaf, Leaf):
        raise GoalError(f"{target.name} is carried earlier in the take; choose another object to open.")
    around.left[target.name] = leaf, leaf.pose
    way = passage(leaf, np.asarray(here, dtype=np.float64))
    return Goal("open", name, np.append(way.middle, 0.0), way.heading, hold, prop=leaf)


def read_leaf(target: bpy.types.Object, hinge: bpy.types.Object | None, handle: bpy.types.Object | None, around: Surroundings) -> Leaf:
    """The leaf of a door as a prop, closed where it stands; see ``open_goal``."""
    frame = around.frame
    board = _board(target, around)
    body = board.body
    pivot = _own(hinge, body, frame)[:2] if hinge is not None else _pivot(target, board, around)
    flip = abs(pivot[0] - board.high) < abs(pivot[0] - board.low)  # the hinge is at +X: turn the frame round
    heading = float(wrap_angle(body.yaw + (np.pi if flip else 0.0)))
    sign = -1.0 if flip else 1.0
    width = float(board.high - pivot[0] if not flip else pivot[0] - board.low)
    middle = sign * (board.middle - pivot[1])
    if handle is not None:
        grip, thickness = _own(handle, body, frame), board.thickness + 2 * _HAND
    else:
        grip, thickness = _handle(board, flip)
    place = np.array((sign * (grip[0] - pivot[0]), middle, grip[2]))
    if not 0.2 < place[0] <= width + 0.05:
        raise GoalError(f"The handle of {target.name} is not on its leaf; move its handle point, or its hinge point to the other edge.")
    if hinge is not None and hinge.get(SWING):
        swing = float(np.sign(hinge[SWING]))
    else:
        swing = _swing(board, pivot, flip, width, heading, around.query)
    vertices = np.column_stack((sign * (body.vertices[:, :2] - pivot), body.vertices[:, 2])).astype(np.float32)
    pose = np.append(body.to_core(np.append(pivot, 0.0)), heading)
    query = body.solid_at(pose)
    volume = sense(query, vertices.min(0), vertices.max(0))
    return Leaf(
        target.name, query, volume, pose, width=width, handle=place, thickness=float(np.clip(thickness, 0.09, 0.2)),
        swing=swing, closed=heading,
    )  # fmt: skip


def _own(marker: bpy.types.Object, body: Body, frame: WorldFrame) -> Array:
    """Place (3,) of an empty in the leaf's frame."""
    return body.to_own(frame.to_core(np.array(marker.matrix_world.translation)))


def _board(target: bpy.types.Object, around: Surroundings) -> _Board:
    """Read the leaf with its long side along X; GoalError where the object is no leaf that one can pass."""
    frame, body = around.frame, around.body(target, snug=True)
    low, high = body.bounds
    if high[1] - low[1] > high[0] - low[0]:
        body.vertices = rotate_planar(body.vertices, np.float32(-np.pi / 2))
        body.yaw = float(wrap_angle(body.yaw + np.pi / 2))
        low, high = body.bounds
    corners = body.vertices[body.triangles].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1)
    flat = np.abs(normal[:, 1]) > 0.95 * size
    weight, y = np.where(flat, size, 0), corners[..., 1].mean(1)
    order = np.argsort(y)
    share = np.cumsum(weight[order]) / max(weight.sum(), 1e-9)
    faces = tuple(float(y[order][min(np.searchsorted(share, part), len(y) - 1)]) for part in (0.05, 0.95))
    board = _Board(body, float(low[0]), float(high[0]), faces)
    width, height, s = high[0] - low[0], high[2] - max(low[2], 0.0), frame.scale
    filled = weight.sum() / 4 / max(width * height, 1e-9)  # of the outline, by either side; ``weight`` is twice the area
    if not NARROWEST <= width <= WIDEST or height < LOWEST or board.thickness > THICKEST or filled < LEAST_FILLED:
        raise GoalError(
            f"{target.name} measures {width * s:.2f} x {(high[1] - low[1]) * s:.2f} x {height * s:.2f} m and is no leaf of a door that "
            f"one walks through ({NARROWEST * s:.2f} to {WIDEST * s:.2f} m wide, at least {LOWEST * s:.2f} m high, upright); choose the "
            "leaf alone, without its frame."
        )
    if low[2] > 0.4 or low[2] < -0.3:
        raise GoalError(f"{target.name} does not stand on the character's floor; move it, or the character, to the same height.")
    return board


def _pivot(target: bpy.types.Object, board: _Board, around: Surroundings) -> Array:
    """Where the hinge is (2,), leaf's frame.

    A part called hinge tells; else it is at the edge away from the handle; else at the edge by the object's origin, or by the
    frame; else at the left edge.  An origin near that edge is the pin.
    """
    frame = around.frame

    def at_edge(point: Array) -> float | None:
        edge = board.low if abs(point[0] - board.low) < abs(point[0] - board.high) else board.high
        near = abs(point[0] - edge) < _NEAR_EDGE and abs(point[1] - board.middle) < board.thickness / 2 + _NEAR_EDGE
        return edge if near else None

    hinges = [p for o in around.scene.objects if _is_hinge(o, target) and at_edge(p := _middle(o, board.body, frame)) is not None]
    if hinges and len({at_edge(p) for p in hinges}) == 1:
        return np.mean(hinges, axis=0)[:2]
    origin = board.body.to_own(frame.to_core(np.array(target.matrix_world.translation)))
    shown = [edge for edge in (board.low, board.high) if _handle_at(board, edge) is not None]
    if len(shown) == 1:
        edge = board.low + board.high - shown[0]
    elif (edge := at_edge(origin)) is None:
        # The free edge has more air beside it than the hinges: handles, locks and fingers need it.
        heights, gaps = np.linspace(0.4, 1.6, 7), []
        for x in (board.low - 0.01, board.high + 0.01):
            points = np.column_stack((np.full(7, x), np.full(7, board.middle), heights))
            gaps.append(float(np.median(around.query.signed_distance(board.body.to_core(points), _REACH))))
        edge = board.high if gaps[1] < gaps[0] - 0.02 else board.low
    return origin[:2] if at_edge(origin) == edge else np.array((edge, board.middle))


def _is_hinge(candidate: bpy.types.Object, target: bpy.types.Object) -> bool:
    """Whether an object is called a hinge, is small, and is no goal point."""
    small = candidate.type == "EMPTY" or max(candidate.dimensions[:2]) < 0.2
    return "hinge" in candidate.name.lower() and candidate != target and small and POINT_LINK not in candidate


def _middle(part: bpy.types.Object, body: Body, frame: WorldFrame) -> Array:
    """Middle (3,) of an object's bounding box in the leaf's frame; of an empty, its place."""
    corners = [part.matrix_world @ Vector(c) for c in part.bound_box] if part.type == "MESH" else [part.matrix_world.translation]
    return body.to_own(frame.to_core(np.mean(np.array(corners), axis=0)))


def _handle(board: _Board, flip: bool) -> tuple[Array, float]:
    """Place (3,) of the handle, leaf's frame, and metres between the places where hands hold it from either side."""
    edge = board.low if flip else board.high
    found = _handle_at(board, edge)
    if found is None:
        inwards = HANDLE_FROM_EDGE if flip else -HANDLE_FROM_EDGE
        return np.array((edge + inwards, board.middle, HANDLE_HEIGHT)), board.thickness + 2 * _HAND
    low, high = found
    reach = max(board.faces[0] - low[1], high[1] - board.faces[1], _HAND)
    place, held = (low + high) / 2, min((high[0] - low[0]) / 2, _ALONG_LEVER)
    place[0] = low[0] + held if flip else high[0] - held
    return place, board.thickness + 2 * min(reach, 0.08)


def _handle_at(board: _Board, edge: float) -> tuple[Array, Array] | None:
    """Lowest and highest corner (3,) of what sticks out of the board near a vertical edge as a handle does; None without."""
    v = board.body.vertices.astype(np.float64)
    out = (v[:, 1] < board.faces[0] - _STICKS_OUT) | (v[:, 1] > board.faces[1] + _STICKS_OUT)
    there = out & (v[:, 2] > _HANDLE_HEIGHTS[0]) & (v[:, 2] < _HANDLE_HEIGHTS[1]) & (np.abs(v[:, 0] - edge) < _HANDLE_WITHIN)
    if not there.any():
        return None
    low, high = v[there].min(0), v[there].max(0)
    return (low, high) if high[2] - low[2] < 0.4 and high[0] - low[0] < 0.25 else None


def _swing(board: _Board, pivot: Array, flip: bool, width: float, heading: float, query: DistanceQuery) -> float:
    """+1 where the leaf opens towards +Y of its frame, -1 towards -Y.

    A leaf opens to the side of the wall on which it sits, else to the side of its hinge's pin, else to the side that is free.
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
    angle, radius = (g.ravel() for g in np.meshgrid(np.radians(np.arange(20, 81, 10)), np.linspace(0.25, 1.0, 6) * width))
    blocked = [int((distance(radius * np.cos(angle), s * radius * np.sin(angle), 1.0, 0.05) < 0.03).sum()) for s in (1.0, -1.0)]
    return -1.0 if blocked[0] > blocked[1] else 1.0


