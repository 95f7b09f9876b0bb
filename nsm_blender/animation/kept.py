"""What a take may change in a file, kept to be put back exactly: the place in time, poses and places, and
actions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import bpy

from .channels import assign, made_since, made_so_far, transform_of
from .identity import exists

# What Python sees where Blender's data was deleted, undone, exchanged or linked meanwhile.
LOST = (ReferenceError, AttributeError, KeyError, TypeError, ValueError, RuntimeError)


class FrameState:
    """The current frame, and what animators have moved there without a key: going to another frame and back
    loses it.
    """

    def __init__(self, scene: bpy.types.Scene) -> None:
        self.scene, self.frame = scene, (scene.frame_current, scene.frame_subframe)
        # Bones by name: Blender tells of an object that is gone, but not of its bones, and writing to these
        # would crash.
        self._moved = [(target, _transforms(target)) for target in scene.objects if target.animation_data]

    def adopt(self, target: bpy.types.Object, bone: str | None, channels: dict[str, Any]) -> None:
        """Put back these channels of an object, or of a bone of it, from now on."""
        for moved, kept in self._moved:
            if moved == target and bone in kept:
                kept[bone] = kept[bone] | channels

    def restore(self, always: bool = False) -> None:
        """Go back to the frame, where the scene is at another one, and put back what was moved there; what is
        gone is passed over.

        ``always``: what was moved is put back at the same frame too.
        """
        if (self.scene.frame_current, self.scene.frame_subframe) != self.frame:
            self.scene.frame_set(self.frame[0], subframe=self.frame[1])
        elif not always:
            return
        for target, kept in self._moved:
            with suppress(*LOST):
                for name, moving in _with_bones(target):
                    if name in kept:
                        _set(moving, kept[name])


@contextmanager
def frame_kept(scene: bpy.types.Scene) -> Iterator[None]:
    """Go to other frames inside; the present one is put back at the end, with what was moved there without a
    key.
    """
    state = FrameState(scene)
    try:
        yield
    finally:
        with suppress(*LOST):
            state.restore()
            bpy.context.view_layer.update()


class SceneState:
    """What a take may disturb before its keys are made: the current frame, the character's pose and the
    places of ``moved`` objects.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        armature: bpy.types.Object | None,
        moved: Iterable[bpy.types.Object] = (),
    ) -> None:
        self.scene, self.armature = scene, armature
        self._frame = FrameState(scene)
        self.places = [(moving, transform_of(moving)) for moving in moved]
        self.pose = (
            [(bone.name, transform_of(bone)) for bone in armature.pose.bones] if armature is not None else []
        )

        bones = armature.pose.bones if armature is not None and armature.pose is not None else ()
        self._numbers = [(bone.name, _numbers_of(bone)) for bone in bones if len(bone.keys())]

    def targets(self) -> list[bpy.types.Object]:
        """The armature and the moved objects."""
        return [*([] if self.armature is None else [self.armature]), *(moving for moving, _ in self.places)]

    def adopt(self, target: bpy.types.Object, bone: str | None, channels: dict[str, Any]) -> None:
        """Put back these channels of an object, or of a bone of it, from now on: others have set them."""
        self._frame.adopt(target, bone, channels)
        if bone is None:
            kept = dict(self.places)
            self.places = list((kept | {target: kept.get(target, {}) | channels}).items())
        elif target == self.armature:
            self.pose = [(name, own | channels if name == bone else own) for name, own in self.pose]

    def restore(self, always: bool = False) -> None:
        """Put frame, pose and places back exactly; what no longer exists, or can no longer be written, is
        passed over.

        ``always`` as in ``FrameState.restore``.
        """
        with suppress(*LOST):
            self._frame.restore(always)
        with suppress(*LOST):
            for bone, transform in self._bones():
                _set(bone, transform)
            for name, numbers in self._numbers:
                _set_numbers(self.armature.pose.bones[name], numbers)
        for moving, place in self.places:
            _set(moving, place)
        with suppress(*LOST):
            bpy.context.view_layer.update()

    def _bones(self) -> list[tuple[bpy.types.PoseBone, dict[str, Any]]]:
        """The bones that still exist, each with its channels; one that was renamed is known by its place
        among them.
        """
        bones = list(self.armature.pose.bones) if self.armature is not None else []
        kept, now = dict(self.pose), {bone.name for bone in bones}
        found = [(bone, kept[bone.name]) for bone in bones if bone.name in kept]
        if len(bones) == len(self.pose):
            pairs = zip(bones, self.pose, strict=True)
            found += [
                (bone, transform)
                for bone, (name, transform) in pairs
                if bone.name not in kept and name not in now
            ]
        return found


