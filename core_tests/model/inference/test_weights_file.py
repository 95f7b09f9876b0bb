"""Weights come back as they were saved, and every bad file is told apart in one sentence."""

from __future__ import annotations

import io
import json
import pickle
import zipfile

import numpy as np
import pytest
from fuzzing import one_sentence
from random_weights import LAYOUT, random_arrays

from nsm_core.errors import OutputError, WeightsError
from nsm_core.model.inference.model import load_model
from nsm_core.model.inference.weights_file import layout_hash, load_weights, save_weights


@pytest.fixture
def small(tmp_path, small_config):
    """Path, parameters and statistics of a small network."""
    parameters, statistics = random_arrays(small_config)
    path = save_weights(
        tmp_path / "small.npz", parameters, statistics, config=small_config, layout=LAYOUT,
        credits=["CMU"], data="captures 1", seeds={"init": 4, "data": 5}, epochs=12,
    )  # fmt: skip
    return path, parameters, statistics


def rewrite(path, change):
    """Copy a weights file with its arrays changed by ``change(dict)``."""
    with np.load(path) as archive:
        entries = {name: archive[name] for name in archive.files}
    change(entries)
    other = path.with_name("other.npz")
    np.savez(other, **entries)
    return other


def edit_metadata(**values):
    def change(entries):
        metadata = json.loads(entries["metadata"].tobytes()) | values
        entries["metadata"] = np.frombuffer(json.dumps(metadata).encode(), dtype=np.uint8)

    return change


def test_round_trip(small):
    path, parameters, statistics = small
    weights = load_weights(path, LAYOUT)
    for name, values in parameters.items():
        assert weights.parameters[name].dtype == np.float32
        np.testing.assert_array_equal(weights.parameters[name], values.astype(np.float16))
    for name, values in statistics.items():
        np.testing.assert_array_equal(weights.statistics[name], values)
    assert weights.metadata["credits"] == ["CMU"] and weights.metadata["data"] == "captures 1"
    assert weights.metadata["seeds"] == {"init": 4, "data": 5} and weights.metadata["epochs"] == 12
    assert weights.config["experts"] == 3
    assert not list(path.parent.glob("*.part"))


def test_nothing_in_the_file_is_pickled_and_it_is_small(full_weights):
    assert full_weights.stat().st_size < 40e6
    with zipfile.ZipFile(full_weights) as archive:
        for name in archive.namelist():
            assert np.lib.format.read_magic(io.BytesIO(archive.read(name)[:8]))
    with np.load(full_weights, allow_pickle=False) as archive:
        assert all(archive[name].dtype != object for name in archive.files)


def test_same_content_gives_same_bytes(small, tmp_path, small_config):
    path, parameters, statistics = small
    again = save_weights(
        tmp_path / "again.npz", parameters, statistics, config=small_config, layout=LAYOUT,
        credits=["CMU"], data="captures 1", seeds={"init": 4, "data": 5}, epochs=12,
    )  # fmt: skip
    assert load_weights(again).metadata == load_weights(path).metadata
    assert again.stat().st_size == path.stat().st_size


def test_layout_hash_sees_names_sizes_and_order():
    base = {"input": {"a": (1,), "b": (2, 3)}}
    others = [
        {"input": {"b": (2, 3), "a": (1,)}},
        {"input": {"a": (1,), "b": (3, 2)}},
        {"input": {"a": (1,)}},
        {"output": {"a": (1,), "b": (2, 3)}},
    ]
    assert layout_hash(base) == layout_hash({"input": {"a": [1], "b": [2, 3]}})
    assert len({layout_hash(x) for x in [base, *others]}) == 5


def test_missing(tmp_path):
    with pytest.raises(WeightsError) as caught:
        load_weights(tmp_path / "none.npz")
    assert "no weights file" in one_sentence(caught)


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(WeightsError) as caught:
        load_weights(tmp_path)
    one_sentence(caught)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.9, 0.999])
