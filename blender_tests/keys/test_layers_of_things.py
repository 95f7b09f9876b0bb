"""What else moves a thing that is carried or opened: the same rules as for a character."""

from __future__ import annotations

import bpy
import pytest
from layers import pushed_down
from scenes import empty

from nsm_blender.keys.objects import require_movable
from nsm_core.errors import GoalError, NsmError


def moved_thing():
    thing = bpy.data.objects.new("Box", bpy.data.meshes.new("Box"))
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.view_layer.update()
    return thing


def test_things_are_held_to_the_same_rules():
    thing = moved_thing()
    thing.constraints.new("COPY_LOCATION")  # no target
    constraint = thing.constraints.new("COPY_ROTATION")
    constraint.target, constraint.influence = empty("Mark", (1, 1, 1)), 0.0
    require_movable(thing, None)
    constraint.driver_add("influence").driver.expression = "1"
    with pytest.raises(GoalError, match="Box has constraints.*Copy Rotation"):
        require_movable(thing, None)


@pytest.mark.parametrize("how", ["solo", "combine", "driver", "unused driver", "delta strip", "hidden"])
def test_a_thing_whose_keys_would_not_rule_is_refused(how):
    thing = moved_thing()
    if how in ("solo", "combine", "delta strip"):
        for frame in (1, 20):
            thing.delta_location.x = frame
            thing.keyframe_insert("delta_location" if how == "delta strip" else "location", frame=frame)
        track, _ = pushed_down(thing)
        track.is_solo = how == "solo"
        thing.animation_data.action_blend_type = "COMBINE" if how == "combine" else "REPLACE"
    elif "driver" in how:
        thing.driver_add(
            "rotation_quaternion" if how == "unused driver" else "delta_location", 0
        ).driver.expression = "1"
    else:
        thing.hide_viewport = True
    bpy.context.view_layer.update()
    if how == "unused driver":
        require_movable(thing, None)
        return
    with pytest.raises(NsmError, match="Box"):
        require_movable(thing, None)
