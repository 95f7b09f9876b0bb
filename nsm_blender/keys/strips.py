"""Takes as strips of the NLA, and back: on tracks of their own, with what lies below still played."""

from __future__ import annotations

from typing import Any

import bpy

from nsm_core.errors import NsmError

from ..animation.channels import assign

TRACK = "NSM"


def push(target: bpy.types.Object, action: bpy.types.Action, slot: Any | None) -> bpy.types.NlaStrip:
    """Put an action of ``target`` on an NSM track as a strip over its own frames, and take it off the object
    where it is the active one.

    What other tracks hold goes on to play before and after it; where they hold nothing, its last pose is held
    as the action itself holds it.  NsmError in the NLA's tweak mode, or
    where the action is a strip already.
    """
    data = target.animation_data or target.animation_data_create()
    require_no_tweaking(target)
    if strip_of(target, action) is not None:
        raise NsmError(f"{action.name} is on the NLA of {target.name} already; choose Back to take it off.")
    start, end = action.frame_range
    track = _free_track(data, start, end)
    below = any(len(other.strips) for other in data.nla_tracks if other != track)
    alone = "HOLD_FORWARD" if len(track.strips) else "HOLD"
    strip = track.strips.new(action.name, round(start), action)
    if slot is not None and hasattr(strip, "action_slot"):
        strip.action_slot = slot
    strip.frame_end, strip.frame_start = end, start
    strip.blend_type = "REPLACE"
    strip.extrapolation = "NOTHING" if below else alone
    if data.action == action:
        assign(target, None, None)
    target.update_tag(refresh={"TIME"})
    return strip


def pull(target: bpy.types.Object, action: bpy.types.Action) -> None:
    """Take the strip of an action off the NSM tracks of ``target``, and its track where that is empty then;
    the action itself is left as it is.
    """
    require_no_tweaking(target)
    found = strip_of(target, action)
    if found is not None:
        found[0].strips.remove(found[1])
    tracks = target.animation_data.nla_tracks if target.animation_data is not None else ()
    for track in [t for t in tracks if _is_ours(t) and not len(t.strips)]:
        tracks.remove(track)
    target.update_tag(refresh={"TIME"})


def strip_of(
    target: bpy.types.Object | None, action: bpy.types.Action | None
) -> tuple[bpy.types.NlaTrack, bpy.types.NlaStrip] | None:
    """The strip that plays an action on an NSM track of ``target``, after its track; None where there is
    none.
    """
    data = target.animation_data if target is not None else None
    if data is None or action is None:
        return None
    return next(
        ((t, s) for t in data.nla_tracks if _is_ours(t) for s in t.strips if s.action == action), None
    )


def _is_ours(track: bpy.types.NlaTrack) -> bool:
    return track.name.partition(".")[0] == TRACK


def _free_track(data: bpy.types.AnimData, start: float, end: float) -> bpy.types.NlaTrack:
    """The uppermost track where it is ours and has room, else a new one on top of all: a take rules what was
    there before it.
    """
    top = data.nla_tracks[-1] if len(data.nla_tracks) else None
    fits = top is not None and all(s.frame_end <= start or s.frame_start >= end for s in top.strips)
    if top is not None and fits and _is_ours(top) and not (top.lock or top.mute):
        return top
    track = data.nla_tracks.new()
    track.name = TRACK
    return track


def require_no_tweaking(target: bpy.types.Object) -> None:
    """Raise an NsmError where the NLA of an object cannot be changed."""
    if target.animation_data is not None and target.animation_data.use_tweak_mode:
        raise NsmError(f"{target.name} is in the NLA's tweak mode; leave it (Tab in the NLA editor) first.")
