"""One index of a capture folder: its BVH files at any depth, their bodies, mappings and sidecars, each read
once.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from functools import cached_property
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


@dataclass(frozen=True)
class Capture:
    """A clip of a capture folder: a BVH ``file``, or of one with several bodies that of number ``body``, from
    0.

    It goes by ``path``: the second body of "two.bvh" by "two.2.bvh".  ``mapping`` is the mapping file that
    holds for it; ``sidecar`` says what it shows, None where its name has to.
    """

    path: Path
    file: Path
    body: int
    mapping: Path | None
    sidecar: Path | None


class CaptureFolder:
    """What a capture folder holds, looked up once; clips and sidecars are read when they are first asked for,
    and once.

    ``captures`` are the clips of the folder and of those below it, sorted by path; there may be none.
    """

    def __init__(self, folder: str | Path, mapping: Path | None = None) -> None:
        """``mapping`` is a mapping file that holds for all instead of those that lie beside them."""
        self.folder = Path(folder)
        self._mappings: dict[Path, Mapping] = {}
        self._files: dict[Path, list[Clip]] = {}
        # Hidden ones are no captures: what a killed program left of one, or what macOS notes beside each file
        # on a foreign disk.
        files = sorted(p for p in self.folder.rglob("[!.]*") if p.suffix.lower() == ".bvh" and not p.is_dir())
        named = {file: mapping or _mapping_path(file, self.folder) for file in files}
        found = {file: self._capture(file, file, 0, named[file]) for file in files}
        for file in files:
            for body in range(1, self._bodies(file, named[file])):
                path = file.with_name(f"{file.stem}.{body + 1}{file.suffix}")
                found.setdefault(
                    path, self._capture(path, file, body, named[file])
                )  # a file of that name is one itself
        self.captures: tuple[Capture, ...] = tuple(found[path] for path in sorted(found))

    def __str__(self) -> str:
        return str(self.folder)

    @staticmethod
    def _capture(path: Path, file: Path, body: int, mapping: Path | None) -> Capture:
        sidecar = sidecar_of(path)
        return Capture(path, file, body, mapping, sidecar if sidecar.exists() else None)

    def _bodies(self, file: Path, mapping: Path | None) -> int:
        """How many bodies a file holds; one where it is damaged, which is told when it is read."""
        try:
            wanted = self._mapping(mapping)
            return len(
                bodies(parse_hierarchy(file), wanted if wanted is not None and wanted.joints else None)
            )
        except NsmError:
            return 1

    def _mapping(self, path: Path | None) -> Mapping | None:
        if path is None:
            return None
        if path not in self._mappings:
            self._mappings[path] = load_mapping(path)
        return self._mappings[path]

    def read(self, capture: Capture) -> Clip:
        """Read a clip by the mapping that holds for it; errors as of ``reader.read``."""
        if capture.file not in self._files:
            self._files[capture.file] = reader.read_all(capture.file, mapping=self._mapping(capture.mapping))
        clips = self._files[capture.file]
        if capture.body >= len(clips):
            raise CaptureError(
                f"{capture.path.name} holds {len(clips)} bodies that its mapping names, not "
                f"{capture.body + 1}; mend its mapping.toml."
            )
        return clips[capture.body]

    def find(self, path: str) -> Capture | None:
        """The clip that goes by a path in the folder; None where there is none."""
        return next((c for c in self.captures if c.path == self.folder / path), None)

    def unlabelled(self, *sources: str) -> list[Capture]:
        """List the clips, every body of a file, of ``clips/SOURCE`` that have no sidecar: what they are used
        for is in their names.

        Sorted within each of the ``sources``; of all of them together where none is named.  May be empty.
        """
        clips = [
            c for c in self.captures if c.path.parent.parent == self.folder / "clips" and c.sidecar is None
        ]
        return [c for source in sources for c in clips if c.path.parent.name == source] if sources else clips

    @cached_property
    def labelled(self) -> tuple[Labelled, ...]:
        """All clips that have a sidecar; CaptureError where one speaks of another number of frames."""
        found = []
        for capture in self.captures:
            if capture.sidecar is None:
                continue
            clip, sheet = self.read(capture), read_sheet(capture.sidecar)
            if sheet.frames != len(clip):
                raise CaptureError(
                    f"{capture.sidecar.name} speaks of {sheet.frames} frames, {capture.path.name} has "
                    f"{len(clip)} at 30 a second; "
                    "run `python -m nsm_core annotate --overwrite` on its folder."
                )
            found.append(
                Labelled(
                    replace(clip, name=capture.path.relative_to(self.folder).with_suffix("").as_posix()),
                    sheet,
                )
            )
        return tuple(found)

    def notes(self) -> list[str]:
        """Sentences on what was read other than its files say, of all captures read so far."""
        return list(
            dict.fromkeys(note for clips in self._files.values() for clip in clips for note in clip.notes)
        )


def _mapping_path(path: Path, folder: Path) -> Path | None:
    """The ``mapping.toml`` that holds for a clip: in its own folder or the nearest above it, up to the
    capture folder.
    """
    for parent in path.parents:
        if os.path.lexists(parent / MAPPING):  # a link to nothing, or a folder, is told where it is read
            return parent / MAPPING
        if parent == folder:
            break
    return None
