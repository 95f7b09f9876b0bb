"""Takes that move objects: what is read from the scene, what is refused, and which objects may not be
moved.
"""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from scenes import box, door, empty, mesh_of_boxes

from nsm_blender.goals.spec import GoalSpec
from nsm_blender.keys.objects import require_movable
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import TakeSpec, finish, generate, prepare
from nsm_core.errors import GoalError, NsmError


def crate(location=(1.0, 0.5, 0.2), turn=0.3, name="Box"):
    return mesh_of_boxes(name, [((-0.2, -0.15, 0), (0.2, 0.15, 0.25))], location, turn)


class TestTakes:
    def scene(self):
        return add_character((0.0, -2.0, 0.0)), crate((0.0, 0.0, 0.0)), empty("Here", (2.0, 1.0, 0.0))

    def test_what_moves_is_no_part_of_the_environment(self):
        character, target, here = self.scene()
        lid = crate((0.0, 0.0, 0.3), name="Lid")
        lid.parent = target
        lid.matrix_parent_inverse = target.matrix_world.inverted()
        leaf = door((3.0, -3.0, 0.0))
        specs = [
            GoalSpec("carry", target, to=here),
            GoalSpec("open", leaf),
            GoalSpec("carry", target, to=here),
        ]
        request, _, things = finish(prepare(TakeSpec(character, specs), bpy.context.scene))
        assert set(things) == {"Box", "Door"} and things["Box"].object == target
        probes = np.array(((0, 0, 0.1), (0, 0, 0.4), (3.4, -3, 1), (2.5, -3, 1)), np.float32)
        np.testing.assert_array_equal(
            request.environment.signed_distance(probes, 0.05) < 0.05, (False, False, False, True)
        )
        assert request.goals[0].prop is request.goals[2].prop

    def test_where_things_stand_is_read_at_the_first_frame(self):
        character, target, here = self.scene()
        for frame, x in ((1, 0.0), (50, 1.0)):
            target.location.x = x
            target.keyframe_insert("location", frame=frame)
        scene = bpy.context.scene
        scene.frame_set(7)
        kept = target.location.copy()
        _, _, things = finish(
            prepare(TakeSpec(character, [GoalSpec("carry", target, to=here)], start_frame=50), scene)
        )
        assert things["Box"].world.translation.x == pytest.approx(1.0)
        assert scene.frame_current == 7 and target.location == kept

    def test_goals_go_on_from_where_the_one_before_leads(self):
        character, target, here = self.scene()
        leaf = door((-0.5, 3.0, 0.0))
        specs = [GoalSpec("open", leaf), GoalSpec("walk", location=(0.0, 6.0, 0.0)), GoalSpec("open", leaf)]
        goals = finish(prepare(TakeSpec(character, specs), bpy.context.scene))[0].goals
        assert abs(math.cos(goals[0].heading) + 1) < 1e-6 and abs(math.cos(goals[2].heading) - 1) < 1e-6

    def test_an_action_that_the_weights_have_not_learned(self):
        character, target, here = self.scene()
        with pytest.raises(GoalError, match="has not learned to carry; it can do: sit, walk, idle"):
            steps = generate(
                TakeSpec(character, [GoalSpec("carry", target, to=here)]), bpy.context.scene, _Untaught()
            )
            finish(steps)
        assert not bpy.data.actions


class _Untaught:
    """Stands for weights that were trained on sitting alone."""

    metadata = {"actions": ["idle", "walk", "sit"]}


class TestWhatMayNotBeMoved:
    def test_objects_linked_from_another_file(self, tmp_path):
        crate()
        path = str(tmp_path / "library.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        with bpy.data.libraries.load(path, link=True) as (_, into):
            into.objects = ["Box"]
        target = bpy.data.objects["Box"]
        bpy.context.scene.collection.objects.link(target)
        bpy.context.view_layer.update()
        character = add_character((0.0, -2.0, 0.0))
        with pytest.raises(NsmError, match="Box is linked from another file"):
            finish(
                prepare(
                    TakeSpec(character, [GoalSpec("carry", target, to=empty("Here", (2, 1, 0)))]),
                    bpy.context.scene,
                )
            )

    def test_parts_and_parents_of_the_character(self):
        character, hat = add_character(), crate(name="Hat")
        hat.parent = character
        with pytest.raises(GoalError, match="hang on each other"):
            require_movable(hat, character)
        hat.parent = None
        character.parent = hat
        with pytest.raises(GoalError, match="hang on each other"):
            require_movable(hat, character)

    def test_objects_under_constraints_drivers_and_in_tweak_mode(self):
        target = crate()
        constraint = target.constraints.new("COPY_LOCATION")
        constraint.target = empty("Goal", (1, 1, 1))
        with pytest.raises(GoalError, match="constraints"):
            require_movable(target, None)
        constraint.influence = 0
        require_movable(target, None)
        target.driver_add("location", 0)
        with pytest.raises(GoalError, match="drivers"):
            require_movable(target, None)
        other = box("Other", (0, 0, 0), (1, 1, 1))
        other.keyframe_insert("location", frame=1)
        track = other.animation_data.nla_tracks.new()
        track.strips.new("Strip", 1, other.animation_data.action)
        other.animation_data.action = None
        other.animation_data.use_tweak_mode = True
        if other.animation_data.use_tweak_mode:
            with pytest.raises(NsmError, match="tweak mode"):
                require_movable(other, None)
