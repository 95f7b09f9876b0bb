"""Training of the code of what stands around a thing, on the fields of the ways that the planner learns
from.
"""

from __future__ import annotations

import numpy as np
import torch

from nsm_core.data.reaches.library import WayLibrary
from nsm_core.model.networks.environment_code import EnvironmentCode
from nsm_core.rotations import Array
from nsm_core.world.planning.hand_fields import NEAREST

from .timed_run import TimedTrainer

_BATCH, _RATE, _JUDGED = 24, 2e-3, 64


class CodeTrainer(TimedTrainer):
    """State of one run of so many ``minutes`` of a core on ways ``rows``, each as it is and mirrored."""

    def __init__(self, library: WayLibrary, rows: Array, minutes: float, seed: int = 0) -> None:
        super().__init__(minutes, 0, seed)
        self.net = EnvironmentCode()
        self._fields = library.obstacles
        self.rows = rows
        self._kept = np.setdiff1d(np.arange(len(library.laden)), rows)[:_JUDGED]
        self.optimise_by(torch.optim.Adam(self.net.parameters(), lr=_RATE))

    def step_on(self, rng: np.random.Generator) -> tuple[float]:
        """One step; returns the mean squared error, shares of the field's most."""
        chosen = rng.choice(self.rows, _BATCH)
        fields = told(self._fields[chosen])
        error = self._error(
            torch.where(
                torch.from_numpy(rng.random(_BATCH) < 0.5)[:, None, None, None], fields.flip(1), fields
            )
        )
        self.descend(error)
        return (float(error.detach()),)

    @torch.no_grad()
    def judge(self) -> tuple[float, ...]:
        """The same error on ways of kitchens that are held out, where there are some."""
        return (float(self._error(told(self._fields[self._kept]))),) if len(self._kept) else ()

    def _error(self, fields: torch.Tensor) -> torch.Tensor:
        return (self.net(fields) - fields).square().mean()

    @torch.no_grad()
    def codes(self, fields: Array) -> Array:
        """Codes (S, 16) of fields of obstacles (S, N, N, N), one over metres."""
        parts = [self.net.encode(told(some)) for some in np.array_split(fields, max(1, len(fields) // 64))]
        return torch.cat(parts).numpy()


def told(fields: Array) -> torch.Tensor:
    """Fields (S, N, N, N), one over metres, as shares of what they are at most."""
    return torch.from_numpy(np.ascontiguousarray(fields, np.float32) * NEAREST)


__all__ = ["CodeTrainer"]
