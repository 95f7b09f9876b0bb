"""Print the figures of the shipped network: one command, fixed seeds, tables and a JSON file."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from nsm_core.evaluation import natural
from nsm_core.evaluation.measures.data_baseline import slide_of_data
from nsm_core.evaluation.report import evaluate, held_back_pool, run_stress, tables, write_report
from nsm_core.evaluation.trials.suite import PARTS, parts_named
from nsm_core.model.features.meaning import remark
from nsm_core.model.inference.model import load_model
from nsm_core.model.inference.transition_model import FILL, load_transitions


def main(arguments: list[str]) -> int:
    """Entry of ``dev.py evaluate``."""
    parser = argparse.ArgumentParser(prog="evaluate", description="Measure the network on fixed trials.")
    parser.add_argument("--weights", default=None, help="weights file (default: the shipped one)")
    parser.add_argument(
        "--only",
        default=",".join(PARTS),
        help="parts or actions to try, with commas, or none: " + ", ".join(PARTS) + "; or transitions",
    )
    parser.add_argument("--starts", type=int, default=10, help="starts for each object")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--assets",
        default=None,
        help="folder of meshes whose held-back part serves as seats, tables and boxes",
    )
    parser.add_argument(
        "--stress",
        type=float,
        default=0.0,
        metavar="SECONDS",
        help="also roll out so much motion of random goals",
    )
    parser.add_argument(
        "--data", default=None, help="folder of composed data whose own foot slide is printed beside ours"
    )
    parser.add_argument(
        "--natural",
        default=None,
        metavar="CAPTURES",
        help="only print how natural takes are beside the captures of this folder",
    )
    parser.add_argument(
        "--sheets",
        default=None,
        help="only draw contact sheets of every part's first trials into this folder",
    )
    parser.add_argument(
        "--no-ablation", action="store_true", help="skip the runs without parts of the method"
    )
    parser.add_argument("--out", default="out/evaluation.json")
    parser.add_argument(
        "--transitions",
        default="runs/transitions",
        metavar="FOLDER",
        help="with --only transitions: folder of windows.npz and of what `transitions --rows` trained",
    )
    a = parser.parse_args(arguments)
    if a.only == "transitions":
        return _transitions(Path(a.transitions), Path(a.out), a.sheets, a.weights)
    named = [name.strip() for name in a.only.split(",") if name.strip() not in ("", "none")]
    unknown = [name for name in named if not parts_named(name)]
    if unknown:
        parser.error(f"there is no part {', '.join(unknown)}; choose from {', '.join(PARTS)}")
    only = list(dict.fromkeys(part for name in named for part in parts_named(name)))
    model = load_model(a.weights, backend="numpy")  # a bad file is told here, not by workers
    for note in remark(model.metadata):
        print(f"note: {note}", flush=True)
    if a.sheets:
        from nsm_core.evaluation.pictures.sheets import draw_sheets  # needs matplotlib

        draw_sheets(model, a.sheets, only, held_back_pool(a.assets))
        return 0
    if a.natural:
        captures = natural.captured(a.natural)  # a bad folder is told before anything is rolled out
        found = natural.figures(natural.taken(model, a.starts), captures)
        print(natural.table(found))
        write_report(found, Path(a.out))
        return 0
    result = evaluate(a.weights, only, a.starts, a.workers, not a.no_ablation, a.assets)
    if a.data:
        result["data"] = slide_of_data(a.data)
    if a.stress:
        result["stress"] = run_stress(a.weights, a.stress, a.workers)
    print(tables(result))
    write_report(result, Path(a.out))
    return 0


def _transitions(folder: Path, out: Path, sheets: str | None, weights: str | None) -> int:
    """Print the tables of transition networks (papers/001), or draw gaps that they fill."""
    from nsm_core.data.transitions.windows import Windows
    from nsm_core.evaluation.transitions import finished, terrain
    from nsm_core.evaluation.transitions.sheets import draw_fills
    from nsm_core.evaluation.transitions.tables import Judge, measured, read, text  # needs torch

    path = Path(weights) if weights else FILL
    windows = Windows.load(folder / "windows.npz")
    if sheets:
        for made in draw_fills(windows, Path(sheets), load_transitions(path) if path.exists() else None):
            print(made)
        return 0
    found = measured(windows, folder, path)
    print(text(found))
    if path.exists():
        model = load_transitions(path)
        gaps, whole = finished.finished(windows, model), finished.decompressed(windows, model)
        print("\n" + finished.text(gaps, whole))
        felt = terrain.felt(Judge(windows), read(path))
        print("\n" + terrain.text(felt))
        found["terrain"] = {frames: {n: asdict(f) for n, f in rows.items()} for frames, rows in felt.items()}
        found |= {"finished": {name: asdict(g) for name, g in gaps.items()}, "decompressed": whole}
    write_report(found, out)
    return 0
