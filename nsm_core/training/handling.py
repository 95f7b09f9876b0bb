"""Training of the controller of picking and placing (papers/002 sections 5.1 and 8.1).

It learns in roll-outs: every step is one frame of a batch of characters, each of which is put back onto its
performance now and then, the more rarely the longer the training goes.  So it learns from where its own
frames lead to come back to the data.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch

from nsm_core import npz
from nsm_core.body.clip import Clip
from nsm_core.data.handling.library import HandlingLibrary
from nsm_core.data.handling.tracks import HandlingTracks, phase_states, tracks_of
from nsm_core.errors import WeightsError
from nsm_core.files import output
from nsm_core.model.handling.codec import advance, build_inputs, build_targets
from nsm_core.model.handling.layout import CHANNELS, OUTPUT, layout_description
from nsm_core.model.handling.phase import bounded, phase_of, wave_of
from nsm_core.model.handling.state import Goals, HandlingState
from nsm_core.model.inference.handling_model import key_features
from nsm_core.model.inference.weights_file import save_weights
from nsm_core.model.networks.handling import HandlingNet
from nsm_core.model.networks.handling_config import HandlingConfig
from nsm_core.model.networks.precision import half_precision_pays
from nsm_core.rotations import Array

from . import periodic_phase
from .timed_run import TimedTrainer

_SMALLEST = {"goal_root": 0.1, "goal_joints": 0.1}  # deviations of outputs that hardly change, at least
_LEAST = 2e-3
_WEIGHTS = {
    "goal_root": 0.1,
    "goal_joints": 0.1,
    "joint_position": 2.0,
    "joint_forward": 2.0,
    "joint_up": 2.0,
}
_LOST = 0.6  # metres of the root off the data at which a character is put back
# Shares of a run to which frames are learnt one by one, and from which on roll-outs are at their longest.
_ALONE, _FULL = 0.3, 0.7
_WARM_UP = 100  # steps
_MANY = 4000  # frames that statistics are taken of


@dataclass(frozen=True)
class HandlingSettings:
    """What a run depends on; stored in the weights.  ``noise`` is that of the goal's phase (equation 13),
    ``longest`` the frames of a roll-out at the end; ``phase_minutes`` of training the Periodic Autoencoder.
    """

    minutes: float = 12.0
    steps: int = 0  # after which it ends whatever the minutes, 0 for none
    batch: int = 64
    learning_rate: float = 1e-3
    noise: float = 0.1
    longest: int = 12
    held_out: float = 0.1
    phase_minutes: float = 4.0
    seed: int = 0


def learnt_phases(
    library: HandlingLibrary, path: Path, settings: HandlingSettings, tell: Callable[[str], None]
) -> list[Array]:
    """Phase states (T, 3, CHANNELS) of every performance: read from ``path``, or of an autoencoder that is
    trained now on those that are learnt from, and kept there.
    """
    lengths = [len(p.hips) for p in library.performances]
    if not path.exists():
        tell("Learning phases ...")
        motions = [periodic_phase.velocities(Clip("", p.hips, p.rotations)) for p in library.performances]
        learnt = motions[: split(library, settings)]
        model, error = periodic_phase.train(learnt, settings.phase_minutes, settings.seed, CHANNELS)
        tell(f"Periodic Autoencoder of {CHANNELS} channels: error {error:.2f} of the velocities' variance.")
        found = phase_states([periodic_phase.phases(model, m) for m in motions])
        with output(path, "The phases") as temporary, open(temporary, "wb") as file:
            np.savez(file, phase=np.concatenate(found), error=np.float32(error))
    phase = npz.read_arrays(path, {"phase": "f", "error": "f"}, 1 << 30)["phase"]
    if len(phase) != sum(lengths):
        raise WeightsError(f"{path} is of other performances; delete it, and phases are learnt anew.")
    return np.split(phase, np.cumsum(lengths)[:-1])


def split(library: HandlingLibrary, settings: HandlingSettings) -> int:
    """How many performances are learnt from: the last ones are held out."""
    return math.floor((1 - settings.held_out) * len(library.performances))


class HandlingTrainer(TimedTrainer):
    """State of one run: the network, and a batch of characters that it leads from frame to frame.

    Where it goes on from a checkpoint, characters begin on the data again.
    """

    def __init__(
        self,
        library: HandlingLibrary,
        phases: Sequence[Array],
        config: HandlingConfig,
        settings: HandlingSettings,
    ) -> None:
        super().__init__(settings.minutes, settings.steps, settings.seed)
        self.settings = settings
        learnt = split(library, settings)
        self.tracks = tracks_of(library.performances[:learnt], phases[:learnt])
        self.others = tracks_of(library.performances[learnt:], phases[learnt:])
        self.net = HandlingNet(config)
        self.half = half_precision_pays(torch.device("cpu"))
        self.optimise_by(
            torch.optim.AdamW(self.net.parameters(), lr=settings.learning_rate, weight_decay=1e-4, fused=True)
        )
        self._weight = np.ones(OUTPUT.size, np.float32)
        for name, weight in _WEIGHTS.items():
            self._weight[OUTPUT.slices[name]] = weight
        self._statistics()
        rng = np.random.default_rng(settings.seed)
        self._frames = self._drawn(rng, settings.batch)
        self._state = self.tracks.state(self._frames)

    def rate(self) -> float:
        """That of every run, after a short warm-up."""
        return super().rate() * min(1.0, (self.step + 1) / _WARM_UP)

    def step_on(self, rng: np.random.Generator) -> tuple[float, float]:
        """One step, a frame of every character; returns its error and how far roots are off the data,
        metres.
        """
        self.net.train()
        inputs, targets, goals = self._pairs(self.tracks, self._state, self._frames, rng)
        told, error = self._error(inputs, targets)
        self.descend(error, clipped=1.0)
        off = self._go_on(told.detach().numpy(), goals, rng)
        return float(error.detach()), off

    def _pairs(
        self, tracks: HandlingTracks, state: HandlingState, frames: Array, rng: np.random.Generator
    ) -> tuple[Array, Array, Goals]:
        goals = tracks.goals(frames)
        goals.phase = noised(goals.phase, self.settings.noise, rng)
        following = frames + 1
        targets = build_targets(
            state, goals, tracks.state(following), tracks.goals(following), tracks.feet[following]
        )
        return build_inputs(state, goals), targets, goals

    def _error(self, inputs: Array, targets: Array) -> tuple[torch.Tensor, torch.Tensor]:
        """Outputs (B, OUTPUT.size) and their mean error: squared in units of the data's deviation, beyond
        three of them linear.
        """
        with torch.autocast("cpu", torch.bfloat16, enabled=self.half):
            told = self.net(torch.from_numpy(inputs))
        wanted = (torch.from_numpy(targets) - self.net.output_mean) / self.net.output_std
        off = torch.nn.functional.smooth_l1_loss(told, wanted, beta=3.0, reduction="none")
        error = 6 * (off * torch.from_numpy(self._weight)).mean()
        return told * self.net.output_std + self.net.output_mean, error

    def _go_on(self, told: Array, goals: Goals, rng: np.random.Generator) -> float:
        self._state = advance(told, self._state, goals).state
        self._frames = self._frames + 1
        off = np.linalg.norm(self._state.root[:, :2] - self.tracks.root[self._frames, :2], axis=1)
        longer = np.clip((self.done - _ALONE) / (_FULL - _ALONE), 0, 1)
        longest = 1 + (self.settings.longest - 1) * longer
        back = (rng.random(len(off)) < 1 / longest) | (off > _LOST)
        back |= self._frames >= self.tracks.last[self._frames]
        rows = np.flatnonzero(back)
        if len(rows):
            self._frames[rows] = self._drawn(rng, len(rows))
            self._state.assign(rows, self.tracks.state(self._frames[rows]))
        return float(off.mean())

    def _drawn(self, rng: np.random.Generator, count: int) -> Array:
        """Frames (count,) by chance, none the last of its performance."""
        frames = rng.integers(len(self.tracks.position), size=count)
        return np.minimum(frames, self.tracks.last[frames] - 1)

    def _statistics(self) -> None:
        rng = np.random.default_rng(self.settings.seed)
        frames = self._drawn(rng, min(_MANY, len(self.tracks.position)))
        inputs, targets, _ = self._pairs(self.tracks, self.tracks.state(frames), frames, rng)
        least = np.full(OUTPUT.size, _LEAST, np.float32)
        for name, value in _SMALLEST.items():
            least[OUTPUT.slices[name]] = value
        for name, values, floor in (("input", inputs, np.float32(0.02)), ("output", targets, least)):
            getattr(self.net, f"{name}_mean").copy_(torch.from_numpy(values.mean(0)))
            getattr(self.net, f"{name}_std").copy_(torch.from_numpy(np.maximum(values.std(0), floor)))

    @torch.no_grad()
    def judge(self) -> tuple[float, ...]:
        """Error of one frame of performances that are not learnt from."""
        rng = np.random.default_rng(0)
        self.net.eval()
        frames = rng.integers(len(self.others.position), size=256)
        frames = np.minimum(frames, self.others.last[frames] - 1)
        inputs, targets, _ = self._pairs(self.others, self.others.state(frames), frames, rng)
        return (float(self._error(inputs, targets)[1]),)

    def export(self, path: Path, credits: Sequence[str]) -> Path:
        """Write the network's weights, half precision, and the key frames that goals are matched to."""
        keys = np.unique(self.tracks.key)
        firsts = np.unique(self.tracks.first)
        features = np.concatenate([key_features(self.tracks.schedule(int(f))) for f in firsts])
        config = HandlingConfig(**{**self.net.config.to_dict(), "keyframes": len(keys)})
        statistics = {
            f"{name}_{kind}": getattr(self.net, f"{name}_{kind}").numpy()
            for name in ("input", "output")
            for kind in ("mean", "std")
        }
        statistics["phase_variance"] = self.tracks.phase.var(0)
        statistics |= {"key_features": features, "key_phases": self.tracks.phase[keys]}
        return save_weights(
            path,
            self.net.named(),
            statistics,
            config=config,
            layout=layout_description(),
            credits=credits,
            seeds={"init": self.settings.seed},
            settings=asdict(self.settings),
            step=self.step,
        )


def noised(phase: Array, noise: float, rng: np.random.Generator) -> Array:
    """Goal phases (B, 3, C) with Gaussian noise on both parts of their waves and on frequencies: equation
    13.
    """
    wave, frequency = wave_of(phase), phase[:, 2]
    wave = wave + rng.normal(0, noise, wave.shape)
    return bounded(phase_of(wave, frequency + rng.normal(0, noise, frequency.shape)))


__all__ = ["HandlingSettings", "HandlingTrainer", "learnt_phases", "noised", "split"]
