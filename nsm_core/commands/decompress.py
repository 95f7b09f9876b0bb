"""Keep one pose a second of a capture, make it whole again and say what that costs."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from nsm_core.control.super_resolution import Compressed, compress, decompress
from nsm_core.conventions import FPS
from nsm_core.data.captures.bvh_writer import write_bvh
from nsm_core.data.captures.reader import read_clip
from nsm_core.model.inference.transition_model import load_transitions


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core decompress``."""
    parser = argparse.ArgumentParser(
        prog="decompress", description="Compress a capture to one pose a second, and make it whole again."
    )
    parser.add_argument("capture", help="BVH file, or what was compressed of one (.npz)")
    parser.add_argument("--out", required=True, help="BVH file to write; beside it lies what was kept (.npz)")
    parser.add_argument("--weights", default=None, help="weights file (default: the shipped one)")
    parser.add_argument("--interpolate", action="store_true", help="without a network")
    a = parser.parse_args(arguments)
    network = None if a.interpolate else load_transitions(a.weights)
    out = Path(a.out)
    if a.capture.endswith(".npz"):
        made = decompress(Compressed.load(a.capture), network)
        write_bvh(out, made.hips_position, made.local_rotations)
        return 0
    clip = read_clip(a.capture)
    kept = compress(clip).save(out.with_suffix(".npz"))
    made = decompress(Compressed.load(kept), network)
    write_bvh(out, made.hips_position, made.local_rotations)
    off = 100 * np.abs(made.world()[0] - clip.world()[0][: len(made)]).mean()
    # As it is kept: places in single, rotations in half precision.
    whole = clip.hips_position[: len(made)].nbytes + clip.local_rotations[: len(made)].nbytes // 2
    print(
        f"{len(made) / FPS:.1f} s kept in {kept.stat().st_size / 1024:.1f} KB of {whole / 1024:.1f} KB; "
        f"{off:.2f} cm off, mean over joints' coordinates and frames."
    )
    return 0
