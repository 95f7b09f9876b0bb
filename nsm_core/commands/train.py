"""Train the network: one command from a capture folder to a weights file, resumable at any time."""

from __future__ import annotations

import argparse
import hashlib
import json
from dataclasses import replace
from pathlib import Path

import torch

from nsm_core.data.export import export
from nsm_core.data.storage import Dataset, require_meaning
from nsm_core.model.networks.allocator import keep_freed_memory
from nsm_core.model.networks.registry import KINDS
from nsm_core.training.batches import RolloutSettings
from nsm_core.training.fresh_takes import SEEDS_APART, FreshSettings, FreshTakes
from nsm_core.training.log import Log
from nsm_core.training.loop import run_training
from nsm_core.training.ranks import Ranks
from nsm_core.training.trainer import Trainer, TrainingSettings, device_of, read_checkpoint
from nsm_core.training.warm_start import start_from


def main(arguments: list[str]) -> int:
    """Entry of ``dev.py train``."""
    parser = argparse.ArgumentParser(
        prog="train", description="Train the Neural State Machine from a capture folder."
    )
    defaults = TrainingSettings()
    parser.add_argument("captures", help="folder with BVH captures")
    parser.add_argument(
        "--objects", default=None, help="folder of furniture meshes to put beside the parametric pieces"
    )
    parser.add_argument(
        "--run", default="runs/nsm", help="folder for data, checkpoints, log and plot (default: runs/nsm)"
    )
    parser.add_argument(
        "--weights", default=None, help="weights file to write at the end (default: RUN/nsm.npz)"
    )
    parser.add_argument("--steps", type=int, default=defaults.steps)
    parser.add_argument("--data-minutes", type=float, default=defaults.data_minutes)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--learning-rate", type=float, default=defaults.learning_rate)
    parser.add_argument("--rollout", type=int, default=defaults.rollout.length)
    parser.add_argument(
        "--root-rate",
        type=float,
        default=defaults.rollout.root_rate,
        help="share of drift that roll-outs learn to undo per frame",
    )
    parser.add_argument(
        "--fresh",
        type=float,
        default=defaults.fresh.share,
        help="share of takes composed meanwhile and put on other objects (0 for none)",
    )
    parser.add_argument(
        "--planted",
        type=float,
        default=defaults.planted,
        help="weight of the slip of standing feet in the loss (0 for none)",
    )
    parser.add_argument(
        "--no-stitching", action="store_true", help="train on captured pieces by themselves, to compare"
    )
    parser.add_argument(
        "--network", choices=list(KINDS), default="nsm", help="network to train (default: nsm)"
    )
    parser.add_argument(
        "--device", default=defaults.device, help="where it is trained: cpu, cuda, cuda:1 ... (default: cpu)"
    )
    parser.add_argument("--threads", type=int, default=2, help="processor threads (default: 2)")
    parser.add_argument(
        "--start-from", default=None, help="checkpoint or weights file whose network to start from"
    )
    a = parser.parse_args(arguments)
    settings = TrainingSettings(
        steps=a.steps,
        data_minutes=a.data_minutes,
        seed=a.seed,
        learning_rate=a.learning_rate,
        rollout=RolloutSettings(length=a.rollout, root_rate=a.root_rate),
        fresh=FreshSettings(share=a.fresh),
        stitched=not a.no_stitching,
        planted=a.planted,
        device=a.device,
    )
    ranks = Ranks.joined(a.device)
    try:
        return _train(a, replace(settings, device=ranks.device(a.device)), ranks)
    finally:
        ranks.leave()


def _train(a: argparse.Namespace, settings: TrainingSettings, ranks: Ranks) -> int:
    """Train as one of ``ranks``; the first composes, tells and writes, the others go along."""
    device_of(settings.device)  # refused before anything is composed

    def tell(words: str) -> None:
        if ranks.first:
            print(words, flush=True)

    run = Path(a.run)
    folder = run / "data"
    if ranks.first and not (folder / "data.json").exists():
        tell(f"Composing {settings.data_minutes:g} minutes of performances ...")
        export(
            a.captures,
            folder,
            settings.data_minutes,
            settings.seed,
            meshes=a.objects,
            stitch=settings.stitched,
            progress=lambda n, of: print(f"\r{min(n / of, 1):6.1%}", end="", flush=True),
            tell=lambda note: print(f"note: {note}", flush=True),
        )
        print()
    ranks.wait()
    meaning = require_meaning(folder)
    keep_freed_memory()
    torch.set_num_threads(a.threads)
    checkpoint, log = run / "checkpoint.pt", Log(run / "log.csv")
    resumed = checkpoint.exists()
    done = read_checkpoint(checkpoint).get("step", 0) if resumed else 0
    fresh = None
    if settings.fresh.share > 0:
        tell("Composing the first fresh takes ...")
        # Fewer than one take a step, so that no take comes twice.
        first = settings.seed + (1 + ranks.rank) * SEEDS_APART + done
        fresh = FreshTakes(
            a.captures, a.objects, str(folder / "objects.npz"), first, settings.fresh.slots, settings.stitched
        )
    trainer = Trainer(Dataset.open(folder), settings, KINDS[a.network].config(), done, fresh, ranks)
    about = (folder / "data.json").read_bytes()
    trainer.stance, trainer.meaning = json.loads(about)["stance"], meaning
    started_from = Path(a.start_from).name if a.start_from else ""
    trainer.origin = {"data_version": hashlib.sha256(about).hexdigest()[:16], "started_from": started_from}
    if resumed:
        trainer.load(checkpoint)
        tell(f"Going on from step {trainer.step}.")
    else:
        trainer.set_statistics()
        if a.start_from:
            start_from(trainer.net, a.start_from)
            trainer.average.refresh(trainer.net)
    ranks.alike(trainer.net, trainer.average)
    if ranks.first:
        log.begin(trainer.step)
    try:
        run_training(trainer, checkpoint, log)
    finally:
        if fresh is not None:
            fresh.close()
    if not ranks.first:
        return 0
    out = trainer.export(Path(a.weights) if a.weights else run / "nsm.npz")
    print(f"Wrote {out} ({out.stat().st_size / 2**20:.1f} MB).")
    return 0
