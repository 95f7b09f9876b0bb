"""A capture folder: its BVH files at any depth, how they are read, and the sidecars beside them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from .. import bvh
from ..bvh_mapping import load_mapping
from ..clip import Clip
from ..errors import CaptureError
from .sidecar import Sheet, sidecar_of
from .sidecar import read as read_sheet

MAPPING = "mapping.toml"


@dataclass(frozen=True)
class Labelled:
    """A clip, named by its path in the folder, and what its sidecar says of it."""

    clip: Clip
    sheet: Sheet


def capture_paths(folder: str | Path) -> list[Path]:
    """List the BVH files of a folder and of those below it, sorted; CaptureError where there are none."""
    paths = sorted(p for p in Path(folder).rglob("*") if p.suffix.lower() == ".bvh")
    if not paths:
        raise CaptureError(f"no BVH file lies in {folder}; name the folder with the captures.")
    return paths


def mapping_path(path: Path, folder: str | Path) -> Path | None:
    """The ``mapping.toml`` that holds for a clip: in its own folder or the nearest above it, up to the capture folder."""
    for parent in path.parents:
        if (parent / MAPPING).is_file():
            return parent / MAPPING
        if parent == Path(folder):
            break
    return None


def read_capture(path: Path, folder: str | Path) -> Clip:
    """Read a clip of a capture folder by the mapping that holds for it; errors as of ``bvh.read``."""
    mapping = mapping_path(path, folder)
    return _read(path, _stamp(path), mapping, _stamp(mapping))


def _stamp(path: Path | None) -> int:
    return path.stat().st_mtime_ns if path is not None and path.exists() else 0


@lru_cache(maxsize=2048)  # every kind of piece looks through all clips
def _read(path: Path, stamp: int, mapping: Path | None, mapping_stamp: int) -> Clip:
    return bvh.read(path, mapping=None if mapping is None else load_mapping(mapping))


def has_sidecar(path: Path) -> bool:
    """Whether labels, not the clip's name, say what it is used for."""
    return sidecar_of(path).exists()


def labelled(folder: str | Path) -> list[Labelled]:
    """Read all clips that have a sidecar; CaptureError where one speaks of another number of frames."""
    found = []
    for path in filter(has_sidecar, sorted(p for p in Path(folder).rglob("*") if p.suffix.lower() == ".bvh")):
        clip, sheet = read_capture(path, folder), read_sheet(sidecar_of(path))
        if sheet.frames != len(clip):
            raise CaptureError(
                f"{sidecar_of(path).name} speaks of {sheet.frames} frames, {path.name} has {len(clip)} at 30 a second; "
                "run `python -m nsm_core annotate --overwrite` on its folder."
            )
        found.append(Labelled(replace(clip, name=path.relative_to(folder).with_suffix("").as_posix()), sheet))
    return found
