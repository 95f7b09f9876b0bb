"""What is opened to get at a thing is shut again, once no later goal needs it open; what blocks a thing in a
drawer is put aside before.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from scenes import mesh_of_boxes

from nsm_blender.demo_scene.kitchen import build_kitchen
from nsm_blender.goals.resolve import moved_by
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.prepare import TakeSpec, resolve_goals, start_of, surroundings_of
from nsm_blender.progress import finish
from nsm_blender.rigs.character import add_character

DRAWER, INSIDE = "Drawers drawer 1", np.array((1.57, -0.34, 0.7))


@pytest.fixture
def kitchen(empty_scene):
    """A kitchen in one of whose drawers a jar stands between two books, and a spoon before them."""
    room, _ = build_kitchen(0)
    bpy.data.objects.remove(bpy.data.objects["Plate"])
    for name, aside, half, high in (
        ("Jar", 0.0, (0.02, 0.02), 0.08),
        ("Red Book", -0.042, (0.016, 0.1), 0.1),
        ("Blue Book", 0.042, (0.016, 0.1), 0.1),
    ):
        mesh_of_boxes(name, [((-half[0], -half[1], 0.0), (*half, high))], INSIDE + (aside, 0.0, 0.0))
    character = add_character((*room.start, 0.0))
    bpy.context.view_layer.update()
    return character


def found(character, *goals):
    scene = bpy.context.scene
    spec = TakeSpec(character, list(goals))
    frame, start = start_of(character, scene)
    around = finish(surroundings_of(spec, scene, frame, moved_by(spec.goals)))
    return resolve_goals(spec, scene, frame, start, around), around


def to_table(name, **more):
    return GoalSpec("place", bpy.data.objects[name], 0.0, to=bpy.data.objects["Table"], **more)


def told(goal):
    return [(one.action, one.name, one.opening if one.action == "open" else None) for one in goal.parts]


def test_try(kitchen):
    goals, around = found(kitchen, to_table("Jar"))
    print(told(goals[0]))
    goals, around = found(kitchen, to_table("Bowl"), to_table("Cup 3"))
    print([told(g) for g in goals])
    assert 0
