"""A capture folder: its BVH files at any depth, how they are read, and the sidecars beside them."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from nsm_core.body.clip import Clip
from nsm_core.errors import CaptureError, NsmError

from . import reader
from .bvh_parser import parse_hierarchy
from .joint_map import Mapping, load_mapping
from .joint_names import bodies
from .sidecar import Sheet, sidecar_of
from .sidecar import read as read_sheet

MAPPING = "mapping.toml"


@dataclass(frozen=True)
class Labelled:
    """A clip, named by its path in the folder, and what its sidecar says of it."""

    clip: Clip
    sheet: Sheet


def capture_paths(folder: str | Path, mapping: Path | None = None) -> list[Path]:
    """List the clips of a folder and of those below it, sorted; CaptureError where there are none.

    A clip is a BVH file, or of a file with several bodies the second and so on: "two.2.bvh" is the second of "two.bvh".
    ``mapping`` is a mapping file that holds for all instead of those that lie beside them.
    """
    paths = _clips(folder, mapping)
    if not paths:
        raise CaptureError(f"no BVH file lies in {folder}; name the folder with the captures.")
    return paths


def _clips(folder: str | Path, mapping: Path | None = None) -> list[Path]:
    # Hidden ones are no captures: what a killed program left of one, or what macOS notes beside each file on a foreign disk.
    files = sorted(p for p in Path(folder).rglob("[!.]*") if p.suffix.lower() == ".bvh" and not p.is_dir())
    named = ((p, mapping or mapping_path(p, folder)) for p in files)
    found = [_numbered(p, n) for p, m in named for n in range(1, _bodies(p, _stamp(p), m, _stamp(m)) + 1)]
    return sorted(dict.fromkeys(found))


def _numbered(path: Path, body: int) -> Path:
    return path if body == 1 else path.with_name(f"{path.stem}.{body}{path.suffix}")


def _file_of(path: Path) -> tuple[Path, int]:
    """The file in which a clip stands, and its number there, from 0."""
    match = re.fullmatch(r"(.+)\.([2-9]|[1-9][0-9])", path.stem)
    file = path if match is None else path.with_name(match[1] + path.suffix)
    return (path, 0) if match is None or path.exists() or not file.exists() else (file, int(match[2]) - 1)


@lru_cache(maxsize=4096)
def _bodies(path: Path, stamp: int, mapping: Path | None, mapping_stamp: int) -> int:
    """How many bodies a file holds; one where it is damaged, which is told when it is read."""
    try:
        wanted = None if mapping is None else load_mapping(mapping)
        return len(bodies(parse_hierarchy(path), wanted if wanted is not None and wanted.joints else None))
    except NsmError:
        return 1


def mapping_path(path: Path, folder: str | Path) -> Path | None:
    """The ``mapping.toml`` that holds for a clip: in its own folder or the nearest above it, up to the capture folder."""
    for parent in path.parents:
        if os.path.lexists(parent / MAPPING):  # a link to nothing, or a folder, is told where it is read
            return parent / MAPPING
        if parent == Path(folder):
            break
    return None


def read_capture(path: Path, folder: str | Path) -> Clip:
    """Read a clip of a capture folder by the mapping that holds for it; errors as of ``reader.read``."""
    path, body = _file_of(path)
    mapping = mapping_path(path, folder)
    clips = _read(path, _stamp(path), mapping, _stamp(mapping))
    _noted.update({note: None for clip in clips for note in clip.notes})
    return _body(path, clips, body)


_noted: dict[str, None] = {}


def notes() -> list[str]:
    """Sentences on what was read other than its files say, of all captures read so far."""
    return list(_noted)


def read_clip(path: Path, mapping: Mapping) -> Clip:
    """Read a clip of a capture folder by a mapping of one's choice; errors as of ``reader.read``."""
    path, body = _file_of(path)
    return _body(path, reader.read_all(path, mapping=mapping), body)


def _body(path: Path, clips: list[Clip], body: int) -> Clip:
    if body >= len(clips):
        raise CaptureError(f"{path.name} holds {len(clips)} bodies that its mapping names, not {body + 1}; mend its mapping.toml.")
    return clips[body]


def _stamp(path: Path | None) -> int:
    return path.stat().st_mtime_ns if path is not None and path.exists() else 0


@lru_cache(maxsize=2048)  # every kind of piece looks through all clips
def _read(path: Path, stamp: int, mapping: Path | None, mapping_stamp: int) -> list[Clip]:
    return reader.read_all(path, mapping=None if mapping is None else load_mapping(mapping))


def has_sidecar(path: Path) -> bool:
    """Whether labels, not the clip's name, say what it is used for."""
    return sidecar_of(path).exists()


def unlabelled(folder: str | Path, *sources: str) -> list[Path]:
    """List the clips, every body of a file, of ``folder/clips/SOURCE`` that have no sidecar: what they are used for is in their names.

    Sorted within each of the ``sources``; of all of them together where none is named.  May be empty.
    """
    clips = [p for p in _clips(folder) if p.parent.parent == Path(folder) / "clips" and not has_sidecar(p)]
    return [p for source in sources for p in clips if p.parent.name == source] if sources else clips


def name_in(path: Path) -> str:
    """The name that a clip's file bears, which holds for all of its bodies."""
    return _file_of(path)[0].stem


def labelled(folder: str | Path) -> list[Labelled]:
    """Read all clips that have a sidecar; CaptureError where one speaks of another number of frames."""
    found = []
    for path in filter(has_sidecar, _clips(folder)):
        clip, sheet = read_capture(path, folder), read_sheet(sidecar_of(path))
        if sheet.frames != len(clip):
            raise CaptureError(
                f"{sidecar_of(path).name} speaks of {sheet.frames} frames, {path.name} has {len(clip)} at 30 a second; "
                "run `python -m nsm_core annotate --overwrite` on its folder."
            )
        found.append(Labelled(replace(clip, name=path.relative_to(folder).with_suffix("").as_posix()), sheet))
    return found
