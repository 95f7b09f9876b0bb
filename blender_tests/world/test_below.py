"""The ground below a way, felt from above on any mesh."""

from __future__ import annotations

import bpy
import numpy as np
from scenes import box, mesh_of_boxes

from nsm_blender.rigs.character import add_character
from nsm_blender.world.below import Below, ground_below
from nsm_blender.world.evaluated import Snapshot
from nsm_blender.world.frame import WorldFrame

WAY = np.array([(0.0, 0.0, 0.9), (0.0, -1.0, 1.1), (0.0, -2.0, 1.3)])


def below(*but, scale: float = 1.0) -> Below | None:
    snapshot = Snapshot.now(bpy.context.evaluated_depsgraph_get())
    return ground_below(snapshot, bpy.context.scene, but, WorldFrame(scale), WAY, -0.02)


def test_steps_and_slopes_and_the_level_where_nothing_is():
    mesh_of_boxes("Steps", [((-1, -0.3 * k - 0.6, 0), (1, -0.3 * k - 0.3, 0.17 * (k + 1))) for k in range(4)])
    box("Shelf over the way", (-1, -2, 2.4), (1, 0, 2.5))
    box("Far", (8, 8, 0), (9, 9, 1))
    ramp = box("Ramp", (0.9, -2, -0.5), (1.4, -1, -0.3))
    ramp.rotation_euler.x = 0.0
    for vertex in ramp.data.vertices:
        vertex.co.z += -0.5 * (vertex.co.y + 1)  # half a metre up over a metre
    bpy.context.view_layer.update()
    found = below()
    places = np.array([(0, -0.4), (0, -0.7), (0, -1.0), (0, -1.3), (0, 0.5), (1.2, -1.5), (0, -1.95)])
    heights = np.array([0.17, 0.34, 0.51, 0.68, -0.02, -0.3 + 0.25, -0.02])
    assert np.abs(found(places) - heights).max() < 1e-5


def test_it_is_what_characters_collide_with_and_not_themselves():
    assert below() is None
    floor, rug = box("Floor", (-3, -3, -0.1), (3, 3, 0)), box("Rug", (-1, -1, 0), (1, 1, 0.01))
    character = add_character((0.0, 0.0, 0.0))
    bpy.context.view_layer.update()
    here = np.array([(0.0, 0.0), (2.0, 0.0)])
    assert np.allclose(below(character)(here), (0.01, 0.0), atol=1e-6)
    assert below()(here)[0] > 0.5  # the body itself
    rug["nsm_collider"] = False
    assert np.allclose(below(character)(here), 0.0, atol=1e-6)
    floor.display_type = "WIRE"
    assert below(character) is None


def test_it_is_told_in_metres_of_the_character():
    box("Step", (-1, -1, 0), (1, 1, 0.5))
    assert np.allclose(below(scale=2.0)(np.array([(0.2, 0.2)])), 0.25, atol=1e-6)
