"""A training by two processes under torchrun: the batches, the losses and the network of one."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import captures
import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch")

from small_nsm import CONFIG, prepared

from nsm_core.data.storage import Dataset
from nsm_core.errors import WeightsError
from nsm_core.training.ranks import ALONE, Ranks
from nsm_core.training.trainer import Trainer, TrainingSettings

ROOT = Path(__file__).resolve().parents[2]
STEPS = 60
SETTINGS = TrainingSettings(steps=STEPS, data_batch=48, pool=48, learning_rate=1e-2, averaging=0.5, seed=4)


def train(data: Dataset, ranks: Ranks) -> tuple[list[tuple[float, float]], Trainer]:
    """The losses of the steps of one process, and its trainer."""
    torch.set_num_threads(1)
    trainer = Trainer(data, SETTINGS, CONFIG, ranks=ranks)
    prepared(trainer, 2000)
    ranks.alike(trainer.net, trainer.average)
    return [trainer.train_step() for _ in range(STEPS)], trainer


def main(arrays: str, out: str) -> None:
    """What ``torchrun`` starts."""
    ranks = Ranks.joined("cpu")
    with np.load(arrays) as held:
        data = {name: held[name] for name in held.files}
    losses, trainer = train(Dataset(data, data.pop("frames of the data")), ranks)
    numbers = float(sum(p.double().abs().sum() for p in trainer.net.parameters()))
    found = {"losses": losses, "validation": trainer.validate(), "numbers": numbers}
    found["pool"] = trainer.batches.pool_frames.tolist()
    Path(out, f"{ranks.rank}.json").write_text(json.dumps(found))
    ranks.leave()


@pytest.fixture(scope="module")
def both(tmp_path_factory) -> tuple[np.ndarray, float, list[dict]]:
    """Losses (steps, 2) and validation loss of one process, and what each of two has written."""
    data, out = captures.dataset(captures.data_folder(tmp_path_factory)), tmp_path_factory.mktemp("ranks")
    np.savez(out / "data.npz", **data.arrays, **{"frames of the data": data.frames})
    paths = os.pathsep.join((str(ROOT), str(ROOT / "core_tests")))
    done = subprocess.run(
        [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2", __file__,
         str(out / "data.npz"), str(out)],
        env={**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1"},
        capture_output=True, text=True, timeout=240,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    losses, trainer = train(data, ALONE)
    return (
        np.array(losses),
        trainer.validate(),
        [json.loads((out / f"{rank}.json").read_text()) for rank in range(2)],
    )


def test_two_processes_have_one_network_and_tell_one_loss(both):
    first, second = both[2]
    assert first["numbers"] == second["numbers"] and first["losses"] == second["losses"]
    # Each has roll-outs of its own.
    assert len(first["pool"]) == len(second["pool"]) == SETTINGS.pool // 2
    assert set(first["pool"]) != set(second["pool"])


def test_two_processes_give_the_loss_of_one(both):
    alone, validation, (first, _) = both
    together = np.array(first["losses"])
    # The first step sees the same rows and the same noise: only sums are in another order.
    np.testing.assert_allclose(together[0], alone[0], rtol=1e-4)
    assert together[-10:, 0].mean() < 0.8 * together[0, 0], "it learns"
    # Later on roll-outs restart at other frames, and half precision rounds other sums.
    np.testing.assert_allclose(together[:, 0].mean(), alone[:, 0].mean(), rtol=0.03)
    assert first["validation"] == pytest.approx(validation, rel=0.05)


def test_one_process_is_alone_and_draws_as_ever():
    rng = np.random.default_rng(3)
    assert Ranks.joined("cpu") == ALONE and ALONE.first and ALONE.draws(rng, 1, 2) is rng
    assert ALONE.device("cuda") == "cuda" and Ranks(1, 2, 1).device("cuda") == "cuda:1"


def test_shares_are_disjoint_and_together_all_rows():
    rows = np.arange(11)
    shares = [rows[Ranks(rank, 3).share] for rank in range(3)]
    assert sorted(np.concatenate(shares)) == list(rows)


def test_who_finds_no_others_is_told_in_one_sentence(monkeypatch):
    monkeypatch.setenv("WORLD_SIZE", "2")
    for name in ("RANK", "MASTER_ADDR", "MASTER_PORT"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(WeightsError, match="start them with torchrun, or train with one"):
        Ranks.joined("cpu")


if __name__ == "__main__":
    main(*sys.argv[1:])
