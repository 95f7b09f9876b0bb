"""Convert a folder of furniture meshes to the object pool."""

from __future__ import annotations

import argparse

from nsm_core.world.assets.pool import Pool


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core pool``: read an object pool, keep it and say what of it is usable."""
    parser = argparse.ArgumentParser(
        prog="pool", description="Convert a folder of furniture meshes to the object pool."
    )
    parser.add_argument("folder", help="folder with index.csv and GLB files")
    parser.add_argument("--cache", default="runs/pool.npz")
    parser.add_argument("--held-back", type=float, default=0.2)
    a = parser.parse_args(arguments)
    print(Pool.load(a.folder, a.held_back, a.cache).table())
    return 0
