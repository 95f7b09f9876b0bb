"""Command: annotate the clips of a folder; writes an editable sidecar and a picture beside each."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.conventions import FPS, STYLES
from nsm_core.data.annotation.phases import keys_of_phase
from nsm_core.data.annotation.picture import draw_annotation
from nsm_core.data.annotation.proposal import arrays_of, propose
from nsm_core.data.captures import sidecar, sidecar_writer
from nsm_core.data.captures.folder import Capture, CaptureFolder
from nsm_core.data.captures.joint_map import load_mapping
from nsm_core.data.captures.sheet import Sheet, Use, fingerprint
from nsm_core.errors import CaptureError, NsmError


def annotate_clip(
    folder: CaptureFolder, capture: Capture, overwrite: bool
) -> tuple[Clip, Sheet, dict[int, str], list[str]]:
    """Read a clip and propose its sheet; the fourth value names the sections that are kept: a person's edits,
    and what the program says of a capture that it knows.
    """
    clip = folder.read(capture)
    kept = None if overwrite else folder.sheet(capture)
    sheet, remarks = propose(clip, kept)
    mine = [] if kept is None else [*kept.edited(), *(["use"] if kept.use != Use() else [])]
    return clip, sheet, remarks, mine


def with_phase(sheet: Sheet, measured: dict[str, list[Any]], kept: list[str]) -> Sheet:
    """The sheet with measured phases in place of those by rule, except where a person's own stand."""
    for name, keys in measured.items():
        if name not in kept:
            sheet = replace(
                sheet.with_section(name, keys),
                proposal=sheet.proposal | {name: fingerprint(keys), f"{name}.by": "pae"},
            )
    return sheet


def main(arguments: list[str]) -> int:
    """Annotate every BVH file below a folder; exit code 1 if a file could not be read."""
    parser = argparse.ArgumentParser(prog="python -m nsm_core annotate", description=__doc__)
    parser.add_argument("folder", type=Path, help="folder with BVH files; those below it count too")
    parser.add_argument(
        "--mapping",
        type=Path,
        help="mapping file (TOML) for all files (default: mapping.toml beside or above them)",
    )
    parser.add_argument("--overwrite", action="store_true", help="propose everything anew, edits too")
    parser.add_argument(
        "--phase",
        choices=("rule", "pae"),
        default="rule",
        help="by foot landings, or by a Periodic Autoencoder",
    )
    parser.add_argument("--minutes", type=float, default=2.0, help="time to train the autoencoder")
    parser.add_argument("--no-pictures", action="store_true", help="write the sidecars only")
    options = parser.parse_args(arguments)
    if options.mapping:
        load_mapping(options.mapping)  # a damaged one is told once, not for every clip
    index = CaptureFolder(options.folder, options.mapping)
    if not index.captures:
        raise CaptureError(f"no BVH file lies in {options.folder}; name the folder with the captures.")
    done: list[tuple[Path, Clip, Sheet, dict[int, str], list[str]]] = []
    failed = 0
    for capture in index.captures:
        path = capture.path
        try:
            done.append((path, *annotate_clip(index, capture, options.overwrite)))
        except NsmError as error:
            failed += 1
            print(f"{path.relative_to(options.folder)}: {error}", file=sys.stderr)
    measured: list[dict[str, np.ndarray[Any, Any]]] = [{} for _ in done]
    if options.phase == "pae" and done:
        from nsm_core.training.periodic_phase import compare, measure

        annotations = [arrays_of(sheet) for _, _, sheet, _, _ in done]
        measured = measure([clip for _, clip, *_ in done], annotations, minutes=options.minutes)
        print(compare(annotations, [m["phase"] for m in measured]))
    seconds = dict.fromkeys(STYLES, 0.0)
    for (path, clip, sheet, remarks, kept), phases in zip(done, measured, strict=True):
        by_rule = sheet
        sheet = with_phase(sheet, {k: keys_of_phase(v) for k, v in phases.items()}, kept)
        sidecar_writer.write_sheet(sidecar.sidecar_of(path), sheet, remarks)
        annotation = arrays_of(sheet)
        if not options.no_pictures:
            shown = arrays_of(by_rule) if phases else annotation
            draw_annotation(clip, shown, path.with_name(path.stem + ".nsm.png"), phases.get("phase"))
        for k, name in enumerate(STYLES):
            seconds[name] += float(annotation.style[:, k].sum()) / FPS
        mine = f"; kept your {', '.join(kept)}" if kept else ""
        for note in clip.notes:
            print(f"{path.relative_to(options.folder)}: note: {note}")
        held = [name for k, name in enumerate(STYLES) if annotation.style[:, k].max() > 0.5]
        print(f"{path.relative_to(options.folder)}: {len(clip) / FPS:.1f} s, {', '.join(held)}{mine}")
    share = ", ".join(f"{name} {seconds[name] / 60:.2f}" for name in STYLES)
    print(f"{len(done)} clips annotated, {failed} not read; minutes: {share}")
    return 1 if failed else 0
