"""A training that runs for its minutes or steps, with checkpoints and a log, and goes on where it was.

A kind of training is a ``TimedTrainer`` with its own data, parts and loss; ``run`` takes it to its end.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch

from nsm_core.model.networks.deferred import collect

from .checkpoint import Part, restore, write_checkpoint
from .schedule import cosine


def core_seconds() -> float:
    """Seconds that this process has had of each core that torch computes on: what else runs beside it takes
    nothing from a training.
    """
    return time.process_time() / torch.get_num_threads()


class TimedTrainer(ABC):
    """State of a run of so many ``minutes`` by its ``clock``, in seconds, or of so many ``steps`` (0: of any
    number) where those are over first.

    Who inherits it sets ``net``, calls ``optimise_by`` and says what a step is and what a log tells beside
    its errors.  All that is random in a step follows from ``seed`` and its number.
    """

    net: torch.nn.Module
    counters: ClassVar[tuple[str, ...]] = ("step", "seconds")  # numbers that a checkpoint holds

    def __init__(
        self, minutes: float, steps: int, seed: int, clock: Callable[[], float] = core_seconds
    ) -> None:
        torch.manual_seed(seed)
        self.minutes, self.steps, self.seed, self._clock = minutes, steps, seed, clock
        self.step, self.seconds = 0, 0.0

    def optimise_by(self, optimiser: torch.optim.Optimizer) -> None:
        """Learn with ``optimiser``, whose learning rates are those of a run's begin."""
        self.optimiser = optimiser
        self._rates = [group["lr"] for group in optimiser.param_groups]

    @property
    def done(self) -> float:
        """Share of the run that is over."""
        by_minutes = self.seconds / (60 * self.minutes) if self.minutes > 0 else 1.0
        by_steps = self.step / self.steps if self.steps else 0.0
        return min(1.0, max(by_minutes, by_steps))

    def learn(self) -> tuple[float, ...]:
        """One step; returns its errors, as ``step_on`` does."""
        begun = self._clock()
        errors = self.step_on(np.random.default_rng((self.seed, self.step)))
        self.step += 1
        self.seconds += self._clock() - begun
        return errors

    @abstractmethod
    def step_on(self, rng: np.random.Generator) -> tuple[float, ...]:
        """Draw a batch, ``descend`` on its loss; returns the errors that the log tells, the loss's first."""

    @abstractmethod
    def judge(self) -> tuple[float, ...]:
        """What the log says beside the mean errors of the steps; of what was not learnt from, or nothing."""

    def rate(self) -> float:
        """Factor 0..1 of the learning rates now: half a cosine over the run."""
        return cosine(self.done)

    def descend(self, loss: torch.Tensor, clipped: float | None = None) -> None:
        """One step of the optimiser against the gradient of ``loss``; a gradient longer than ``clipped`` is
        made as long.
        """
        self.optimiser.zero_grad()
        loss.backward()
        collect(self.net)
        if clipped is not None:
            torch.nn.utils.clip_grad_norm_(self.net.parameters(), clipped)
        factor = self.rate()
        for group, rate in zip(self.optimiser.param_groups, self._rates, strict=True):
            group["lr"] = rate * factor
        self.optimiser.step()

    def parts(self) -> dict[str, Part]:
        """What a checkpoint holds the state of, by name."""
        return {"net": self.net, "optimiser": self.optimiser}

    def save(self, path: Path) -> None:
        """Write a checkpoint; OutputError where that fails."""
        write_checkpoint(path, self.parts(), {name: getattr(self, name) for name in self.counters})

    def load(self, path: Path) -> None:
        """Go on from a checkpoint; WeightsError where it is of something else."""
        state = restore(path, self.parts(), self.counters)
        for name in self.counters:
            setattr(self, name, state[name])


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


__all__ = ["TimedTrainer", "core_seconds", "run"]
