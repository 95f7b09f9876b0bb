"""The kitchen as objects: each part opens by one channel, as the core moves it, and files hold all of it."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from nsm_blender.demo import main
from nsm_blender.demo_scene.kitchen import build_kitchen
from nsm_blender.demo_scene.kitchen_take import kitchen_goals
from nsm_blender.rigs.character import add_character
from nsm_core.world.assets.tea_kitchen import JAR, MUG, TEA


@pytest.fixture
def built(empty_scene):
    return build_kitchen(3)[1]


def named(container, part=None):
    title = container.name[0].upper() + container.name[1:]
    return bpy.data.objects[f"{title} {part.name}" if part else title]


def test_parts_open_about_their_own_z_as_in_the_core(built):
    opened = 0
    for container in built.containers.values():
        for part in container.parts:
            shown = named(container, part)
            assert shown.parent == named(container)
            travel = shown["nsm_opens"]
            corner = np.asarray(shown.data.vertices[3].co)
            bpy.context.view_layer.update()
            shut = np.asarray(shown.matrix_world @ Vector(corner))
            move = Matrix.Rotation(travel, 4, "Z") if part.turns else Matrix.Translation((0, 0, travel))
            shown.matrix_basis = shown.matrix_basis @ move
            bpy.context.view_layer.update()
            expected = part.to_world(part.to_local(shut), opening=1.0)
            np.testing.assert_allclose(shown.matrix_world @ Vector(corner), expected, atol=1e-4)
            opened += 1
    assert opened > 12


def test_things_stand_where_the_core_puts_them(built):
    bpy.context.view_layer.update()
    for standing in built.things.values():
        thing = standing.thing
        shown = bpy.data.objects[thing.name[0].upper() + thing.name[1:]]
        corner = shown.matrix_world @ shown.data.vertices[5].co
        np.testing.assert_allclose(corner, thing.to_world(thing.mesh()[0][5]), atol=1e-5)


def test_the_demo_saves_a_kitchen(tmp_path, capsys):
    assert main(["--kitchen", "1", "--no-take", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "kitchen.blend").stat().st_size > 50_000
    assert "parts that open" in capsys.readouterr().out


def goals_in(seed, scene):
    kitchen = build_kitchen(seed)[1]
    character = add_character((2.0, -1.6, 0.0))
    bpy.context.view_layer.update()
    goals = kitchen_goals(kitchen, character, scene)
    assert [(goal.action, goal.close_after) for goal in goals] == [("place", True)] * 2
    for goal, drawer in zip(goals, (False, True), strict=True):
        name = goal.object.name[0].lower() + goal.object.name[1:]
        (part,) = kitchen.shut_by(name)
        holder = kitchen.containers[kitchen.things[name].container]
        assert (holder.part(part).kind == "drawer") == drawer
    return kitchen, goals


def test_what_is_fetched_is_shut_away_behind_a_door_and_in_a_drawer(empty_scene):
    _, goals = goals_in(0, empty_scene)
    assert {goal.to.name for goal in goals} == {"Table"}


def test_tea_is_made_of_a_mug_from_behind_a_bowl_and_a_jar(empty_scene):
    kitchen, goals = goals_in(TEA, empty_scene)
    assert {goal.to.name for goal in goals} == {"Worktop"}
    mug, jar = (kitchen.things[name] for name in (MUG, JAR))
    assert mug.thing.kind == "mug" and kitchen.things[mug.blockers[0]].thing.kind == "bowl"
    place = bpy.data.objects[goals[1].object.name].matrix_world.translation
    np.testing.assert_allclose(place, jar.thing.pose[:3], atol=1e-6)
    others = [standing.thing for name, standing in kitchen.things.items() if name != JAR]
    foot = np.float32((jar.thing.pose[:3] + (0.0, 0.0, 0.05))[None])
    assert min(float(other.signed_distance(foot, 0.3)[0]) for other in others) > 0.05
