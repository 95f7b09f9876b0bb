"""The board of a door: an object's mesh with its long side along X, and what shows that the object is more
than one leaf.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector

from nsm_core.errors import GoalError
from nsm_core.rotations import Array, rotate_planar, wrap_angle
from nsm_core.world.geometry.orientation import connected_parts

from ..world.bodies import GoalBody
from ..world.evaluated import is_worn
from ..world.frame import WorldFrame
from ..world.surroundings import Surroundings
from .door_kinds import PARENTED, furniture_by_name, no_leaf

NARROWEST, WIDEST, LOWEST = 0.5, 1.6, 1.2  # leaves that one walks through: width and height, metres
THICKEST = 0.25
LEAST_FILLED = 0.4  # of its outline: a frame is no leaf
# A post beside a leaf: how much of the leaf's height it has, how much deeper than the board both posts are,
# how near the edge, metres.
_POST_HEIGHT, _POST_DEPTH, _POST_WITHIN = 0.7, 0.05, 0.25
_GAP = 3e-4  # metres between a leaf and what it is not part of: boards of one leaf touch
_TWO_LEAVES = 0.3  # of the whole width, of which each of two leaves in one mesh has this much at least
# A second leaf stands in line with the first, about as tall, and ends this near to its edge, metres.
_MEETS, _IN_LINE, _AS_TALL = 0.08, 0.06, 0.15
_TWO_FROM = 1.1  # metres of width from which an object may be two leaves


@dataclass
class Board:
    """A leaf along X: ``low`` and ``high`` x of its vertical edges, ``faces`` the two y of its board, own
    frame of ``body``.
    """

    body: GoalBody
    low: float
    high: float
    top: float
    faces: tuple[float, float]

    @property
    def middle(self) -> float:
        return (self.faces[0] + self.faces[1]) / 2

    @property
    def thickness(self) -> float:
        return self.faces[1] - self.faces[0]

    def own(self, marker: bpy.types.Object, frame: WorldFrame) -> Array:
        """Place (3,) of an object's origin in the leaf's frame."""
        return self.body.to_own(frame.to_core(np.array(marker.matrix_world.translation)))


def read_board(
    target: bpy.types.Object, around: Surroundings, fittings: Sequence[bpy.types.Object] = ()
) -> Board:
    """Read the leaf ``target`` with its long side along X; ``fittings`` are objects that hang on it without
    being its children.

    Raises GoalError where the object is no leaf that one can pass, or more than one leaf.
    """
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
    weight = np.where(flat, size, 0)
    faces = _quantiles(corners[..., 1].mean(1), weight, (0.05, 0.95))
    width, height, depth, s = high[0] - low[0], high[2] - max(low[2], 0.0), faces[1] - faces[0], frame.scale
    # Of the outline, by either side; ``weight`` is twice the area.
    filled = weight.sum() / 4 / max(width * height, 1e-9)
    family = _family(target)
    if width >= NARROWEST and height >= LOWEST:
        _require_one_leaf(target.name, body, corners, normal, size, family)
    board = Board(body, float(low[0]), float(high[0]), float(high[2]), (faces[0], faces[1]))
    if not NARROWEST <= width <= WIDEST or height < LOWEST or depth > THICKEST or filled < LEAST_FILLED:
        alone = second_leaf(target, board, around) is None
        told = no_leaf(target, high - low, alone, filled >= LEAST_FILLED)
        raise GoalError(
            f"{target.name} measures {width * s:.2f} x {(high[1] - low[1]) * s:.2f} x {height * s:.2f} m "
            "and is no leaf of a door that "
            f"one walks through ({NARROWEST * s:.2f} to {WIDEST * s:.2f} m wide, at least {LOWEST * s:.2f} "
            "m high, upright)"
            f"{f': {told}' if told else '; choose the leaf alone, without its frame'}."
        )
    if low[2] > 0.4 or low[2] < -0.3:
        part = furniture_by_name(target)
        if part is not None:
            raise GoalError(f"{target.name} is {part}; {PARENTED}.")
        raise GoalError(
            f"{target.name} does not stand on the character's floor; move it, or the character, to the same "
            "height."
        )
    for fitting in fittings:
        part = around.body(fitting)
        body.solids = [*body.solids, *part.solids]
        body.triangles = np.concatenate((body.triangles, part.triangles + len(body.vertices)))
        body.vertices = np.concatenate(
            (body.vertices, body.to_own(part.to_core(part.vertices)).astype(body.vertices.dtype))
        )
    return board


def second_leaf(target: bpy.types.Object, board: Board, around: Surroundings) -> float | None:
    """The edge (low or high) at which a second leaf of a double door ends where this one does; None without,
    or with two.
    """
    met = set()
    for _, low, high in neighbours(target, board, around):
        tall = high[2] - max(low[2], 0.0)
        alike = (
            abs(high[2] - board.top) < _AS_TALL
            and tall > LOWEST
            and 0.3 < high[0] - low[0] < 2 * (board.high - board.low)
        )
        if not alike or high[1] - low[1] > THICKEST or abs((low[1] + high[1]) / 2 - board.middle) > _IN_LINE:
            continue
        for edge, gap in ((board.low, board.low - high[0]), (board.high, low[0] - board.high)):
            if abs(gap) < _MEETS:
                met.add(edge)
    return met.pop() if len(met) == 1 else None


def neighbours(
    target: bpy.types.Object, board: Board, around: Surroundings
) -> list[tuple[str, Array, Array]]:
    """Name, lowest and highest corner (3,), leaf's frame, of the bounding box of each other mesh."""
    own, found = {target, *target.children_recursive}, []
    for other in around.scene.objects:
        if other.type == "MESH" and other not in own and not other.hide_render and not is_worn(other):
            box = box_of(other, board, around.frame)
            found.append((other.name, box.min(0), box.max(0)))
    return found


