"""Phases as a linear system, and the filter that finds the goal's."""

from __future__ import annotations

import numpy as np

from nsm_core.conventions import DT
from nsm_core.model.handling.phase import GoalFilter, control_of, controlled, phase_of, wave_of


def states(rng: np.random.Generator, count: int = 5) -> np.ndarray:
    return np.stack(
        (rng.random((count, 8)), rng.uniform(0.1, 1, (count, 8)), rng.uniform(0.1, 4, (count, 8))), axis=1
    )


def test_without_control_a_phase_turns_by_its_frequency():
    phase = states(np.random.default_rng(0))
    following = controlled(phase, np.zeros_like(phase))
    step = following[:, 0] - phase[:, 0]
    assert np.allclose((step - DT * phase[:, 2] + 0.5) % 1 - 0.5, 0)
    assert np.allclose(following[:, 1:], phase[:, 1:])


def test_the_control_between_two_states_leads_from_one_to_the_other():
    rng = np.random.default_rng(1)
    one, other = states(rng), states(rng)
    reached = controlled(one, control_of(one, other))
    assert np.allclose((reached[:, 0] - other[:, 0] + 0.5) % 1 - 0.5, 0, atol=1e-9)
    assert np.allclose(reached[:, 1:], other[:, 1:])


def test_waves_tell_phases():
    phase = states(np.random.default_rng(2))
    assert np.allclose(phase_of(wave_of(phase), phase[:, 2]), phase)


def test_the_filter_finds_a_goal_that_is_measured_with_noise():
    rng = np.random.default_rng(3)
    variance = np.stack((np.full(8, 1 / 12), np.full(8, 0.05), np.full(8, 0.3)))
    truth = states(rng, 1)
    truth[:, 2] = 0.05  # slow, so that what it turns by is small beside the noise
    kalman = GoalFilter.unknown(variance, 1)
    kalman.renew(np.arange(1))
    off, single = [], []
    for _ in range(300):
        noisy = truth + rng.normal(0, 0.05, truth.shape)
        kalman.predict()
        kalman.measure(noisy, np.full(1, 4.0))
        off.append(np.abs((kalman.state - truth)[:, 1:]).mean())
        single.append(np.abs((noisy - truth)[:, 1:]).mean())
    assert np.mean(off[50:]) < 0.75 * np.mean(single[50:])


def test_the_more_the_views_deviate_the_less_is_believed():
    variance = np.ones((3, 8))
    gone = []
    for doubt in (0.1, 1.0, 10.0):
        kalman = GoalFilter.unknown(variance, 1)
        kalman.predict()
        kalman.measure(np.full((1, 3, 8), 0.4), np.full(1, doubt))
        gone.append(float(kalman.state[:, 1].mean()))
    assert gone[0] > gone[1] > gone[2] > 0
    assert np.isclose(gone[1], 0.2, atol=0.01)  # as sure of either: half way


def test_one_who_is_not_measured_stays_where_he_is_led():
    kalman = GoalFilter.unknown(np.ones((3, 8)), 2)
    kalman.predict()
    kalman.measure(np.full((2, 3, 8), 0.4), np.ones(2), np.array((True, False)))
    assert kalman.state[0, 1].min() > 0.1 and not kalman.state[1].any()
    assert kalman.spread[0, 0, 0, 0] < kalman.spread[1, 0, 0, 0]
