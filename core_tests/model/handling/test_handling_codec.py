"""What the controller is told and says: vectors lead from a state to the next, wherever it stands."""

from __future__ import annotations

import numpy as np
import pytest
from handled import walked

from nsm_core.model.features.state import PIVOT
from nsm_core.model.handling.codec import advance, build_inputs, build_targets, carried
from nsm_core.model.handling.layout import INPUT, OUTPUT


@pytest.fixture(scope="module")
def tracks():
    return walked()


def test_targets_lead_from_a_state_to_the_next(tracks):
    frames = np.array((40, 55, 90))
    state, goals = tracks.state(frames), tracks.goals(frames)
    following, coming = tracks.state(frames + 1), tracks.goals(frames + 1)
    told = advance(build_targets(state, goals, following, coming, tracks.feet[frames + 1]), state, goals)
    assert np.allclose(told.state.root_past, following.root_past, atol=1e-4)
    assert np.allclose(told.state.root_future, following.root_future, atol=1e-4)
    assert np.allclose(told.state.joints_future, following.joints_future, atol=1e-4)
    assert np.allclose(told.state.phase, following.phase, atol=1e-4)
    assert np.allclose(told.goal_phase, coming.phase, atol=1e-3)
    assert np.allclose(told.deviation, 0, atol=2e-3)
    # Half of a place comes from where the velocity leads, so that it is near and not the same.
    assert np.abs(told.state.joint_position - following.joint_position).max() < 0.02
    assert np.allclose(told.state.joint_forward, following.joint_forward, atol=1e-4)


def test_goals_are_told_as_what_changes_of_them(tracks):
    frames = np.array((40, 70))
    state, goals = tracks.state(frames), tracks.goals(frames)
    told = build_targets(state, goals, tracks.state(frames + 1), goals, tracks.feet[frames + 1])
    assert not OUTPUT.get(told, "goal_root").any() and not OUTPUT.get(told, "goal_joints").any()
    assert np.allclose(OUTPUT.get(told, "joint_position")[:, 0, 2], tracks.position[frames + 1, 0, 2])


def test_inputs_do_not_depend_on_where_one_stands(tracks):
    frames = np.array((40, 70))
    turned = walked(turn=1.3, shift=(2.0, -5.0))
    for make in (build_inputs, carried):
        here, there = (make(t.state(frames), t.goals(frames)) for t in (tracks, turned))
        assert np.allclose(here, there, atol=1e-3)
    assert here.shape == (2, OUTPUT.size)


def test_goals_are_the_key_frame_next_after_each_key(tracks):
    keys = np.unique(tracks.key)
    frame = int(keys[0]) - 7
    goals = tracks.goals(np.array([frame]))
    assert np.allclose(goals.root[0, PIVOT], tracks.root[keys[0]])
    assert np.allclose(goals.root[0, -1], tracks.root[keys[2]])
    root, joints, label, present = tracks.schedule(frame).at(0.0)
    for told, known in ((root, goals.root), (joints, goals.joints), (label, goals.label)):
        assert np.allclose(told, known[0])
    assert np.allclose(present, goals.present[0])
    assert INPUT.get(build_inputs(tracks.state(np.array([frame])), goals), "label").sum() == 2 + present[0]
