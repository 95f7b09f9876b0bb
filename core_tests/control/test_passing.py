"""Goals without a stay flow into each other: one walks through a place on the way to the next."""

from __future__ import annotations

import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeRunner
from nsm_core.model.inference.model import load_model
from nsm_core.world.geometry.distance import Cuboids


def walked(hold: float) -> tuple[np.ndarray, list]:
    """Speeds (T,), m/s, of a walk over two places, and what became of them."""
    goals = [
        Goal("walk", "corner", np.array((0.0, -2.5, 0.0)), 0.0, hold),
        Goal("walk", "end", np.array((2.5, -2.5, 0.0)), 1.57, 0.1),
    ]
    runner = TakeRunner(
        load_model(backend="numpy"), TakeRequest(np.zeros(2), 0.0, goals, Cuboids(), contact_ik=False)
    )
    while runner.step():
        pass
    root = runner.result().root
    off = np.linalg.norm(root[:, :2] - (0.0, -2.5), axis=1)
    assert off.min() < 0.2, "it comes through the place"
    return np.linalg.norm(np.diff(root[:, :2], axis=0), axis=1) * 30, runner.director.results


def test_one_who_does_not_stay_does_not_stop():
    speed, (corner, end) = walked(0.0)
    assert corner.reached and corner.position_error_cm < 25 and end.reached
    around = np.convolve(speed, np.ones(5) / 5, "same")[corner.end_frame - 15 : corner.end_frame + 30]
    assert around.min() > 0.3


def test_one_who_stays_comes_to_rest():
    speed, (corner, end) = walked(0.3)
    assert corner.reached and end.reached
    assert speed[corner.end_frame - 10 : corner.end_frame + 5].min() < 0.15
