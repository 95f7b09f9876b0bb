"""Training of the diffusion policy that the planner of hands' ways is compared with."""

from __future__ import annotations

import numpy as np
import torch

from nsm_core.conventions import DT
from nsm_core.data.reaches.library import WayLibrary
from nsm_core.model.networks.field_config import CONDITION
from nsm_core.model.networks.field_numpy import cells_of, seen_of
from nsm_core.model.networks.way_diffusion import LEVELS, POINTS, SCALE, WayDiffusion, kept_shares
from nsm_core.rotations import Array
from nsm_core.world.planning.hand_fields import NEAREST

from .schedule import cosine

_RATE = 1e-3


class DiffusionTrainer:
    """State of one run: ways as they are and mirrored."""

    def __init__(self, library: WayLibrary, rows: Array, seed: int = 0) -> None:
        torch.manual_seed(seed)
        self.net, self.library, self.rows, self.seed = WayDiffusion(), library, rows, seed
        self.optimiser = torch.optim.AdamW(self.net.parameters(), lr=_RATE, weight_decay=1e-3)
        self._kept = kept_shares()
        self._cells = np.stack([self._seen(mirrored) for mirrored in (False, True)])
        self._ways = np.stack([_sampled(library, row) for row in rows])

    def _seen(self, mirrored: bool) -> Array:
        parts = []
        for row in self.rows:
            both = [f[row].astype(np.float32) for f in (self.library.target, self.library.obstacles)]
            both = [f[::-1] if mirrored else f for f in both]
            parts.append(cells_of(both[0], both[1], np.full(2, 1 / NEAREST)).astype(np.float16))
        return np.stack(parts)

    def learn(self, step: int, steps: int, scenes: int = 256) -> float:
        """One step of so many; returns the mean squared error of the noise."""
        rng = np.random.default_rng((self.seed, step))
        chosen, mirrored = rng.integers(len(self.rows), size=scenes), rng.random(scenes) < 0.5
        condition, task = self.library.asked(self.rows[chosen], np.zeros(scenes, bool), mirrored)
        ways = self._ways[chosen].copy()
        ways[mirrored, :-1:3] *= -1
        seen = seen_of(self._cells[mirrored.astype(int), chosen], condition, task, np.ones(CONDITION.size))
        level = torch.from_numpy(rng.integers(LEVELS, size=scenes))
        kept = self._kept[level][:, None]
        noise = torch.from_numpy(rng.normal(size=ways.shape).astype(np.float32))
        noisy = kept.sqrt() * torch.from_numpy(ways) + (1 - kept).sqrt() * noise
        error = (self.net(noisy, level.float(), torch.from_numpy(seen)) - noise).square().mean()
        self.optimiser.zero_grad()
        error.backward()
        for group in self.optimiser.param_groups:
            group["lr"] = _RATE * cosine(step / steps)
        self.optimiser.step()
        return float(error.detach())


def _sampled(library: WayLibrary, row: int) -> Array:
    """A way (49,) of POINTS places and its seconds, scaled."""
    path = library.path[row, -library.length[row] :]
    at = np.linspace(0, len(path) - 1, POINTS)
    places = np.stack([np.interp(at, np.arange(len(path)), column) for column in path.T], -1)
    seconds = (len(path) - 1) * DT
    return np.append((places / SCALE).ravel(), seconds).astype(np.float32)


__all__ = ["DiffusionTrainer"]
