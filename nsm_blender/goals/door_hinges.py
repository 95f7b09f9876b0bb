"""Where the pin of a leaf is: by what is called a hinge, by its handle, a second leaf, its origin or the
frame beside it.
"""

from __future__ import annotations

import bpy
import numpy as np

from nsm_core.rotations import Array

from ..world.surroundings import Surroundings
from .door_board import Board, box_of, second_leaf
from .door_handles import handle_at
from .points import POINT_LINK

_NEAR_EDGE = 0.1  # an origin this near to a vertical edge is the hinge
_REACH = 0.5  # metres around the leaf in which its frame is looked for
_PINS = ("pin", "axis", "axle", "knuckle", "barrel")  # besides "hinge" in a name
# Metres across, at most, of hardware; of a pin, what is wider being a plate that tells the edge alone; and
# between parts of one pin.
_LARGEST, _SLENDER, _ONE_PIN = 0.2, 0.035, 0.008


def find_pivot(target: bpy.types.Object, board: Board, around: Surroundings) -> Array:
    """Where the hinge is (2,), leaf's frame.

    What is called hinge tells the edge, the surest kind of it first; where that tells nothing, it is the edge
    away from the handle, away from a second leaf, by the object's origin or an empty that it is parented to,
    or by the frame; else the left one.  The pin is at that edge where a pin or an empty called hinge is, or
    such an origin; else in the middle of the edge.
    """
    frame = around.frame
    kinds = _hinges(target, board, around)
    origins = [
        board.own(o, frame)
        for o in (target, target.parent)
        if o is not None and (o is target or o.type == "EMPTY")
    ]
    edges = next((found for kind in kinds if (found := {_edge_of(board, p) for p in kind})), set())
    edge = edges.pop() if len(edges) == 1 else _hinge_edge(target, board, around, origins)
    empties, pins, rods, _ = ([p for p in kind if _edge_of(board, p) == edge] for kind in kinds)
    at_edge = [o for o in origins if _edge_of(board, o) == edge]
    for places in (empties, pins, at_edge[:1], rods):
        if places:
            return _outermost(np.array(places)[:, :2], edge, board)
    return np.array((edge, board.middle))


def _hinge_edge(target: bpy.types.Object, board: Board, around: Surroundings, origins: list[Array]) -> float:
    shown = [edge for edge in (board.low, board.high) if handle_at(board, edge) is not None]
    if len(shown) == 1:
        return board.low + board.high - shown[0]
    meets = second_leaf(target, board, around)
    if meets is not None:
        return board.low + board.high - meets
    for origin in origins:
        if (edge := _edge_of(board, origin)) is not None:
            return edge
    # The free edge has more air beside it than the hinges: handles, locks and fingers need it.
    heights, gaps = np.linspace(0.4, 1.6, 7), []
    for x in (board.low - 0.01, board.high + 0.01):
        points = np.column_stack((np.full(7, x), np.full(7, board.middle), heights))
        gaps.append(float(np.median(around.query.signed_distance(board.body.to_core(points), _REACH))))
    return board.high if gaps[1] < gaps[0] - 0.02 else board.low


def _hinges(target: bpy.types.Object, board: Board, around: Surroundings) -> tuple[list[Array], ...]:
    """Places near an edge of the leaf of what is called hinge: empties, pins, what is slender like a pin, and
    plates.

    Hardware that hangs on the leaf often bears the word too and lies centimetres beside the pin, or at the
    other edge.
    """
    empties, pins, rods, plates = kinds = [], [], [], []
    for other in around.scene.objects:
        name = other.name.lower()
        if (
            "hinge" not in name
            or other == target
            or POINT_LINK in other
            or other.type not in ("MESH", "EMPTY")
        ):
            continue
        box = (
            box_of(other, board, around.frame)
            if other.type == "MESH"
            else board.own(other, around.frame)[None]
        )
        place, across = box.mean(0), float(np.ptp(box[:, :2], axis=0).max())
        if across > _LARGEST or _edge_of(board, place) is None:
            continue
        pin = other.type == "MESH" and any(word in name for word in _PINS)
        (
            empties if other.type == "EMPTY" else pins if pin else rods if across <= _SLENDER else plates
        ).append(place)
    return kinds


def _outermost(places: Array, edge: float, board: Board) -> Array:
    """The pin (2,) among places (N, 2): the mean of those farthest out over the edge; what lies inwards is
    fixed to the leaf.
    """
    out = (places[:, 0] - edge) * (1.0 if edge == board.high else -1.0)
    return places[out > out.max() - _ONE_PIN].mean(0)


def _edge_of(board: Board, point: Array) -> float | None:
    """The vertical edge that a place (2 or 3,), leaf's frame, is near enough to be its pin; None for
    neither.
    """
    edge = board.low if abs(point[0] - board.low) < abs(point[0] - board.high) else board.high
    near = (
        abs(point[0] - edge) < _NEAR_EDGE and abs(point[1] - board.middle) < board.thickness / 2 + _NEAR_EDGE
    )
    return edge if near else None
