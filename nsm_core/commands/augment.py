"""Put captured sit-downs on other seats by the five steps of contact transfer; writes each as BVH with a
picture.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from nsm_core.data.augmentation.swap_seats import switch_all
from nsm_core.data.captures import bvh_writer
from nsm_core.errors import OutputError
from nsm_core.world.assets.pool import Pool
from nsm_core.world.scene.furniture import cuboids


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core augment``."""
    from nsm_core.evaluation.pictures.figures import figure_sheet

    parser = argparse.ArgumentParser(prog="python -m nsm_core augment", description=__doc__)
    parser.add_argument("captures", help="folder with BVH captures")
    parser.add_argument(
        "--objects", default=None, help="folder of furniture meshes to put beside the parametric pieces"
    )
    parser.add_argument("--out", type=Path, default=Path("runs/augmented"))
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--seed", type=int, default=0)
    a = parser.parse_args(arguments)
    try:
        a.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"{a.out} cannot be made ({error.strerror}); choose a folder you may write to."
        ) from error
    pool = Pool() if a.objects is None else Pool.load(a.objects, cache=a.out / "objects.npz").training()
    for done in switch_all(a.captures, pool, a.count, a.seed):
        clip, path = done.clip, a.out / f"{done.clip.name}.bvh"
        bvh_writer.write_bvh(path, clip.hips_position, clip.local_rotations)
        solid = cuboids([(done.piece, done.pose[:3], float(done.pose[3]))])
        seat = f"seat {done.piece.require_seat().height:.2f} m high"
        figure_sheet(
            clip.world()[0],
            path.with_suffix(".png"),
            boxes=solid,
            title=f"{clip.name}, {seat}",
            camera="character",
            rows=2,
        )
        x, y, _, heading = done.pose
        print(f"{path.name}: {seat}, at {x:.3f}, {y:.3f}, turned by {np.degrees(heading):.1f} degrees")
    return 0
