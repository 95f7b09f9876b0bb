"""Compose training data from captures and say what it covers."""

from __future__ import annotations

import argparse


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core compose``: write training data and say what it covers."""
    from nsm_core.data.coverage import (
        draw_coverage,
        report,  # these need this module
    )
    from nsm_core.data.export import export

    parser = argparse.ArgumentParser(
        prog="compose", description="Stitch goal-directed performances from a capture folder."
    )
    parser.add_argument("captures", help="folder with BVH captures")
    parser.add_argument(
        "--objects", default=None, help="folder of furniture meshes to put beside the parametric pieces"
    )
    parser.add_argument("--out", default="runs/data")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2, help="processes that compose (default: 2)")
    a = parser.parse_args(arguments)

    def show(n: int, of: int) -> None:
        print(f"\r{min(n / of, 1):6.1%}", end="", flush=True)

    folder = export(
        a.captures,
        a.out,
        a.minutes,
        a.seed,
        meshes=a.objects,
        workers=a.workers,
        progress=show,
        tell=lambda note: print(f"note: {note}"),
    )
    print()
    print(report(folder))
    print(f"Wrote {draw_coverage(folder, folder / 'coverage.png')}.")
    return 0
