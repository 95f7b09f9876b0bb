"""Train the network: one command from a capture folder to a weights file, resumable at any time."""

from __future__ import annotations

import argparse
import csv
import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch

from ..conventions import STYLES
from ..dataset.export import Dataset, export
from ..features import layout_description
from ..networks.config import NsmConfig
from ..networks.memory import keep_freed_memory
from ..networks.nsm import NSM, STATISTICS
from ..weights_file import save_weights
from .adopt import start_from
from .batches import Batches, RolloutSettings, loss_weights, statistics
from .schedule import cosine_restarts

CREDITS = Path(__file__).parent.parent / "weights" / "CREDITS.md"


@dataclass(frozen=True)
class TrainingSettings:
    """Everything a run depends on; stored in the weights."""

    steps: int = 16000
    data_batch: int = 192
    pool: int = 320
    learning_rate: float = 6e-4
    weight_decay: float = 2.5e-3
    noise: float = 0.05
    averaging: float = 0.999
    seed: int = 0
    data_minutes: float = 240.0
    rollout: RolloutSettings = RolloutSettings()


class Trainer:
    """State of one run: network, average, optimiser, batches."""

    def __init__(self, data: Dataset, settings: TrainingSettings, config: NsmConfig, seed_offset: int = 0) -> None:
        self.settings, self.config = settings, config
        torch.manual_seed(settings.seed)
        self.rng = np.random.default_rng((settings.seed, seed_offset))
        takes = np.unique(data.arrays["start"][data.frames])
        held_back = np.isin(data.arrays["start"][data.frames], takes[::20])  # every twentieth take validates
        self.batches = Batches(data, data.frames[~held_back], self.rng, settings.pool, settings.rollout)
        self.validation = Batches(data, data.frames[held_back], np.random.default_rng(1), 8, settings.rollout)
        self.net, self.average = NSM(config), NSM(config)
        self.optimiser = torch.optim.AdamW(self.net.parameters(), lr=settings.learning_rate, weight_decay=settings.weight_decay, fused=True)
        self.weights = torch.from_numpy(loss_weights())
        self.step = 0
        self.stance: dict[str, object] | None = None
        # What the data shows in more than a thousandth of its frames is offered.
        shown = data.arrays["style"].mean(axis=0) > 1e-3
        self.actions = [name for name, there in zip(STYLES, shown, strict=True) if there]

    def set_statistics(self) -> None:
        """Measure normalisation on the data and start the average at the network."""
        stats = statistics(self.batches)
        self.net.set_statistics(floor=1e-4, **stats)
        self.average.refresh(self.net)

    def _normalised(self, x: np.ndarray, g: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
        n = self.net
        return (torch.from_numpy(x) - n.input_mean) / n.input_std, (torch.from_numpy(g) - n.gating_mean) / n.gating_std

    def train_step(self) -> tuple[float, float]:
        """One optimiser step on half data, half roll-out; returns the two losses."""
        s, n, net = self.settings, self.settings.data_batch, self.net
        for group in self.optimiser.param_groups:
            factor = cosine_restarts(self.step, s.steps)
            group["lr"], group["weight_decay"] = s.learning_rate * factor, s.weight_decay * factor
        data, pool = self.batches.from_data(n), self.batches.from_pool()
        x, g = self._normalised(np.concatenate((data[0], pool[0])), np.concatenate((data[1], pool[1])))
        frame = self.config.frame + self.config.goal
        x[:n, :frame] += s.noise * torch.randn(n, frame)
        y = (torch.from_numpy(np.concatenate((data[2], pool[2]))) - net.output_mean) / net.output_std
        with torch.autocast("cpu", torch.bfloat16):
            out, _ = net(x, g)
        error = (((out - y) ** 2).clamp_max(100.0) * self.weights).mean(dim=1)
        loss = error.mean()
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        self.optimiser.step()
        with torch.no_grad():
            rate = min(s.averaging, (self.step + 1) / (self.step + 10))
            torch._foreach_lerp_(list(self.average.parameters()), list(net.parameters()), 1 - rate)
            self.batches.step_pool((out.detach()[n:] * net.output_std + net.output_mean).numpy())
        self.step += 1
        errors = error.detach()
        return float(errors[:n].mean()), float(errors[n:].mean())

    @torch.no_grad()
    def validate(self, count: int = 1024) -> float:
        """One-step loss of the averaged network on held-back takes."""
        x, g, y = self.validation.from_data(count)
        x, g = self._normalised(x, g)
        with torch.autocast("cpu", torch.bfloat16):
            out, _ = self.average(x, g)
        return float(((out - (torch.from_numpy(y) - self.net.output_mean) / self.net.output_std) ** 2).mean())

    def save(self, path: Path) -> None:
        """Write everything needed to go on, whole or not at all."""
        state = {
            "net": self.net.state_dict(),
            "average": self.average.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
        }
        torch.save(state, path.with_suffix(".part"))
        path.with_suffix(".part").replace(path)

    def load(self, path: Path) -> None:
        """Go on from what ``save`` wrote."""
        state = torch.load(path, weights_only=True)
        self.net.load_state_dict(state["net"])
        self.average.load_state_dict(state["average"])
        self.optimiser.load_state_dict(state["optimiser"])
        for group in self.optimiser.param_groups:
            group["fused"] = True
        self.step = state["step"]

    def export(self, path: Path) -> Path:
        """Write the averaged network as a weights file with its settings and the credits of its data."""
        stats = {k: getattr(self.average, k).numpy() for k in STATISTICS}
        parameters = {k: v.detach().numpy() for k, v in self.average.named_parameters()}
        return save_weights(
            path,
            parameters,
            stats,
            config=self.config.to_dict(),
            layout=layout_description(),
            credits=[line for line in CREDITS.read_text().splitlines() if line.strip()] if CREDITS.exists() else [],
            data=f"stitched performances, {self.settings.data_minutes:g} minutes, seed {self.settings.seed}",
            seeds={"data": self.settings.seed, "training": self.settings.seed},
            training={**asdict(self.settings), "steps_done": self.step},
            actions=self.actions,
            stance=self.stance,
        )


def plot(log: Path) -> None:
    """Draw the loss log beside itself."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows = np.genfromtxt(log, delimiter=",", names=True)
    if rows.ndim == 0 or len(rows) < 2:
        return
    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4.5))
    for name in ("data", "rollout", "validation"):
        left.plot(rows["step"], rows[name], label=name)
    left.set(yscale="log", xlabel="step", ylabel="mean squared error, normalised")
    left.legend()
    for name in ("drift_m", "pose_error_m"):
        right.plot(rows["step"], rows[name], label=name)
    right.set(xlabel="step", ylabel="metres", title="roll-outs against the takes they left")
    right.legend()
    figure.tight_layout()
    figure.savefig(log.with_suffix(".png"), dpi=90)
    plt.close(figure)


def main(arguments: list[str]) -> int:
    """Entry of ``dev.py train``."""
    parser = argparse.ArgumentParser(prog="train", description="Train the Neural State Machine from a capture folder.")
    defaults = TrainingSettings()
    parser.add_argument("captures", help="folder with BVH captures")
    parser.add_argument("--objects", default=None, help="folder of furniture meshes to put beside the parametric pieces")
    parser.add_argument("--run", default="runs/nsm", help="folder for data, checkpoints, log and plot (default: runs/nsm)")
    parser.add_argument("--weights", default=None, help="weights file to write at the end (default: RUN/nsm.npz)")
    parser.add_argument("--steps", type=int, default=defaults.steps)
    parser.add_argument("--data-minutes", type=float, default=defaults.data_minutes)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--learning-rate", type=float, default=defaults.learning_rate)
    parser.add_argument("--rollout", type=int, default=defaults.rollout.length)
    parser.add_argument("--threads", type=int, default=2, help="processor threads (default: 2)")
    parser.add_argument("--start-from", default=None, help="checkpoint or weights file whose network to start from")
    a = parser.parse_args(arguments)
    settings = TrainingSettings(
        steps=a.steps, data_minutes=a.data_minutes, seed=a.seed, learning_rate=a.learning_rate, rollout=RolloutSettings(length=a.rollout)
    )
    run = Path(a.run)
    folder = run / "data"
    if not (folder / "data.json").exists():
        print(f"Composing {settings.data_minutes:g} minutes of performances ...", flush=True)
        export(
            a.captures,
            folder,
            settings.data_minutes,
            settings.seed,
            meshes=a.objects,
            progress=lambda n, of: print(f"\r{min(n / of, 1):6.1%}", end="", flush=True),
        )
        print()
    keep_freed_memory()
    torch.set_num_threads(a.threads)
    checkpoint, log = run / "checkpoint.pt", run / "log.csv"
    resumed = checkpoint.exists()
    trainer = Trainer(Dataset.open(folder), settings, NsmConfig(), seed_offset=int(time.time()) if resumed else 0)
    trainer.stance = json.loads((folder / "data.json").read_text())["stance"]
    if resumed:
        trainer.load(checkpoint)
        print(f"Going on from step {trainer.step}.")
    else:
        trainer.set_statistics()
        if a.start_from:
            start_from(trainer.net, a.start_from)
            trainer.average.refresh(trainer.net)
        with log.open("w", newline="") as f:
            csv.writer(f).writerow(("step", "minutes", "data", "rollout", "validation", "drift_m", "pose_error_m"))
    _loop(trainer, checkpoint, log)
    out = trainer.export(Path(a.weights) if a.weights else run / "nsm.npz")
    print(f"Wrote {out} ({out.stat().st_size / 2**20:.1f} MB).")
    return 0


def _loop(trainer: Trainer, checkpoint: Path, log: Path) -> None:
    from tqdm import tqdm

    s = trainer.settings
    started, saved = time.time(), time.time()
    sums, count = np.zeros(2), 0
    bar = tqdm(total=s.steps, initial=trainer.step, unit="step", mininterval=5, dynamic_ncols=False)
    while trainer.step < s.steps:
        sums += trainer.train_step()
        count += 1
        bar.update()
        if trainer.step % 200 == 0 or trainer.step == s.steps:
            data, rollout = sums / count
            drift, pose = trainer.batches.drift
            row = (trainer.step, round((time.time() - started) / 60, 2), data, rollout, trainer.validate(), drift, pose)
            with log.open("a", newline="") as f:
                csv.writer(f).writerow([f"{v:.5g}" for v in row])
            bar.set_postfix_str(f"data {data:.4f} roll-out {rollout:.4f} drift {drift * 100:.1f} cm pose {pose * 100:.1f} cm")
            sums, count = np.zeros(2), 0
        if time.time() - saved > 120 or trainer.step == s.steps:
            trainer.save(checkpoint)
            trainer.export(checkpoint.with_name("nsm.npz"))
            plot(log)
            saved = time.time()
    bar.close()
