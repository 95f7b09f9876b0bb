"""A training that runs for its minutes or steps, with checkpoints and a log, and goes on where it was."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import numpy as np


class TimedTrainer(Protocol):
    """State of a run, as ``run`` needs it."""

    step: int
    seconds: float

    @property
    def done(self) -> float:
        """Share of the run that is over."""
        ...

    def learn(self) -> tuple[float, ...]:
        """One step; returns its errors."""
        ...

    def judge(self) -> tuple[float, ...]:
        """What the log says beside the mean errors of the steps; of what was not learnt from, or nothing."""
        ...

    def save(self, path: Path) -> None:
        """Write a checkpoint, whole or not at all."""
        ...

    def load(self, path: Path) -> None:
        """Go on from a checkpoint; WeightsError where it is of something else."""
        ...


def run(trainer: TimedTrainer, folder: Path, every: float, tell: Callable[[str], None]) -> None:
    """Train to the end of the run, a checkpoint and a line of the log ``every`` so many seconds: step,
    minutes, mean errors since the last line, and what ``judge`` says.
    """
    checkpoint, log = folder / "checkpoint.pt", folder / "log.csv"
    folder.mkdir(parents=True, exist_ok=True)
    if checkpoint.exists():
        trainer.load(checkpoint)
        tell(f"Going on from step {trainer.step}.")
    recent: list[tuple[float, ...]] = []
    since = time.monotonic()
    while True:
        over = trainer.done >= 1
        if over or time.monotonic() - since > every:
            judged = trainer.judge()
            trainer.save(checkpoint)
            errors = (*(np.mean(recent, axis=0) if recent else (float("nan"),)), *judged)
            line = f"{trainer.step},{trainer.seconds / 60:.2f}," + ",".join(f"{e:.5f}" for e in errors)
            with open(log, "a", encoding="utf-8") as file:
                file.write(line + "\n")
            tell(line)
            recent, since = [], time.monotonic()
        if over:
            return
        recent.append(trainer.learn())


__all__ = ["TimedTrainer", "run"]
