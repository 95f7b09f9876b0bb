"""Takes composed while training: they come from a process of their own, pass through a ring and are drawn
like stored ones.
"""

from __future__ import annotations

import itertools
import time

import captures
import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch")

from small_nsm import CONFIG, prepared

from nsm_core.data.export import take_arrays
from nsm_core.data.scenarios.composer import Composer
from nsm_core.data.storage import OBJECT_FIELDS
from nsm_core.errors import CaptureError
from nsm_core.training.batches import Batches, RolloutSettings
from nsm_core.training.fresh_takes import LONGEST, THINGS, FreshSettings, FreshTakes, Ring, both
from nsm_core.training.trainer import Trainer, TrainingSettings


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return captures.capture_folder(tmp_path_factory)


@pytest.fixture(scope="module")
def arrays(folder):
    found = [take_arrays(t) for t in captures.takes(folder)]
    return sorted(found, key=lambda a: -a["object"].max())  # takes that sense something first


def test_a_slot_holds_the_take_that_was_written_last(arrays):
    ring = Ring(2)
    assert not len(ring.data.frames) and arrays[0]["object"].max() >= 0
    assert ring.write(arrays[0]) == (0, LONGEST) and ring.write(arrays[1]) == (LONGEST, 2 * LONGEST)
    for slot, take in enumerate(arrays[:2]):
        rows = slice(slot * LONGEST, slot * LONGEST + len(take["root"]))
        np.testing.assert_array_equal(ring.data.arrays["joint_position"][rows], take["joint_position"])
        which, own = ring.data.arrays["object"][rows], take["object"]
        np.testing.assert_array_equal(which, np.where(own >= 0, own + slot * THINGS, -1))
        count = len(take["object_cells"])
        np.testing.assert_array_equal(
            ring.data.arrays["object_cells"][slot * THINGS :][:count], take["object_cells"]
        )
    assert ring.write(arrays[2]) == (0, LONGEST) and ring.written == 3
    mine = ring.data.frames[ring.data.frames < LONGEST]
    assert mine.max() == len(arrays[2]["root"]) - 32  # nothing of the longer or shorter take before is drawn
    state = ring.data.state(mine[[0, -1]])
    np.testing.assert_array_equal(state.joint_position, arrays[2]["joint_position"][mine[[0, -1]]])
    assert np.isfinite(state.root_future).all()


def test_a_take_longer_than_a_slot_is_cut(arrays):
    take = {k: v if k in OBJECT_FIELDS else np.concatenate([v] * 9) for k, v in arrays[0].items()}
    assert len(take["root"]) > LONGEST
    ring = Ring(1)
    ring.write(take)
    assert len(ring.data.frames) == LONGEST - 31 and ring.data.arrays["end"].max() == LONGEST


def test_roll_outs_start_anew_where_their_take_is_gone(arrays):
    ring = Ring(2)
    ring.write(arrays[0])
    ring.write(arrays[1])
    batches = Batches(ring.data, ring.data.frames, np.random.default_rng(0), 40, RolloutSettings())
    before, age = batches.pool_frames.copy(), batches.pool_age.copy()
    gone = slice(*ring.write(arrays[2]))
    batches.replace(ring.data, ring.data.frames, gone)
    inside = before < LONGEST
    assert 0 < inside.sum() < 40
    np.testing.assert_array_equal(batches.pool_frames[~inside], before[~inside])
    np.testing.assert_array_equal(batches.pool_age, np.where(inside, 0, age))
    np.testing.assert_array_equal(
        batches.pool_state.joint_position[inside], ring.data.state(batches.pool_frames[inside]).joint_position
    )
    np.testing.assert_array_equal(
        batches.pool_state.goal_position, ring.data.arrays["goal_position"][batches.pool_frames]
    )


def test_a_process_composes_the_takes_of_its_seeds_and_training_draws_from_them(folder, tmp_path_factory):
    slots, first = 2, 503
    fresh = FreshTakes(str(folder), None, "", first, slots)
    try:
        composer, own = Composer(captures.source(folder)), []
        for seed in itertools.count(first):
            own += both(composer, seed)
            if len(own) >= fresh.ring.written:
                break
        got = fresh.ring.data.arrays
        for slot in range(fresh.ring.written):
            rows = slice(slot * LONGEST, slot * LONGEST + min(len(own[slot]["root"]), LONGEST))
            np.testing.assert_array_equal(got["joint_position"][rows], own[slot]["joint_position"][:LONGEST])
        settings = TrainingSettings(data_batch=16, pool=16, fresh=FreshSettings(share=0.25, slots=slots))
        trainer = Trainer(
            captures.dataset(captures.data_folder(tmp_path_factory)), settings, CONFIG, fresh=fresh
        )
        prepared(trainer)
        assert [(len(b.pool_frames), count) for b, count in trainer.sources] == [(12, 12), (4, 4)]
        before = fresh.ring.written
        for _ in range(1500):
            losses = trainer.train_step()
            if fresh.ring.written > before + 1:
                break
            time.sleep(0.05)  # a busy machine composes slowly
        assert np.isfinite(losses).all() and fresh.ring.written > before + 1
    finally:
        fresh.close()


def test_without_a_take_it_says_what_to_do(folder, tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(CaptureError, match=r"no fresh take was composed; train with --fresh 0"):
        FreshTakes(str(empty), None, "", 0, 4)
