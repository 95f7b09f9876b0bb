"""Training of the network that tells fields around things: an auto-decoder, whose latent codes are learnt
with it (papers/002 equations 7 and 8), and the encoder that guesses them.
"""

from __future__ import annotations

import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import nn

from nsm_core.data.reaches.library import WayLibrary
from nsm_core.errors import WeightsError
from nsm_core.files import output
from nsm_core.model.inference.field_model import PRIOR
from nsm_core.model.inference.weights_file import save_weights
from nsm_core.model.networks.field_config import CONDITION, FieldConfig, field_layout
from nsm_core.model.networks.field_decoder import CODE, FieldDecoder
from nsm_core.model.networks.field_numpy import seen_of
from nsm_core.rotations import Array
from nsm_core.training.trainer import read_checkpoint
from nsm_core.world.planning.hand_fields import NEAREST, SIDE, SOONEST, grid_around


@dataclass(frozen=True)
class FieldSettings:
    """What a run depends on; stored in the weights.  Batches are of ``scenes`` with ``points`` of each;
    ``codes`` is the learning rate of latent codes.
    """

    minutes: float = 50.0
    scenes: int = 32
    points: int = 512
    learning_rate: float = 1e-3
    codes: float = 3e-3
    held_out: float = 0.1
    seed: int = 0


class FieldTrainer:
    """State of one run."""

    def __init__(self, library: WayLibrary, config: FieldConfig, settings: FieldSettings) -> None:
        self.library, self.settings = library, settings
        torch.manual_seed(settings.seed)
        self.net = FieldDecoder(config)
        self.net.field_scale.copy_(torch.tensor((1 / NEAREST, 1 / NEAREST, 1 / SOONEST)))
        self.net.query_scale.copy_(torch.tensor((1.0,) * CONDITION.size + (SIDE / 2,) * 3))
        last = math.ceil((1 - settings.held_out) * (int(library.kitchen.max()) + 1))
        self.rows = np.flatnonzero(library.kitchen < last)
        self.codes = nn.Embedding(len(self.rows), config.latent, sparse=False)
        nn.init.normal_(self.codes.weight, std=CODE)
        self.optimiser = torch.optim.Adam(
            [
                {"params": list(self.net.parameters()), "lr": settings.learning_rate},
                {"params": list(self.codes.parameters()), "lr": settings.codes},
            ],
            fused=True,
        )
        self.rates = [group["lr"] for group in self.optimiser.param_groups]
        self.places = grid_around(np.zeros(3)).reshape(-1, 3).astype(np.float32)
        self.step, self.seconds = 0, 0.0

    @property
    def done(self) -> float:
        """Share of the run that is over."""
        return min(1.0, self.seconds / (60 * self.settings.minutes))

    def learn(self) -> tuple[float, float]:
        """One step; returns the mean error of fields and of guessed codes."""
        begun, settings = time.perf_counter(), self.settings
        rng = np.random.default_rng((settings.seed, self.step))
        chosen = rng.integers(len(self.rows), size=settings.scenes)
        rows = self.rows[chosen]
        condition = self.library.conditions(rng.random(len(self.library.laden)) < 0.5)[rows]
        cells = rng.integers(len(self.places), size=(settings.scenes, settings.points))
        wanted = torch.from_numpy(self._values(rows, cells)) / self.net.field_scale
        given = np.broadcast_to(condition[:, None], (*cells.shape, CONDITION.size))
        query = torch.from_numpy(np.concatenate((given, self.places[cells]), axis=-1))
        code = self.codes(torch.from_numpy(chosen))
        off = self.net(query, code) - wanted
        error = off[..., :2].abs().sum(-1).mean() + off[..., 2].square().mean()
        guessed = self.net.guessed(torch.from_numpy(self._seen(rows, condition)))
        missed = (guessed - code.detach()).square().mean()
        loss = error + PRIOR * code.square().sum(-1).mean() + missed
        self.optimiser.zero_grad()
        loss.backward()
        for group, rate in zip(self.optimiser.param_groups, self.rates, strict=True):
            group["lr"] = rate * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * self.done)))
        self.optimiser.step()
        self.step += 1
        self.seconds += time.perf_counter() - begun
        return float(error.detach()), float(missed.detach())

    def _values(self, rows: Array, cells: Array) -> Array:
        lib = self.library
        parts = [
            f.reshape(len(f), -1)[rows[:, None], cells] for f in (lib.target, lib.obstacles, lib.arrival)
        ]
        return np.stack(parts, -1).astype(np.float32)

    def _seen(self, rows: Array, condition: Array) -> Array:
        lib = self.library
        known = (lib.target[rows].astype(np.float32), lib.obstacles[rows].astype(np.float32))
        return seen_of(*known, condition, self.net.field_scale.numpy(), self.net.query_scale.numpy())

    def judge(self) -> tuple[float, ...]:
        """Nothing: ways not learnt from are planned when all is learnt (``evaluation.hand_ways``)."""
        return ()

    def save(self, path: Path) -> None:
        """Write a checkpoint, whole or not at all."""
        state = {
            "net": self.net.state_dict(),
            "codes": self.codes.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
            "seconds": self.seconds,
        }
        with output(path, "The checkpoint") as temporary:
            torch.save(state, temporary)

    def load(self, path: Path) -> None:
        """Go on from a checkpoint of the same network and ways; WeightsError where it is of others."""
        state = read_checkpoint(path)
        try:
            self.net.load_state_dict(state["net"])
            self.codes.load_state_dict(state["codes"])
            self.optimiser.load_state_dict(state["optimiser"])
        except (KeyError, RuntimeError, ValueError) as error:
            raise WeightsError(
                f"{path} is of another network or of other ways; choose another folder with --run, or delete "
                "it."
            ) from error
        self.step, self.seconds = state["step"], state["seconds"]

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
