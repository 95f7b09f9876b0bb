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
from .sheet import Sheet
from .sidecar import read_sheet as read_sheet
from .sidecar import shipped, sidecar_of

MAPPING = "mapping.toml"


@dataclass(frozen=True)
class Labelled:
    """A clip, named by its path in the folder, and what its own or the shipped sidecar says of it."""

    clip: Clip
    sheet: Sheet


@dataclass(frozen=True)
class Capture:
    """A clip of a capture folder: a BVH ``file``, or of one with several bodies that of number ``body``, from
    0.

    It goes by ``path``: the second body of "two.bvh" by "two.2.bvh".  ``mapping`` is the mapping file that
    holds for it; ``sidecar`` is the one that lies beside it, None where there is none.
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
                # A file of that name is one itself.
                found.setdefault(path, self._capture(path, file, body, named[file]))
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
        """Read a clip by the mapping that holds for it; errors as of ``reader.read_clip``."""
        if capture.file not in self._files:
            self._files[capture.file] = reader.read_clips(
                capture.file, mapping=self._mapping(capture.mapping)
            )
        clips = self._files[capture.file]
        if capture.body >= len(clips):
            raise CaptureError(
                f"{capture.path.name} holds {len(clips)} bodies that its mapping names, not "
                f"{capture.body + 1}; mend its mapping.toml."
            )
        return clips[capture.body]

    def sheet(self, capture: Capture) -> Sheet | None:
        """What a clip shows: as the sidecar beside it says, else the one that the program brings for the
        capture of that name and length.

        None where there is neither; CaptureError where the one beside it speaks of another number of frames.
        """
        count = len(self.read(capture)) if capture.sidecar or shipped(capture.path).exists() else 0
        if capture.sidecar is None:
            known = read_sheet(shipped(capture.path)) if count else None
            return known if known is not None and known.frames == count else None
        sheet = read_sheet(capture.sidecar)
        if sheet.frames != count:
            raise CaptureError(
                f"{capture.sidecar.name} speaks of {sheet.frames} frames, {capture.path.name} has {count} "
                "at 30 a second; delete it, or run `python -m nsm_core annotate --overwrite` on its "
                "folder, which proposes it anew."
            )
        return sheet

    @cached_property
    def labelled(self) -> tuple[Labelled, ...]:
        """All clips that have a sidecar, in the order of their paths; the others are not used.  Errors as of
        ``sheet``.
        """
        found = ((capture, self.sheet(capture)) for capture in self.captures)
        return tuple(
            Labelled(replace(self.read(capture), name=self._name(capture)), sheet)
            for capture, sheet in found
            if sheet is not None
        )

    def _name(self, capture: Capture) -> str:
        return capture.path.relative_to(self.folder).with_suffix("").as_posix()

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
