"""The comparison of whole files, which stands with the faults; and the add-on, registered once a file."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "faults"))


@pytest.fixture(scope="module")
def addon():
    """The add-on at work, and the walk that gaps are cut from made before any scene is opened."""
    from gaps import walk

    import nsm_blender

    walk()
    nsm_blender.register()
    yield
    nsm_blender.unregister()


@pytest.fixture
def hero(addon):
    """A character whose walk lacks some frames, with the playhead in the gap and a pose that is not keyed."""
    import bpy
    from gaps import END, START, cut, walking

    from nsm_blender.rigs.character import add_character

    character = add_character((0.0, 0.0, 0.0))
    walking(character, 30)
    cut(character, START, END)
    bpy.context.scene.frame_set(50)
    bpy.context.view_layer.update()
    return character
