"""Trained weights as one .npz: no pickle, half-precision parameters, metadata as JSON.

Entries: ``metadata`` (UTF-8 JSON bytes), ``parameters/<name>`` in float16 and ``statistics/<name>`` in
float32, named as in the torch module's state.  The metadata says which network of the registry it is (the NSM
where it says nothing) and carries the feature layout, so that a network can never be fed with, or read by,
another layout than the one it was trained on, and what its data meant (``features.meaning``).
"""

from __future__ import annotations

import errno
import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core import npz
from nsm_core.body.skeleton import JOINTS
from nsm_core.errors import WeightsError
from nsm_core.files import output
from nsm_core.model.features.meaning import Meaning, differences, meaning_hash, sentence_part
from nsm_core.model.networks.config import NetworkConfig
from nsm_core.model.networks.field_config import FieldConfig
from nsm_core.model.networks.gap_config import GapConfig
from nsm_core.model.networks.handling_config import HandlingConfig
from nsm_core.model.networks.protocol import Weights
from nsm_core.model.networks.registry import kind_of
from nsm_core.rotations import Array
from nsm_core.validate import is_number, listed, number, shown, table, text

# Vector ("input", "output", ...) -> its blocks in order -> their shapes.
Layout = Mapping[str, Mapping[str, Sequence[int]]]

FORMAT = "nsm-weights"
VERSION = 1
MOST_BYTES = 1 << 28  # of all entries, unpacked: six times the network of the paper
MOST_METADATA = 1 << 20  # bytes
LEAST_DEVIATION = 1e-9  # training keeps 1e-4; what is divided by less than this is no longer a number


def plain_layout(layout: Layout) -> dict[str, list[list[Any]]]:
    """Layout as JSON keeps it: lists of [name, shape] by vector, since the order counts."""
    return {
        vector: [[name, [int(n) for n in shape]] for name, shape in blocks.items()]
        for vector, blocks in layout.items()
    }


