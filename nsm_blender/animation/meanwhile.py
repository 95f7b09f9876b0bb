"""What others do to a character and its things between two steps of a take: noticed, and left as it is.

Scripts, timers and other windows may pose, move, key or give an action while a take is shown or keyed.  What
they change is told from what the take itself left behind; it goes on as they left it when the take is broken
off, and is never put back with what the take has disturbed.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from nsm_core.rotations import Array

from .channels import assign, curves_in, transform_of
from .identity import exists, identity
from .kept import LOST, SceneState

_WIDTHS = {
    "location": 3, "rotation_quaternion": 4, "rotation_euler": 3, "rotation_axis_angle": 4, "scale": 3,
}  # fmt: skip
_SAME = 1e-5  # by which a value may differ from the one that its curve plays
_Print = dict[tuple[str, int], Array]  # (K, 2) frames and values of the keys, by path and index


@dataclass
class _Left:
    """One object as a take left it: its channels, its bones' (B, 17) by their names, and what animates it."""

    target: bpy.types.Object
    own: dict[str, Any]
    names: list[str]
    bones: Array
    animation: tuple[bool, int | str | None, Any]
    prints: _Print | None  # where the take is being keyed


class Meanwhile:
    """What may be put back of a scene (``states``), and what others have made of it since it was left.

    ``left`` is called whenever a take leaves the scene to others, ``look`` when it goes on.
    """

    def __init__(self, scene: bpy.types.Scene, states: Sequence[SceneState]) -> None:
        self.scene, self._states = scene, states
        self.targets = list(dict.fromkeys(target for state in states for target in state.targets()))
        self._own = {target: _animation(target) for target in self.targets}
        self._left: list[_Left] = []
        self._frame: tuple[int, float] | None = None  # at which the take left the scene
        self._chosen: tuple[int, float] | None = None  # by others since the take began
        self._animations: dict[bpy.types.Object, tuple[bool, Any, Any]] = {}
        self._keys: list[tuple[bpy.types.Object, str, int, float, float]] = []

    @property
    def keyed(self) -> bool:
        """Whether actions of the take's own play on what it moves."""
        return any(exists(target) and _animation(target) != self._own[target] for target in self.targets)

    def left(self) -> None:
        """Note what the take leaves behind."""
        keyed = self.keyed
        if keyed:
            bpy.context.view_layer.update()  # as it will be when others see it
        self._frame = _frame_of(self.scene)
        self._left = [
            _Left(
                target, transform_of(target), *_bones(target), _animation(target),
                _prints(target) if keyed else None,
            ) for target in self.targets if exists(target)
        ]  # fmt: skip

    def look(self) -> str:
        """Return what others have changed that the take stands on, in the words "X was posed"; empty where it
        can go on.  What they have changed is no longer put back.
        """
        if not self._left:
            return ""
        left, self._left = self._left, []  # each change is told of once
        elsewhere = _frame_of(self.scene) != self._frame
        if elsewhere:
            self._chosen = _frame_of(self.scene)
        bpy.context.view_layer.update()
        told = [self._changed(each, elsewhere) for each in left if exists(each.target)]
        return next(filter(None, told), "")

    def restore(self) -> None:
        """Put back what the take has disturbed; the scene is then as it would be without it."""
        for state in self._states:
            state.restore()
        self.go_to_chosen()

    def settle(self) -> None:
        """As ``restore``, once the take has taken its own actions off: the animation that others gave, and
        the keys that they made, are there.
        """
        self.restore()
        for target, (had, action, slot) in self._animations.items():
            with suppress(*LOST):
                if had:
                    assign(target, action if action is not None and exists(action) else None, slot)
                elif target.animation_data is not None:
                    target.animation_data_clear()
        for target, path, index, at, value in self._keys:
            with suppress(*LOST):
                _insert(target, path, index, at, value, _frame_of(self.scene))
        if self._keys or self._animations:
            with suppress(*LOST):
                bpy.context.view_layer.update()

    def go_to_chosen(self) -> None:
        """Go to the frame that others have chosen while the take was made."""
        with suppress(*LOST):
            if self._chosen is not None and _frame_of(self.scene) != self._chosen:
                self.scene.frame_set(self._chosen[0], subframe=self._chosen[1])

    def _changed(self, left: _Left, elsewhere: bool) -> str:
        target, name, told = left.target, left.target.name, ""
        if left.prints is not None and _animation(target) != left.animation:
            data = target.animation_data
            slot = getattr(data, "action_slot", None) if data is not None and data.action else None
            self._animations[target] = data is not None, data and data.action, slot
            told = f"The animation of {name} was exchanged or removed"
        elif left.prints is not None and (made := _made(left.prints, _prints(target))) is not None:
            self._keys += [(target, *key) for key in made]
            told = f"Keys of {name} were made or removed"
        if elsewhere:  # another frame has moved it
            return told
        own, at = transform_of(target), None if left.prints is None else sum(_frame_of(self.scene))
        changed = {c: own[c] for c in own if own[c] != left.own[c] and not _ruled(target, c, own[c], at)}
        moved = self._adopt(target, None, changed)
        names, bones = _bones(target)
        for row in np.flatnonzero((bones != left.bones).any(1)) if names == left.names else ():
            bone = names[row]
            prefix, own = _prefix(bone), transform_of(target.pose.bones[bone])
            differ = _channels(bones[row] != left.bones[row])
            changed = {c: own[c] for c in differ if not _ruled(target, prefix + c, own[c], at)}
            moved |= self._adopt(target, bone, changed)
        return told or (f"{name} was moved or posed" if moved else "")

    def _adopt(self, target: bpy.types.Object, bone: str | None, changed: dict[str, Any]) -> bool:
        for state in self._states if changed else ():
            state.adopt(target, bone, changed)
        return bool(changed)


