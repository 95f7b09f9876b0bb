"""The add-on has a part for every action."""

from __future__ import annotations

import bpy

from nsm_blender.goals.icons import ICONS
from nsm_blender.goals.registry import FINDERS
from nsm_core.world.actions import BY_KEY


def test_every_action_is_found_in_a_scene_and_has_an_icon():
    assert set(FINDERS) == set(BY_KEY)
    icons = set(bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items.keys())
    assert set(ICONS) == set(BY_KEY) and set(ICONS.values()) <= icons