def box_of(part: bpy.types.Object, board: Board, frame: WorldFrame) -> Array:
    """Corners (8, 3) of an object's bounding box in the leaf's frame."""
    return board.body.to_own(frame.to_core(np.array([part.matrix_world @ Vector(c) for c in part.bound_box])))


def _quantiles(values: Array, weight: Array, shares: Sequence[float]) -> tuple[float, ...]:
    """Values (N,) below which the ``shares`` of all ``weight`` (N,) lie."""
    order = np.argsort(values)
    share = np.cumsum(weight[order]) / max(weight.sum(), 1e-9)
    return tuple(float(values[order][min(np.searchsorted(share, part), len(values) - 1)]) for part in shares)


def _family(target: bpy.types.Object) -> str:
    """What to do where an object holds more than a leaf: by whether it is one mesh or several objects."""
    if target.instance_type == "COLLECTION":
        return "make its instances real (Ctrl+A, Make Instances Real) and choose the leaf"
    meshes = [c.name for c in target.children_recursive if c.type == "MESH"]
    if meshes:
        return (
            f"choose the leaf alone, and unparent from it what stays "
            f"({', '.join(meshes[:3])}{', ...' if len(meshes) > 3 else ''})"
        )
    return "separate the leaf into an object of its own (Edit Mode, P) and choose that"


def _require_one_leaf(
    name: str, body: GoalBody, corners: Array, normal: Array, size: Array, remedy: str
) -> None:
    """GoalError where a mesh holds a frame besides its leaf, or two leaves: what is keyed turns as a whole.

    ``corners`` (F, 3, 3), ``normal`` (F, 3) and its length ``size`` (F,) of the triangles.
    """
    posts = f"{name} holds a leaf and its frame in one object, and the frame would swing with it; {remedy}."
    if _stands_proud(corners, normal, size):
        raise GoalError(posts)
    part = connected_parts(body.vertices, body.triangles)
    count = int(part.max()) + 1
    if count == 1:
        return
    low = np.full((count, 3), np.inf)
    high = np.full((count, 3), -np.inf)
    np.minimum.at(low, part, corners.min(1))
    np.maximum.at(high, part, corners.max(1))
    area = np.bincount(
        part, weights=np.where(np.abs(normal[:, 1]) > 0.95 * size, size, 0) / 4, minlength=count
    )
    whole, height = np.ptp(corners[..., 0]), np.ptp(corners[..., 2])
    main = int(area.argmax())
    wide, tall = (high - low)[:, 0], (high - low)[:, 2] > _POST_HEIGHT * height
    beside = (low[:, 0] > high[main, 0] + _GAP) | (high[:, 0] < low[main, 0] - _GAP)
    boards = beside & tall & (wide > _TWO_LEAVES * whole) & (area > 0.5 * area[main])
    if boards.any() and whole >= _TWO_FROM and area[boards].sum() + area[main] > 0.6 * whole * height:
        raise GoalError(
            f"{name} holds two leaves in one object, which would swing as one; {remedy}, one goal for each."
        )
    if wide[main] > 0.6 * whole and _posts_beside(
        corners, normal, size, (part != main) & tall[part], low[main], high[main]
    ):
        raise GoalError(posts)


def _stands_proud(corners: Array, normal: Array, size: Array) -> bool:
    """Whether posts at both vertical edges stand off the board, from bottom to top, and nothing of the kind
    below: a frame's do.
    """
    y, x, z = corners[..., 1].mean(1), corners[..., 0], corners[..., 2]
    weight = np.where(np.abs(normal[:, 1]) > 0.95 * size, size, 0)
    near, far = _quantiles(y, weight, (0.25, 0.75))
    low, high, bottom, height = x.min(), x.max(), z.min(), np.ptp(z)
    depth = []
    for inner in (x.max(1) < low + _POST_WITHIN, x.min(1) > high - _POST_WITHIN):
        deep = 0.0
        for out in (near - y, y - far):
            post = inner & (weight > 0) & (out > _POST_DEPTH / 2)
            if post.any() and np.ptp(z[post]) > _POST_HEIGHT * height:
                deep += float(np.median(out[post]))
        depth.append(deep)
    if min(depth) < _POST_DEPTH:
        return False
    low_down = (
        (z.max(1) < bottom + 0.15 * height)
        & (weight > 0)
        & ((near - y > _POST_DEPTH / 2) | (y - far > _POST_DEPTH / 2))
    )
    rail = low_down & (x.min(1) < low + 0.4 * (high - low)) & (x.max(1) > high - 0.4 * (high - low))
    return not (rail.any() and np.ptp(z[rail]) > 0.04)


def _posts_beside(corners: Array, normal: Array, size: Array, other: Array, low: Array, high: Array) -> bool:
    """Whether parts of their own stand beside both edges of the leaf from ``low`` to ``high`` (3,) with a gap
    between.

    Stiles and planks of one leaf touch or overlap each other.
    """
    x, z = corners[..., 0], corners[..., 2]
    upright = other & (np.abs(normal[:, 0]) > 0.95 * size)
    for edge, outward in ((low[0], -1.0), (high[0], 1.0)):
        gap = outward * (x.mean(1) - edge)
        near = upright & (gap > -0.03) & (gap < 0.03)
        if not near.any() or gap[near].min() < _GAP or np.ptp(z[near]) < _POST_HEIGHT * (high[2] - low[2]):
            return False
    return True
