"""The head leads: into turns, along the way, and to what hands come to; at rest it stays as it is."""

from __future__ import annotations

import numpy as np

from nsm_core.body.ik.solver import Pose
from nsm_core.body.skeleton import INDEX, OFFSETS, J
from nsm_core.body.tree import HUMAN
from nsm_core.control.actions.hold import Lead
from nsm_core.control.gaze import SIDE, looking
from nsm_core.rotations import direction_to_heading, heading_quat, quat_rotate, wrap_angle
from nsm_core.signals import smooth_step

HEAD, CHEST = INDEX["Head"], INDEX["Chest4"]


def standing(headings: np.ndarray, places: np.ndarray | None = None) -> Pose:
    count = len(headings)
    local = np.zeros((count, J, 4))
    local[..., 0] = 1
    local[:, 0] = heading_quat(headings)
    hips = np.zeros((count, 3)) if places is None else np.column_stack((places, np.zeros(count)))
    return Pose(HUMAN, hips + (0, 0, OFFSETS[0, 2]), local)


def facing(pose: Pose, joint: int) -> np.ndarray:
    forward = quat_rotate(pose.world[:, joint], np.broadcast_to((0.0, -1.0, 0.0), (len(pose.hips), 3)))
    return np.unwrap(direction_to_heading(forward[:, :2]))


def test_the_head_goes_into_a_turn_first_the_chest_after_it_and_the_hips_last():
    headings = np.radians(120) * smooth_step((np.arange(90) - 30) / 30)
    still = standing(headings)
    pose = looking(still, [[]] * 90)
    half = [int(np.argmax(facing(pose, j) > np.radians(30))) for j in (HEAD, CHEST, 0)]
    assert half[0] + 5 <= half[2] and half[0] < half[1] < half[2], half
    neck = wrap_angle(facing(pose, HEAD) - facing(pose, 0))
    assert np.abs(neck).max() < SIDE + 0.1 and np.degrees(np.abs(np.diff(neck)).max()) < 8
    np.testing.assert_array_equal(pose.hips, still.hips)
    assert np.abs(neck[[0, 10, -1]]).max() < 0.02, "at rest it looks ahead"


def test_one_looks_where_one_goes_but_not_behind_when_one_steps_back():
    step = np.column_stack((np.linspace(0, 3, 90), np.zeros(90)))  # along +X, facing 30 degrees off it
    aside = looking(standing(np.full(90, np.radians(60)), step), [[]] * 90)
    assert abs(np.degrees(facing(aside, HEAD)[40]) - 90) < 8
    back = looking(standing(np.full(90, np.radians(-90)), step), [[]] * 90)
    np.testing.assert_allclose(facing(back, HEAD), np.radians(-90), atol=1e-6)


def test_one_looks_at_what_hands_come_to():
    place = np.array((-0.5, -0.4, 0.5))
    shares = np.clip((np.arange(90) - 40) / 12, 0, 1)
    leads = [[Lead(0, place, float(s))] if s > 0 else [] for s in shares]
    pose = looking(standing(np.zeros(90)), leads)

    def off(t: int) -> float:
        forward = quat_rotate(pose.world[t, HEAD], np.array((0.0, -1.0, 0.0)))
        to = place - pose.positions[t, HEAD]
        return float(np.degrees(np.arccos(forward @ to / np.linalg.norm(to))))

    assert off(0) > 60 and off(45) < 40 and off(40) < 40, "before the hand is on its way"
    assert off(89) > 55, "and no longer once it holds it"
