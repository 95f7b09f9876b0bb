"""The animator's own keys in a take: told from those that the add-on made, and taken over into the next try.

What was made is noted on the action, as one number for each key (its channel, frame, value and type), since
Blender keeps the type of a generated key that somebody sets to another value.  All other keys are the
animator's: in the frames where they lie they rule, and the new motion leads up to them and away from them.
"""

from __future__ import annotations

import zlib
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np

from nsm_core.rotations import (
    Array,
    quat_conjugate,
    quat_from_rotvec,
    quat_mul,
    quat_normalize,
    quat_to_rotvec,
)

from ..animation.channels import ActionChannels, curves_in
from .before import copy_keys, copy_whole, new_like, turn_alike

_MADE, _FIRST = "nsm_made", "nsm_first"  # on an action: numbers of its keys, and the frame it begins with
_EASE = 0.4  # seconds over which a new motion leads up to the animator's keys
_PARTS = ("co", "handle_left", "handle_right")
Path = tuple[str, int]


@dataclass
class KeptEdits:
    """The animator's keys that a new take has taken over: in how many frames of what, and the first and the
    last of these.
    """

    counts: dict[str, int] = field(default_factory=dict)
    prints: list[Array] = field(default_factory=list, repr=False)  # the numbers of these keys
    first: float = np.inf
    last: float = -np.inf

    def add(self, name: str, frames: Array) -> None:
        """Count keys of a bone, or of an object's own channels."""
        self.counts[name] = self.counts.get(name, 0) + len(frames)
        self.first, self.last = min(self.first, frames.min()), max(self.last, frames.max())

    def join(self, other: KeptEdits) -> None:
        """Count what another action has taken over, too."""
        self.counts |= other.counts
        self.first, self.last = min(self.first, other.first), max(self.last, other.last)

    def sentence(self) -> str:
        """What was kept, for the animator; empty where it is nothing."""
        if not self.counts:
            return ""
        names = list(self.counts)
        told = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
        count, first, last = sum(self.counts.values()), self.first, self.last
        when = f"frame {first:g}" if first == last else f"frames {first:g} to {last:g}"
        if count == 1:
            return f"Your key on {told} at {when} was kept; the new motion leads to it."
        return f"Your {count} keys on {told} at {when} were kept; the new motion leads to them."


def note_made(channels: ActionChannels, first: float, kept: KeptEdits) -> None:
    """Note the keys that an action has now as the add-on's, but for those ``kept``, and the frame that its
    take begins with.
    """
    made = np.concatenate([np.zeros(0, np.uint32), *(prints(curve) for curve in channels.bag.fcurves)])
    theirs = np.concatenate([np.zeros(0, np.uint32), *kept.prints])
    channels.action[_MADE] = np.setdiff1d(made, theirs).tobytes()
    channels.action[_FIRST] = float(first)


def note_more_made(action: bpy.types.Action, more: Array) -> None:
    """Note keys with these numbers (N,) as the add-on's, too."""
    made = np.union1d(np.frombuffer(action[_MADE], np.uint32), more).astype(np.uint32)
    del action[_MADE]  # bytes set over others would end with their first zero
    action[_MADE] = made.tobytes()


def edited_keys(action: bpy.types.Action, slot: Any | None) -> Iterator[tuple[bpy.types.FCurve, Array]]:
    """Curves of a take's action with keys of the animator's, and which these are, (N,) bool."""
    made = np.frombuffer(action.get(_MADE, b""), np.uint32)
    for curve in curves_in(action, slot):
        edited = ~np.isin(prints(curve), made)
        if edited.any():
            yield curve, edited


def edited_paths(action: bpy.types.Action | None, slot: Any | None, first: float) -> set[str]:
    """Properties with keys of the animator's in an action, where that is another try of a take that begins at
    the frame ``first``.
    """
    if action is None or _MADE not in action or abs(action[_FIRST] - first) > 1e-3:
        return set()
    return {curve.data_path for curve, _ in edited_keys(action, slot)}


def keep_edits(
    channels: ActionChannels, action: bpy.types.Action | None, slot: Any | None, first: float, rate: float
) -> KeptEdits:
    """Take the animator's keys in ``action`` over into the new ``channels``, where that is another try of the
    same take, one that begins at the frame ``first`` too; ``rate`` is frames a second.  The new channels have
    a key in every frame of what was edited.
    """
    kept = KeptEdits()
    if not edited_paths(action, slot, first):
        return kept
    edited = {(c.data_path, c.array_index): (c, mask) for c, mask in edited_keys(action, slot)}
    paths: dict[str, list[Path]] = defaultdict(list)
    for path in edited:
        paths[path[0]].append(path)
    own = {(c.data_path, c.array_index): c for c in channels.bag.fcurves}
    old = {(c.data_path, c.array_index): c for c in curves_in(action, slot)}
    for name, listed in paths.items():
        frames = np.unique(np.concatenate([_frames(edited[p][0])[edited[p][1]] for p in listed]))
        if all(p in own for p in old if p[0] == name):
            _take_over(name, own, old, frames, _EASE * rate)
        else:
            for p in [p for p in old if p[0] == name]:
                mine = own.get(p) or new_like(channels, old[p])
                _clear(mine)
                copy_whole(mine, old[p])
                mine.update()
        group = old[listed[0]].group
        bone = name.startswith("pose.bones") and group is not None
        kept.add(group.name if bone else name, frames)
        kept.prints += [prints(edited[p][0])[edited[p][1]] for p in listed]
    return kept