def _frame_of(scene: bpy.types.Scene) -> tuple[int, float]:
    return scene.frame_current, scene.frame_subframe


def _animation(target: bpy.types.Object) -> tuple[bool, int | str | None, Any]:
    data = target.animation_data
    action = data.action if data is not None else None
    slot = getattr(data, "action_slot", None) if action is not None else None
    return data is not None, action and identity(action), slot and slot.handle


def _bones(target: bpy.types.Object) -> tuple[list[str], Array]:
    """Names of an armature's bones, and their channels (B, 17)."""
    bones = target.pose.bones if target.type == "ARMATURE" and target.pose is not None else ()
    columns = []
    for channel, width in _WIDTHS.items() if len(bones) else ():
        values = np.empty(len(bones) * width, np.float32)
        bones.foreach_get(channel, values)
        columns.append(values.reshape(-1, width))
    return [bone.name for bone in bones], np.concatenate(columns, axis=1) if columns else np.zeros((0, 17))


def _prefix(bone: str) -> str:
    return f'pose.bones["{bpy.utils.escape_identifier(bone)}"].'


def _channels(differs: Array) -> list[str]:
    """Names of those of a bone's channels (17,) of which something differs."""
    starts = np.cumsum([0, *_WIDTHS.values()])
    return [c for c, at in zip(_WIDTHS, starts, strict=False) if differs[at : at + _WIDTHS[c]].any()]


def _prints(target: bpy.types.Object) -> _Print:
    """Frames and values of all keys of an object's action."""
    data = target.animation_data
    prints: _Print = {}
    if data is None or data.action is None:
        return prints
    for curve in curves_in(data.action, getattr(data, "action_slot", None)):
        places = np.empty(2 * len(curve.keyframe_points), np.float32)
        curve.keyframe_points.foreach_get("co", places)
        prints[curve.data_path, curve.array_index] = places.reshape(-1, 2)
    return prints


def _made(before: _Print, now: _Print) -> list[tuple[str, int, float, float]] | None:
    """The keys that are new, by path, index, frame and value; None where no key has changed."""
    same = before.keys() == now.keys() and all(np.array_equal(before[k], now[k]) for k in now)
    if same:
        return None
    # With a bone or a property its curves are renamed; the keys are still the take's.
    gone = [(index, keys.tolist()) for (path, index), keys in before.items() if (path, index) not in now]
    made = set()
    for (path, index), keys in now.items():
        known = {tuple(key) for key in before.get((path, index), np.zeros((0, 2))).tolist()}
        if known or (index, keys.tolist()) not in gone:
            made |= {(path, key[0]) for key in keys.tolist() if tuple(key) not in known}
    # A property is keyed as a whole: some of its numbers may be what the take had keyed there.
    return [
        (p, index, *key) for (p, index), keys in now.items() for key in keys.tolist() if (p, key[0]) in made
    ]


def _ruled(target: bpy.types.Object, path: str, values: Sequence[float], at: float | None) -> bool:
    """Whether drivers have given a property these values or, at a frame, the keys that a take makes."""
    data = target.animation_data
    if data is None:
        return False
    if any(curve.data_path == path for curve in data.drivers):
        return True
    if at is None or data.action is None:
        return False
    curves = curves_in(data.action, getattr(data, "action_slot", None))
    played = [abs(c.evaluate(at) - values[c.array_index]) for c in curves if c.data_path == path]
    return bool(played) and max(played) < _SAME


def _insert(
    target: bpy.types.Object, path: str, index: int, at: float, value: float, now: tuple[int, float]
) -> None:
    """Make a key as a script does, of a value that the property has for that moment; then it is as the keys
    have it at the frame ``now``.
    """
    owner, name = target.path_resolve(path, False).data, path.rpartition(".")[2]
    values = getattr(owner, name)
    listed = hasattr(values, "__len__")

    def give(value: float) -> None:
        if listed:
            values[index] = value
        else:
            setattr(owner, name, type(values)(value))

    give(value)
    owner.keyframe_insert(name, index=index if listed else -1, frame=at)
    data = target.animation_data
    for curve in curves_in(data.action, getattr(data, "action_slot", None)):
        if (curve.data_path, curve.array_index) == (path, index):
            give(curve.evaluate(sum(now)))
