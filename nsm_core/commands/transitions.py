"""Train a transition network: one command from a capture folder to a weights file, resumable at any time."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import torch

from nsm_core.data.transitions.windows import LEFT_OUT, Windows, clips_of, cut
from nsm_core.model.networks.allocator import keep_freed_memory
from nsm_core.model.networks.gap_config import GapConfig
from nsm_core.model.networks.gap_kinds import TRANSITIONS
from nsm_core.model.networks.rtn_config import INITIAL, TransitionConfig
from nsm_core.model.networks.rtn_rows import ROWS, TransitionSettings
from nsm_core.training.timed_run import run
from nsm_core.training.transitions import TransitionTrainer


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core transitions``."""
    parser = argparse.ArgumentParser(
        prog="transitions", description="Train a network that fills gaps, from a capture folder."
    )
    defaults = TransitionSettings()
    parser.add_argument("captures", help="folder with a folder of BVH captures for each actor or source")
    parser.add_argument("--run", default="runs/fill", help="folder for windows, checkpoints and log")
    parser.add_argument("--windows", default=None, help="file of windows (default: RUN/windows.npz)")
    parser.add_argument("--weights", default=None, help="weights file to write (default: RUN/fill.npz)")
    parser.add_argument("--minutes", type=float, default=defaults.minutes, help="of training (default: 50)")
    parser.add_argument("--steps", type=int, default=0, help="of training, whatever time they take")
    parser.add_argument("--threads", type=int, default=2, help="processor threads (default: 2)")
    parser.add_argument("--every", type=float, default=120.0, help="seconds between checkpoints")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--learning-rate", type=float, default=defaults.learning_rate)
    parser.add_argument("--batch", type=int, default=defaults.batch)
    parser.add_argument(
        "--frames", type=int, nargs=2, default=(3, 90), metavar=("LEAST", "MOST"), help="that are missing"
    )
    parser.add_argument(
        "--leave-out", nargs="*", default=LEFT_OUT, help="folders of captures to leave out (smartbody)"
    )
    parser.add_argument("--world", type=float, default=1.0, help="weight of where joints are in the world")
    parser.add_argument("--pace", type=float, default=0.0, help="weight of how fast joints are in the world")
    parser.add_argument(
        "--evened",
        type=float,
        default=0.0,
        help="by how much rare paces are drawn as often as others, 0 to 1",
    )
    parser.add_argument(
        "--hasted",
        type=float,
        default=0.0,
        help="share by which captures are played faster or slower at most",
    )
    parser.add_argument(
        "--rows",
        nargs="*",
        metavar="NAME",
        help="train what the tables compare, one after the other, each with --seeds into RUN/NAME-SEED; all "
        "without a name: " + ", ".join(ROWS),
    )
    parser.add_argument("--seeds", type=int, default=3, help="of each row (default: 3)")
    parser.add_argument("--network", choices=list(TRANSITIONS), default="rtn")
    parser.add_argument("--units", type=int, default=512, help="of the recurrent layer; others go along")
    parser.add_argument("--teacher", type=float, default=defaults.teacher)
    parser.add_argument("--scheduled", action="store_true", help="teacher forcing that ends over the run")
    parser.add_argument(
        "--paper", action="store_true", help="as in the paper: any heading, no arrival, the paper's loss"
    )
    parser.add_argument("--no-homing", action="store_true", help="it is not set on the way to the target")
    parser.add_argument("--no-terrain", action="store_true", help="a network that does not see the ground")
    parser.add_argument("--no-residual", action="store_true", help="it tells frames, not what is added")
    parser.add_argument("--no-future", action="store_true", help="it is not told of the target")
    parser.add_argument("--initial", choices=INITIAL, default=None, help="state that a gap begins with")
    a = parser.parse_args(arguments)
    least, most = a.frames
    if not 1 <= least <= most:
        parser.error("--frames needs two numbers, the smaller one first")
    config = TRANSITIONS[a.network]().of_units(a.units)
    config = replace(config, terrain=not a.no_terrain, faced=not a.paper)
    if isinstance(config, TransitionConfig):
        config = replace(
            config,
            arrival=not a.paper,
            residual=config.residual and not a.no_residual,
            future=0 if a.no_future else config.future,
            initial=a.initial or config.initial,
            homing=config.homing and not (a.paper or a.no_homing),
        )
    elif a.paper or a.no_residual or a.no_future or a.initial or a.no_homing:
        parser.error(f"{a.network} is not in the paper, and has none of the parts that it leaves out there")
    settings = TransitionSettings(
        a.minutes, least, most, a.batch, a.learning_rate, a.teacher, a.scheduled,
        0.0 if a.paper else a.world, a.seed, a.steps,
        a.pace, a.evened, a.hasted,
    )  # fmt: skip
    keep_freed_memory()
    torch.set_num_threads(a.threads)
    folder = Path(a.run)
    file = Path(a.windows) if a.windows else folder / "windows.npz"
    if not file.exists():
        print("Cutting windows and fitting ground under them ...", flush=True)
        cut(
            clips_of(a.captures, a.leave_out),
            most,
            progress=lambda share: print(f"\r{share:4.0%}", end="", flush=True),
        ).save(file)
        print()
    windows = Windows.load(file)
    if a.rows is None:
        _train(
            windows, config, settings, folder, Path(a.weights) if a.weights else folder / "fill.npz", a.every
        )
        return 0
    unknown = [name for name in a.rows if name not in ROWS]
    if unknown:
        parser.error(f"there is no row {', '.join(unknown)}; choose from {', '.join(ROWS)}")
    for seed in range(a.seeds):
        for name in a.rows or ROWS:
            own, to = ROWS[name], folder / f"{name}-{seed}"
            if not (to / "fill.npz").exists():
                print(f"{name}, seed {seed}", flush=True)
                asked = replace(
                    own.settings, minutes=a.minutes, steps=a.steps, seed=seed, learning_rate=a.learning_rate
                )
                _train(windows, own.config.of_units(a.units), asked, to, to / "fill.npz", a.every)
    return 0


def _train(
    windows: Windows,
    config: GapConfig,
    settings: TransitionSettings,
    folder: Path,
    out: Path,
    every: float,
) -> None:
    trainer = TransitionTrainer(windows, config, settings)
    run(trainer, folder, every, lambda words: print(words, flush=True))
    trainer.export(out)
    print(f"Wrote {out} ({out.stat().st_size / 2**20:.1f} MB).", flush=True)
