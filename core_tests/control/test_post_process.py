"""Whole takes solved: feet that stand, hips on seats, hands on what they hold, nothing in anything, and no
pops.
"""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from actors import Actor, drive, solved
from walks import seated_pose, synthetic_walk

from nsm_core.body.capsules import penetration_depths
from nsm_core.body.contacts import TOES
from nsm_core.body.ik.solver import AT_ONCE, ROUNDS
from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import (
    ANKLE_HEIGHT,
    ARMS,
    END_SITES,
    FEET,
    HIPS,
    INDEX,
    TOE_HEIGHT,
    J,
    forward_kinematics,
)
from nsm_core.control.actions.touch import Touching
from nsm_core.control.goals import Goal, Moment
from nsm_core.control.post_process import PostProcess
from nsm_core.conventions import FOOT_CONTACTS, FPS, HIP_CONTACT, STYLES
from nsm_core.evaluation.measures.motion import backward_bend, jumps
from nsm_core.evaluation.measures.objects import all_depths
from nsm_core.rotations import quat_from_rotvec, quat_rotate
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.props import Box, sense
from nsm_core.world.scene.terrain import Terrain

POINT = np.array((0.2, -0.5, 1.25))
SEAT = np.array((0.02, -0.03, 0.53))
LEGS = (FEET[0][:3], FEET[1][:3])


def noted(hips, local, contacts, solids=None, seats=None, grasps=()) -> PostProcess:
    """The notes of a motion: hips (T, 3), local rotations (T, 23, 4) and contacts (T, 5)."""
    post = PostProcess(Cuboids() if solids is None else solids, Terrain(), Terrain())
    wrists = forward_kinematics(hips, local)[0][:, [arm[2] for arm in ARMS]]
    for t in range(len(hips)):
        root = np.append(hips[t, :2], 0.0).astype(np.float32)
        moment = Moment(root, hips[t], 0.0, 0.0, np.zeros(len(STYLES)), wrists[t], contacts[t])
        post.note(hips[t], local[t], moment, None if seats is None else seats[t], grasps, 0.0)
    return post


def contacts_of(count: int, feet=True, hips=False) -> np.ndarray:
    contacts = np.zeros((count, 5), np.float32)
    contacts[:, FOOT_CONTACTS] = np.asarray(feet)
    contacts[:, HIP_CONTACT] = np.asarray(hips)
    return contacts


def hanging(local: np.ndarray) -> np.ndarray:
    """The same poses with arms that hang, a little off the body."""
    local = local.copy()
    for side, sign in (("Right", -1.0), ("Left", 1.0)):
        local[:, INDEX[f"{side}Shoulder"]] = quat_from_rotvec(np.array((0, sign * 1.3, 0)))
        local[:, INDEX[f"{side}Elbow"]] = quat_from_rotvec(np.array((0, 0, sign * -0.3)))
    return local


