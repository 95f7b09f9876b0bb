"""Points to touch, as they are found on meshes."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from scenes import mesh_of_boxes

from nsm_blender.goals.resolve import resolve
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.world.frame import WorldFrame
from nsm_core.errors import GoalError

SOUTH = (np.array((0.0, -3.0), np.float32), math.pi)


def touch(low, high):
    target = mesh_of_boxes("Block", [(low, high)])
    bpy.context.view_layer.update()
    return resolve(GoalSpec("touch", target), bpy.context.scene, WorldFrame(), SOUTH)


def test_the_middle_of_the_front_is_touched():
    goal = touch((-0.5, -0.3, 0.0), (0.5, 0.3, 1.0))
    np.testing.assert_allclose(goal.position, (0.0, -0.3, 0.5), atol=0.01)
    assert abs(math.cos(goal.heading) + 1) < 1e-3


def test_what_no_hand_reaches_is_told():
    with pytest.raises(GoalError, match="a hand touches what is between"):
        touch((-0.5, -0.3, 2.5), (0.5, 0.3, 3.0))
