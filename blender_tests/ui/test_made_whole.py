"""What a button makes: all of it, or nothing, whatever is raised on the way."""

from __future__ import annotations

import bpy
import pytest
from scenes import box

import nsm_blender
from nsm_blender.rigs.mannequin import build

KINDS = (
    "scenes",
    "collections",
    "objects",
    "meshes",
    "armatures",
    "materials",
    "actions",
    "cameras",
    "lights",
)


@pytest.fixture
def scene():
    nsm_blender.register()
    bpy.context.view_layer.objects.active = box("Crate", (0, 0, 0), (1, 1, 1))
    bpy.context.view_layer.objects.active.select_set(True)
    yield bpy.context.scene
    nsm_blender.unregister()


def as_it_is() -> dict[str, object]:
    held: dict[str, object] = {kind: sorted(b.name for b in getattr(bpy.data, kind)) for kind in KINDS}
    layer = bpy.context.view_layer
    held["shown"] = bpy.context.scene.name, bpy.context.mode, layer.objects.active.name
    held["selected"] = sorted(o.name for o in layer.objects if o.select_get())
    return held | {"chosen": bpy.context.scene.nsm.character}


@pytest.mark.parametrize("button", ["add_character", "example"])
@pytest.mark.parametrize("error", [RuntimeError, MemoryError])
def test_a_character_is_made_whole_or_not_at_all(scene, monkeypatch, button, error):
    def broken(*_):
        raise error

    before = as_it_is()
    monkeypatch.setattr(build, "_weigh", broken)
    with pytest.raises(RuntimeError):  # as Blender tells of it
        getattr(bpy.ops.nsm, button)()
    assert as_it_is() == before
    monkeypatch.undo()
    assert getattr(bpy.ops.nsm, button)() == {"FINISHED"}
    assert len(bpy.data.armatures) == len(before["armatures"]) + 1
