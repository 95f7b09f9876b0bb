"""Training of the code of what stands around a thing, on the fields of the ways that the planner learns
from.
"""

from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np
import torch

from nsm_core.data.reaches.library import WayLibrary
from nsm_core.errors import WeightsError
from nsm_core.files import output
from nsm_core.model.networks.environment_code import EnvironmentCode
from nsm_core.rotations import Array
from nsm_core.world.planning.hand_fields import NEAREST

from .trainer import read_checkpoint

_BATCH, _RATE, _JUDGED = 24, 2e-3, 64


class CodeTrainer:
    """State of one run: a ``timed_run.TimedTrainer`` of so many ``minutes`` of a core on ways ``rows``, each
    as it is and mirrored.
    """

    def __init__(self, library: WayLibrary, rows: Array, minutes: float, seed: int = 0) -> None:
        torch.manual_seed(seed)
        self.net, self.minutes, self.seed = EnvironmentCode(), minutes, seed
        self._fields = library.obstacles
        self.rows = rows
        self._kept = np.setdiff1d(np.arange(len(library.laden)), rows)[:_JUDGED]
        self.optimiser = torch.optim.Adam(self.net.parameters(), lr=_RATE)
        self.step, self.seconds = 0, 0.0

    @property
    def done(self) -> float:
        """Share of the run that is over."""
        return min(1.0, self.seconds / (60 * self.minutes)) if self.minutes > 0 else 1.0

    def learn(self) -> tuple[float]:
        """One step; returns the mean squared error, shares of the field's most."""
        begun, rng = time.process_time(), np.random.default_rng((self.seed, self.step))
        chosen = rng.choice(self.rows, _BATCH)
        fields = told(self._fields[chosen])
        error = self._error(
            torch.where(
                torch.from_numpy(rng.random(_BATCH) < 0.5)[:, None, None, None], fields.flip(1), fields
            )
        )
        self.optimiser.zero_grad()
        error.backward()
        for group in self.optimiser.param_groups:
            group["lr"] = _RATE * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * self.done)))
        self.optimiser.step()
        self.step += 1
        self.seconds += (time.process_time() - begun) / torch.get_num_threads()
        return (float(error.detach()),)

    @torch.no_grad()
    def judge(self) -> tuple[float, ...]:
        """The same error on ways of kitchens that are held out, where there are some."""
        return (float(self._error(told(self._fields[self._kept]))),) if len(self._kept) else ()

    def _error(self, fields: torch.Tensor) -> torch.Tensor:
        return (self.net(fields) - fields).square().mean()

    def save(self, path: Path) -> None:
        """Write a checkpoint, whole or not at all."""
        state = {
            "net": self.net.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
            "seconds": self.seconds,
        }
        with output(path, "The checkpoint") as temporary:
            torch.save(state, temporary)

    def load(self, path: Path) -> None:
        """Go on from a checkpoint; WeightsError where it is of something else."""
        state = read_checkpoint(path)
        try:
            self.net.load_state_dict(state["net"])
            self.optimiser.load_state_dict(state["optimiser"])
        except (KeyError, RuntimeError, ValueError) as error:
            raise WeightsError(
                f"{path} is of another network; choose another folder with --run, or delete it."
            ) from error
        self.step, self.seconds = state["step"], state["seconds"]

    @torch.no_grad()
    def codes(self, fields: Array) -> Array:
        """Codes (S, 16) of fields of obstacles (S, N, N, N), one over metres."""
        parts = [self.net.encode(told(some)) for some in np.array_split(fields, max(1, len(fields) // 64))]
        return torch.cat(parts).numpy()


def told(fields: Array) -> torch.Tensor:
    """Fields (S, N, N, N), one over metres, as shares of what they are at most."""
    return torch.from_numpy(np.ascontiguousarray(fields, np.float32) * NEAREST)


__all__ = ["CodeTrainer"]
