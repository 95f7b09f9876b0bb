"""The list of a character's bones: found, saved, loaded, taken away."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import StringProperty

from ..properties import settings_of
from .reporting import WhileIdle, sentences, telling


class _OnBones(WhileIdle, bpy.types.Operator):
    """Shared by the operators on the bones of the chosen character."""

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        character = settings_of(context.scene).character
        if character is None or character.type != "ARMATURE":
            return "No character is chosen; choose its armature first."
        if not character.data.is_editable:
            return (
                f"The armature data {character.data.name} is linked from another file; make a library "
                "override of it."
            )
        return ""


class NSM_OT_bones_detect(_OnBones):
    bl_idname = "nsm.bones_detect"
    bl_label = "Detect"
    bl_description = (
        "Find the bones of the character by their names, their order and their places, and list them here"
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        from nsm_core.body.skeleton import JOINTS

        from ...rigs.bone_map import found_map, store_map

        character = settings_of(context.scene).character
        bone_map = found_map(character.data)
        store_map(character.data, bone_map)
        problem = bone_map.problem(character.name, character.data.bones)
        if problem:
            self.report({"WARNING"}, problem)
        else:
            found = f"{len(bone_map.joints)} of {len(JOINTS)} bones found as of {bone_map.family}"
            self.report({"INFO"}, f"{found}; fits {bone_map.score:.0%}.")
        return {"FINISHED"}


class NSM_OT_bones_clear(_OnBones):
    bl_idname = "nsm.bones_clear"
    bl_label = "Clear Bone List"
    bl_description = "Take the list away; the bones are then found by themselves again"

    def execute(self, context: bpy.types.Context) -> set[str]:
        rig = settings_of(context.scene).character.data.nsm_rig
        for name in ("joints", "family", "score", "remarks", "extras"):
            rig.property_unset(name)
        return {"FINISHED"}


class _OnFile(_OnBones):
    """Shared by saving and loading: the browser opens in the folder of the user's bone lists."""

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: StringProperty(default="*.toml", options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        from ...rigs.presets import user_folder

        if not self.filepath:
            folder = user_folder()
            name = bpy.path.clean_name(settings_of(context.scene).character.name)
            self.filepath = str(folder / f"{name}.toml") if folder.is_dir() else f"{name}.toml"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class NSM_OT_bones_save(_OnFile):
    bl_idname = "nsm.bones_save"
    bl_label = "Save Bone List"
    bl_description = (
        "Save the list as a small text file; those in the folder that opens are tried on every character"
    )

    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        from ...rigs.presets import user_folder

        with sentences(self):
            try:
                user_folder().mkdir(parents=True, exist_ok=True)
            except OSError as error:
                self.report({"WARNING"}, f"The folder of bone lists cannot be made ({error.strerror}).")
        return super().invoke(context, event)

    @telling
    def execute(self, context: bpy.types.Context) -> None:
        from ...rigs.bone_map import forget_told, found_map, stored_map
        from ...rigs.presets import save_preset

        character = settings_of(context.scene).character
        path = Path(bpy.path.abspath(self.filepath))
        forget_told()
        save_preset(path.with_suffix(".toml"), stored_map(character.data) or found_map(character.data))


class NSM_OT_bones_load(_OnFile):
    bl_idname = "nsm.bones_load"
    bl_label = "Load Bone List"
    bl_description = "Load a list of bones that was saved; bones that this character lacks are left empty"

    @telling
    def execute(self, context: bpy.types.Context) -> None:
        from ...rigs.bone_map import store_map
        from ...rigs.detect import judged_on
        from ...rigs.presets import load_preset

        data = settings_of(context.scene).character.data
        preset = load_preset(bpy.path.abspath(self.filepath))
        store_map(data, judged_on(data, preset.on(data.bones)))


CLASSES = (NSM_OT_bones_detect, NSM_OT_bones_clear, NSM_OT_bones_save, NSM_OT_bones_load)
