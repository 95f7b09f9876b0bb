"""Objects are told apart by what they are, not by their names: a linked one and a local one may share a name,
and names change.
"""

from __future__ import annotations

import bpy
import pytest
from mathutils import Vector
from scenes import box, empty

import nsm_blender
from nsm_blender.animation.identity import Known
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.pictures import viewpoint
from nsm_blender.prepare import TakeSpec, own_objects
from nsm_blender.rigs.armature import build_armature
from nsm_blender.ui import running
from nsm_blender.ui.watch import Watch
from nsm_blender.world.ground import floor_under


def linked(name: str, path) -> bpy.types.Object:
    """Replace an object of the scene by a link to itself in another file, so that its name is free."""
    bpy.data.libraries.write(str(path), {bpy.data.objects[name]})
    bpy.data.objects.remove(bpy.data.objects[name])
    with bpy.data.libraries.load(str(path), link=True) as (_, wanted):
        wanted.objects = [name]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    bpy.context.view_layer.update()
    return wanted.objects[0]


@pytest.fixture
def watched():
    scene, hero, goal = bpy.context.scene, build_armature("Hero"), empty("Mark", (1, 1, 0))
    return Watch(TakeSpec(hero, [GoalSpec("walk", goal)]), scene), hero, goal


def test_what_is_renamed_is_the_same_and_told_by_its_new_name(watched):
    watch, hero, goal = watched
    hero.name, goal.name, bpy.context.scene.name = "Heroine", "Spot", "Shot 2"
    assert watch.changed() == ""
    bpy.data.objects.remove(goal)
    assert watch.changed().startswith("Spot, a goal of the take, was deleted")
    bpy.data.objects.remove(hero)
    assert watch.changed().startswith("The character Heroine was deleted")


@pytest.mark.parametrize("which", ["hero", "goal", "armature"])
def test_what_is_made_anew_under_the_same_name_is_another(watched, which):
    watch, hero, goal = watched
    if which == "hero":
        bpy.data.objects.remove(hero)
        build_armature("Hero")
        assert "Hero was deleted" in watch.changed()
    elif which == "goal":
        bpy.data.objects.remove(goal)
        empty("Mark", (1, 1, 0))
        assert watch.changed().startswith("Mark, a goal of the take, was deleted")
    else:
        hero.data = hero.data.copy()
        assert "another armature" in watch.changed()


def test_a_goal_that_leaves_the_scene_while_its_name_stays_there(watched, tmp_path):
    watch, _, goal = watched
    goal.name = "Mark of mine"
    empty("Mark", (1, 1, 0))
    linked("Mark", tmp_path / "other.blend")
    goal.name = "Mark"
    assert watch.changed() == ""
    bpy.context.scene.collection.objects.unlink(goal)
    assert (
        "Mark" in bpy.context.scene.objects and "The goal Mark was taken out of the scene" in watch.changed()
    )


def test_a_character_elsewhere_whose_name_a_link_bears(tmp_path):
    nsm_blender.register()
    try:
        empty("Hero", (0, 0, 0))
        linked("Hero", tmp_path / "other.blend")
        hero = build_armature("Hero")
        bpy.context.scene.nsm.character = hero
        assert hero.name == "Hero" and "no goal yet" in running.reason_not_ready(bpy.context)
        bpy.context.scene.collection.objects.unlink(hero)
        assert "Hero is no longer in this scene" in running.reason_not_ready(bpy.context)
    finally:
        nsm_blender.unregister()


def test_a_block_is_known_through_undo_by_its_number():
    mark = empty("Mark", (0, 0, 0))
    bpy.ops.ed.undo_push(message="made")
    known = Known(mark)
    mark.name = "Spot"
    bpy.ops.ed.undo_push(message="renamed")
    bpy.ops.ed.undo()
    again = next(o for o in bpy.data.objects if Known(o)._identity == known._identity)
    assert again.name == "Mark"


def test_a_wall_with_the_name_of_the_body_stands_in_the_way(tmp_path):
    box("Body", (-1, -1, -0.5), (1, -0.9, 2))
    wall = linked("Body", tmp_path / "other.blend")
    hero = build_armature("Hero")
    body = box("Body", (-0.2, -0.2, 0), (0.2, 0.2, 1.8))
    body.modifiers.new("Armature", "ARMATURE").object = hero  # worn, but no child
    scene, own = bpy.context.scene, own_objects(hero, bpy.context.scene)
    assert own == {hero, body} and wall.name == body.name == "Body"
    graph = bpy.context.evaluated_depsgraph_get()

    def clear(camera):
        return viewpoint._is_clear(scene, graph, Vector(camera), Vector((0, 0, 1)), own)

    assert not clear((0, -5, 1)) and clear((0, 5, 1)) and clear((5, 0, 1))


def test_a_rug_with_the_name_of_the_body_is_stood_on(tmp_path):
    box("Body", (-2, -2, 0), (2, 2, 0.05))
    linked("Body", tmp_path / "other.blend")
    body = box("Body", (-0.2, -0.2, 0.05), (0.2, 0.2, 1.8))
    assert floor_under(Vector((0, 0, 0.05)), 1.0, bpy.context.scene, {body}) == pytest.approx(0.0, abs=1e-6)
