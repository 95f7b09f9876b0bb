"""Takes stepped together become what each becomes by itself, whichever ends first."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.control.batch import step_together
from nsm_core.control.goals import Goal
from nsm_core.control.take import STAGES, TakeRequest, TakeRunner
from nsm_core.model.inference.model import load_model
from nsm_core.world.geometry.distance import Cuboids

FRAMES = 70


def takes(model) -> list[TakeRunner]:
    """Two walks from places of their own, and a stand between them that is over first."""
    goals = [
        Goal("walk", "there", np.array((0.3, -3.0, 0.0)), 0.0),
        Goal("idle", "here", np.array((2.0, 1.0, 0.0)), 0.4, hold=0.2),
        Goal("walk", "back", np.array((-1.0, 2.0, 0.0)), 1.0),
    ]
    starts = [(0.0, 0.0), (2.0, 1.0), (3.0, 0.0)]
    requests = zip(starts, goals, strict=True)
    return [
        TakeRunner(model, TakeRequest(np.array(start), 0.4, [goal], Cuboids([]), seed=7))
        for start, goal in requests
    ]


def test_together_is_as_alone():
    model = load_model(backend="numpy")
    together, alone = takes(model), takes(model)
    went_on, grown = [], []
    for _ in range(FRAMES):
        went_on.append(step_together(together))
        grown.append([take.frames for take in together])
    went_on, grown = np.array(went_on), np.array(grown)
    assert went_on[:, ::2].all() and went_on[0, 1]
    # The one that is complete first is solved, a little at a step, while the others go on.
    steps = (np.diff(grown[:, 1], prepend=1) == 0) & went_on[:, 1]
    assert steps.sum() > 10 and not went_on[-1, 1]
    for one, other in zip(together, alone, strict=True):
        while other.frames < one.frames and other.step():
            pass
        ours, theirs = one.result(), other.result()
        assert ours.root.shape == theirs.root.shape and ours.experts.shape == (one.frames, 8)
        # Sums of a batch round otherwise than those of one character, and every frame builds on the last.
        np.testing.assert_allclose(ours.root, theirs.root, atol=2e-3)
        np.testing.assert_allclose(ours.network_hips, theirs.network_hips, atol=2e-3)
        assert set(ours.stage_ms) == set(STAGES) and all(ms > 0 for ms in ours.stage_ms.values())
    assert together[0].frames == FRAMES + 1 and together[1].frames == grown[-20, 1] < FRAMES - 20


def test_takes_of_several_networks_are_not_mixed():
    first, second = takes(load_model(backend="numpy"))[0], takes(load_model(backend="numpy"))[1]
    with pytest.raises(ValueError, match="one network"):
        step_together([first, second])
    assert first.frames == second.frames == 1
