"""A run ends when its steps or its minutes are over, and one that was broken off is as one that was not."""

from __future__ import annotations

import math

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch")

from nsm_core.errors import OutputError, WeightsError
from nsm_core.training.checkpoint import write_checkpoint
from nsm_core.training.timed_run import TimedTrainer, run

TRUE = torch.tensor([[2.0, -1.0, 0.5]])


class LineTrainer(TimedTrainer):
    """Learns a linear function of three numbers."""

    def __init__(self, minutes: float = math.inf, steps: int = 0, ticks: float = 0.0, inputs: int = 3):
        self.ticks = np.cumsum([ticks / 2] * 1000).tolist()
        super().__init__(minutes, steps, 7, clock=lambda: self.ticks.pop(0))
        self.net = torch.nn.Linear(inputs, 1)
        self.optimise_by(torch.optim.Adam(self.net.parameters(), lr=0.1))
        self.rates: list[float] = []

    def step_on(self, rng):
        x = torch.from_numpy(rng.normal(size=(16, 3)).astype(np.float32))
        error = (self.net(x) - x @ TRUE.T).square().mean()
        self.descend(error, clipped=1.0)
        self.rates.append(self.optimiser.param_groups[0]["lr"])
        return (float(error.detach()),)

    def judge(self):
        return (float((self.net.weight.detach() - TRUE).norm()),)


def weights(trainer: LineTrainer) -> np.ndarray:
    return trainer.net.weight.detach().numpy()


def test_a_run_that_was_broken_off_ends_as_one_that_was_not(tmp_path):
    whole, begun, gone_on = (LineTrainer(steps=40) for _ in range(3))
    run(whole, tmp_path / "whole", 60.0, lambda _: None)
    for _ in range(15):
        begun.learn()
    begun.save(tmp_path / "parts" / "checkpoint.pt")
    said: list[str] = []
    run(gone_on, tmp_path / "parts", 60.0, said.append)
    assert said[0] == "Going on from step 15." and gone_on.step == whole.step == 40
    assert np.array_equal(weights(whole), weights(gone_on))
    assert whole.judge()[0] < 0.3 * LineTrainer().judge()[0]
    assert np.isclose(whole.rates[0], 0.1) and whole.rates[-1] < 0.1 * whole.rates[0]
    assert (np.diff(whole.rates) < 0).all()


@pytest.mark.parametrize(
    ("minutes", "steps", "taken"), [(1.0, 0, 6), (1.0, 4, 4), (1.0, 20, 6), (math.inf, 20, 20), (0.0, 0, 0)]
)
def test_it_ends_with_what_is_over_first(minutes, steps, taken, tmp_path):
    trainer = LineTrainer(minutes, steps, ticks=20.0)  # ten seconds a step
    run(trainer, tmp_path, 60.0, lambda _: None)
    assert trainer.step == taken and np.isclose(trainer.seconds, 10 * taken)
    line = (tmp_path / "log.csv").read_text().splitlines()[-1].split(",")
    assert int(line[0]) == taken and np.isclose(float(line[1]), taken / 6, atol=0.01)


def test_checkpoints_of_something_else_are_refused_in_a_sentence(tmp_path):
    path = tmp_path / "checkpoint.pt"
    LineTrainer(inputs=2).save(path)
    with pytest.raises(WeightsError, match="of another network or of other data"):
        LineTrainer().load(path)
    mine = LineTrainer()
    write_checkpoint(path, mine.parts(), {"step": 3})  # and no word of its seconds
    with pytest.raises(WeightsError, match="delete it"):
        LineTrainer().load(path)
    with pytest.raises(OutputError, match="The checkpoint cannot be written"):
        mine.save(path / "below")
