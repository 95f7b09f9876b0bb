"""What a take has made and what it replaced, and how that is given back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from nsm_core.body.key_reduction import Reduced

from ..animation.channels import assign, remove_unused, transform_of
from ..animation.identity import exists
from .edits import KeptEdits
from .objects import KeyedThing, take_off_thing
from .switches import set_switches, switches_of

_PLACE = ""  # the object itself, among the names of its bones


@dataclass
class KeyedTake:
    """A take in an action: what was made, where it lies, and what it replaced; ``things`` the same of the
    objects it moved.
    """

    armature: bpy.types.Object
    action: bpy.types.Action
    slot: Any | None
    frame_start: float
    frame_end: float
    fps: float  # of the scene, keys per second
    previous_action: bpy.types.Action | None
    previous_slot: Any | None
    previous_fake_user: bool
    # Bone name, transform channels before the take; or, where it has switches that are keyed, their values.
    previous_pose: list[tuple[str, Any]]
    things: list[KeyedThing] = field(default_factory=list)
    reduced: Reduced | None = None  # where fewer keys were asked for
    kept: KeptEdits = field(default_factory=KeptEdits)
    aside: list[Matrix] | None = None  # by which each frame is seen off its place, where it plays in place

    @property
    def first(self) -> int:
        """The first whole frame."""
        return int(np.ceil(self.frame_start))

    @property
    def last(self) -> int:
        """The last whole frame."""
        return int(np.floor(self.frame_end))

    @property
    def count(self) -> int:
        """Frames that have keys."""
        return round(self.frame_end - self.frame_start) + 1


def pose_of(armature: bpy.types.Object, placed: bool = False) -> list[tuple[str, Any]]:
    """What a take must be able to give back of a pose: bones with their transform channels (a matrix would
    lose whole turns), and with the values of their switches that are keyed; and where it is ``placed`` by the
    take, the object's own transform.
    """
    pose: list[tuple[str, Any]] = [(bone.name, transform_of(bone)) for bone in armature.pose.bones]
    return pose + switches_of(armature) + ([(_PLACE, transform_of(armature))] if placed else [])


def take_off(take: KeyedTake) -> None:
    """Give the armature, and what it moved, back the actions, the pose and the places they had; the take's
    own actions stay in the file.
    """
    for thing in take.things:
        take_off_thing(thing)
    if take.previous_action:
        take.previous_action.use_fake_user = take.previous_fake_user
    assign(take.armature, take.previous_action, take.previous_slot)
    bpy.context.view_layer.update()  # the old action plays once more, before the pose that was not keyed
    for name, values in take.previous_pose:
        moving = take.armature if name == _PLACE else take.armature.pose.bones.get(name)
        if moving is None:
            continue
        if not isinstance(values, dict):  # a matrix, of files of an earlier version
            moving.matrix_basis = values
        elif "rotation_quaternion" in values:
            for channel, value in values.items():
                setattr(moving, channel, value)
        else:
            set_switches(moving, values)
    take.armature.update_tag()
    bpy.context.view_layer.update()


def forget_gone(take: KeyedTake) -> None:
    """Pass over what a take has replaced where somebody has deleted it since."""
    for made in (take, *take.things):
        if made.previous_action is not None and not exists(made.previous_action):
            made.previous_action = made.previous_slot = None


def discard_take(take: KeyedTake) -> None:
    """Remove a take's actions and give the armature, and what it moved, back the actions, the pose and the
    places they had.
    """
    take_off(take)
    for made in (take, *take.things):
        remove_unused(made.action)
