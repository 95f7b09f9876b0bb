"""A filled motion keyed into a copy of the animator's action: keys outside the gap stay as they are."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import bpy
import numpy as np

from nsm_core.errors import GapError
from nsm_core.rotations import Array

from ..animation.channels import ActionChannels
from ..keys.edits import prints
from .gap import BONES, MADE, SPAN, AskedGap, made_keys
from .key_arrays import Keys, frames_of, generated, merged, read_keys, taken, write_keys
from .values import Moves, led_places, led_turns, path_of, rotation_path

_STILL = 1e-4  # by which a channel without keys may differ from what it is and still gets none
_SAME = 1e-3  # frames by which two keys are at one place
_SHAPED = 1e-5  # by which a curve may differ from a straight line


@dataclass
class GapKeys:
    """Keys being made in the gap from ``start`` to ``end``, one of those between the poses ``outer``, in
    ``channels`` of their own.

    ``kept`` counts the animator's keys in the gap that stay, by their bone.
    """

    character: bpy.types.Object
    channels: ActionChannels
    outer: tuple[float, float]
    replace: bool = False
    start: float = 0.0
    end: float = 0.0
    kept: dict[str, int] = field(default_factory=dict)
    _made: list[Array] = field(default_factory=list)

    def take_out(self) -> None:
        """Take out what the last fill has made; keys that the animator has set since stay."""
        made = made_keys(self.channels)
        for curve in list(self.channels.bag.fcurves):
            mine = np.isin(prints(curve), made)
            if mine.all() and len(mine):
                self.channels.bag.fcurves.remove(curve)
            elif mine.any():
                write_keys(curve, taken(read_keys(curve), ~mine))

    def note(self, asked: AskedGap, bones: frozenset[str] | None) -> None:
        """Note on the action which keys were made, between which poses, and of which bones."""
        if MADE in self.channels.action:  # bytes set over others would end with their first zero
            del self.channels.action[MADE]
        self.channels.action[MADE] = np.concatenate([np.zeros(0, np.uint32), *self._made]).tobytes()
        self.channels.action[SPAN] = [float(asked.start), float(asked.end)]
        self.channels.action[BONES] = "\n".join(sorted(bones or ()))

    def key(self, moves: Moves, rows: Array, free: tuple[bool, bool] = (False, False)) -> None:
        """Key what a bone does: its first and last row are the poses at the gap's ends, ``rows`` (N,) the
        frames of all.  At ends that are ``free`` its channels do not show, whatever they say there.
        """
        bone = self.character.pose.bones[moves.bone]
        if moves.places is not None:
            path, now = path_of(bone.name, "location"), np.array(bone.location)
            old, anchors, there = self._anchors(path, rows, now, free)
            self._write(path, bone.name, rows, led_places(moves.places, anchors, there), old, now)
        if moves.turns is not None:
            path = rotation_path(bone)
            now = np.array(getattr(bone, path.rpartition(".")[2]))
            old, anchors, there = self._anchors(path, rows, now, free)
            values, held = led_turns(bone.rotation_mode, moves.turns, anchors, there)
            self._write(path, bone.name, rows, values, old, now, held)

    def switched(self, path: str, value: float, now: float) -> tuple[bool, bool]:
        """Whether a property has another value than ``value`` at the start and at the end of the gap."""
        old = self._curves(path).get(0)
        there = [now if old is None else old.evaluate(end) for end in (self.start, self.end)]
        return abs(there[0] - value) > _STILL, abs(there[1] - value) > _STILL

    def switch(self, bone: str, path: str, value: float, now: float) -> None:
        """Have a property be ``value`` in the gap, and what it was at its ends."""
        if not any(self.switched(path, value, now)):
            return
        old = self._curves(path).get(0)
        frames = np.array((np.floor(self.start + _SAME) + 1, self.end))
        values = np.array((value, now if old is None else old.evaluate(self.end)))
        if old is None:
            frames, values = np.insert(frames, 0, self.start), np.insert(values, 0, now)
        else:
            self._hold_shape(old)
        self._add(path, 0, bone, frames, values, np.ones(len(frames), bool))

    def _anchors(
        self, path: str, rows: Array, now: Array, free: tuple[bool, bool]
    ) -> tuple[dict[int, bpy.types.FCurve], Array, Array]:
        """The curves of a property, the rows (K,) at which it has its value already, and these (K, C)."""
        old = self._curves(path)
        inner = np.concatenate([np.zeros(0), *(self._inner(curve) for curve in old.values())])
        if self.replace:
            for curve in old.values():
                keys = read_keys(curve)
                if self._inside(keys["co"][:, 0]).any():
                    self._hold_shape(curve)  # while it is still what is seen outside
                    keys = read_keys(curve)
                    write_keys(curve, taken(keys, ~self._inside(keys["co"][:, 0])))
            inner = np.zeros(0)
        ends = [end for end, off in ((self.start, free[0]), (self.end, free[1])) if not off]
        frames = np.unique(np.round([*ends, *inner], 3))
        anchors = np.unique(np.array([np.abs(rows - frame).argmin() for frame in frames], int))
        there = np.array([[old[i].evaluate(rows[a]) if i in old else now[i] for i in range(len(now))]
                          for a in anchors.tolist()])  # fmt: skip
        return old, anchors, there

    def _write(
        self,
        path: str,
        bone: str,
        rows: Array,
        values: Array,
        old: dict[int, bpy.types.FCurve],
        now: Array,
        held: Array | None = None,
    ) -> None:
        """Key values (N, C) of a property in the gap."""
        if not old and np.abs(values - now).max() < _STILL:
            return
        inner = slice(1, -1)
        kept = {round(f, 3) for curve in old.values() for f in self._inner(curve).tolist()}
        if kept:
            self.kept[bone] = self.kept.get(bone, 0) + len(kept)
        holds = None if held is None else held[inner]
        for index in range(values.shape[1]):
            frames, own, hold = rows[inner], values[inner, index], holds
            if index not in old:  # it stands outside the gap where it stood
                frames, own = rows, np.concatenate((now[index : index + 1], own, now[index : index + 1]))
                hold = None if held is None else np.concatenate(([False], holds, [False]))
            else:
                self._hold_shape(old[index])
            self._add(path, index, bone, frames, own, hold)

    def _hold_shape(self, curve: bpy.types.FCurve) -> None:
        """Give a curve keys where it would else look otherwise outside the gap: at the ends of the gap, and
        up to its next key beyond them where it is no straight line there.
        """
        frames = frames_of(curve)
        before, after = frames[frames <= self.start + _SAME], frames[frames >= self.end - _SAME]
        wanted: list[Array] = []
        for beyond, end in ((before[-1:], self.start), (after[:1], self.end)):
            if len(beyond) and abs(beyond[0] - end) < _SAME:
                continue
            if not len(beyond) or end not in self.outer:
                wanted.append(np.array([end]))
                continue
            low, high = sorted((float(beyond[0]), float(end)))
            each = np.append(np.arange(np.floor(low + _SAME) + 1, high - _SAME), end)
            told = np.array([curve.evaluate(f) for f in each])
            line = np.interp(each, (low, high), (curve.evaluate(low), curve.evaluate(high)))
            wanted.append(each if np.abs(told - line).max() > _SHAPED else np.array([end]))
        if wanted:
            every = np.unique(np.concatenate(wanted))
            self._insert(curve, generated(every, np.array([curve.evaluate(f) for f in every])))

    def _add(
        self, path: str, index: int, bone: str, frames: Array, values: Array, held: Array | None
    ) -> None:
        """Add keys to a curve of a property, which is made where there is none."""
        bag = self.channels.bag
        curve = self._curves(path).get(index)
        if curve is None:
            curve = bag.fcurves.new(path, index=index)
            curve.group = bag.groups.get(bone) or bag.groups.new(bone)
        self._insert(curve, generated(frames, values, held))

    def _insert(self, curve: bpy.types.FCurve, new: Keys) -> None:
        keys, mine = merged(read_keys(curve), new)
        write_keys(curve, keys)
        self._made.append(prints(curve)[mine])

    def _curves(self, path: str) -> dict[int, bpy.types.FCurve]:
        return {c.array_index: c for c in self.channels.bag.fcurves if c.data_path == path}

    def _inner(self, curve: bpy.types.FCurve) -> Array:
        """Frames of a curve's keys inside the gap."""
        frames = frames_of(curve)
        return np.asarray(frames[self._inside(frames)], float)

    def _inside(self, frames: Array) -> Array:
        return (frames > self.start + _SAME) & (frames < self.end - _SAME)


def require_open(curves: Iterable[bpy.types.FCurve], who: str) -> None:
    """Raise GapError where curves are muted, locked or changed by modifiers, so that keys on them would not
    be what is seen, or may not be made.
    """
    for curve in curves:
        group = curve.group
        name = f"{group.name + ' ' if group is not None else ''}{curve.data_path.rpartition('.')[2]}"
        name = name.replace("_", " ")
        if curve.mute or group is not None and group.mute:
            raise GapError(
                f"The channel {name} of {who} is muted, so that keys on it do not play; unmute it (the "
                "checkbox in the Graph Editor's channels) and fill again."
            )
        if curve.lock or group is not None and group.lock:
            raise GapError(
                f"The channel {name} of {who} is locked; unlock it (the padlock in the Graph Editor's "
                "channels) and fill again."
            )
        changing = [m for m in curve.modifiers if not m.mute and m.type != "CYCLES"]
        if changing:
            raise GapError(
                f"The channel {name} of {who} has a modifier ({changing[0].type.title().replace('_', ' ')}) "
                "that changes what keys say; bake the channel, or mute the modifier, and fill again."
            )


__all__ = ["GapKeys", "require_open"]
