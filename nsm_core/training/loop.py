"""The loop of a training, which can be resumed at any time, and a picture of its losses."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np

from .log import Log
from .trainer import Trainer


def run_training(trainer: Trainer, checkpoint: Path, log: Log) -> None:
    """Train to the last step; the first of several processes writes ``checkpoint``, weights and ``log``."""
    from tqdm import tqdm

    first = trainer.ranks.first
    started, saved, begun = time.time(), time.time(), time.monotonic()
    sums, count = np.zeros(2), 0
    bar = tqdm(total=trainer.total, initial=trainer.step, unit="step", mininterval=5, disable=not first)
    while trainer.step < trainer.total:
        sums += trainer.train_step()
        count += 1
        now = time.monotonic()
        trainer.spend(now - begun)
        begun, bar.total = now, trainer.total
        bar.update()
        if not first:
            continue
        if trainer.step % 200 == 0 or trainer.step == trainer.total:
            data, rollout = sums / count
            drift, pose = trainer.batches.drift
            row = (
                trainer.step,
                round((time.time() - started) / 60, 2),
                data,
                rollout,
                trainer.validate(),
                drift,
                pose,
            )
            log.add(row)
            bar.set_postfix_str(
                f"data {data:.4f} roll-out {rollout:.4f} drift {drift * 100:.1f} cm pose {pose * 100:.1f} cm"
            )
            sums, count = np.zeros(2), 0
        if time.time() - saved > 120 or trainer.step == trainer.total:
            trainer.save(checkpoint)
            trainer.export(checkpoint.with_name("nsm.npz"))
            log.plot()
            saved = time.time()
    bar.close()
