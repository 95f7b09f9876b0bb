"""What is no leaf that one swings open and walks through: what slides, rolls, folds, tilts, lies flat or
shuts a cupboard.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import bpy
import numpy as np
from mathutils import Quaternion

from nsm_core.errors import GoalError
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.geometry.distance import DistanceQuery

from ..animation.channels import strip_curves
from ..keys.layers import acts, driven, rotation_channel, varies
from ..keys.objects import own_turn

ONLY = "only a leaf that swings on an upright hinge, and that one walks through, can be opened"
PARENTED = "parent it to the furniture that it is a part of, and a hand opens it"
UNLESS = "if it does swing, choose Show Goal Points, which give it a hinge"
# Words in a name, with the plural "s" left off, and what such a thing does; two words stand beside each
# other.
_MOVES_ELSE = {
    "slides": ("sliding", "slide", "slider", "on rail", "bypass", "pocket door"),
    "folds": ("bifold", "folding", "accordion", "concertina"),
    "rolls or is lifted": ("roller", "rolling", "shutter", "overhead", "sectional", "garage door"),
    "revolves": ("revolving", "turnstile"),
    "is a hatch": ("hatch", "trapdoor", "trap door", "manhole"),
}
_FURNITURE = {
    "a drawer": ("drawer",),
    "the door of a fridge": ("fridge", "refrigerator", "freezer"),
    "the door of an oven": ("oven", "stove", "cooker", "dishwasher", "microwave", "washer"),
    "the door of a cupboard": (
        "cupboard",
        "cabinet",
        "closet",
        "wardrobe",
        "locker",
        "bookcase",
        "sideboard",
        "vitrine",
        "credenza",
    ),
}
# Metres behind a leaf within which a cupboard's back is; so much of its face is before it.
_DEEP, _SHUT_IN = 0.75, 0.9
# Of two that slide past one another: share of the width; thicknesses and metres apart.
_OVERLAP, _BEHIND = (0.008, 0.6), (0.6, 0.2)
_SOLID = 0.25  # metres behind a leaf within which there is no room for anything
_FLAT = 0.15  # of its length at most, that something which lies is high


def kind_by_name(target: bpy.types.Object) -> tuple[str, str] | None:
    """How a thing moves by its name ("slides") and the word that tells; None where its name tells nothing."""
    return _named(_MOVES_ELSE, [target])


def furniture_by_name(target: bpy.types.Object) -> str | None:
    """The part of furniture that an object is by its name or those of its parents ("a drawer"); None where
    these tell nothing.
    """
    chain, parent = [target], target.parent
    while parent is not None:
        chain.append(parent)
        parent = parent.parent
    found = _named(_FURNITURE, chain)
    return found[0] if found else None


def require_swings(target: bpy.types.Object) -> None:
    """GoalError where the name, keys, locks, limits or drivers of an object say that it moves in another way
    than a leaf swings.
    """
    how = _moves_else(target)
    if how is not None:
        raise GoalError(f"{target.name} {how}; {ONLY}.")
    named = kind_by_name(target)
    if named is not None:
        raise GoalError(f'{target.name} {named[0]}, as "{named[1]}" in its name says; {ONLY}: {UNLESS}.')


def no_leaf(target: bpy.types.Object, size: Array, alone: bool, filled: bool) -> str:
    """What to say of a thing of ``size`` (3,), along, across and up, in metres of the character, that is no
    leaf one can pass.

    ``alone`` where it is not one of a double door's leaves, ``filled`` where it is a board and no frame; ""
    where that tells nothing.
    """
    along, across, up = (float(s) for s in size)
    part = furniture_by_name(target)
    if part is not None:
        return f"it is {part}; {PARENTED}"
    if up < _FLAT * min(along, across) and min(along, across) > 0.3:
        return "it lies flat, as a hatch or a lid does"
    if not filled or up < 0.9 * along and along > 1.6 or across > 0.5 * along:
        return ""
    if up < 1.2 and across < 0.3:
        return f"it is low, as a cupboard's door, a flap or a gate is; {PARENTED}"
    if along < 0.5 and up >= 1.2:
        return "it is too narrow to walk through" + (
            "" if alone else " while the other leaf of this double door stays shut"
        )
    return ""


def require_way_through(
    target: bpy.types.Object,
    pose: Array,
    closed: float,
    across: tuple[float, float],
    top: float,
    query: DistanceQuery,
    scale: float,
) -> None:
    """GoalError where what a leaf shuts is as shallow as a cupboard, or solid.

    ``pose`` (4,) of the leaf, ``closed`` its heading when shut; ``across`` x of its edges and ``top`` z, its
    own frame; ``query`` what stands about.  A wall that is only near, or furniture before a door, leaves a
    way beside it.
    """
    x, z = np.linspace(*across, 9)[1:-1], np.linspace(0.15, 0.8, 6) * top
    u, v = (g.ravel() for g in np.meshgrid(x, z, indexing="ij"))
    if (_distance(query, pose, closed, u, np.zeros(len(u)), v) < 0).mean() > 0.5:
        return  # it was put into a wall, where nothing tells of what is behind
    reach = np.arange(0.04, _DEEP + 0.03, 0.03)
    for side in (1.0, -1.0):
        depth = np.full(len(u), np.inf)
        for y in reach[::-1]:
            near = _distance(query, pose, closed, u, np.full(len(u), side * y), v) < 0.02
            depth[near] = y
        if np.isfinite(depth).mean() < _SHUT_IN:
            continue
        # A cupboard has sides as well: without them one steps through and turns.
        y = np.repeat(np.linspace(0.25, 0.75, 3) * float(np.median(depth)), len(z))
        deep, part = float(np.median(depth)), furniture_by_name(target)
        if part is None and (depth < _SOLID).mean() > 0.97:
            raise GoalError(
                f"Behind {target.name}, {deep * scale:.2f} m off, is something solid that leaves no way "
                "through; cut an opening into it, "
                "move it, or choose another leaf."
            )
        walls = [_shut_beside(query, pose, closed, edge, side * y, np.tile(z, 3)) for edge in across]
        if part is None and min(walls) < _SHUT_IN:
            continue
        kind = part or "the door of a cupboard"
        raise GoalError(
            f"{target.name} is {kind}: what is behind it ends after {deep * scale:.2f} m, too soon to walk "
            f"in; {PARENTED}."
        )


def require_no_track(
    target: bpy.types.Object, others: list[tuple[str, Array, Array]], low: Array, high: Array
) -> None:
    """GoalError where another board hangs behind a leaf from ``low`` to ``high`` (3,), own frame, and
    overlaps it in part: they slide.

    ``others``: name, lowest and highest corner (3,) of the other meshes about it in that frame.
    """
    width, thick = high[0] - low[0], high[1] - low[1]
    for name, a, b in others:
        over = min(high[0], b[0]) - max(low[0], a[0])
        apart = abs((a[1] + b[1]) - (low[1] + high[1])) / 2
        alike = abs(b[2] - high[2]) < 0.06 and abs(a[2] - low[2]) < 0.06 and 0.7 < (b[0] - a[0]) / width < 1.4
        least = _BEHIND[0] * (thick + b[1] - a[1]) / 2
        if (
            alike
            and _OVERLAP[0] * width < over < _OVERLAP[1] * width
            and b[1] - a[1] < 0.12
            and least < apart < _BEHIND[1]
        ):
            raise GoalError(
                f"{target.name} hangs before {name} and overlaps it, as doors that slide do; {ONLY}: "
                f"{UNLESS}."
            )


def _distance(query: DistanceQuery, pose: Array, closed: float, x: Array, y: Array, z: Array) -> Array:
    points = rotate_planar(np.column_stack((x, y)), np.float64(closed)) + np.asarray(
        pose[:2], dtype=np.float64
    )
    return np.asarray(query.signed_distance(np.insert(points, 2, z, axis=1).astype(np.float32), 0.1))


def _shut_beside(query: DistanceQuery, pose: Array, closed: float, edge: float, y: Array, z: Array) -> float:
    """Share of places (N,) about one edge, at ``y`` and ``z`` (N,), that are beside a side of a body."""
    near = np.zeros(len(y), bool)
    for x in np.linspace(edge - 0.12, edge + 0.12, 9):
        near |= _distance(query, pose, closed, np.full(len(y), x), y, z) < 0.02
    return float(near.mean())


def _moves_else(target: bpy.types.Object) -> str | None:
    """How an object moves by its own keys, limits, locks and drivers where that is no turn about the
    vertical: "slides"; else None.
    """
    turns = rotation_channel(target.rotation_mode)
    curves = [c for c in strip_curves(target, own_action=True) if varies(c)]
    moved, turned = ([c for c in curves if c.data_path == path] for path in ("location", turns))
    if moved and not turned:
        return "slides, by its keys"
    if turned and _tilt(target, turned):
        return "tilts, by its keys"
    drivers = set(driven(target))
    if "location" in drivers and turns not in drivers:
        return "slides, by its drivers"
    for constraint in target.constraints:
        if not acts(constraint):
            continue
        if constraint.type == "LIMIT_LOCATION" and any(_between(constraint)):
            return f"slides, by its constraint {constraint.name}"
        if constraint.type in ("FOLLOW_PATH", "CLAMP_TO"):
            return f"slides, by its constraint {constraint.name}"
    return None


def _between(limit: bpy.types.Constraint) -> Iterator[bool]:
    """For each axis whether a limit of the location leaves a way between two ends."""
    for axis in "xyz":
        both = getattr(limit, f"use_min_{axis}") and getattr(limit, f"use_max_{axis}")
        yield both and 0.1 < getattr(limit, f"max_{axis}") - getattr(limit, f"min_{axis}") < 20


def _tilt(target: bpy.types.Object, curves: list[bpy.types.FCurve]) -> bool:
    """Whether keys turn an object about a level axis by over 15 degrees."""
    ends = [
        frame
        for c in curves
        for frame in (c.keyframe_points[0].co.x, c.keyframe_points[-1].co.x)
        if len(c.keyframe_points)
    ]
    if not ends:
        return False
    space = (target.matrix_world @ target.matrix_basis.inverted_safe()).to_3x3()
    first = _turn_at(target, curves, min(ends))
    for frame in np.linspace(min(ends), max(ends), 7)[1:]:
        change = _turn_at(target, curves, float(frame)) @ first.inverted()
        axis, angle = change.to_axis_angle()
        if min(angle, 2 * np.pi - angle) > np.radians(15) and abs((space @ axis).normalized().z) < 0.5:
            return True
    return False


def _turn_at(target: bpy.types.Object, curves: list[bpy.types.FCurve], frame: float) -> Quaternion:
    values = list(getattr(target, rotation_channel(target.rotation_mode)))
    for curve in curves:
        values[curve.array_index] = curve.evaluate(frame)
    return own_turn(target, values)


def _named(kinds: dict[str, tuple[str, ...]], objects: list[bpy.types.Object]) -> tuple[str, str] | None:
    for one in objects:
        words = [w.removesuffix("s") for w in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", one.name)]
        text = " " + " ".join(words).lower() + " "
        for kind, marks in kinds.items():
            found = next(
                (m for m in marks if any(f" {form} " in text for form in (m, f"{m}door", f"door{m}"))), None
            )
            if found is not None:
                return kind, found
    return None