def standing(count: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Somebody who stands on the floor."""
    hips = np.tile((0.0, 0.0, 0.93), (count, 1))
    local = np.zeros((count, J, 4))
    local[..., 0] = 1
    feet = np.array(((-0.1, 0.03, ANKLE_HEIGHT), (0.1, 0.03, ANKLE_HEIGHT)))
    return hips, place_limbs(
        hips, hanging(local), LEGS, np.tile(feet, (count, 1, 1)), np.tile((1.0, 0, 0, 0), (count, 2, 1))
    )


def sliding_walk(frames: int = 150) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A walk whose body goes a tenth further than its feet step, up and down a centimetre too."""
    hips, local, feet = synthetic_walk(frames)
    hips = hips * (1.0, 1.1, 1.0) + 0.01 * np.sin(np.arange(frames) / 7)[:, None] * (1.0, 0.0, 1.0)
    return hips, local, contacts_of(frames, feet)


def toe_speeds(joints: np.ndarray, feet: np.ndarray) -> np.ndarray:
    """Metres a second (N,) over the floor of toes in frames well within their stands."""
    speed = np.linalg.norm(np.diff(joints[:, TOES, :2], axis=0), axis=-1) * FPS
    firm = feet[:-1] & feet[1:]
    firm[1:] &= feet[:-2]  # a stand is landed on first
    return speed[firm]


def test_planted_feet_do_not_slide_and_stand_on_the_floor():
    hips, local, contacts = sliding_walk()
    feet = contacts[:, FOOT_CONTACTS] > 0.5
    before = forward_kinematics(hips, local)[0]
    assert np.median(toe_speeds(before, feet)) > 0.05, "the motion that is given does slide"
    kept = solved(noted(hips, local, contacts))
    joints = forward_kinematics(*kept)[0]
    assert toe_speeds(joints, feet).max() < 0.005
    heights = joints[1:-1, TOES, 2][feet[1:-1] & feet[2:] & feet[:-2]]
    assert np.abs(heights - TOE_HEIGHT).max() < 0.003
    bend = backward_bend(*kept)
    assert bend["knee_backward_deg"] < 1 and bend["elbow_backward_deg"] < 1
    assert jumps(*kept)["jolt_cm"] < 1.5 * jumps(hips, local)["jolt_cm"]


def test_a_motion_that_lacks_nothing_stays_as_it_is():
    hips, local, feet = synthetic_walk(90)
    joints = forward_kinematics(*solved(noted(hips, local, contacts_of(90, feet))))[0]
    apart = np.linalg.norm(joints - forward_kinematics(hips, local)[0], axis=-1)
    assert apart[:, HIPS].max() < 0.01 and apart.max() < 0.03


def sat(seated: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Hips (T, 3) as given and as kept of one who sits 4 cm beside and over a seat, contact label
    ``seated`` (T,).
    """
    hips, local = seated_pose()
    hips = (
        np.tile(SEAT + (0.03, 0.02, 0.02), (len(seated), 1)) + np.sin(np.arange(len(seated)))[:, None] * 0.002
    )
    local = np.tile(local, (len(seated), 1, 1))
    contacts = contacts_of(len(seated), True, seated)
    return hips, solved(noted(hips, local, contacts, seats=[(SEAT, None)] * len(seated)))[0]


def test_hips_settle_on_the_seat_and_leave_it():
    seated = np.zeros(120, bool)
    seated[30:80] = True
    hips, kept = sat(seated)
    assert np.linalg.norm(kept[50:76] - SEAT, axis=1).max() < 0.01
    np.testing.assert_allclose(kept[[0, 5, -1]], hips[[0, 5, -1]], atol=0.008)
    assert np.linalg.norm(np.diff(kept - hips, axis=0), axis=1).max() * FPS < 0.25
    assert np.ptp(kept[50:78], axis=0).min() > 1e-4, "a sitter lives"


def test_without_a_label_nobody_is_drawn_to_a_seat():
    hips, kept = sat(np.zeros(40, bool))
    np.testing.assert_allclose(kept, hips, atol=0.008)


@pytest.fixture(scope="module")
def touched() -> tuple[list[list], np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Leads by frame of one who stands and touches a point before the left shoulder; joints given; joints and
    rotations kept.
    """
    hips, local = standing(75)
    grasp = Touching(POINT, 1, Cuboids())
    post = noted(hips, local, contacts_of(len(hips)), grasps=[grasp])
    kept = solved(post)
    return [n.leads for n in post.notes], forward_kinematics(hips, local)[0], forward_kinematics(*kept)


def test_hands_are_where_they_are_led(touched):
    leads, given, (kept, turns) = touched
    wrist = ARMS[1][2]
    firm = [t for t, led in enumerate(leads) if led and led[0].share > 0.5]
    assert len(firm) > 20 and np.linalg.norm(kept[firm[-1], wrist] - given[firm[-1], wrist]) > 0.4
    gaps = [np.linalg.norm(kept[t, wrist] - leads[t][0].target) for t in firm]
    assert max(gaps) < 0.003
    tips = kept[:, wrist] + quat_rotate(turns[:, wrist], np.array(END_SITES["LeftWrist"]))
    assert np.linalg.norm(tips[-20:] - POINT, axis=1).max() < 0.01, "fingers end at the point that is touched"
    step = np.linalg.norm(np.diff(kept[:, wrist], axis=0), axis=1) * FPS
    assert step.max() < 2.0 and np.abs(np.diff(step)).max() < 0.6, "it comes to speed and to rest"


def test_what_an_arm_reaches_by_itself_moves_neither_trunk_nor_feet_nor_the_other_arm(touched):
    _, given, (kept, _) = touched
    for joint, most in ((TOES[0], 0.003), (TOES[1], 0.003), (ARMS[0][2], 0.02), (INDEX["Neck"], 0.02)):
        assert np.linalg.norm(kept[:, joint] - given[:, joint], axis=-1).max() < most


def block(low, high) -> Cuboids:
    return Cuboids([((0, 0), 0.0, np.array([low]), np.array([high]))])


@pytest.mark.parametrize(
    ("name", "solid"),
    [
        ("toes under a plinth", block((-0.5, -0.6, 0.0), (0.5, -0.12, 0.12))),
        ("an elbow in a post", block((0.3, -0.1, 0.0), (0.5, 0.3, 2.2))),
        ("a thigh at the edge of a table", block((0.13, -0.5, 0.66), (0.9, 0.5, 0.7))),
        ("a trunk in a wall", block((-1.0, 0.09, 0.0), (1.0, 0.5, 2.2))),
    ],
)
def test_bodies_give_way_to_what_is_solid(name, solid):
    hips, local = standing(40)
    assert penetration_depths(hips, local, solid).max() > 0.015, "it is in it at first"
    kept = solved(noted(hips, local, contacts_of(len(hips)), solid))
    assert penetration_depths(*kept, solid).max() < 0.006, name
    away = np.linalg.norm(forward_kinematics(*kept)[0] - forward_kinematics(hips, local)[0], axis=-1)
    assert away.max() < 0.2


def test_a_walker_goes_by_a_post_with_arms_and_feet_and_no_pop():
    hips, local, feet = synthetic_walk(150)
    local = hanging(local)
    post = Cuboids([((0.5, hips[75, 1]), 0.0, [(-0.2, -0.05, 0.0)], [(0.2, 0.05, 2.0)])])
    assert penetration_depths(hips, local, post).max() > 0.03
    kept = solved(noted(hips, local, contacts_of(150, feet), post))
    assert penetration_depths(*kept, post).max() < 0.01
    assert (
        jumps(*kept)["jolt_cm"] < jumps(hips, local)["jolt_cm"] + 1
        and jumps(*kept)["turn_per_frame_deg"] < 20
    )
    assert toe_speeds(forward_kinematics(*kept)[0], feet).max() < 0.005


@pytest.fixture(scope="module")
def carried() -> Actor:
    """A crate from one place on the floor to another, by hands that miss by some centimetres."""
    half = np.array((0.18, 0.15, 0.14))
    query = Cuboids([((0, 0, 0), 0.0, -half[None], half[None])])
    crate = Box("Crate", query, sense(query, -half, half), np.array((0.0, -1.2, 0.14, 0.3)), 2 * half)
    goal = Goal("carry", "Crate", np.array((1.2, -1.5, 0.14)), 0.8, 0.1, prop=crate)
    return drive([goal], error=(0.02, -0.02, 0.02))


def test_hands_meet_what_they_carry_and_the_body_keeps_out_of_it(carried):
    poses = {"Crate": carried.track("Crate")}
    network = [np.array(c) for c in zip(*(f["network"] for f in carried.frames), strict=True)]
    given, kept = (all_depths(*m, carried.solids, carried.props, poses) for m in (network, carried.kept))
    assert carried.director.results[0].reached and carried.hand_errors(0)[0] < 0.1
    assert given.max() > 0.05 and kept.max() < 0.025


def test_solving_goes_on_in_small_slices():
    """Whoever waits for it hears of it as often as there are rounds over every part of a take."""

    def slices(count: int) -> int:
        hips, local = standing(count)
        solving = noted(hips, local, contacts_of(count)).solve(())
        return sum(1 for _ in solving)

    short, long = slices(AT_ONCE), slices(5 * AT_ONCE)
    assert short >= 2 * len(ROUNDS) and long - short >= 4 * len(ROUNDS)
    assert AT_ONCE <= 60, "a slice is one round of no more than two seconds of motion"


@pytest.mark.parametrize("count", [1, 2, 5])
def test_the_shortest_takes_are_solved(count):
    hips, local = standing(count)
    kept_hips, kept = solved(noted(hips, local, contacts_of(count)))
    assert kept_hips.shape == (count, 3) and kept.shape == (count, J, 4)
    np.testing.assert_allclose(np.linalg.norm(kept, axis=-1), 1, atol=1e-6)
    np.testing.assert_allclose(kept_hips, hips, atol=0.01)


def test_notes_are_left_as_they_are_so_that_a_take_may_go_on():
    hips, local, contacts = sliding_walk(60)
    post = noted(hips, local, contacts)
    before = deepcopy(post.notes)
    first = solved(post)
    for one, other in zip(before, post.notes, strict=True):
        for name in ("hips", "local", "contacts"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for a, b in zip(first, solved(post), strict=True):
        np.testing.assert_array_equal(a, b)