def test_truncated(small, share):
    path = small[0]
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    with pytest.raises(WeightsError) as caught:
        load_model(path, "numpy")
    assert "truncated or damaged" in one_sentence(caught)


def test_flipped_bytes(small):
    path = small[0]
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(WeightsError) as caught:
        load_weights(path)
    assert "damaged" in one_sentence(caught)


@pytest.mark.parametrize("content", [b"", b"hello", pickle.dumps({"a": 1}), b"\x93NUMPY\x01\x00"])
def test_foreign_bytes(tmp_path, content):
    path = tmp_path / "foreign.npz"
    path.write_bytes(content)
    with pytest.raises(WeightsError) as caught:
        load_weights(path)
    assert "not a weights file" in one_sentence(caught)


def test_foreign_npz(tmp_path):
    np.savez(tmp_path / "foreign.npz", a=np.zeros(3))
    with pytest.raises(WeightsError) as caught:
        load_weights(tmp_path / "foreign.npz")
    assert "not a weights file" in one_sentence(caught)


def test_pickled_objects_are_not_loaded(small):
    other = rewrite(small[0], lambda entries: entries.update(trap=np.array([{"a": 1}], dtype=object)))
    with pytest.raises(WeightsError):
        load_weights(other)


def test_newer_version(small):
    with pytest.raises(WeightsError) as caught:
        load_weights(rewrite(small[0], edit_metadata(version=99)))
    assert "99" in one_sentence(caught)


@pytest.mark.parametrize(
    ("layout", "words"),
    [
        (
            {**LAYOUT, "gating": {"per_key": (13, 51)}},
            "gating vector has per_key of 13 x 50 where this program has per_key of 13 x 51",
        ),
        ({**LAYOUT, "input": {**LAYOUT["input"], "smell": (4,)}}, "input vector lacks smell"),
        ({**LAYOUT, "input": {"frame": (419,)}}, "input vector also has goal"),
    ],
)
def test_other_layout_names_the_difference(small, layout, words):
    with pytest.raises(WeightsError) as caught:
        load_weights(small[0], layout)
    assert words in one_sentence(caught)


def test_a_lacking_array(small):
    other = rewrite(small[0], lambda entries: entries.pop("parameters/experts.1.bias"))
    with pytest.raises(WeightsError) as caught:
        load_model(other, "numpy")
    assert "experts.1.bias" in one_sentence(caught)


def test_an_array_of_another_shape(small):
    other = rewrite(
        small[0], lambda entries: entries.update({"statistics/input_std": np.ones(3, np.float32)})
    )
    with pytest.raises(WeightsError) as caught:
        load_model(other, "numpy")
    assert "input_std" in one_sentence(caught)


def test_metadata_without_config(small):
    with pytest.raises(WeightsError) as caught:
        load_model(rewrite(small[0], edit_metadata(config={"frame": "many"})), "numpy")
    one_sentence(caught)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e6])
def test_diverged_parameters_are_not_saved(tmp_path, small_config, value):
    parameters, statistics = random_arrays(small_config)
    parameters["gating.0.bias"][2] = value
    with pytest.raises(WeightsError, match=r"gating\.0\.bias"):
        save_weights(tmp_path / "w.npz", parameters, statistics, config=small_config, layout=LAYOUT)
    assert not list(tmp_path.iterdir())


def test_unwritable_target(tmp_path, small_config):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError) as caught:
        save_weights(
            tmp_path / "file" / "w.npz", *random_arrays(small_config), config=small_config, layout=LAYOUT
        )
    one_sentence(caught)


def test_only_the_programs_own_layout_is_stepped(tmp_path, small_config):
    other = {**LAYOUT, "output": {"everything": (605,)}}
    path = save_weights(tmp_path / "w.npz", *random_arrays(small_config), config=small_config, layout=other)
    with pytest.raises(WeightsError) as caught:
        load_model(path, "numpy")
    assert "everything of 605" in one_sentence(caught)
