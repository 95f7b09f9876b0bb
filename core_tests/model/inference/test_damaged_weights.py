"""Weights files that others damaged end in one sentence, whatever the damage, and take no more memory than
they hold.
"""

from __future__ import annotations

import io
import json
import struct
import tracemalloc
import zipfile

import numpy as np
import pytest
from fuzzing import one_sentence
from random_weights import random_arrays

from nsm_core.errors import WeightsError
from nsm_core.model.features.layout import layout_description
from nsm_core.model.inference.model import load_model
from nsm_core.model.inference.weights_file import load_weights, save_weights
from nsm_core.model.networks.nsm_config import NsmConfig

ARRAY = "parameters/gating.0.bias.npy"
METADATA = "metadata.npy"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Path and bytes of a small network of the program's own layout."""
    sizes = {
        "encoder_frame": 8,
        "encoder_goal": 8,
        "encoder_environment": 8,
        "encoder_interaction": 8,
        "gating_hidden": 8,
        "hidden": 8,
    }
    config = NsmConfig(**sizes, experts=2)
    parameters, statistics = random_arrays(config)
    path = tmp_path_factory.mktemp("weights") / "whole.npz"
    save_weights(path, parameters, statistics, config=config, layout=layout_description())
    load_model(path, "numpy")
    return path, path.read_bytes()


def entries_of(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def zipped(entries: dict[str, bytes], method: int = zipfile.ZIP_STORED) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    return out.getvalue()


def npy(array: np.ndarray, pickled: bool = False) -> bytes:
    out = io.BytesIO()
    np.save(out, array, allow_pickle=pickled)
    return out.getvalue()


def declared(text: str) -> bytes:
    """An array of which there is only a header, saying ``text``."""
    head = text.encode()
    head += b" " * (63 - (10 + len(head)) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head


def told(metadata: dict | bytes) -> bytes:
    data = metadata if isinstance(metadata, bytes) else json.dumps(metadata).encode()
    return npy(np.frombuffer(data, np.uint8))


ARRAYS = {
    "no array": b"hello",
    "nothing": b"",
    "texts": npy(np.array(["a"] * 8)),
    "objects": npy(np.array([{}] * 8, dtype=object), pickled=True),
    "complex numbers": npy(np.ones(8, np.complex64)),
    "whole numbers": npy(np.ones(8, np.int64)),
    "another shape": npy(np.ones((8, 1), np.float32)),
    "no dimension": npy(np.float32(1)),
    "terabytes declared": declared("{'descr': '<f4', 'fortran_order': False, 'shape': (1000000000000,), }"),
    "a negative shape": declared("{'descr': '<f4', 'fortran_order': False, 'shape': (-8,), }"),
    "code in the header": declared("{'descr': __import__('os'), 'fortran_order': False, 'shape': (8,), }"),
    "brackets without end": declared("{'descr':" + "[" * 50),
    "a header of 60,000 bytes": declared("{'descr': '<f4'" + " " * 60000),
    "a value that is no number": npy(np.array([np.nan] + [0.0] * 7, np.float16)),
    "an infinite value": npy(np.array([np.inf] + [0.0] * 7, np.float32)),
    "a value beyond single precision": npy(np.array([1e200] + [0.0] * 7)),
}
METADATA_CHANGES = {
    "nothing": b"",
    "no text": b"\xff\xfe\x00",
    "brackets without end": b"[" * 100000,
    "a list": b"[1, 2]",
    "a number": b"1e999",
    "layout a list": {"layout_hash": "x", "layout": [1]},
    "layout of odd blocks": {"layout": {"frame": [["a"], 3], "input": "b"}},
    "a size that is text": {"config": {"hidden": "8"}},
    "a size without end": {"config": {"hidden": 10**30}},
    "a negative size": {"config": {"experts": -2}},
    "an unknown config": {"config": [8]},
    "credits that are no list": {"credits": 5},
    "actions that are no words": {"actions": [["sit"]]},
    "a stance of other joints": {"stance": {"hips_height": 0.9, "local_rotations": [[1, 0, 0, 0]]}},
    "a version to come": {"version": 10**40},
}


def refused(path, data: bytes, most: float = 30e6) -> str:
    path = path.with_name("damaged.npz")
    path.write_bytes(data)
    tracemalloc.start()
    try:
        with pytest.raises(WeightsError) as caught:
            load_model(path, "numpy")
        assert tracemalloc.get_traced_memory()[1] < most
    finally:
        tracemalloc.stop()
    return one_sentence(caught)


@pytest.mark.parametrize("damage", ARRAYS)
def test_an_array_that_is_none(whole, damage):
    path, data = whole
    assert "gating.0.bias" in refused(path, zipped({**entries_of(data), ARRAY: ARRAYS[damage]}))


@pytest.mark.parametrize("damage", METADATA_CHANGES)
def test_metadata_that_make_no_sense(whole, damage):
    path, data = whole
    entries, change = entries_of(data), METADATA_CHANGES[damage]
    metadata = json.loads(np.load(io.BytesIO(entries[METADATA])).tobytes())
    refused(
        path, zipped({**entries, METADATA: told(change if isinstance(change, bytes) else metadata | change)})
    )


def test_a_deviation_of_zero(whole):
    path, data = whole
    entries = entries_of(data)
    deviation = np.load(io.BytesIO(entries["statistics/input_std.npy"])).copy()
    deviation[3] = 0
    assert "input_std holds a deviation of 0" in refused(
        path, zipped({**entries, "statistics/input_std.npy": npy(deviation)})
    )


def test_an_archive_that_unpacks_without_end(whole):
    path, data = whole
    bomb = npy(np.zeros(100_000_000, np.float32))
    assert "MB" in refused(
        path, zipped({**entries_of(data), "parameters/more.npy": bomb}, zipfile.ZIP_DEFLATED)
    )


def test_entries_that_are_encrypted_or_of_an_unknown_method(whole):
    path, data = whole
    start = zipfile.ZipFile(io.BytesIO(data)).start_dir
    for place, bit in ((start + 8, 1), (start + 10, 64)):
        changed = bytearray(data)
        changed[place] ^= bit
        refused(path, bytes(changed))


def test_any_other_damage_is_a_sentence_or_a_network(whole):
    """Bytes flipped, pieces cut out, doubled or swapped, by seed: what loads is finite throughout."""
    path, data = whole
    chance, loaded = np.random.default_rng(7), 0
    directory = zipfile.ZipFile(io.BytesIO(data)).start_dir
    path = path.with_name("damaged.npz")
    for k in range(400):
        changed = bytearray(data)
        at = int(chance.integers(directory, len(data)) if k % 2 else chance.integers(len(data)))
        piece = int(chance.integers(1, 200))
        match k // 2 % 5:
            case 0:
                changed[at] ^= 1 << int(chance.integers(8))
            case 1:
                del changed[at : at + piece]
            case 2:
                changed[at:at] = changed[at : at + piece]
            case 3:
                changed[at : at + 4] = chance.bytes(4)
            case 4:
                del changed[at:]
        path.write_bytes(changed)
        try:
            load_model(path, "numpy")
            weights = load_weights(path)
        except WeightsError as error:
            assert "\n" not in str(error) and str(error).endswith(".")
        else:
            loaded += 1
            assert all(
                np.isfinite(v).all() for v in (*weights.parameters.values(), *weights.statistics.values())
            )
    assert loaded < 100
