"""Make ways of hands in generated kitchens and train the network that plans by them: one command, resumable
at any time; and compare it with what plans otherwise.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, replace
from pathlib import Path

import torch

from nsm_core.data.reaches.library import WayLibrary, load_library, make_library
from nsm_core.evaluation.goal_matching import GoalKeyframes, match_table
from nsm_core.evaluation.hand_layouts import layouts
from nsm_core.evaluation.hand_table import DIFFUSION, LAYOUTS, descent, planners, rival_paths, tables
from nsm_core.files import output
from nsm_core.model.inference.field_model import load_fields
from nsm_core.model.networks.allocator import keep_freed_memory
from nsm_core.model.networks.field_config import FieldConfig
from nsm_core.training.environment_code import CodeTrainer
from nsm_core.training.hand_fields import FieldSettings, FieldTrainer
from nsm_core.training.timed_run import run
from nsm_core.training.way_rivals import train_rivals


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core planner``."""
    defaults = FieldSettings()
    parser = argparse.ArgumentParser(
        prog="planner", description="Train the network that plans ways of hands through clutter."
    )
    parser.add_argument("--run", default="runs/planner", help="folder for ways, checkpoints and log")
    parser.add_argument("--kitchens", type=int, default=150, help="whose ways are learnt from (default: 150)")
    parser.add_argument("--things", type=int, default=8, help="of each kitchen (default: 8)")
    parser.add_argument("--weights", default=None, help="weights file to write (default: RUN/planner.npz)")
    parser.add_argument(
        "--minutes", type=float, default=defaults.minutes, help="of training, of a core (default: 50)"
    )
    parser.add_argument("--threads", type=int, default=2, help="processor threads (default: 2)")
    parser.add_argument("--every", type=float, default=120.0, help="seconds between checkpoints")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--width", type=int, default=FieldConfig.width, help="units of a layer")
    parser.add_argument(
        "--rivals", type=int, default=0, help="steps for which what it is compared with is trained, too"
    )
    parser.add_argument("--table", action="store_true", help="train nothing; compare on layouts")
    parser.add_argument("--layouts", type=int, default=LAYOUTS, help=f"of each kind (default: {LAYOUTS})")
    parser.add_argument(
        "--descent", action="store_true", help="with --table: what steps and guesses are worth"
    )
    parser.add_argument(
        "--codes",
        type=float,
        default=0.0,
        metavar="MINUTES",
        help="train a code of what is around a thing for so long instead, of a core, and match grasps by it",
    )
    a = parser.parse_args(arguments)
    keep_freed_memory()
    torch.set_num_threads(a.threads)
    folder = Path(a.run)
    weights = Path(a.weights) if a.weights else folder / "planner.npz"
    if a.codes:
        _match(a, folder)
        return 0
    if not a.table:
        _train(a, folder, weights)
    if a.layouts:
        _compare(a, folder, weights)
    return 0


def _train(a: argparse.Namespace, folder: Path, weights: Path) -> None:
    library = _library(a, folder)
    settings = replace(FieldSettings(), minutes=a.minutes, seed=a.seed)
    config = FieldConfig(width=a.width)
    trainer = FieldTrainer(library, config, settings)
    print(f"{len(trainer.rows)} of {len(library.laden)} ways are learnt.", flush=True)
    run(trainer, folder, a.every, _tell)
    out = trainer.export(weights)
    print(f"Wrote {out} ({out.stat().st_size / 2**20:.1f} MB).", flush=True)
    if a.rivals:
        train_rivals(library, config, settings, a.rivals, rival_paths(folder), folder / DIFFUSION, _tell)


def _compare(a: argparse.Namespace, folder: Path, weights: Path) -> None:
    model = load_fields(weights)
    rows = [
        {"layouts": name, "ways": who, **asdict(judged)}
        for name, who, judged in tables(planners(model, folder), a.layouts, _tell)
    ]
    with output(folder / "table.json", "The table") as temporary:
        temporary.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    if a.descent:
        descent(model, list(layouts(min(a.layouts, 40), reshaped=False)), _tell)


def _match(a: argparse.Namespace, folder: Path) -> None:
    library = _library(a, folder)
    trainer = CodeTrainer(library, FieldTrainer.learnt_rows(library, FieldSettings()), a.codes, a.seed)
    run(trainer, folder / "codes", a.every, _tell)
    match_table(GoalKeyframes(library, trainer.rows, trainer.codes), a.layouts, _tell)


def _library(a: argparse.Namespace, folder: Path) -> WayLibrary:
    print("Making ways of hands ...", flush=True)
    make_library(folder / "ways", a.kitchens, a.things, _tell)
    return load_library(folder / "ways")


def _tell(words: str) -> None:
    print(words, flush=True)