@dataclass
class _Animation:
    """The animation of one object before a take."""

    target: bpy.types.Object
    had_data: bool
    action: bpy.types.Action | None
    slot: Any | None
    slot_name: str
    fake_user: bool

    @classmethod
    def of(cls, target: bpy.types.Object) -> _Animation:
        data = target.animation_data
        action = data.action if data else None
        slot = getattr(data, "action_slot", None) if action else None
        return cls(
            target,
            data is not None,
            action,
            slot,
            getattr(data, "last_slot_identifier", ""),
            bool(action and action.use_fake_user),
        )

    def restore(self) -> None:
        try:
            self._give_back()
        finally:  # also where the object is gone by now
            if self.action is not None and exists(self.action):
                self.action.use_fake_user = self.fake_user

    def _give_back(self) -> None:
        data = self.target.animation_data
        if data is None:
            return
        if not self.had_data:
            self.target.animation_data_clear()
            return
        if data.action != self.action or getattr(data, "action_slot", None) != self.slot:
            assign(self.target, self.action, self.slot)
        if hasattr(data, "last_slot_identifier"):
            data.last_slot_identifier = self.slot_name


class Kept:
    """Frame, poses, places and actions of ``targets``, and what actions the add-on has made, before a take is
    keyed.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        targets: Iterable[bpy.types.Object],
        replaced: Iterable[bpy.types.Action] = (),
    ) -> None:
        targets = list(dict.fromkeys(targets))
        armature = next((t for t in targets if t.type == "ARMATURE"), None)
        self._mark = made_so_far()
        self._animations = [_Animation.of(target) for target in targets]
        # What a take has replaced is kept in the file by this alone.
        self._fake_users = [(action, action.use_fake_user) for action in replaced]
        self._state = SceneState(scene, armature, targets)

    def restore(self) -> None:
        """Put everything back exactly and remove the actions that the add-on made since; what no longer
        exists is passed over.
        """
        self._restore(made_since(self._mark))

    def put_on(self) -> None:
        """Put everything back exactly, animation that was taken off altogether, too; actions made since are
        left in the file.
        """
        for animation in self._animations:
            if animation.had_data:
                _try(lambda kept=animation: kept.target.animation_data_create())
        self._restore(())
        for action, fake in self._fake_users:
            _try(lambda action=action, fake=fake: setattr(action, "use_fake_user", fake))

    @property
    def actions(self) -> list[bpy.types.Action]:
        """The actions that played, but for those that are gone."""
        played = [animation.action for animation in self._animations if animation.action is not None]
        return [action for action in dict.fromkeys(played) if exists(action)]

    def _restore(self, gone: Iterable[bpy.types.Action]) -> None:
        for animation in self._animations:
            _try(animation.restore)
        for action in gone:
            _try(lambda action=action: bpy.data.actions.remove(action))
        # The old actions play once more, before the poses that were not keyed.
        _try(bpy.context.view_layer.update)
        _try(lambda: self._state.restore(always=True))


@contextmanager
def restored_on_failure(kept: Kept) -> Iterator[Kept]:
    """Put everything back where anything whatever is raised inside, a break included."""
    try:
        yield kept
    except BaseException:
        kept.restore()
        raise


def _transforms(target: bpy.types.Object) -> dict[str | None, dict[str, Any]]:
    """Transforms of an object, under None, and of its bones by name."""
    return {name: transform_of(moving) for name, moving in _with_bones(target)}


def _with_bones(
    target: bpy.types.Object,
) -> Iterator[tuple[str | None, bpy.types.Object | bpy.types.PoseBone]]:
    yield None, target
    if target.type == "ARMATURE" and target.pose is not None:
        for bone in target.pose.bones:
            yield bone.name, bone


def _numbers_of(bone: bpy.types.PoseBone) -> dict[str, int | float]:
    """The custom properties of a bone that are numbers: switches of its rig."""
    return {key: value for key, value in bone.items() if isinstance(value, (int, float))}


def _set_numbers(bone: bpy.types.PoseBone, numbers: dict[str, int | float]) -> None:
    for key, value in numbers.items():
        if key in bone and bone[key] != value:
            bone[key] = value
            bone.id_data.update_tag()


def _set(moving: bpy.types.Object | bpy.types.PoseBone, transform: dict[str, Any]) -> None:
    """Set the channels of an object or bone that differ; one that is gone or linked is passed over.

    Whatever is set, be it to what it is, has Blender evaluate and draw the scene anew.
    """
    with suppress(*LOST):
        for channel, value in transform.items():
            if tuple(getattr(moving, channel)) != value:
                setattr(moving, channel, value)


def _try(step: Callable[[], Any]) -> None:
    """Do one step of putting things back; what is gone by now must not keep the others from it."""
    with suppress(*LOST):
        step()