def layout_hash(layout: Layout) -> str:
    """Short fingerprint of the names, order and shapes of all feature blocks."""
    text = json.dumps(plain_layout(layout), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def save_weights(
    path: str | Path,
    parameters: Mapping[str, Array],
    statistics: Mapping[str, Array],
    *,
    config: NetworkConfig | GapConfig | FieldConfig | HandlingConfig,
    layout: Layout,
    credits: Sequence[str] = (),
    data: str = "",
    seeds: Mapping[str, int] | None = None,
    meaning: Meaning | None = None,
    **more: Any,
) -> Path:
    """Write a weights file, whole or not at all.

    ``config`` tells which network it is and its sizes; ``parameters`` are stored in half precision,
    ``statistics`` in single; ``credits`` name the captures the network learned from, ``data`` their version
    and ``meaning`` what they meant, if that is known; ``more`` joins the metadata and must suit JSON.  Raises
    WeightsError on values that are not numbers or too large for half precision, OutputError if the file
    cannot be written.
    """
    path = Path(path)
    entries: dict[str, Array] = {}
    for name, values in parameters.items():
        values = np.asarray(values, dtype=np.float32)
        if not np.all(np.abs(values) < np.finfo(np.float16).max):  # false for NaN too
            raise WeightsError(
                f"Parameter {name} holds values that half precision cannot keep; the training diverged, "
                "resume from an earlier state."
            )
        entries[f"parameters/{name}"] = values.astype(np.float16)
    for name, values in statistics.items():
        values = np.asarray(values, dtype=np.float32)
        if not np.all(np.isfinite(values)):
            raise WeightsError(
                f"Statistic {name} holds values that are not numbers; export the training data again."
            )
        entries[f"statistics/{name}"] = values
    metadata = {
        **more,
        "format": FORMAT,
        "version": VERSION,
        "network": config.network,
        "config": config.to_dict(),
        "layout": plain_layout(layout),
        "layout_hash": layout_hash(layout),
        "credits": list(credits),
        "data": data,
        "seeds": dict(seeds or {}),
    }
    if meaning is not None:
        metadata |= {"meaning": meaning, "meaning_hash": meaning_hash(meaning)}
    entries["metadata"] = np.frombuffer(json.dumps(metadata, indent=1).encode(), dtype=np.uint8)
    with output(path, "The weights") as temporary, open(temporary, "wb") as file:
        np.savez(file, **entries)
    return path


def load_weights(
    path: str | Path, layout: Layout | None = None, known: Callable[[Any, object], object] = kind_of
) -> Weights:
    """Read a weights file; all arrays come back as float32, finite, and deviations above zero.

    With ``layout``, the file's feature layout must equal it, and its features must mean what they mean here,
    if it tells what they do.  ``known`` raises on the name of a network that is not looked for.  Nothing is
    allocated that the file does not hold.  Raises WeightsError if the file is missing, truncated, damaged,
    foreign, of a newer format, of an unknown network, of another layout or of features of another meaning.
    """
    path = Path(path)
    entries = _read(path)
    metadata = _metadata(path, entries.pop("metadata", None))
    weights = Weights({}, {}, metadata)
    known(weights.network, path)
    if layout is not None and metadata.get("layout") != plain_layout(layout):
        difference = _difference(metadata.get("layout"), layout)
        raise WeightsError(f"{path} was trained on another feature layout ({difference}); train it again.")
    if layout is not None and (other := differences(metadata.get("meaning"), "features")):
        raise WeightsError(f"{path} was trained with {sentence_part(other)}; train it again.")
    groups = {"parameters": weights.parameters, "statistics": weights.statistics}
    for key, values in entries.items():
        group, _, name = key.partition("/")
        with np.errstate(over="ignore", invalid="ignore"):
            groups[group][name] = np.ascontiguousarray(values, dtype=np.float32)
        if bad := _unusable(name, groups[group][name]):
            raise WeightsError(
                f"{path} is damaged or its training diverged: {name} {bad}; copy it again or take another "
                "one."
            )
    return weights


def _unusable(name: str, values: Array) -> str:
    """What no network can be stepped with, in words; empty where all is well."""
    size = np.abs(values)
    if not np.isfinite(values).all():
        return "holds values that are not numbers"
    if size.size and size.max() >= np.finfo(np.float16).max:
        return f"holds a value of {size.max():g}"
    if name.endswith("_std") and values.size and values.min() < LEAST_DEVIATION:
        return f"holds a deviation of {values.min():g}"
    return ""


def _read(path: Path) -> dict[str, Array]:
    """All arrays of a weights file, or WeightsError."""
    try:
        if path.exists() and not path.is_file():
            raise OSError(errno.EINVAL, "it is no file")  # a folder, or a pipe that would be waited for
        with open(path, "rb") as file:
            beginning = file.read(2)
        if beginning != b"PK":
            raise WeightsError(
                f"{path} is not a weights file of this project; choose one that `dev.py train` wrote."
            )
        return npz.read_arrays(path, {"metadata": "u", "parameters/": "f", "statistics/": "f"}, MOST_BYTES)
    except FileNotFoundError as error:
        raise WeightsError(
            f"There is no weights file at {path}; check the path or run `dev.py train`."
        ) from error
    except npz.DamagedArrays as error:
        raise WeightsError(
            f"{path} is not a weights file that can be used: {error}; copy or download it again."
        ) from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise WeightsError(
            f"Cannot read {shown(str(path), 300)} ({reason}); check that it is a file you may read."
        ) from error


def _metadata(path: Path, stored: Array | None) -> dict[str, Any]:
    """What a weights file says of itself, its types checked."""
    try:
        if stored is None or stored.itemsize != 1 or stored.ndim != 1 or stored.size > MOST_METADATA:
            raise ValueError("no metadata")
        metadata = json.loads(stored.tobytes().decode(), parse_constant=_no_constant)
        ours = metadata["format"] == FORMAT
    except (LookupError, ValueError, TypeError, RecursionError):
        ours = False
    if not ours:
        raise WeightsError(
            f"{path} is not a weights file of this project; choose one that `dev.py train` wrote."
        )
    if metadata.get("version") != VERSION or isinstance(metadata["version"], bool):
        raise WeightsError(
            f"{path} has format version {shown(metadata.get('version'))} and this program reads version "
            f"{VERSION}; "
            "update the program or train the weights again."
        )
    try:
        table(metadata.get("config"), "config", WeightsError)
        for key in ("credits", "actions"):
            for line in listed(metadata.get(key, []), key, WeightsError):
                text(line, f"an entry of {key}", WeightsError)
        if "meaning" in metadata and meaning_hash(
            table(metadata["meaning"], "meaning", WeightsError)
        ) != metadata.get("meaning_hash"):
            raise WeightsError("meaning is not what its meaning_hash was made of.")
        if (stance := metadata.get("stance")) is not None:
            _check_stance(stance)
    except WeightsError as error:
        raise WeightsError(
            f"{path} is damaged: in its metadata, {str(error).removesuffix('.')}; copy or download it again."
        ) from error
    return metadata


def _check_stance(stance: Any) -> None:
    """Raise WeightsError unless the pose in which a character stands is one: height of the hips, and a
    rotation for each joint.
    """
    number(
        table(stance, "stance", WeightsError).get("hips_height"),
        "hips_height of stance",
        WeightsError,
        0.1,
        3,
    )
    rotations = listed(stance.get("local_rotations"), "local_rotations of stance", WeightsError, len(JOINTS))
    fit = [isinstance(q, list) and len(q) == 4 and all(is_number(v, -2, 2) for v in q) for q in rotations]
    if len(fit) != len(JOINTS) or not all(fit):
        raise WeightsError(f"local_rotations of stance must be {len(JOINTS)} lists of four numbers.")


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is no number")


def _difference(theirs: Any, ours: Layout) -> str:
    """First difference of two layouts, in words; ``theirs`` may be anything that a file can hold."""

    def block(entry: Any) -> str:
        name, shape = entry
        return f"{name} of {' x '.join(map(str, shape))}"

    def is_block(entry: Any) -> bool:
        return (
            isinstance(entry, list)
            and len(entry) == 2
            and isinstance(entry[0], str)
            and len(entry[0]) < 80
            and isinstance(entry[1], list)
            and len(entry[1]) < 8
            and all(isinstance(n, int) and is_number(n, 0, 1e9) for n in entry[1])
        )

    for vector, blocks in plain_layout(ours).items():
        others = theirs.get(vector, []) if isinstance(theirs, dict) else None
        if not isinstance(others, list) or not all(map(is_block, others)):
            return f"what it says of its {vector} vector makes no sense"
        for mine, other in zip(blocks, others, strict=False):
            if mine != other:
                return f"its {vector} vector has {block(other)} where this program has {block(mine)}"
        if len(others) < len(blocks):
            return f"its {vector} vector lacks {blocks[len(others)][0]}"
        if len(others) > len(blocks):
            return f"its {vector} vector also has {others[len(blocks)][0]}"
    return "other vectors"
