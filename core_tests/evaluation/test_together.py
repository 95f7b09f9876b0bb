"""Trials rolled out side by side give the figures that each gives by itself; each breaks off for itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, roll
from nsm_core.errors import GoalError
from nsm_core.evaluation.report import reports_of, shares
from nsm_core.evaluation.trials import locomotion, sit
from nsm_core.evaluation.trials.together import TOGETHER, alone, rolled, together, told
from nsm_core.model.inference.model import Model, load_model
from nsm_core.world.geometry.distance import Cuboids


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(backend="numpy")


def stand(hold: float = 0.3) -> TakeRequest:
    return TakeRequest(np.zeros(2), 0.4, [Goal("idle", "here", np.zeros(3), 0.0, hold)], Cuboids())


def close(figure: float, other: float, name: str) -> bool:
    """Whether a figure is the same but for the rounding of sums, which a frame hands on to the next."""
    return bool(np.isclose(figure, other, rtol=0.02, atol=0.05, equal_nan=True)) or name == "ms_per_frame"


def test_figures_are_those_of_each_trial_by_itself(model):
    seat = replace(sit.trials(1, 1)[0], start=np.array((0.1, -0.9)), heading=0.0)
    jobs = [
        ("response", None, locomotion.orders(1)[1]),
        ("sit", None, replace(seat, start=np.array((np.nan, 0.0)))),
        ("sit", None, seat),
        ("response", None, locomotion.orders(1)[6]),
    ]
    ours, theirs = reports_of(model, jobs, most=3), [reports_of(model, [job])[0] for job in jobs]
    assert [r["reached"] for r in ours] == [1, 0, 1, 1]
    assert "not a number" in ours[1]["error"] and ours[1] == theirs[1]
    for mine, other in zip((ours[0], *ours[2:]), (theirs[0], *theirs[2:]), strict=True):
        assert mine.keys() == other.keys()
        assert not {k: (mine[k], other[k]) for k in mine if not close(mine[k], other[k], k)}


def test_a_take_rolled_out_in_a_trial_is_the_take(model):
    mine, other = alone(rolled(model, stand())), roll(model, stand())
    np.testing.assert_array_equal(mine.root, other.root)
    np.testing.assert_array_equal(mine.local_rotations, other.local_rotations)
    assert len(alone(rolled(model, stand(9.0), limit=0.5)).root) == 15


def test_what_breaks_off_ends_its_own_trial_alone(model):
    told_of = []

    def spoilt(caught: bool):
        try:
            take = rolled(model, stand())
            runner = next(take)
            yield runner
            runner.state.joint_position[:] = np.nan
            yield runner
        except GoalError as error:
            told_of.append(str(error))
            if not caught:
                raise
        return "went on"

    def faulty():
        yield next(rolled(model, stand()))
        raise ValueError("of the judge")

    made = together([spoilt(False), rolled(model, stand()), spoilt(True), faulty()], most=3)
    assert isinstance(made[0], GoalError) and "broke down" in str(made[0]) and len(told_of) == 2
    np.testing.assert_allclose(made[1].root, alone(rolled(model, stand())).root, atol=1e-3)
    assert made[2] == "went on" and isinstance(made[3], ValueError)
    with pytest.raises(ValueError, match="of the judge"):
        told(made[3])
    assert together([]) == []


def test_trials_of_several_networks_are_not_mixed(model):
    other = load_model(backend="numpy")
    with pytest.raises(ValueError, match="one network"):
        together([rolled(model, stand()), rolled(other, stand())])


def test_workers_get_trials_of_one_network_and_every_trial_once():
    jobs = [("sit", ablation, n) for n in range(70) for ablation in (None, "environment sensor zeroed")]
    handed = shares(jobs, 2)
    assert sorted(n for some in handed for n in some) == list(range(140))
    assert all(len({jobs[n][1] for n in some}) == 1 and len(some) <= 4 * TOGETHER for some in handed)
    assert len(handed) >= 4 and shares([], 2) == []
    assert [len(some) for some in shares(jobs[:8:2], 2)] == [2, 2] and len(shares(jobs[:1], 4)) == 1
