"""Train the network: one command from a capture folder to a weights file, resumable at any time."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from nsm_core.conventions import FPS
from nsm_core.data.export import export
from nsm_core.data.storage import Dataset, require_meaning
from nsm_core.files import output
from nsm_core.model.features.rollout_step import BLENDINGS
from nsm_core.model.networks.allocator import keep_freed_memory
from nsm_core.model.networks.config import NetworkConfig
from nsm_core.model.networks.gate_features import BLINDABLE, GATE_PARTS
from nsm_core.model.networks.registry import KINDS
from nsm_core.training.batches import RolloutSettings
from nsm_core.training.checkpoint import read_checkpoint
from nsm_core.training.fresh_takes import SEEDS_APART, FreshSettings, FreshTakes
from nsm_core.training.log import Log
from nsm_core.training.loop import run_training
from nsm_core.training.measured_phase import with_measured_phase
from nsm_core.training.ranks import Ranks
from nsm_core.training.trainer import Trainer, TrainingSettings, device_of
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
    parser.add_argument("--data", default=None, help="folder of composed data (default: RUN/data)")
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
    compared = parser.add_argument_group("to compare", "the method without one of its parts")
    compared.add_argument("--experts", type=int, default=None, help="experts that are blended (default: 8)")
    compared.add_argument(
        "--width", type=float, default=1.0, help="share of the widths of its layers (default: 1)"
    )
    compared.add_argument(
        "--without",
        choices=[*BLINDABLE, *GATE_PARTS],
        action="append",
        default=[],
        help="part of its input that the network never reads; may be given several times",
    )
    compared.add_argument(
        "--blending",
        choices=list(BLENDINGS),
        default="both",
        help="what of the bi-directional scheme roll-outs are stepped with (default: both)",
    )
    compared.add_argument(
        "--one-step", action="store_true", help="train on frames of the data alone, as the paper does"
    )
    compared.add_argument(
        "--phase", choices=("labels", "pae"), default="labels", help="the data's phase, or a measured one"
    )
    parser.add_argument(
        "--minutes", type=float, default=0.0, help="time after which training ends, in place of its steps"
    )
    parser.add_argument("--threads", type=int, default=2, help="processor threads (default: 2)")
    parser.add_argument(
        "--start-from", default=None, help="checkpoint or weights file whose network to start from"
    )
    a = parser.parse_args(arguments)
    if a.phase == "pae" and a.fresh > 0:
        parser.error("fresh takes have no measured phase; add --fresh 0")
    several = int(os.environ.get("WORLD_SIZE", 1)) > 1
    if a.minutes > 0 and several:
        parser.error("several processes must agree on their steps; give --steps in place of --minutes")
    config = KINDS[a.network].config()
    if a.experts is not None:
        if not hasattr(config, "gates"):
            parser.error(f"{a.network} blends no experts")
        config = type(config).from_dict(config.to_dict() | {"experts": a.experts})
    if not 0 < a.width <= 1:
        parser.error("--width is a share of the usual widths, more than 0 and up to 1")
    config = config.narrowed(a.width)
    rollout = RolloutSettings.one_step() if a.one_step else RolloutSettings(a.rollout, a.root_rate)
    settings = TrainingSettings(
        steps=a.steps,
        minutes=a.minutes,
        data_minutes=a.data_minutes,
        seed=a.seed,
        learning_rate=a.learning_rate,
        rollout=replace(rollout, blending=BLENDINGS[a.blending]),
        fresh=FreshSettings(share=a.fresh),
        stitched=not a.no_stitching,
        planted=a.planted,
        device=a.device,
        without=tuple(a.without),
        phase=a.phase,
        noise=0.0 if a.one_step else defaults.noise,
    )
    ranks = Ranks.joined(a.device)
    try:
        return _train(a, replace(settings, device=ranks.device(a.device)), config, ranks)
    finally:
        ranks.leave()


def _train(a: argparse.Namespace, settings: TrainingSettings, config: NetworkConfig, ranks: Ranks) -> int:
    """Train as one of ``ranks``; the first composes, tells and writes, the others go along."""
    device_of(settings.device)  # refused before anything is composed

    def tell(words: str) -> None:
        if ranks.first:
            print(words, flush=True)

    run = Path(a.run)
    folder = Path(a.data) if a.data else run / "data"
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
    about = (folder / "data.json").read_bytes()
    # As much as there is, which of a given folder is not what would have been composed.
    settings = replace(settings, data_minutes=round(json.loads(about)["frames"] / (60 * FPS), 1))
    trainer = Trainer(_data(folder, settings, run), settings, config, done, fresh, ranks)
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
            trainer.blind()
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


def _data(folder: Path, settings: TrainingSettings, run: Path) -> Dataset:
    """The composed data; a measured phase is kept beside the checkpoint, so that a run goes on with it."""
    data, kept = Dataset.open(folder), run / "phase.npy"
    if settings.phase != "pae":
        return data
    if not kept.exists():
        data = with_measured_phase(data, seed=settings.seed)
        with output(kept, "The measured phase") as temporary, open(temporary, "wb") as file:
            np.save(file, data.arrays["phase"])
    return replace(data, arrays={**data.arrays, "phase": np.load(kept)})
