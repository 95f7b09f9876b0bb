"""How far a leaf may turn for a body: spheres before it, behind it, past its edge and about its hinge; trunks
that lean less near it.
"""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.skeleton import J
from nsm_core.control.actions.hold import SeenBody
from nsm_core.control.actions.leaf_room import SOON, TOUCH, LeafRoom, leaf_spheres
from nsm_core.world.scene.door import make_door
from nsm_core.world.scene.props import Leaf

WIDTH, PANEL = 0.9, 0.04


def shut(swing: float = 1.0) -> Leaf:
    door = make_door(np.random.default_rng(1), width=WIDTH, panel=PANEL, height=2.0)
    return door.leaf((1.0, -2.0, 0.0, 0.6), swing)


def sphere(leaf: Leaf, away: float, degrees: float, height: float = 1.0) -> np.ndarray:
    """World centre (1, 3) of a sphere ``away`` metres from the hinge, at that opening angle of the leaf."""
    return leaf.to_world(np.array(((away, 0.0, height),)), leaf.pose_at(np.radians(degrees)))


@pytest.mark.parametrize("swing", [1.0, -1.0])
@pytest.mark.parametrize("height", [0.03, 1.7])
def test_the_leaf_touches_a_sphere_at_the_angles_told(swing, height):
    leaf, radius = shut(swing), 0.1
    leaf.pose = leaf.pose_at(np.radians(45))
    room = LeafRoom(leaf)
    for degrees, which in ((20, 0), (70, 1)):
        centre = sphere(leaf, 0.6, degrees, height)
        angle = room.limits(centre, np.array((radius,)))[which]
        assert np.isinf(room.limits(centre, np.array((radius,)))[1 - which])
        there = Leaf(**{**leaf.__dict__, "pose": leaf.pose_at(angle)})
        assert there.signed_distance(centre, 1.0)[0] == pytest.approx(radius + TOUCH, abs=0.002)
        assert (angle - np.radians(degrees)) * (1 if which == 0 else -1) > 0


def test_what_is_out_of_its_reach_leaves_it_free():
    leaf = shut()
    room = LeafRoom(leaf)
    for away, degrees, height in ((WIDTH + 0.12, 30, 1.0), (0.6, 30, 2.2), (0.6, 170, 1.0), (0.05, 30, 1.0)):
        assert np.isinf(room.limits(sphere(leaf, away, degrees, height), np.array((0.1,)))).all(), (
            away,
            degrees,
            height,
        )
    grazing = room.limits(sphere(leaf, WIDTH + 0.05, 30), np.array((0.1,)))[1]
    assert np.radians(20) < grazing < np.radians(30), "the edge meets what stands past it"


def test_a_trunk_leans_less_the_nearer_it_is():
    leaf = shut(-1.0)
    room, size = LeafRoom(leaf), np.array((0.1,))
    shares = []
    for off in (0.5, 0.1 + PANEL / 2 + SOON / 2, 0.1 + PANEL / 2):
        shares.append(room.share_to_lean((leaf.to_world(np.array(((0.6, off, 1.4),))), size)))
    assert shares[0] == 1.0 and 0.2 < shares[1] < 0.8 and shares[2] == 0.0


def test_the_arm_that_holds_is_left_out_and_the_trunk_told():
    local = np.zeros((J, 4))
    local[:, 0] = 1
    pose = SeenBody(np.array((0.0, 0.0, 0.9)), local, np.zeros((2, 3)))
    (whole, _), (trunk, _) = leaf_spheres(pose)
    (without, _), (same, _) = leaf_spheres(pose, 0)
    assert len(without) < len(whole) and without[:, 0].min() > whole[:, 0].min() + 0.3, (
        "the right arm of the rest pose points to -X"
    )
    np.testing.assert_array_equal(trunk, same)
    assert np.abs(trunk[:, 0]).max() < 0.3 and trunk[:, 2].max() > 1.5
