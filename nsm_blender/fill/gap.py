"""Which frames of a character's animation are missing: found among its keys."""

from __future__ import annotations

import re
from dataclasses import dataclass

import bpy
import numpy as np

from nsm_core.control.inbetween import MAX_FRAMES, MIN_FRAMES
from nsm_core.conventions import FPS
from nsm_core.errors import GapError
from nsm_core.rotations import Array

from ..animation.channels import ActionChannels, channels_of
from ..keys.edits import prints
from ..rigs.bone_map import bone_map_of
from .key_arrays import frames_of
from .spec import FillSpec

# On an action: numbers of the last fill's keys, the poses that it is between, and which bones got keys.
MADE, SPAN, BONES = "nsm_filled", "nsm_fill", "nsm_fill_bones"
_BODY = re.compile(r'pose\.bones\["((?:[^"\\]|\\.)*)"\]\.(location|rotation_\w+)$')
_POSE = 0.5  # share of a body's keyed bones that have a key where there is a pose
_SAME = 1e-3  # frames by which two keys are at one place


@dataclass(frozen=True)
class Stretch:
    """One gap: frames of the scene of the poses before and after it, which stay."""

    start: float
    end: float

    @property
    def frames(self) -> Array:
        """The whole frames (N,) in between."""
        return np.arange(np.floor(self.start + _SAME) + 1, np.ceil(self.end - _SAME))

    def count(self, fps: float) -> int:
        """How many frames are missing at the 30 a second of the network."""
        return max(round((self.end - self.start) * FPS / fps) - 1, MIN_FRAMES)


@dataclass(frozen=True)
class AskedGap:
    """The ``stretches`` to fill from the pose at ``start`` to the one at ``end``; ``again`` where these very
    frames were filled before.  ``first`` and ``last`` are the frames between which there are keys.
    """

    start: float
    end: float
    stretches: tuple[Stretch, ...]
    again: bool
    first: float
    last: float


def own_channels(character: bpy.types.Object) -> ActionChannels:
    """The channels that a character plays; GapError where it has no action."""
    channels = channels_of(character)
    if channels is None:
        raise GapError(
            f"{character.name} has no action with keys of its own; key the pose before and the pose after "
            "the missing frames, or press Merge Strips where the NLA plays it."
        )
    return channels


def body_bones(character: bpy.types.Object) -> set[str]:
    """Names of the bones that keys of a performance move: those of the joints, controls, and what carries
    the hips.
    """
    bone_map = bone_map_of(character)
    pulled = {bone for limb in bone_map.limbs.values() for bone in limb.bones}
    above = {bone.name for bone in character.data.bones[bone_map.hips].parent_recursive}
    return {*bone_map.joints.values()} | pulled | above


def body_curves(character: bpy.types.Object, channels: ActionChannels) -> dict[str, list[bpy.types.FCurve]]:
    """Curves of places and turns of the body's bones, by their bone, and those of the object under ""."""
    bones, found = body_bones(character), dict[str, list[bpy.types.FCurve]]()
    for curve in channels.bag.fcurves:
        match = _BODY.match(curve.data_path)
        name = bpy.utils.unescape_identifier(match[1]) if match else ""
        if name in bones or not match and re.match(r"(location|rotation_\w+)$", curve.data_path):
            found.setdefault(name, []).append(curve)
    return found


def poses(curves: dict[str, list[bpy.types.FCurve]], made: Array) -> Array:
    """Frames (K,) at which the body is posed: at least half of the bones that have keys have one there.
    Keys with numbers in ``made`` do not count.
    """
    each = [np.unique(np.concatenate([_standing(c, made) for c in own])) for own in curves.values()]
    each = [frames for frames in each if len(frames)]
    if not each:
        return np.zeros(0)
    frames, counts = np.unique(np.concatenate(each).round(3), return_counts=True)
    return frames[counts >= _POSE * len(each)]


def made_keys(channels: ActionChannels) -> Array:
    """Numbers of the keys that the last fill of an action has made, as ``edits.prints``."""
    return np.frombuffer(channels.action.get(MADE, b""), np.uint32)


