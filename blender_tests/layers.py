"""Rigs that something else than the keys of their own action moves."""

from __future__ import annotations

import bpy
import numpy as np


def bones_of(armature, *names):
    return [armature.pose.bones[name] for name in names]


def with_root(armature, between: str | None = None):
    """Give the rig a root bone over the hips, or a bone between ``between`` and its parent."""
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    bones = armature.data.edit_bones
    extra = bones.new("extra")
    child = bones[between or "Hips"]
    extra.head, extra.tail, extra.roll = child.head + child.vector * 0.1, child.tail, 0.7
    extra.parent, child.parent = child.parent, extra
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature.pose.bones["extra"]


def slide(moving, to=(2.0, 0.5, 0.3), turn=1.0):
    """Key an object, or a bone, on its way and turning."""
    moving.rotation_mode = "XYZ"
    for frame, share in ((1, 0.0), (30, 1.0)):
        moving.location = np.array(to) * share
        moving.rotation_euler = (0.2 * share, 0.1 * share, turn * share)
        moving.keyframe_insert("location", frame=frame)
        moving.keyframe_insert("rotation_euler", frame=frame)
    bpy.context.scene.frame_set(1)


def pushed_down(target, name="below"):
    data = target.animation_data
    track = data.nla_tracks.new()
    track.name = name
    strip = track.strips.new(name, 1, data.action)
    data.action = None
    return track, strip
