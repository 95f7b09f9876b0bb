"""Training of the network that tells fields around things: an auto-decoder, whose latent codes are learnt
with it (papers/002 equations 7 and 8), and the encoder that guesses them.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import nn

from nsm_core.data.reaches.library import CELLS, WayLibrary
from nsm_core.model.inference.field_model import PRIOR
from nsm_core.model.inference.weights_file import save_weights
from nsm_core.model.networks.field_config import CONDITION, FieldConfig, field_layout
from nsm_core.model.networks.field_decoder import CODE, FieldDecoder
from nsm_core.model.networks.field_numpy import cells_of, seen_of
from nsm_core.model.networks.precision import half_precision_pays
from nsm_core.rotations import Array
from nsm_core.world.planning.hand_fields import (
    CELL,
    NEAREST,
    SIDE,
    SOONEST,
    SPREAD,
    grid_around,
)

from .checkpoint import Part
from .timed_run import TimedTrainer


@dataclass(frozen=True)
class FieldSettings:
    """What a run depends on; stored in the weights.  Batches are of ``scenes`` with ``points`` of each;
    ``codes`` is the learning rate of latent codes; ``arrival`` weighs that field's error beside the others';
    ``without`` one of the known fields, "target" or "obstacles", which is then neither seen nor told (the
    two-channel networks of section 8.2.3).
    """

    minutes: float = 50.0
    scenes: int = 32
    points: int = 256
    learning_rate: float = 1e-3
    codes: float = 3e-3
    arrival: float = 10.0
    held_out: float = 0.1
    without: str = ""
    seed: int = 0


class FieldTrainer(TimedTrainer):
    """State of one run: the network, and a latent code of every way that is learnt, as it is and mirrored."""

    def __init__(self, library: WayLibrary, config: FieldConfig, settings: FieldSettings) -> None:
        super().__init__(settings.minutes, 0, settings.seed)
        self.library, self.settings = library, settings
        self.net = FieldDecoder(config)
        self.net.field_scale.copy_(torch.tensor((1 / NEAREST, 1 / NEAREST, 1 / SOONEST)))
        self.net.query_scale.copy_(torch.tensor((1.0,) * CONDITION.size + (SIDE / 2,) * 3))
        self.rows = self.learnt_rows(library, settings)
        # Every way is learnt as it is and mirrored, gone by the other hand.
        self.codes = nn.Embedding(2 * len(self.rows), config.latent, sparse=False)
        nn.init.normal_(self.codes.weight, std=CODE)
        self.net.half = half_precision_pays(torch.device("cpu"))
        self.optimise_by(
            torch.optim.Adam(
                [
                    {"params": list(self.net.parameters()), "lr": settings.learning_rate},
                    {"params": list(self.codes.parameters()), "lr": settings.codes},
                ],
                fused=True,
            )
        )
        self.places = grid_around(np.zeros(3)).reshape(-1, 3).astype(np.float32)
        self._told = [float(name != settings.without) for name in ("target", "obstacles")]
        self._seen = np.stack([self._cells(mirrored) for mirrored in (False, True)])

    @staticmethod
    def learnt_rows(library: WayLibrary, settings: FieldSettings) -> Array:
        """Numbers of the ways that are learnt: those of the last kitchens are held out."""
        last = math.ceil((1 - settings.held_out) * (int(library.kitchen.max()) + 1))
        return np.flatnonzero(library.kitchen < last)

    def _cells(self, mirrored: bool) -> Array:
        """What the encoder sees of the fields of all learnt ways, half precision."""
        lib, scale = self.library, self.net.field_scale.numpy()
        parts = []
        for some in np.array_split(self.rows, max(1, len(self.rows) // 64)):
            both = [f[some].astype(np.float32) for f in (lib.target, lib.obstacles)]
            both = [told * (f[:, ::-1] if mirrored else f) for told, f in zip(self._told, both, strict=True)]
            parts.append(cells_of(both[0], both[1], scale).astype(np.float16))
        return np.concatenate(parts)

    def parts(self) -> dict[str, Part]:
        """Network, codes of the ways that are learnt, and optimiser."""
        return super().parts() | {"codes": self.codes}

    def step_on(self, rng: np.random.Generator) -> tuple[float, float]:
        """One step; returns the mean error of fields and of guessed codes."""
        settings = self.settings
        chosen = rng.integers(len(self.rows), size=settings.scenes)
        mirrored = rng.random(settings.scenes) < 0.5
        rows = self.rows[chosen]
        condition, task = self.library.asked(rows, rng.random(settings.scenes) < 0.5, mirrored)
        cells = self._drawn(rows, rng)
        wanted = torch.from_numpy(self._values(rows, cells)) / self.net.field_scale
        given = np.broadcast_to(condition[:, None], (*cells.shape, CONDITION.size))
        places = self.places[cells]
        places[mirrored, :, 0] *= -1
        query = torch.from_numpy(np.concatenate((given, places), axis=-1))
        code = self.codes(torch.from_numpy(2 * chosen + mirrored))
        seen = seen_of(
            self._seen[mirrored.astype(int), chosen], condition, task, self.net.query_scale.numpy()
        )
        guessed = self.net.guessed(torch.from_numpy(seen))
        # One half is told from learnt codes, the other from guessed ones: the encoder learns what of a code
        # matters to the fields, and the decoder to tell them from what can be guessed.
        by_guess = torch.arange(settings.scenes)[:, None] % 2 == 0
        told = self.net(query, torch.where(by_guess, guessed, code))
        off = told - wanted
        known = sum(told * off[..., k].abs().mean() for k, told in enumerate(self._told))
        error = known + settings.arrival * off[..., 2].square().mean()
        missed = (guessed - code).square().mean()
        self.descend(error + PRIOR * code.square().sum(-1).mean() + missed)
        return float(error.detach()), float(missed.detach())

    def _drawn(self, rows: Array, rng: np.random.Generator) -> Array:
        """Numbers (S, P) of cells, one half anywhere, the other about the way, where a hand arrives."""
        lib, many = self.library, self.settings.points // 2
        anywhere = rng.integers(len(self.places), size=(len(rows), many))
        back = (rng.random((len(rows), many)) * lib.length[rows, None]).astype(int)
        near = lib.path[rows[:, None], lib.path.shape[1] - 1 - back]
        at = (near + rng.normal(0, SPREAD, near.shape) + SIDE / 2) / CELL
        i, j, k = np.moveaxis(np.clip(at.astype(int), 0, CELLS - 1), -1, 0)
        return np.concatenate((anywhere, (i * CELLS + j) * CELLS + k), 1)

    def _values(self, rows: Array, cells: Array) -> Array:
        lib = self.library
        parts = [
            f.reshape(len(f), -1)[rows[:, None], cells] for f in (lib.target, lib.obstacles, lib.arrival)
        ]
        return np.stack(parts, -1).astype(np.float32)

    def judge(self) -> tuple[float, ...]:
        """Nothing: ways not learnt from are planned when all is learnt (``evaluation.hand_ways``)."""
        return ()

    def export(self, path: Path) -> Path:
        """Write the network's weights, half precision."""
        values = {name.replace("/", "."): v.detach().numpy() for name, v in self.net.values.items()}
        scales = {name: getattr(self.net, name).numpy() for name in ("field_scale", "query_scale")}
        return save_weights(
            path,
            values,
            scales,
            config=self.net.config,
            layout=field_layout(),
            credits=["Ways of hands were made in generated kitchens; no captures were used."],
            seeds={"init": self.settings.seed},
            settings=asdict(self.settings),
            step=self.step,
            ways=len(self.rows),
        )


__all__ = ["FieldSettings", "FieldTrainer"]
