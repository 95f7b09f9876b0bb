"""The add-on comes and goes as often as it likes, and its first operator works."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import bpy
import pytest

import nsm_blender
from nsm_blender.ui import operators, panels, properties
from nsm_core.body.skeleton import JOINTS

ROOT = Path(__file__).resolve().parents[2]
CLASSES = (*properties.CLASSES, *operators.CLASSES, *panels.CLASSES)


def test_registering_twice_and_unregistering_twice_is_harmless():
    nsm_blender.register()
    nsm_blender.register()
    assert all(cls.is_registered for cls in CLASSES)
    assert bpy.context.scene.nsm.seed == 0
    nsm_blender.unregister()
    nsm_blender.unregister()
    assert not any(cls.is_registered for cls in CLASSES)
    assert not hasattr(bpy.types.Scene, "nsm")


def test_settings_survive_unregistering(registered):
    bpy.context.scene.nsm.seed = 17
    nsm_blender.unregister()
    nsm_blender.register()
    assert bpy.context.scene.nsm.seed == 17


def test_settings_survive_another_file(registered):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert len(bpy.context.scene.nsm.goals) == 0


def test_character_is_added_at_the_cursor_facing_minus_y(registered):
    bpy.context.scene.cursor.location = (1.0, -2.0, 0.5)
    assert bpy.ops.nsm.add_character() == {"FINISHED"}
    character = bpy.data.objects["Character"]
    assert character.type == "ARMATURE"
    assert tuple(character.location) == (1.0, -2.0, 0.5)
    assert set(JOINTS) <= set(character.data.bones.keys())
    toe, ankle = (character.data.bones[n].head_local for n in ("LeftToe", "LeftAnkle"))
    assert toe.y < ankle.y - 0.05
    assert bpy.context.scene.nsm.character == character


def test_every_operator_says_what_it_does(registered):
    for cls in operators.CLASSES:
        assert cls.bl_description and not cls.bl_description.endswith("."), cls


@pytest.mark.skipif(not bpy.app.module, reason="the application has no Python with bpy to start")
def test_a_plain_script_needs_only_the_repository_on_its_path(tmp_path):
    code = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
        "import bpy, nsm_blender\n"
        "nsm_blender.register()\n"
        "print(bpy.ops.nsm.add_character(), 'Character' in bpy.data.objects)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert "{'FINISHED'} True" in done.stdout
    assert "Not freed memory" not in done.stdout + done.stderr