def _take_over(
    name: str,
    own: dict[Path, bpy.types.FCurve],
    old: dict[Path, bpy.types.FCurve],
    frames: Array,
    ease: float,
) -> None:
    """Put the animator's keys at ``frames`` of one property over the new ones, one in every frame, which lead
    to them within ``ease`` frames.
    """
    here = sorted(p for p in own if p[0] == name and p in old)
    curves, before = [own[p] for p in here], [old[p] for p in here]
    turn_alike({p: own[p] for p in here}, {p: old[p] for p in here}, float(frames[0]))
    theirs = _frames(before[0])
    spans = _spans(frames, theirs[~np.isin(theirs, frames)])
    quaternion = name.endswith("rotation_quaternion") and len(here) == 4
    ends = [(a, b, *(_change(before, curves, f, quaternion) for f in (a, b))) for a, b in spans]
    keys = _frames(curves[0])
    inside = np.zeros(len(keys), bool)
    for a, b in spans:
        inside |= (keys >= a - 1e-3) & (keys <= b + 1e-3)
    for curve in curves:  # from the last one on, so that indices stay
        for row in np.flatnonzero(inside)[::-1]:
            curve.keyframe_points.remove(curve.keyframe_points[row], fast=True)
    keys = keys[~inside]
    for part in _PARTS:
        values = np.stack([_part(curve, part)[:, 1] for curve in curves], axis=1)
        for side in (0, 1):  # what follows an end of a span, and what comes before one
            values = _led(values, keys, ends, side, ease, quaternion)
        for c, curve in enumerate(curves):
            places = _part(curve, part)
            places[:, 1] = values[:, c]
            curve.keyframe_points.foreach_set(part, places.astype(np.float32).ravel())
    for curve, past in zip(curves, before, strict=True):
        copy_keys(curve, past, [k for k in past.keyframe_points if np.isin(np.float32(k.co[0]), frames)])
        curve.update()


def _spans(frames: Array, others: Array) -> list[tuple[float, float]]:
    """Stretches of the animator's keys with no other keys in between: first and last frames."""
    spans = [[float(frames[0]), float(frames[0])]]
    for frame in frames[1:]:
        if ((others > spans[-1][1]) & (others < frame)).any():
            spans.append([float(frame), float(frame)])
        else:
            spans[-1][1] = float(frame)
    return [(a, b) for a, b in spans]


def _led(
    values: Array, keys: Array, ends: list[tuple[float, float, Array, Array]], side: int, ease: float,
    quaternion: bool,
) -> Array:  # fmt: skip
    """Values (N, C) of new keys, changed after (``side`` 0) or before (1) the animator's keys, ever less with
    the distance from them.
    """
    if not ends:
        return values
    firsts, lasts = np.array([e[0] for e in ends]), np.array([e[1] for e in ends])
    if side == 0:
        i = np.searchsorted(lasts, keys) - 1
        far = keys - lasts[np.maximum(i, 0)]
        gap = np.append(firsts[1:], np.inf)[np.maximum(i, 0)] - lasts[np.maximum(i, 0)]
        there = i >= 0
    else:
        i = np.searchsorted(firsts, keys)
        there = i < len(ends)
        i = np.minimum(i, len(ends) - 1)
        far = firsts[i] - keys
        gap = firsts[i] - np.insert(lasts[:-1], 0, -np.inf)[i]
    u = np.clip(far / np.minimum(ease, gap), 0, 1)
    weight = np.where(there, 1 - u * u * (3 - 2 * u), 0.0)[:, None]
    changes = np.stack([e[3 - side] for e in ends])[np.clip(i, 0, len(ends) - 1)]
    if quaternion:
        return quat_mul(quat_from_rotvec(changes * weight), values)
    return values + changes * weight


def _change(old: list[Any], new: list[Any], frame: float, quaternion: bool) -> Array:
    """What leads from the new curves to the old ones at a frame: differences (C,), or a rotation vector."""
    before, after = (np.array([c.evaluate(frame) for c in curves]) for curves in (old, new))
    if not quaternion:
        return before - after
    turn = quat_mul(quat_normalize(before), quat_conjugate(quat_normalize(after)))
    return quat_to_rotvec(turn if turn[0] >= 0 else -turn)


def prints(curve: bpy.types.FCurve) -> Array:
    """A number (N,) uint32 for each key of a curve."""
    count = len(curve.keyframe_points)
    kinds = np.empty(count, np.intc)
    curve.keyframe_points.foreach_get("type", kinds)
    bits = _part(curve, "co").view(np.uint32).reshape(count, 2)
    seed = zlib.crc32(f"{curve.data_path}[{curve.array_index}]".encode())
    mixed = (bits[:, 0] ^ np.uint32(seed)) * np.uint32(0x9E3779B1)
    mixed = (mixed ^ (mixed >> np.uint32(15)) ^ bits[:, 1]) * np.uint32(0x85EBCA6B)
    return (mixed ^ (mixed >> np.uint32(13)) ^ kinds.astype(np.uint32)) * np.uint32(0xC2B2AE35)


def _part(curve: bpy.types.FCurve, part: str) -> Array:
    places = np.empty(2 * len(curve.keyframe_points), np.float32)
    curve.keyframe_points.foreach_get(part, places)
    return places.reshape(-1, 2)


def _frames(curve: bpy.types.FCurve) -> Array:
    return _part(curve, "co")[:, 0]


def _clear(curve: bpy.types.FCurve) -> None:
    while len(curve.keyframe_points):
        curve.keyframe_points.remove(curve.keyframe_points[-1], fast=True)
