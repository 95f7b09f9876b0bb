"""Make performances of picking and placing, train the controller on them and compare what tells it the
goal's phase: one command, resumable at any time.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import torch

from nsm_core.data.handling.library import handling_coverage, make_handling
from nsm_core.evaluation.handling.rolled import captured_bodies, rolled_bodies
from nsm_core.evaluation.handling.table import HEAD, JudgedHandling, as_rows, control_figure, judge
from nsm_core.evaluation.pictures.figures import figure_sheet
from nsm_core.files import output
from nsm_core.model.inference.handling_model import (
    KALMAN,
    MATCHED,
    NONE,
    PREDICTED,
    HandlingModel,
    load_handling,
)
from nsm_core.model.networks.allocator import keep_freed_memory
from nsm_core.model.networks.handling_config import HandlingConfig
from nsm_core.training.handling import HandlingSettings, HandlingTrainer, learnt_phases
from nsm_core.training.timed_run import run

CREDITS = ("Performances were made of the captures in the folder that the training was given.",)


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core controller``."""
    defaults, sizes = HandlingSettings(), HandlingConfig()
    parser = argparse.ArgumentParser(
        prog="controller", description="Train the controller of picking and placing."
    )
    parser.add_argument("captures", help="folder with BVH captures, reaches among them")
    parser.add_argument(
        "--run", default="runs/controller", help="folder for performances, checkpoints, tables"
    )
    parser.add_argument(
        "--frames", type=int, default=45000, help="of performances, at least (default: 45000)"
    )
    parser.add_argument(
        "--minutes", type=float, default=defaults.minutes, help="of training, of a core (default: 12)"
    )
    parser.add_argument("--steps", type=int, default=0, help="after which training ends all the same")
    parser.add_argument("--width", type=int, default=sizes.hidden, help="units of a layer (default: 512)")
    parser.add_argument("--experts", type=int, default=sizes.experts, help="that are blended (default: 4)")
    parser.add_argument("--threads", type=int, default=1, help="processor threads (default: 1)")
    parser.add_argument("--every", type=float, default=60.0, help="seconds between checkpoints")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--table", action="store_true", help="train nothing; compare what is there")
    parser.add_argument(
        "--sheets", type=int, default=0, help="roll-outs to draw, from the side and the front"
    )
    a = parser.parse_args(arguments)
    keep_freed_memory()
    torch.set_num_threads(a.threads)
    folder = Path(a.run)
    library = make_handling(folder / "performances", a.captures, a.frames, _tell)
    _tell(handling_coverage(library))
    settings = replace(defaults, minutes=a.minutes, steps=a.steps, seed=a.seed)
    phases = learnt_phases(library, folder / "phases.npz", settings, _tell)
    made = {}
    for goal_phase, name in ((1, "controller"), (0, "without")):
        config = HandlingConfig(a.width, a.experts, goal_phase=goal_phase)
        trainer = HandlingTrainer(library, phases, config, settings)
        weights = folder / f"{name}.npz"
        if not a.table:
            _tell(f"Training {name} ...")
            run(trainer, folder / name, a.every, _tell)
            trainer.export(weights, CREDITS)
            _tell(f"Wrote {weights} ({weights.stat().st_size / 2**20:.1f} MB).")
        made[name] = load_handling(weights)
    _tell(control_figure(trainer.tracks, folder / "control.png"))
    _compare(made, trainer, folder, a.sheets)
    return 0


def _compare(made: dict[str, HandlingModel], trainer: HandlingTrainer, folder: Path, sheets: int) -> None:
    data = captured_bodies(trainer.others)
    _tell(HEAD)
    found: dict[str, JudgedHandling] = {}
    for goal_phase in (NONE, MATCHED, PREDICTED, KALMAN):
        model = made["without" if goal_phase == NONE else "controller"]
        bodies = rolled_bodies(model, trainer.others, goal_phase)
        found[goal_phase] = judge(bodies, data)
        _tell(found[goal_phase].row(goal_phase))
        for n, body in enumerate(bodies[:sheets]):
            for view in ("side", "front"):
                figure_sheet(
                    body.positions,
                    folder / f"{goal_phase}_{n}_{view}.png",
                    view=view,
                    tiles=14,
                    camera="character",
                    contacts=body.feet,
                    title=f"{goal_phase}, {view}",
                )
    found["data"] = judge(data, data)
    _tell(found["data"].row("data"))
    with output(folder / "table.json", "The table") as temporary:
        temporary.write_text(json.dumps(as_rows(found), indent=1), encoding="utf-8")


def _tell(words: str) -> None:
    print(words, flush=True)
