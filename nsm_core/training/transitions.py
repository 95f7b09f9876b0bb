"""Training of transition networks: probabilistic teacher forcing, AMSGrad, mean squared error over all
missing frames and the target's (papers/001 section 6).
"""

from __future__ import annotations

import math
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch

from nsm_core.data.transitions.gaps import GapSource, statistics_of
from nsm_core.data.transitions.windows import Windows
from nsm_core.model.inference.weights_file import save_weights
from nsm_core.model.networks.delta import DeltaNetwork
from nsm_core.model.networks.gap_config import NOISE, GapConfig
from nsm_core.model.networks.gap_torch import filled, gap_network
from nsm_core.model.networks.precision import half_precision_pays
from nsm_core.model.networks.rtn_rollout import RollOut
from nsm_core.model.networks.rtn_rows import TransitionSettings
from nsm_core.model.transitions.layout import layout_description

from .checkpoint import Part
from .schedule import cosine
from .timed_run import TimedTrainer
from .trainer import CREDITS

VALIDATED = (30, 128)  # frames and number of the gaps of held-out actors that a run is judged by
CLIPPED = 1.0  # norm of the gradient at most
EASED = 0.5  # share of a run from which on the learning rate falls
LAST_RATE = 0.05  # share of it at the end


class TransitionTrainer(TimedTrainer):
    """State of one run: the network as it is and as it was when it did best on actors held out."""

    counters = (*TimedTrainer.counters, "least")

    def __init__(self, windows: Windows, config: GapConfig, settings: TransitionSettings) -> None:
        # Steps that are asked for are taken, whatever time they take.
        minutes = math.inf if settings.steps else settings.minutes
        super().__init__(minutes, settings.steps, settings.seed, clock=time.perf_counter)
        self.settings, self.windows = settings, windows
        self.net, self.best = gap_network(config), gap_network(config)
        if isinstance(self.net, DeltaNetwork):
            self.net.half = half_precision_pays(torch.device("cpu"))
        self.source = GapSource(windows, False, config.faced, settings.evened, settings.hasted)
        self.held = GapSource(windows, True, config.faced)
        self.optimise_by(
            torch.optim.Adam(self.net.parameters(), lr=settings.learning_rate, amsgrad=True, fused=True)
        )
        self.least = float("inf")
        rng = np.random.default_rng(settings.seed)
        lengths = [int(n) for n in np.linspace(settings.shortest, settings.longest, 8)]
        for name, values in statistics_of(self.source, lengths, rng).items():
            getattr(self.net, name).copy_(torch.from_numpy(values))
        self.best.load_state_dict(self.net.state_dict())

    def parts(self) -> dict[str, Part]:
        """The network, its best and the optimiser."""
        return super().parts() | {"average": self.best}

    def rate(self) -> float:
        """1 for the first half of a run, then half a cosine down to ``LAST_RATE``."""
        return cosine(max(0.0, (self.done - EASED) / (1 - EASED)), LAST_RATE)

    def step_on(self, rng: np.random.Generator) -> tuple[float]:
        """One step; returns its error."""
        settings = self.settings
        generator = torch.Generator().manual_seed(int(rng.integers(1 << 40)))
        spread = settings.longest - settings.shortest + 1
        frames = settings.shortest + int(spread * rng.random() ** 1.5)
        teacher = 1 - self.done if settings.scheduled else settings.teacher
        self.net.train()
        noise = NOISE if self.net.config.varied else 0.0
        out = filled(self.net, self.source.draw(frames, settings.batch, rng), teacher, noise, generator)
        error = out.error()
        loss = error + settings.world * self._world(out) if settings.world else error
        if settings.pace:
            loss = loss + settings.pace * self._pace(out)
        self.descend(loss, CLIPPED)
        return (float(error.detach()),)

    def _world(self, out: RollOut) -> torch.Tensor:
        return ((out.joints - out.true_joints) / self.net.offset_std).square().mean()

    def _pace(self, out: RollOut) -> torch.Tensor:
        speeds = (joints.diff(dim=1) / self.net.velocity_std for joints in (out.joints, out.true_joints))
        told, true = speeds
        return (told - true).abs().mean()

    @torch.no_grad()
    def judge(self) -> tuple[float]:
        """Error on gaps of actors held out; the network that has the least is kept."""
        self.net.eval()
        error = float(filled(self.net, self.held.fixed(*VALIDATED)).error())
        if error < self.least:
            self.least = error
            self.best.load_state_dict(self.net.state_dict())
        return (error,)

    def export(self, path: Path) -> Path:
        """Write the best network's weights, half precision, with credits and who was held out."""
        shapes = self.best.config.parameter_shapes()
        arrays = {name: values.detach().numpy() for name, values in self.best.state_dict().items()}
        return save_weights(
            path,
            {name: arrays[name] for name in shapes},
            {name: values for name, values in arrays.items() if name not in shapes},
            config=self.best.config,
            layout=layout_description(),
            credits=[line for line in CREDITS.read_text(encoding="utf-8").splitlines() if line],
            seeds={"init": self.settings.seed},
            settings=asdict(self.settings),
            step=self.step,
            held_out=self.windows.about["held_out"],
            held_out_share=self.windows.about["held_out_share"],
            validation=self.least if math.isfinite(self.least) else None,
        )


__all__ = ["TransitionTrainer"]
