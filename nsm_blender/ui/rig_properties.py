"""What an armature keeps of itself: which bones stand for the body's joints, and how its limbs are keyed."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, StringProperty


def _edited(row: NsmBone, _context: bpy.types.Context) -> None:
    """Judge a list of bones anew when a bone was exchanged."""
    from ..rigs.bone_map import stored_map
    from ..rigs.detect import judged_on

    data = row.id_data
    bone_map = stored_map(data)
    if bone_map is not None:
        judge = judged_on(data, bone_map)
        data.nsm_rig.score, data.nsm_rig.remarks = judge.score, "\n".join(judge.remarks)


class NsmBone(bpy.types.PropertyGroup):
    """One joint of the body, by its name, and the bone that stands for it."""

    bone: StringProperty(
        name="Bone",
        description="The bone that moves this part of the body; empty where the rig has none",
        update=_edited,
    )


class NsmRig(bpy.types.PropertyGroup):
    """The list of an armature's bones; empty where they are found anew for every take."""

    joints: CollectionProperty(type=NsmBone)
    family: StringProperty(description="What the list was made from")
    score: FloatProperty(description="How well the bones fit a body, 0 to 1")
    remarks: StringProperty(description="What is odd about the list, a line each")
    extras: StringProperty(description="Bones that show the result, switches and IK controls, JSON")
    limbs: EnumProperty(
        name="Arms and Legs",
        description="Which controls of arms and legs get the keys of a take",
        items=(
            ("FK", "FK", "Keys turn upper arms, forearms, hands, thighs, shins and feet"),
            ("IK", "IK", "Keys place hands and feet, and poles say where elbows and knees point"),
        ),
    )
    fingers: BoolProperty(
        name="Fingers",
        description="Relax the fingers, and close them on what the hands hold, by a few keys; off, they stay "
        "as they are",
        default=True,
    )
