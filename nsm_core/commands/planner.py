"""Make ways of hands in generated kitchens and train the network that plans by them: one command, resumable
at any time.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from nsm_core.data.reaches.library import load_library, make_library
from nsm_core.evaluation.hand_ways import judge, table
from nsm_core.model.inference.field_model import load_fields
from nsm_core.model.networks.allocator import keep_freed_memory
from nsm_core.model.networks.field_config import FieldConfig
from nsm_core.training.hand_fields import FieldSettings, FieldTrainer
from nsm_core.training.timed_run import run


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
    parser.add_argument("--minutes", type=float, default=defaults.minutes, help="of training (default: 50)")
    parser.add_argument("--threads", type=int, default=2, help="processor threads (default: 2)")
    parser.add_argument("--every", type=float, default=120.0, help="seconds between checkpoints")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--width", type=int, default=FieldConfig.width, help="units of a layer")
    parser.add_argument("--judged", type=int, default=40, help="ways not learnt from that are planned")
    a = parser.parse_args(arguments)
    keep_freed_memory()
    torch.set_num_threads(a.threads)
    folder = Path(a.run)
    print("Making ways of hands ...", flush=True)
    make_library(folder / "ways", a.kitchens, a.things, lambda words: print(words, flush=True))
    library = load_library(folder / "ways")
    settings = replace(defaults, minutes=a.minutes, seed=a.seed)
    trainer = FieldTrainer(library, FieldConfig(width=a.width), settings)
    print(f"{len(trainer.rows)} of {len(library.laden)} ways are learnt.", flush=True)
    run(trainer, folder, a.every, lambda words: print(words, flush=True))
    out = trainer.export(Path(a.weights) if a.weights else folder / "planner.npz")
    print(f"Wrote {out} ({out.stat().st_size / 2**20:.1f} MB).", flush=True)
    rest = np.setdiff1d(np.arange(len(library.laden)), trainer.rows)
    if len(rest) and a.judged:
        some = rest[np.unique(np.linspace(0, len(rest) - 1, a.judged).astype(int))]
        print(table(judge(load_fields(out), library, some, trainer.rows)))
    return 0
