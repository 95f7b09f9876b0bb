"""One road for captures: those that labels are brought for, and a copy under other names with sidecars of its
own, train the same network.
"""

from __future__ import annotations

import shutil
from itertools import pairwise
from pathlib import Path

import captures
import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch")

from small_nsm import CONFIG, prepared

from nsm_core.data.captures import sidecar
from nsm_core.data.export import take_arrays
from nsm_core.data.scenarios.composer import Composer, load
from nsm_core.data.scenarios.take import ComposedTake
from nsm_core.data.storage import Dataset
from nsm_core.model.features.state import WINDOW
from nsm_core.training.trainer import Trainer, TrainingSettings

# A name that labels are brought for, and another for the copy; both in one order, which draws depend on.
NAMES = {
    "accad_female1/female1_run_to_stand": "a day/first.bvh",
    "accad_female1/female1_run_to_walk": "a day/second.bvh",
    "accad_female1/female1_walk": "b.bvh",
    "accad_female1/female1_walk_turn_left_90": "c.bvh",
    "accad_male1/male1_a1_stand": "deep/down/still.bvh",
    "accad_male1/male1_a5_pickupbox": "deep/down/thing.bvh",
    "accad_male2/male2_walk": "e.bvh",
    "cmu/cmu_07_01": "f.bvh",
    "opencap/opencap_sts1": "g.bvh",
}
SEEDS = {"carry": 3, "sit": 3, "walk": 2, "run": 3}  # of takes that are soon composed
SETTINGS = TrainingSettings(steps=6, data_batch=16, pool=16, learning_rate=1e-2, data_minutes=0.5, seed=2)


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> tuple[Path, Path]:
    """Captures under known names without sidecars, and their copy under others with those of the program."""
    known, other = tmp_path_factory.mktemp("known"), tmp_path_factory.mktemp("other")
    for path, name in zip(captures.write_shipped(known, *NAMES), NAMES.values(), strict=True):
        copy = other / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, copy)
        shutil.copy(sidecar.shipped(path), sidecar.sidecar_of(copy))
    assert not list(known.rglob("*" + sidecar.SUFFIX))
    return known, other


@pytest.fixture(scope="module")
def roads(folders) -> tuple[list[ComposedTake], list[ComposedTake]]:
    """Takes of every action that the captures hold, composed of either folder."""
    sources = [load(str(folder)) for folder in folders]
    return tuple([Composer(s, {name: 1}).compose(seed) for name, seed in SEEDS.items()] for s in sources)


def test_composed_takes_are_the_same(roads):
    for one, two in zip(*roads, strict=True):
        assert [p[1:] for p in one.provenance] == [p[1:] for p in two.provenance]
        assert {p.clip for p in one.provenance}.isdisjoint({p.clip for p in two.provenance})
        ours, theirs = take_arrays(one), take_arrays(two)
        for name in ours.keys() - {"validates"}:  # which clips are held back goes by name
            np.testing.assert_array_equal(ours[name], theirs[name])


def trained(takes: list[ComposedTake]) -> tuple[list[float], list[np.ndarray]]:
    """Losses of a few steps on takes, the last of which validates, and the parameters after them."""
    parts = [take_arrays(take) for take in takes]
    frames, things = (np.cumsum([0, *(len(p[k]) for p in parts)]) for k in ("root", "object_cells"))
    for part, frame, thing in zip(parts, frames, things, strict=False):
        part["start"], part["end"] = part["start"] + frame, part["end"] + frame
        part["object"] = np.where(part["object"] >= 0, part["object"] + thing, -1)
        part["validates"][:] = False
    arrays = {name: np.concatenate([p[name] for p in parts]) for name in parts[0]}
    inside = [np.arange(a, b - WINDOW - 1) for a, b in pairwise(frames)]
    trainer = Trainer(Dataset(arrays, np.concatenate(inside)), SETTINGS, CONFIG)
    prepared(trainer)
    losses = [trainer.train_step() for _ in range(SETTINGS.steps)]
    return losses, [p.detach().numpy() for p in trainer.net.parameters()]


def test_a_short_round_of_training_is_the_same(roads):
    (first, ours), (second, theirs) = (trained(takes) for takes in roads)
    assert np.isfinite(first).all()
    np.testing.assert_array_equal(first, second)
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(a, b)
