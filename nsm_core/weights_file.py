"""Trained weights as one .npz: no pickle, half-precision parameters, metadata as JSON.

Entries: ``metadata`` (UTF-8 JSON bytes), ``parameters/<name>`` in float16 and ``statistics/<name>`` in
float32, named as in the torch module's state.  The metadata carries the feature layout, so that a network
can never be fed with, or read by, another layout than the one it was trained on.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .errors import OutputError, WeightsError

Array = np.ndarray
Layout = Mapping[str, Mapping[str, Sequence[int]]]  # vector ("input", "output", ...) -> its blocks in order -> their shapes

FORMAT = "nsm-weights"
VERSION = 1


@dataclass(frozen=True)
class Weights:
    """What a weights file holds: parameters and statistics as float32 arrays by name, and its metadata."""

    parameters: dict[str, Array]
    statistics: dict[str, Array]
    metadata: dict[str, Any] = field(default_factory=dict)

    @property
    def config(self) -> dict[str, Any]:
        """Sizes of the network, as ``NsmConfig.to_dict`` gives them."""
        return self.metadata["config"]


def plain_layout(layout: Layout) -> dict[str, list[list[Any]]]:
    """Layout as JSON keeps it: lists of [name, shape] by vector, since the order counts."""
    return {vector: [[name, [int(n) for n in shape]] for name, shape in blocks.items()] for vector, blocks in layout.items()}


def layout_hash(layout: Layout) -> str:
    """Short fingerprint of the names, order and shapes of all feature blocks."""
    text = json.dumps(plain_layout(layout), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def save_weights(
    path: str | Path,
    parameters: Mapping[str, Array],
    statistics: Mapping[str, Array],
    *,
    config: Mapping[str, Any],
    layout: Layout,
    credits: Sequence[str] = (),
    data: str = "",
    seeds: Mapping[str, int] | None = None,
    **more: Any,
) -> Path:
    """Write a weights file, whole or not at all.

    ``parameters`` are stored in half precision, ``statistics`` in single; ``credits`` name the captures the
    network learned from and ``data`` their version; ``more`` joins the metadata and must suit JSON.
    Raises WeightsError on values that are not numbers or too large for half precision, OutputError if the
    file cannot be written.
    """
    path = Path(path)
    entries: dict[str, Array] = {}
    for name, values in parameters.items():
        values = np.asarray(values, dtype=np.float32)
        if not np.all(np.abs(values) < np.finfo(np.float16).max):  # false for NaN too
            raise WeightsError(
                f"Parameter {name} holds values that half precision cannot keep; the training diverged, resume from an earlier state."
            )
        entries[f"parameters/{name}"] = values.astype(np.float16)
    for name, values in statistics.items():
        values = np.asarray(values, dtype=np.float32)
        if not np.all(np.isfinite(values)):
            raise WeightsError(f"Statistic {name} holds values that are not numbers; export the training data again.")
        entries[f"statistics/{name}"] = values
    metadata = {
        **more,
        "format": FORMAT,
        "version": VERSION,
        "config": dict(config),
        "layout": plain_layout(layout),
        "layout_hash": layout_hash(layout),
        "credits": list(credits),
        "data": data,
        "seeds": dict(seeds or {}),
    }
    entries["metadata"] = np.frombuffer(json.dumps(metadata, indent=1).encode(), dtype=np.uint8)
    partial = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with partial.open("wb") as file:
            np.savez(file, **entries)
        os.replace(partial, path)
    except OSError as error:
        if path.parent.is_dir():
            partial.unlink(missing_ok=True)
        raise OutputError(f"Cannot write the weights to {path} ({error.strerror or error}); choose a folder you may write to.") from error
    return path


def load_weights(path: str | Path, layout: Layout | None = None) -> Weights:
    """Read a weights file; all arrays come back as float32.

    With ``layout``, the file's feature layout must equal it.  Raises WeightsError if the file is missing,
    truncated, foreign, of a newer format or of another layout.
    """
    path = Path(path)
    entries = _read(path)
    try:
        metadata = json.loads(entries.pop("metadata").tobytes().decode())
        ours = metadata["format"] == FORMAT
    except (KeyError, ValueError, TypeError, UnicodeDecodeError):
        ours = False
    if not ours:
        raise WeightsError(f"{path} is not a weights file of this project; choose one that `dev.py train` wrote.")
    if metadata.get("version") != VERSION:
        raise WeightsError(
            f"{path} has format version {metadata.get('version')} and this program reads version {VERSION}; "
            "update the program or train the weights again."
        )
    if layout is not None and metadata.get("layout_hash") != layout_hash(layout):
        difference = _difference(metadata.get("layout", {}), layout)
        raise WeightsError(f"{path} was trained on another feature layout ({difference}); train it again.")
    groups: dict[str, dict[str, Array]] = {"parameters": {}, "statistics": {}}
    for key, values in entries.items():
        group, _, name = key.partition("/")
        if group in groups:
            groups[group][name] = values.astype(np.float32)
    return Weights(groups["parameters"], groups["statistics"], metadata)


def _read(path: Path) -> dict[str, Array]:
    """All arrays of an .npz, or WeightsError."""
    try:
        data = path.read_bytes()
    except FileNotFoundError as error:
        raise WeightsError(f"There is no weights file at {path}; check the path or run `dev.py train`.") from error
    except OSError as error:
        raise WeightsError(f"Cannot read {path} ({error.strerror or error}); check that it is a file you may read.") from error
    if not data.startswith(b"PK"):
        raise WeightsError(f"{path} is not a weights file of this project; choose one that `dev.py train` wrote.")
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (zipfile.BadZipFile, zlib.error, EOFError, KeyError, OSError) as error:
        raise WeightsError(f"{path} is truncated or damaged; copy or download it again.") from error
    except ValueError as error:  # pickled objects, or arrays that end early
        raise WeightsError(f"{path} is damaged or not a weights file of this project; copy or download it again.") from error


def _difference(theirs: Mapping[str, Any], ours: Layout) -> str:
    """First difference of two layouts, in words."""
    def block(name: str, shape: list[int]) -> str:
        return f"{name} of {' x '.join(map(str, shape))}"

    for vector, blocks in plain_layout(ours).items():
        others = theirs.get(vector, [])
        for mine, other in zip(blocks, others, strict=False):
            if mine != other:
                return f"its {vector} vector has {block(*other)} where this program has {block(*mine)}"
        if len(others) < len(blocks):
            return f"its {vector} vector lacks {blocks[len(others)][0]}"
        if len(others) > len(blocks):
            return f"its {vector} vector also has {others[len(blocks)][0]}"
    return "other vectors"
