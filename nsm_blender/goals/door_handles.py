"""Where a leaf is held: its handle, found on the board, and hardware that hangs on the leaf without being
parented to it.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix, Vector

from nsm_core.rotations import Array

from ..world.evaluated import is_worn
from .door_board import Board

HANDLE_HEIGHT, HANDLE_FROM_EDGE = 1.0, 0.06  # where there is no handle to be seen, metres
_HANDLE_HEIGHTS = (0.6, 1.4)  # between which a handle is looked for, at least
_HANDLE_WITHIN = 0.3  # of the free edge
_STICKS_OUT = 0.02  # from the board, at least
_ALONG_LEVER = 0.04  # from its end at the free edge, a lever is held at most
_BAR = 1.5  # times as high as wide as a handle that stands is at least
_HAND = 0.04  # from the board to where a hand holds the handle
# Hardware of a leaf as shares of the leaf's height: what is no larger, touches the board and lies within its
# outline hangs on it.
_FITTING_WIDE, _FITTING_DEEP, _FITTING_TALL, _FITTING_LOWEST, _TOUCHES = 0.2, 0.12, 0.7, 0.1, 0.01


def fittings_of(target: bpy.types.Object) -> list[bpy.types.Object]:
    """Objects that hang on a leaf by nothing but their place: handles, locks, panes; the topmost of those
    parented to each other.

    What touches its board within its outline and is no larger than hardware goes with it.
    """
    own = {target, *target.children_recursive, *_ancestors(target)}
    if target.type != "MESH" or not target.users_scene:
        return []
    axes = _axes(target)
    if axes is None:
        return []
    to_leaf, low, high = axes
    height, found = high[2] - low[2], []
    for other in target.users_scene[0].objects:
        if other.type != "MESH" or other in own or other.hide_render:
            continue
        matrix, corners = to_leaf @ other.matrix_world, other.bound_box
        middle = matrix @ ((Vector(corners[0]) + Vector(corners[6])) / 2)
        if not all(
            low[k] - height * _FITTING_DEEP < middle[k] < high[k] + height * _FITTING_DEEP for k in range(3)
        ):
            continue
        box = np.array([matrix @ Vector(c) for c in corners])
        if _hangs(box.min(0), box.max(0), low, high, height) and not is_worn(other):
            found.append(other)
    return [o for o in found if not any(a in found for a in _ancestors(o))]


def find_handle(board: Board, flip: bool) -> tuple[Array, float]:
    """Place (3,) of the handle, leaf's frame, and metres between the places where hands hold it from either
    side.
    """
    edge = board.low if flip else board.high
    found = handle_at(board, edge)
    if found is None:
        inwards = HANDLE_FROM_EDGE if flip else -HANDLE_FROM_EDGE
        return np.array((edge + inwards, board.middle, HANDLE_HEIGHT)), grip_depth(board)
    low, high = found
    reach = max(board.faces[0] - low[1], high[1] - board.faces[1], _HAND)
    place, held = (low + high) / 2, min((high[0] - low[0]) / 2, _ALONG_LEVER)
    place[0] = low[0] + held if flip else high[0] - held
    return place, board.thickness + 2 * min(reach, 0.08)


def stands(board: Board, flip: bool) -> bool:
    """Whether the handle is a bar that stands, rather than a lever or a knob."""
    found = handle_at(board, board.low if flip else board.high)
    return found is not None and bool(found[1][2] - found[0][2] > _BAR * (found[1][0] - found[0][0]))


def grip_depth(board: Board) -> float:
    """Metres between the places where hands hold a handle of which nothing but its place is known."""
    return board.thickness + 2 * _HAND


def handle_at(board: Board, edge: float) -> tuple[Array, Array] | None:
    """Lowest and highest corner (3,) of what sticks out of the board near a vertical edge as a handle does;
    None without.
    """
    v = board.body.vertices.astype(np.float64)
    out = (v[:, 1] < board.faces[0] - _STICKS_OUT) | (v[:, 1] > board.faces[1] + _STICKS_OUT)
    there = (
        out
        & (v[:, 2] > _HANDLE_HEIGHTS[0])
        & (v[:, 2] < _HANDLE_HEIGHTS[1])
        & (np.abs(v[:, 0] - edge) < _HANDLE_WITHIN)
    )
    if not there.any():
        return None
    low, high = v[there].min(0), v[there].max(0)
    return (low, high) if high[2] - low[2] < 0.4 and high[0] - low[0] < 0.25 else None


def _hangs(low: Array, high: Array, leaf_low: Array, leaf_high: Array, height: float) -> bool:
    """Whether a box from ``low`` to ``high`` (3,), leaf's axes, is hardware on the board or a pane in it."""
    slack, size = _TOUCHES * height, high - low
    within = (low[[0, 2]] > leaf_low[[0, 2]] - slack).all() and (
        high[[0, 2]] < leaf_high[[0, 2]] + slack
    ).all()
    if not within or low[1] > leaf_high[1] + slack or high[1] < leaf_low[1] - slack:
        return False
    inlaid = low[1] > leaf_low[1] - slack and high[1] < leaf_high[1] + slack
    small = (
        size[0] < _FITTING_WIDE * height
        and size[1] < _FITTING_DEEP * height
        and size[2] < _FITTING_TALL * height
    )
    return bool(inlaid or (small and low[2] > leaf_low[2] + _FITTING_LOWEST * height))


def _axes(target: bpy.types.Object) -> tuple[Matrix, Array, Array] | None:
    """The matrix from the world to axes along a leaf (x along, z up), and its own lowest and highest corner
    there; None for no leaf.

    Corners are of its own mesh alone and lengths are those of the world.
    """
    corners = np.array([target.matrix_world @ Vector(c) for c in target.bound_box])
    # The longest horizontal edge of its bounding box is the way along it.
    edges = corners[[4, 3, 1]] - corners[0]
    along = edges[int(np.linalg.norm(edges[:, :2], axis=1).argmax()), :2]
    length = float(np.linalg.norm(along))
    if not 1e-6 < length < np.inf:
        return None
    turn = Matrix.Rotation(-float(np.arctan2(along[1], along[0])), 4, "Z")
    box = np.array([turn @ Vector(c) for c in corners])
    return turn, box.min(0), box.max(0)


def _ancestors(target: bpy.types.Object) -> list[bpy.types.Object]:
    chain, ancestor = [], target.parent
    while ancestor is not None:
        chain.append(ancestor)
        ancestor = ancestor.parent
    return chain
