"""A diffusion policy that denoises the ways of hands, as the rival of the planner's fields (Chi et al. 2023,
after papers/002 section 8.2): a small perceptron that is given what the planner's encoder sees.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from nsm_core import npz
from nsm_core.conventions import DT
from nsm_core.files import output
from nsm_core.rotations import Array
from nsm_core.world.planning.hand_fields import SIDE

from .field_config import COARSE, CONDITION, TASK

POINTS = 16  # of a way, even in time, the last one at the grasp
LEVELS, _STEPS = 100, 20  # of noise in training, and of them those that are gone through
SCALE = SIDE / 2  # metres that places are told in
_WIDTH, _SEEN, _TIMES = 384, 192, 32
_CELLS = 2 * COARSE**3


class WayDiffusion(nn.Module):
    """Tells the noise in a way of POINTS places and its seconds, (S, 49)."""

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("query_scale", torch.ones(CONDITION.size))
        seen = _CELLS + CONDITION.size + TASK.size
        self.eye = nn.Sequential(nn.Linear(seen, _SEEN), nn.ReLU(), nn.Linear(_SEEN, _SEEN), nn.ReLU())
        wide = 3 * POINTS + 1
        self.body = nn.Sequential(
            nn.Linear(wide + _SEEN + TASK.size + CONDITION.size + _TIMES, _WIDTH),
            nn.SiLU(),
            nn.Linear(_WIDTH, _WIDTH),
            nn.SiLU(),
            nn.Linear(_WIDTH, _WIDTH),
            nn.SiLU(),
            nn.Linear(_WIDTH, wide),
        )

    def forward(self, way: Tensor, level: Tensor, seen: Tensor) -> Tensor:
        """Noise (S, 49) of ways at levels (S,), of scenes that are seen (S, 8205)."""
        rates = torch.exp(torch.arange(_TIMES // 2) * (-math.log(1e4) / (_TIMES // 2)))
        turns = level[:, None] * rates
        given = torch.cat((torch.sin(turns), torch.cos(turns), self.eye(seen), seen[:, _CELLS:]), 1)
        return torch.as_tensor(self.body(torch.cat((way, given), 1)))

    def save(self, path: Path) -> None:
        """Write the parameters, whole or not at all."""
        with output(path, "The rival") as temporary, open(temporary, "wb") as file:
            np.savez(file, **{name: value.numpy() for name, value in self.state_dict().items()})


def kept_shares() -> Tensor:
    """How much (LEVELS,) of a way's square is left at each level of noise (cosine schedule)."""
    at = (torch.arange(LEVELS) + 1) / LEVELS
    return torch.cos((at + 0.008) / 1.008 * math.pi / 2).square().clamp(1e-4, 0.9999)


def load_diffusion(path: Path) -> WayDiffusion:
    """Read what ``WayDiffusion.save`` wrote."""
    net = WayDiffusion()
    arrays = npz.read_arrays(path, dict.fromkeys(net.state_dict(), "f"), 1 << 28)
    net.load_state_dict({name: torch.from_numpy(value) for name, value in arrays.items()})
    return net


@torch.no_grad()
def denoised(net: WayDiffusion, seen: Array, end: Array, seed: int = 0) -> Array:
    """A way (T, 3) at 30 Hz to its ``end`` (3,), of a scene that is seen (8205,), from noise (DDIM,
    Song et al. 2021).
    """
    given, kept = torch.from_numpy(seen)[None], kept_shares()
    way = torch.from_numpy(np.random.default_rng(seed).normal(size=(1, 3 * POINTS + 1)).astype(np.float32))
    levels = np.linspace(LEVELS - 1, 0, _STEPS).astype(int)
    for level, after in zip(levels, (*levels[1:], -1), strict=True):
        noise = net(way, torch.tensor([float(level)]), given)
        clean = ((way - (1 - kept[level]).sqrt() * noise) / kept[level].sqrt()).clamp(-4, 4)
        then = kept[after] if after >= 0 else torch.tensor(1.0)
        way = then.sqrt() * clean + (1 - then).sqrt() * noise
    places = way[0, :-1].numpy().reshape(POINTS, 3).astype(np.float64) * SCALE
    seconds = max(float(way[0, -1]), 0.2)
    places += np.linspace(0, 1, POINTS)[:, None] ** 3 * (end - places[-1])
    at = np.linspace(0, POINTS - 1, max(round(seconds / DT), 4) + 1)
    return np.stack([np.interp(at, np.arange(POINTS), column) for column in places.T], -1)


__all__ = ["LEVELS", "POINTS", "SCALE", "WayDiffusion", "denoised", "kept_shares", "load_diffusion"]