def selected_keys(character: bpy.types.Object) -> tuple[float, float, frozenset[str] | None] | None:
    """First and last frame of the selected keys of a character's body, and the bones that have some (None
    where all with keys have); None where fewer than two frames have some.
    """
    channels = channels_of(character)
    curves = {} if channels is None else body_curves(character, channels)
    each = {
        name: [key.co.x for curve in own for key in curve.keyframe_points if key.select_control_point]
        for name, own in curves.items()
    }
    frames = [frame for own in each.values() for frame in own]
    if not frames or max(frames) - min(frames) < _SAME:
        return None
    bones = frozenset(name for name, own in each.items() if own)
    return min(frames), max(frames), None if bones >= curves.keys() - {""} else bones


def pose_span(character: bpy.types.Object) -> tuple[float, float] | None:
    """First and last frame at which a character's body is posed; None where there are no two."""
    channels = channels_of(character)
    keyed = np.zeros(0)
    if channels is not None:
        keyed = poses(body_curves(character, channels), np.zeros(0, np.uint32))
    return (float(keyed[0]), float(keyed[-1])) if len(keyed) > 1 else None


def find(spec: FillSpec, channels: ActionChannels, now: float, fps: float) -> AskedGap:
    """What a spec asks for among the keys of its character; GapError where there is nothing to fill."""
    who, curves = spec.character.name, body_curves(spec.character, channels)
    made = made_keys(channels)
    every = poses(curves, np.zeros(0, np.uint32))
    if not len(every):
        raise GapError(
            f"{who} has no keys on its body; key the pose before and the pose after the missing frames."
        )
    at = now if spec.at is None else spec.at
    last_fill = tuple(channels.action.get(SPAN, ()))
    if spec.start is not None and spec.end is not None:
        start, end = spec.start, spec.end
    elif last_fill and last_fill[0] < at < last_fill[1]:
        start, end = last_fill
    else:
        start, end = _around(at, every, who)
    again = bool(last_fill) and max(abs(start - last_fill[0]), abs(end - last_fill[1])) < _SAME
    if not end - start > _SAME:
        raise GapError(
            f"The gap ends at frame {end:g}, not after frame {start:g}; give its end a later frame."
        )
    made = made if again else np.zeros(0, np.uint32)
    keyed = poses(curves, made)
    frames = np.concatenate([_standing(curve, made) for own in curves.values() for curve in own])
    if not (frames <= start + _SAME).any():
        raise GapError(
            f"{who} has no key at or before frame {start:g}; key the pose that is left, or begin later."
        )
    if not (frames >= end - _SAME).any():
        raise GapError(
            f"{who} has no keys after the gap, at frame {end:g} or later; key the pose that is to be reached."
        )
    inner = [] if spec.replace else keyed[(keyed > start + _SAME) & (keyed < end - _SAME)].tolist()
    ends = [start, *inner, end]
    stretches = [Stretch(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]
    stretches = [stretch for stretch in stretches if len(stretch.frames)]
    if not stretches:
        raise GapError(
            f"No frame is missing between {start:g} and {end:g}; choose keys that are further apart"
            + (", or tick Replace Keys." if inner else ".")
        )
    for stretch in stretches:
        _require_short(stretch, fps)
    return AskedGap(start, end, tuple(stretches), again, float(frames.min()), float(frames.max()))


def _around(at: float, keyed: Array, who: str) -> tuple[float, float]:
    """The poses on both sides of a frame; where it lies on one, the gap after it, else the one before it."""
    before, after = keyed[keyed <= at + _SAME], keyed[keyed > at + _SAME]
    if not len(before):
        raise GapError(f"{who} has no keys before frame {at:g}; key a pose there, or go into the gap.")
    on = at - before[-1] < _SAME and len(before) > 1
    if on and (not len(after) or after[0] - before[-1] < 1 + _SAME) and before[-1] - before[-2] > 1 + _SAME:
        return float(before[-2]), float(before[-1])
    if not len(after):
        raise GapError(
            f"{who} has no keys after the gap, after frame {at:g}; key the pose that is to be reached."
        )
    return float(before[-1]), float(after[0])


def _require_short(stretch: Stretch, fps: float) -> None:
    if stretch.count(fps) > MAX_FRAMES:
        most = int(np.floor((MAX_FRAMES + 1) * fps / FPS)) - 1
        raise GapError(
            f"{len(stretch.frames)} frames are missing between {stretch.start:g} and {stretch.end:g}, and up "
            f"to {most} can be filled at {fps:g} a second; key a pose in between, or choose nearer keys."
        )


def _standing(curve: bpy.types.FCurve, made: Array) -> Array:
    """Frames (K,) of a curve's keys that are none of ``made``."""
    frames = frames_of(curve)
    return frames if not len(made) else frames[~np.isin(prints(curve), made)]
