"""The list of a character's bones: which bone stands for which joint."""

from __future__ import annotations

import bpy

from . import running
from .drawing import Sidebar, sentence
from .properties import settings_of

# Joints in the order in which a body is gone through, under the words that animators use for them.
_PARTS = (
    ("Trunk", (("Hips", "Hips"), ("Chest", "Spine 1"), ("Chest2", "Spine 2"), ("Chest3", "Spine 3"),
               ("Chest4", "Chest"), ("Neck", "Neck"), ("Head", "Head"))),
    ("Left Arm", (("LeftCollar", "Shoulder"), ("LeftShoulder", "Upper Arm"), ("LeftElbow", "Forearm"),
                  ("LeftWrist", "Hand"))),
    ("Right Arm", (("RightCollar", "Shoulder"), ("RightShoulder", "Upper Arm"), ("RightElbow", "Forearm"),
                   ("RightWrist", "Hand"))),
    ("Left Leg", (("LeftHip", "Thigh"), ("LeftKnee", "Shin"), ("LeftAnkle", "Foot"), ("LeftToe", "Toes"))),
    ("Right Leg", (("RightHip", "Thigh"), ("RightKnee", "Shin"), ("RightAnkle", "Foot"),
                   ("RightToe", "Toes"))),
)  # fmt: skip


class NSM_PT_bones(Sidebar, bpy.types.Panel):
    bl_label = "Bones"
    bl_idname = "NSM_PT_bones"
    bl_parent_id = "NSM_PT_character"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        character = settings_of(context.scene).character
        return character is not None and character.type == "ARMATURE"

    def draw(self, context: bpy.types.Context) -> None:
        from ..rigs.bone_map import stored_map, told_map

        layout, character = self.layout, settings_of(context.scene).character
        rig = character.data.nsm_rig
        body = layout.column()
        body.enabled = running.current() is None
        row = body.row(align=True)
        row.operator("nsm.bones_detect", icon="VIEWZOOM")
        row.operator("nsm.bones_load", text="Load", icon="FILE_FOLDER")
        row.operator("nsm.bones_save", text="Save", icon="FILE_TICK")
        row.operator("nsm.bones_clear", text="", icon="X")
        if told_map(character).limbs:
            body.row(align=True).prop(rig, "limbs", expand=True)
        body.prop(rig, "fingers")
        bone_map = stored_map(character.data)
        if bone_map is None:
            sentence(
                context, body, "The bones are found by themselves. Press Detect to see and edit them.", "INFO"
            )
            return
        problem = bone_map.problem(character.name, character.data.bones)
        found = f"{rig.family}: fits {rig.score:.0%}, {len(bone_map.joints)} of {len(rig.joints)} bones."
        sentence(context, body, problem or found, "ERROR" if problem else "CHECKMARK")
        for line in filter(None, rig.remarks.split("\n")):
            sentence(context, body, line, "QUESTION")
        rows = {each.name: each for each in rig.joints}
        for part, joints in _PARTS:
            column = body.column(align=True)
            column.label(text=part)
            for joint, label in joints:
                if joint in rows:
                    line = column.split(factor=0.35, align=True)
                    line.label(text=label)
                    line.prop_search(rows[joint], "bone", character.data, "bones", text="")
