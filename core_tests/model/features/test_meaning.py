"""Weights keep what their data meant; others than this version's are refused or remarked on, in one sentence
that names them.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from fuzzing import one_sentence
from random_weights import LAYOUT, random_arrays

from nsm_core import distances
from nsm_core.body import skeleton
from nsm_core.data.storage import require_meaning
from nsm_core.errors import CaptureError, WeightsError
from nsm_core.model.features import meaning as room
from nsm_core.model.features.meaning import differences, meaning, meaning_hash, remark
from nsm_core.model.inference.model import BUNDLED, load_model
from nsm_core.model.inference.weights_file import load_weights, save_weights


@pytest.fixture
def saved(tmp_path, small_config):
    """Weights written with what is in force now, or with a meaning that is given."""

    def save(told=None):
        return save_weights(
            tmp_path / "w.npz",
            *random_arrays(small_config),
            config=small_config,
            layout=LAYOUT,
            meaning=told or meaning(),
        )

    return save


def test_every_shared_distance_is_kept_and_comes_back_from_the_file_as_it_was(saved):
    ours = meaning()
    names = {n for n in vars(distances) if n.isupper()}
    assert (
        names <= ours["features"].keys() | ours["distances"].keys()
        and {"PULL_BACK", "STAND_AHEAD", "WALK_TO_RUN"} <= names
    )
    assert ours["distances"]["WALK_TO_RUN"] == [1.8, 2.4] and ours["features"]["the offset of LeftKnee"] == [
        0,
        0,
        -0.42,
    ]
    told = load_weights(saved(), LAYOUT).metadata
    assert told["meaning"] == ours and told["meaning_hash"] == meaning_hash(ours) == meaning_hash(
        json.loads(json.dumps(ours))
    )
    assert not remark(told) and not differences(told["meaning"], "features")
    assert not set(room._UNITS) - (ours["features"].keys() | ours["distances"].keys()), (
        "units of names that nobody keeps"
    )


def test_weights_of_other_distances_load_with_a_sentence_that_tells_both(saved, monkeypatch):
    with monkeypatch.context() as then:
        then.setattr(distances, "PULL_BACK", 0.5)
        then.setattr(distances, "WALK_TO_RUN", (1.8, 2.5))
        then.setattr(distances, "OF_OLD", 0.3, raising=False)
        path = saved()
    metadata = load_weights(path, LAYOUT).metadata
    (sentence,) = remark(metadata)
    assert "PULL_BACK 0.5 m where this version has 0.55 m" in sentence
    assert "WALK_TO_RUN 1.8 2.5 m/s where this version has 1.8 2.4 m/s" in sentence
    assert "OF_OLD 0.3 m, which this version does not know" in sentence and sentence.endswith(".")
    assert metadata["meaning_hash"] != meaning_hash(meaning())


def test_weights_of_other_features_are_refused(saved, monkeypatch):
    offsets = skeleton.OFFSETS.copy()
    offsets[skeleton.INDEX["LeftKnee"], 2] = -0.4
    with monkeypatch.context() as then:
        then.setattr(room, "OFFSETS", offsets)
        then.setattr(room.environment, "DIAMETER", 3.0)
        then.setattr(room, "ROOT_SMOOTHING", 0.2)
        path = saved()
    with pytest.raises(WeightsError) as caught:
        load_weights(path, LAYOUT)
    told = one_sentence(caught)
    assert (
        "DIAMETER 3 m where this version has 4 m" in told
        and "ROOT_SMOOTHING 0.2 s where this version has 0.12 s" in told
    )
    assert "the offset of LeftKnee 0 0 -0.4 m where this version has 0 0 -0.42 m" in told
    assert load_weights(path).config, "they may still be trained on"


def test_what_is_told_is_short_however_much_differs(saved):
    told = meaning()
    told["distances"] = {k: 9.0 for k in told["distances"]}
    (sentence,) = remark(load_weights(saved(told), LAYOUT).metadata)
    assert f"and {len(told['distances']) - 3} more" in sentence and len(sentence) < 400


@pytest.mark.parametrize(
    "told",
    [{"features": 3, "distances": []}, {}, {"distances": {"PULL_BACK": {"a": ["x"] * 99}, "\n": None}}],
)
def test_a_meaning_without_sense_is_read_without_harm(saved, told):
    assert all(
        "\n" not in sentence and len(sentence) < 400
        for sentence in remark(load_weights(saved(told or {"x": {}}), LAYOUT).metadata)
    )


def test_a_meaning_that_was_changed_in_the_file_is_damage(saved):
    path = saved()
    with np.load(path) as archive:
        entries = {name: archive[name] for name in archive.files}
    metadata = json.loads(entries["metadata"].tobytes())
    for changed in (metadata["meaning"] | {"distances": {}}, 3):
        entries["metadata"] = np.frombuffer(
            json.dumps(metadata | {"meaning": changed}).encode(), dtype=np.uint8
        )
        np.savez(path, **entries)
        with pytest.raises(WeightsError) as caught:
            load_weights(path, LAYOUT)
        assert "damaged" in one_sentence(caught)


def test_the_shipped_weights_mean_what_this_version_means():
    metadata = load_model(BUNDLED, "numpy").metadata
    assert "meaning" in metadata and not remark(metadata)


def test_weights_that_do_not_tell_are_loaded_without_a_word():
    told = load_model(BUNDLED, "numpy").metadata
    assert not remark({k: v for k, v in told.items() if not k.startswith("meaning")})


def test_training_goes_on_only_with_data_that_mean_the_same(tmp_path, monkeypatch):
    about = {"frames": 0, "objects": 0, "stance": {}, "takes": {}}
    (tmp_path / "data.json").write_text(json.dumps(about))
    assert require_meaning(tmp_path) is None, "data of older versions do not tell"
    (tmp_path / "data.json").write_text(json.dumps(about | {"meaning": meaning()}))
    assert require_meaning(tmp_path) == meaning()
    monkeypatch.setattr(distances, "STAND_AHEAD", 0.5)
    with pytest.raises(CaptureError) as caught:
        require_meaning(tmp_path)
    assert "STAND_AHEAD 0.45 m where this version has 0.5 m" in one_sentence(caught)
