"""How keys of takes are made, and which missing frames Fill makes: settings of the sidebar."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty


class NsmKeyOptions(bpy.types.PropertyGroup):
    """How the keys of takes are made, and how many takes at a time."""

    root_motion: EnumProperty(
        name="Root Motion",
        description="What carries the character through the scene; its motion is seen the same, but in place",
        items=[
            ("hips", "Hips", "The hips bone, and the object stays where it is", 0),
            ("object", "Object", "The armature object moves over the floor and turns, the hips within it", 1),
            ("bone", "Root Bone", "The topmost bone above the hips, where the rig has one", 2),
            ("in_place", "In Place", "Leave the way and the turns out, as games want it; what is moved keeps "
             "its own place", 3),
        ],
    )  # fmt: skip
    reduce: BoolProperty(
        name="Fewer Keys",
        description="Leave out keys that the motion does without, by curves in between that may be edited",
        default=False,
    )
    variations: IntProperty(
        name="Variations", description="How many takes are shown beside each other", default=3, min=2, max=6
    )
    keep_edits: BoolProperty(
        name="Keep My Keys",
        description="Keys that you have set in the take that is shown go into the next one from the same "
        "start frame, and its motion leads to them",
        default=True,
    )
    reduce_mm: FloatProperty(
        name="Off by at Most",
        description="How far a joint may be from where it was, in millimetres; feet that stand keep closer",
        default=5.0,
        min=0.1,
        soft_max=20.0,
        max=100.0,
    )
    reduce_degrees: FloatProperty(
        name="Turned by at Most",
        description="How far a bone may be turned from how it was, in degrees",
        default=1.0,
        min=0.05,
        soft_max=5.0,
        max=20.0,
    )


class NsmFillOptions(bpy.types.PropertyGroup):
    """Which missing frames Fill makes, and how."""

    seam: IntProperty(
        name="Frames on Each Side",
        description="How many frames before and after the seam are made anew",
        default=10,
        min=2,
        soft_max=30,
        max=90,
    )

    where: EnumProperty(
        name="Frames",
        description="Which frames are filled",
        items=(
            ("AROUND", "Around the Playhead", "Between the poses keyed before and after the current frame"),
            ("SELECTED", "Selected Keys", "Between the first and the last selected keys of the character"),
            ("PREVIEW", "Preview Range", "Between the first and the last frame of the preview range"),
            ("ALL", "All Gaps", "Every gap between the first and the last pose, one after the other"),
            (
                "SEAM",
                "Seam at the Playhead",
                "Where one motion is cut to another: the frames on both sides of "
                "the current one are made anew",
            ),
        ),
    )
    method: EnumProperty(
        name="Method",
        description="What makes the frames",
        items=(
            ("network", "Transition Network", "Motion as people move, by a network "
             "that has learned from captures and senses the ground below"),
            ("interpolate", "Interpolation", "The shortest way from pose to pose, with planted feet"),
        ),
    )  # fmt: skip
    replace: BoolProperty(
        name="Replace Keys",
        description="Make the keys between the two ends anew; off, poses there are reached and single keys "
        "kept",
        default=False,
    )
    seed: IntProperty(
        name="Variation",
        description="0 is the likeliest motion; other numbers give others",
        default=0,
        min=0,
    )
