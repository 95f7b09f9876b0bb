"""The keys of a curve as arrays: some are added or taken out, and all others stay as they are, byte for byte.

Blender's own ways of adding a key reckon the automatic handles of its neighbours anew, and what they show
with them.
"""

from __future__ import annotations

import bpy
import numpy as np

from nsm_core.rotations import Array

from ..animation.channels import GENERATED, LINEAR

_PAIRS = ("co", "handle_left", "handle_right")
_FLOATS = ("back", "amplitude", "period")
_KINDS = ("interpolation", "easing", "handle_left_type", "handle_right_type", "type")
_FLAGS = ("select_control_point", "select_left_handle", "select_right_handle")
_INTERPOLATIONS = bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items
CONSTANT = _INTERPOLATIONS["CONSTANT"].value
_VECTOR = bpy.types.Keyframe.bl_rna.properties["handle_left_type"].enum_items["VECTOR"].value
_SAME = 1e-3  # frames by which two keys are at one place

Keys = dict[str, Array]


def read_keys(curve: bpy.types.FCurve) -> Keys:
    """All that Blender keeps of a curve's keys, an array (K, ...) each."""
    points = curve.keyframe_points
    keys: Keys = {}
    for names, kind in ((_PAIRS, np.float32), (_FLOATS, np.float32), (_KINDS, np.intc), (_FLAGS, bool)):
        for name in names:
            keys[name] = np.empty(len(points) * (2 if name in _PAIRS else 1), kind)
            points.foreach_get(name, keys[name])
            if name in _PAIRS:
                keys[name] = keys[name].reshape(-1, 2)
    return keys


def write_keys(curve: bpy.types.FCurve, keys: Keys) -> None:
    """Have a curve hold these keys and no others, in their order."""
    points = curve.keyframe_points
    points.clear()
    points.add(len(keys["co"]))
    for name, values in keys.items():
        points.foreach_set(name, np.ascontiguousarray(values).ravel())


def frames_of(curve: bpy.types.FCurve) -> Array:
    """Frames (K,) at which a curve has keys."""
    places = np.empty(2 * len(curve.keyframe_points), np.float32)
    curve.keyframe_points.foreach_get("co", places)
    return places[::2].astype(np.float64)


def taken(keys: Keys, rows: Array) -> Keys:
    """The keys of these rows."""
    return {name: values[rows] for name, values in keys.items()}


def generated(frames: Array, values: Array, held: Array | None = None) -> Keys:
    """Linear keys of type GENERATED at ``frames`` (N,); those ``held`` (N,) bool keep their value until the
    next one.
    """
    count = len(frames)
    places = np.column_stack((frames, values)).astype(np.float32)
    kinds = np.full(count, LINEAR, np.intc)
    if held is not None:
        kinds[held] = CONSTANT
    return {
        **{name: places.copy() for name in _PAIRS},
        "back": np.full(count, 1.70158, np.float32),
        "amplitude": np.zeros(count, np.float32),
        "period": np.zeros(count, np.float32),
        "interpolation": kinds,
        "easing": np.zeros(count, np.intc),
        "handle_left_type": np.full(count, _VECTOR, np.intc),
        "handle_right_type": np.full(count, _VECTOR, np.intc),
        "type": np.full(count, GENERATED, np.intc),
        **{name: np.zeros(count, bool) for name in _FLAGS},
    }


def merged(old: Keys, new: Keys) -> tuple[Keys, Array]:
    """Keys of both in the order of their frames, and which of them are new (K,) bool; where both have one at
    a frame, the old one stays.
    """
    theirs, frames = old["co"][:, 0], new["co"][:, 0]
    near = np.searchsorted(theirs, frames)
    fresh = np.ones(len(frames), bool)
    for row in (near - 1, near) if len(theirs) else ():
        fresh &= np.abs(theirs[np.clip(row, 0, len(theirs) - 1)] - frames) >= _SAME
    new = taken(new, fresh)
    both = {name: np.concatenate((old[name], new[name])) for name in old}
    mine = np.arange(len(both["co"])) >= len(theirs)
    order = np.argsort(both["co"][:, 0], kind="stable")
    both, mine = taken(both, order), mine[order]
    _give_handles(both, mine)
    return both, mine


def _give_handles(keys: Keys, which: Array) -> None:
    """Have the handles of some keys point to their neighbours, a third of the way, as vector handles do."""
    places, rows = keys["co"], np.flatnonzero(which)
    for name, beside in (("handle_left", rows - 1), ("handle_right", rows + 1)):
        inside = (beside >= 0) & (beside < len(places))
        mine, other = rows[inside], beside[inside]
        keys[name][mine] = places[mine] + (places[other] - places[mine]) / 3
