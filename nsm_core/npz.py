"""Read the arrays of an .npz of others: no pickle, and nothing allocated that the file does not hold."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from .rotations import Array

_MOST_ENTRIES = 1000
_MOST_HEADER = 4096
_HEADER = re.compile(
    rb"\{\s*'descr':\s*'([<>|=]?[a-zA-Z]\d{1,4})',\s*'fortran_order':\s*(True|False),\s*'shape':\s*\(((?:\d{1,15},\s*)*(?:\d{1,15})?)\),?\s*\}\s*"
)


class DamagedArrays(Exception):
    """What is wrong with an .npz, as the end of a sentence: "its entry x is encrypted"."""


@dataclass(frozen=True)
class Member:
    """An array of an .npz as its header declares it, held against the bytes that follow."""

    dtype: np.dtype[Any]
    fortran: bool
    shape: tuple[int, ...]


def read_arrays(path: Path, kinds: Mapping[str, str], most: int) -> dict[str, Array]:
    """All arrays of an .npz of at most ``most`` bytes, unpacked, by name.

    ``kinds`` tells, by the beginning of a name, which kind of numbers it may hold ("f", "u", "i" or "b", as
    numpy names them); other names and kinds are refused.  Raises DamagedArrays, and OSError where the file
    cannot be opened.
    """
    with open(path, "rb") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                return {
                    name: _array(archive, info, kinds)
                    for name, info in _entries(archive, kinds, most).items()
                }
        except DamagedArrays:
            raise
        except (
            Exception
        ) as error:  # a dozen kinds: zip, zlib, struct, text and size errors, encryption, unknown methods
            raise DamagedArrays("it is truncated or damaged") from error


def _entries(archive: zipfile.ZipFile, kinds: Mapping[str, str], most: int) -> dict[str, zipfile.ZipInfo]:
    """Entries by name, none read yet; DamagedArrays on what cannot be an array of ours."""
    found: dict[str, zipfile.ZipInfo] = {}
    infos = archive.infolist()
    if len(infos) > _MOST_ENTRIES:
        raise DamagedArrays(f"it has {len(infos)} entries, more than {_MOST_ENTRIES}")
    if (size := sum(info.file_size for info in infos)) > most:
        raise DamagedArrays(f"its entries would take {size / 1e6:.0f} MB, more than {most / 1e6:.0f} MB")
    for info in infos:
        name = info.filename.removesuffix(".npy")
        if not info.filename.endswith(".npy") or _kind(name, kinds) is None:
            raise DamagedArrays(f"its entry {ascii(info.filename)[:60]} is none that it should have")
        if name in found:
            raise DamagedArrays(f"its entry {name} is there twice")
        if info.flag_bits & 1:
            raise DamagedArrays(f"its entry {name} is encrypted")
        found[name] = info
    return found


def _kind(name: str, kinds: Mapping[str, str]) -> str | None:
    return next(
        (
            kind
            for beginning, kind in kinds.items()
            if name.startswith(beginning) and re.fullmatch(r"[\w./-]{1,200}", name)
        ),
        None,
    )


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo, kinds: Mapping[str, str]) -> Array:
    """One array, checked before it is allocated."""
    name = info.filename.removesuffix(".npy")
    with archive.open(info) as file:
        start = file.read(12)
        if start[:6] != b"\x93NUMPY" or start[6:8] not in (b"\x01\x00", b"\x02\x00"):
            raise DamagedArrays(f"its entry {name} is no array of numbers")
        wide = start[6] == 2
        length = int.from_bytes(start[8:12] if wide else start[8:10], "little")
        if length > _MOST_HEADER:
            raise DamagedArrays(f"its entry {name} has a header of {length} bytes")
        entry = _declared(
            b"" if wide else start[10:12], file.read(length if wide else max(length - 2, 0)), name
        )
        if entry.dtype.kind != _kind(name, kinds):
            raise DamagedArrays(f"its entry {name} holds {entry.dtype.name} values")
        size, held = (
            int(np.prod(entry.shape, dtype=object)) * entry.dtype.itemsize,
            info.file_size - (12 if wide else 10) - length,
        )
        if size != held:
            raise DamagedArrays(f"its entry {name} declares {size} bytes of values and holds {max(held, 0)}")
        data = bytearray(size)  # of our own, so that what comes of it may be written to
        # The end of the entry is where its checksum is held against it.
        if cast(zipfile.ZipExtFile, file).readinto(data) != size or file.read(1):
            raise DamagedArrays("it is truncated or damaged")
    return np.frombuffer(data, entry.dtype).reshape(entry.shape, order="F" if entry.fortran else "C")


def _declared(begun: bytes, rest: bytes, name: str) -> Member:
    match = _HEADER.fullmatch(begun + rest)
    try:
        dtype = np.dtype(match[1].decode()) if match else None
    except TypeError:
        dtype = None
    if match is None or dtype is None:
        raise DamagedArrays(f"its entry {name} has a header that numpy does not write for numbers")
    shape = tuple(int(n) for n in match[3].split(b",") if n.strip())
    if len(shape) > 8:
        raise DamagedArrays(f"its entry {name} has {len(shape)} dimensions")
    return Member(dtype, match[2] == b"True", shape)
