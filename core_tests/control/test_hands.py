"""Bodies of another build at a box: off belly and palms, hands on its sides, a neck that stays over it."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.capsules import BUNDLED, CAPSULES, Figure, Spheres
from nsm_core.body.ik.grip import Grip
from nsm_core.body.ik.solver import Pose, solved
from nsm_core.body.ik.stiffness import stiffness
from nsm_core.body.skeleton import ARMS, INDEX, OFFSETS, J
from nsm_core.control.actions.hold import Lead
from nsm_core.control.goals import Goal
from nsm_core.control.hands import AT_WORK, hands_of
from nsm_core.errors import GoalError
from nsm_core.rotations import quat_conjugate, quat_from_rotvec, quat_rotate
from nsm_core.world.affordances.standing import further_off
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.props import Box, Leaf, sense

FRAMES, LED = 90, slice(40, 60)
WRISTS, NECK = [arm[2] for arm in ARMS], INDEX["Neck"]


def built(bulk: float = 1.0, trunk: float = 1.0, hands: float = 1.0) -> Figure:
    """The bundled body with a trunk and hands as many times as thick, and a spine as many times as long."""
    offsets = OFFSETS.astype(float).copy()
    offsets[[INDEX[n] for n in ("Chest", "Chest2", "Chest3", "Chest4")], 2] *= trunk

    def times(name: str) -> float:
        return bulk if name.startswith(("Hips", "Chest")) else hands if name.endswith("Wrist") else 1.0

    capsules = [
        c._replace(radius_a=c.radius_a * times(c.a), radius_b=c.radius_b * times(c.b)) for c in CAPSULES
    ]
    return Figure(offsets, Spheres(capsules, offsets))


def crate() -> Box:
    half = np.array((0.19, 0.15, 0.13))
    query = Cuboids([((0, 0, 0), 0.0, -half[None], half[None])])
    return Box("Box", query, sense(query, -half, half), np.array((0, -1.5, 0.13, 0.0)), size=2 * half)


def test_a_box_is_kept_off_a_belly_and_large_palms():
    goal = Goal("carry", "Box", (0, -3, 0.13), 0.0, prop=crate())
    assert goal.fitting(BUNDLED) is goal
    bulky = goal.fitting(built(bulk=1.5, hands=3.0)).prop
    assert bulky.off == pytest.approx(0.5 * 0.11, abs=0.01) and 0.03 < bulky.palm < 0.06
    own, plain = bulky.grasps(0.0), crate().grasps(0.0)
    assert own[:, 0] == pytest.approx(plain[:, 0] + (-bulky.palm, bulky.palm)) and goal.prop.off == 0
    gap = further_off(bulky, 0.0, bulky.pose, 0.0, None) - further_off(crate(), 0.0, bulky.pose, 0.0, None)
    assert gap == pytest.approx(bulky.off)


def test_who_is_wider_than_a_door_is_told_so():
    query = Cuboids([((0, 0, 0), 0.0, np.array([(0, -0.02, 0)]), np.array([(0.85, 0.02, 2)]))])
    leaf = Leaf("Door", query, sense(query, (0, -0.02, 0), (0.85, 0.02, 2)), np.zeros(4), handle=(0.8, 0, 1))
    goal = Goal("open", "Door", (0, 0, 0), 0.0, prop=leaf)
    assert goal.fitting(built(bulk=1.5)) is goal
    with pytest.raises(GoalError, match=r"times as wide as Door; choose a wider door"):
        goal.fitting(built(bulk=5.0))


@pytest.fixture(scope="module")
def bending():
    """A body that bows, hands hanging, and the leads of its hands to the sides of a thing for a while."""
    turns = np.zeros((FRAMES, J, 3))
    bow = np.sin(np.linspace(0, np.pi, FRAMES))
    for name in ("Chest", "Chest2", "Chest3"):
        turns[:, INDEX[name], 0] = 0.35 * bow
    for (shoulder, _, _), sign in zip(ARMS, (-1, 1), strict=True):
        turns[:, shoulder, 1] = sign * 1.3
    hips, local = np.tile(OFFSETS[0].astype(float), (FRAMES, 1)), quat_from_rotvec(turns)
    left, ahead = np.eye(3)[0], np.array((0.0, -1.0, 0.0))
    leads = [[] for _ in range(FRAMES)]
    for t in range(FRAMES)[LED]:
        leads[t] = [
            Lead(h, np.array((sign * 0.22, -0.45, 0.8)), 1.0, grip=Grip(-sign * left, ahead))
            for h, sign in ((0, -1), (1, 1))
        ]
    return hips, local, leads


def test_hands_are_laid_on_what_they_hold_and_only_then(bending):
    hips, local, leads = bending
    pose = Pose(BUNDLED.tree, hips, local)
    hands = hands_of(leads, pose, BUNDLED)
    free = np.ones(FRAMES, bool)
    free[LED] = False
    assert not hands.firm[free].any() and not hands.laid[free].any()
    assert hands.turns[free] == pytest.approx(pose.world[free][:, WRISTS])
    for side, way in ((0, 1.0), (1, -1.0)):
        palm = quat_rotate(hands.turns[LED, side], np.tile((0.0, 0.0, -1.0), (20, 1)))
        assert palm @ (way, 0, 0) == pytest.approx(np.ones(20), abs=1e-6)
    assert hands.trunk(pose) == []


def test_a_longer_trunk_takes_hands_and_neck_no_lower_than_the_network(bending):
    hips, local, leads = bending
    tall = built(trunk=1.6)
    own, network = Pose(tall.tree, hips, local), Pose(BUNDLED.tree, hips, local)
    hands = hands_of(leads, own, tall)
    just = LED.start - 4  # before they are led
    assert np.linalg.norm(own.positions[just, WRISTS] - network.positions[just, WRISTS], axis=-1).min() > 0.1
    assert hands.wrists[just] == pytest.approx(network.positions[just, WRISTS], abs=0.01)
    assert hands.wrists[0] == pytest.approx(own.positions[0, WRISTS])
    steps = np.linalg.norm(np.diff(hands.wrists[: LED.start], axis=0), axis=-1)
    assert steps.max() < 0.03 and LED.start > AT_WORK
    eased = solved(own, hands.trunk(own), stiffness())
    gap = [abs(p.positions[just, NECK, 1] - network.positions[just, NECK, 1]) for p in (own, eased)]
    assert gap[0] > 0.1 and gap[1] < 0.03
    assert eased.positions[0] == pytest.approx(own.positions[0], abs=0.02)


@pytest.mark.parametrize("palm", [(0.0, 0.0, -1.0), (1.0, 0.0, 0.0)])
def test_a_handle_lies_across_the_palm_with_fingers_before_the_board(bending, palm):
    hips, local, _ = bending
    pose = Pose(BUNDLED.tree, hips, local)
    bar, ahead, room = np.array((-0.25, -0.5, 0.95)), np.array((0.0, -1.0, 0.0)), 0.04
    leads = [[] for _ in range(FRAMES)]
    for t in range(FRAMES)[LED]:
        leads[t] = [Lead(0, bar - 0.03 * ahead, 1.0, grip=Grip(np.array(palm), ahead, bar, room))]
    hands = hands_of(leads, pose, BUNDLED)
    wrist = hands.wrists[LED, 0]
    assert wrist - hands.beside[LED, 0] == pytest.approx(np.tile(bar - 0.03 * ahead, (20, 1)))
    from_bar = quat_rotate(quat_conjugate(hands.turns[LED, 0]), bar - wrist)
    assert from_bar[:, 0].max() < -0.07 and from_bar[:, 2] == pytest.approx(np.full(20, -0.03), abs=1e-6)
    assert from_bar[:, 1] == pytest.approx(np.zeros(20), abs=1e-6)
    tips = wrist + quat_rotate(hands.turns[LED, 0], np.tile((-BUNDLED.hand, 0.0, 0.0), (20, 1)))
    assert (tips @ ahead).max() < bar @ ahead + room
    own = hands.twisted(local)
    before, after = (BUNDLED.tree.forward(hips, turns) for turns in (local, own))
    assert after[0] == pytest.approx(before[0], abs=1e-6)
    assert after[1][:, WRISTS] == pytest.approx(before[1][:, WRISTS], abs=1e-6)
