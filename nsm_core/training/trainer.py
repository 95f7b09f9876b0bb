"""One run of training: the network, its average, the optimiser and what each step is drawn from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch

from nsm_core.conventions import STYLES
from nsm_core.data.storage import Dataset
from nsm_core.errors import WeightsError
from nsm_core.model.features.layout import Inputs, layout_description
from nsm_core.model.features.meaning import Meaning
from nsm_core.model.inference.weights_file import save_weights
from nsm_core.model.networks.config import STATISTICS, NetworkConfig
from nsm_core.model.networks.precision import half_precision_pays
from nsm_core.model.networks.registry import kind_of
from nsm_core.model.networks.trainable import Tensors
from nsm_core.rotations import Array

from .batches import Batches, RolloutSettings, loss_weights, statistics
from .checkpoint import Part, restore, write_checkpoint
from .fresh_takes import FreshSettings, FreshTakes
from .planted import planted_loss
from .ranks import ALONE, Ranks
from .schedule import cosine_restarts

CREDITS = Path(__file__).parent.parent / "weights" / "CREDITS.md"


@dataclass(frozen=True)
class TrainingSettings:
    """Everything a run depends on; stored in the weights.

    ``data_batch`` and ``pool`` are the frames of the data and of roll-outs that a step learns from.  A
    network with memory sees them as sequences of ``window`` frames, through which gradients go back: without
    them it would never learn what to remember.  ``device`` is where the network is trained, as torch names
    it.
    """

    steps: int = 40000
    minutes: float = 0.0  # of training after which it ends instead, whatever its steps; 0 for none
    data_batch: int = 192
    pool: int = 320
    window: int = 8
    learning_rate: float = 5e-4
    weight_decay: float = 2.5e-3
    noise: float = 0.05
    averaging: float = 0.999
    planted: float = 0.0
    seed: int = 0
    data_minutes: float = 260.0
    rollout: RolloutSettings = RolloutSettings()
    fresh: FreshSettings = FreshSettings()
    stitched: bool = True
    device: str = "cpu"
    without: tuple[str, ...] = ()  # parts of its input that the network never reads
    phase: str = "labels"  # where the data's phase is from: "labels", or "pae" for what was measured of it


def device_of(name: str) -> torch.device:
    """The device that a setting names; WeightsError where torch does not know it or cannot use it here."""
    try:
        device = torch.device(name)
        torch.zeros(1, device=device).cpu()
    except (
        RuntimeError,
        AssertionError,
        NotImplementedError,
    ) as error:  # how torch says that it was built without, or finds none
        raise WeightsError(
            f"PyTorch cannot train on {name!r} here; choose cpu, or cuda where there is such a device."
        ) from error
    return device


def divide(data: Dataset) -> tuple[Array, Array]:
    """Frames to train on and frames to validate with: of captured clips that are kept for that, none of which
    is trained on.
    """
    kept = data.arrays["validates"]
    here, following = kept[data.frames], kept[data.frames + 1]
    return data.frames[~(here | following)], data.frames[here & following]


def sequences(sources: list[tuple[Batches, int]], window: int) -> Iterator[tuple[list[Array], Array]]:
    """Draw rows of true frames and follow them for ``window`` frames: at each the frames by source, and which
    of all rows (B,) begin there.
    """
    frames, begins = (
        [b.draw(count) for b, count in sources],
        np.ones(sum(count for _, count in sources), bool),
    )
    for left in reversed(range(window)):
        yield frames, begins
        if left:
            following = [b.after(f) for (b, _), f in zip(sources, frames, strict=True)]
            frames, begins = [f for f, _ in following], np.concatenate([anew for _, anew in following])


class Trainer:
    """State of one run: network, average, optimiser, batches."""

    def __init__(
        self,
        data: Dataset,
        settings: TrainingSettings,
        config: NetworkConfig,
        seed_offset: int = 0,
        fresh: FreshTakes | None = None,
        ranks: Ranks = ALONE,
    ) -> None:
        """``fresh`` takes fill their share of every batch, if there are any; ``ranks`` share the rows of a
        batch among them.
        """
        self.settings, self.config, self.ranks = settings, config, ranks
        torch.manual_seed(settings.seed)
        self.rng = np.random.default_rng((settings.seed, seed_offset))
        rollout = replace(settings.rollout, teacher=max(settings.rollout.teacher, config.teacher))
        drawing = (rollout, ranks.share, ranks.draws(self.rng, settings.seed, seed_offset))
        mine, kept = divide(data)
        if not len(kept):  # few clips, none of them kept by its name: whole takes are
            takes = data.arrays["start"][mine]
            last = takes >= np.unique(takes)[-1]
            mine, kept = mine[~last], mine[last]
        # As many frames a step for every network: rows times the frames of a sequence.
        self.window = settings.window if config.memory_sizes else 1
        self.rows, pool = (max(1, round(n / self.window)) for n in (settings.data_batch, settings.pool))
        share = settings.fresh.share if fresh else 0.0
        second = (round(share * self.rows), round(share * pool))
        self.batches = Batches(data, mine, self.rng, pool - second[1], *drawing)
        self.validation = Batches(data, kept, np.random.default_rng(1), 8, settings.rollout)
        # What each batch is drawn from, and how many rows of it.
        self.sources, self.fresh = [(self.batches, self.rows - second[0])], fresh
        if fresh is not None and min(second) > 0:
            ring = fresh.ring.data
            self.sources.append((Batches(ring, divide(ring)[0], self.rng, second[1], *drawing), second[0]))
        self.device, module = device_of(settings.device), kind_of(config.network).module
        self._half = half_precision_pays(self.device)
        self.net, self.average = module(config).to(self.device), module(config).to(self.device)
        self.blind()
        self.optimiser = torch.optim.AdamW(
            self.net.parameters(), lr=settings.learning_rate, weight_decay=settings.weight_decay, fused=True
        )
        self.weights = self._tensor(loss_weights())
        # Which of all rows are this process's, of each source as of the pool.
        ends = np.cumsum([count for _, count in self.sources])
        self._share = np.concatenate([part[ranks.share] for part in np.split(np.arange(ends[-1]), ends[:-1])])
        self._all = self.window * (self.rows + pool)  # rows of a step, of all processes
        held = len(self._share) + sum(len(b.pool_frames) for b, _ in self.sources)
        self._memory = self.net.start(held)  # of the last frame's rows, the data's first
        self.step, self.total = 0, settings.steps
        self.spent = 0.0  # seconds of training, those before it was resumed too
        self.stance: dict[str, object] | None = None
        self.meaning: Meaning | None = None  # of the data, if they tell it
        self.origin: dict[str, str] = {}  # what the data and the first weights were, for the metadata
        # What the data shows in more than a thousandth of its frames is offered.
        shown = data.arrays["style"].mean(axis=0) > 1e-3
        self.actions = [name for name, there in zip(STYLES, shown, strict=True) if there]

    def set_statistics(self) -> None:
        """Measure normalisation on the data and start the average at the network."""
        stats = statistics(self.batches)
        self.net.set_statistics(floor=1e-4, **stats)
        self.average.refresh(self.net)

    def blind(self) -> None:
        """Take what the settings say from the network's sight."""
        for part in self.settings.without:
            self.net.blind(part)

    def _tensor(self, values: Array) -> torch.Tensor:
        return torch.from_numpy(values).to(self.device)

    def _normalised(self, x: Array, g: Array, y: Array) -> tuple[Inputs[torch.Tensor], torch.Tensor]:
        """Inputs and targets of a batch in the network's units, where the network is."""
        n = self.net
        return n.normalised(Inputs(self._tensor(x), self._tensor(g))), (
            self._tensor(y) - n.output_mean
        ) / n.output_std

    def _recalled(self, memory: Tensors, begins: Array) -> Tensors:
        """What the rows of a frame remember: ``memory`` that their last frame left, none where one ``begins``
        (B,).
        """
        anew, start = self._tensor(begins)[:, None], self.net.start(len(begins))
        return {k: torch.where(anew, v, memory[k].float()) for k, v in start.items()}

    def train_step(self) -> tuple[float, float]:
        """One optimiser step on data and roll-outs, through ``window`` frames; returns the two losses, of all
        processes.
        """
        s, n = self.settings, len(self._share)
        for group in self.optimiser.param_groups:
            factor = cosine_restarts(self.step, self.total)
            group["lr"], group["weight_decay"] = s.learning_rate * factor, s.weight_decay * factor
        self._take_in()
        # Roll-outs go on with what they remember, but gradients end where the step begins.
        self._memory = {k: v.detach() for k, v in self._memory.items()}
        error = torch.stack([self._errors(*drawn) for drawn in sequences(self.sources, self.window)])
        self.optimiser.zero_grad(set_to_none=True)
        (error.sum() / self._all).backward()
        self.ranks.add_gradients(self.net.parameters())
        torch.nn.utils.clip_grad_norm_(self.net.parameters(), 1.0)
        self.optimiser.step()
        with torch.no_grad():
            rate = min(s.averaging, (self.step + 1) / (self.step + 10))
            torch._foreach_lerp_(list(self.average.parameters()), list(self.net.parameters()), 1 - rate)
        self.step += 1
        found = error.detach()
        sums = self.ranks.added(torch.stack((found[:, :n].sum(), found[:, n:].sum()))).cpu()
        of_data = self.window * self.rows
        return float(sums[0] / of_data), float(sums[1] / (self._all - of_data))

    def _errors(self, frames: list[Array], begins: Array) -> torch.Tensor:
        """Errors (B,) of one frame: of the data's, as of ``sequences``, then of roll-outs, taken on by it."""
        net, n = self.net, len(self._share)
        frames, begins = [f[self.ranks.share] for f in frames], begins[self._share]
        parts = [b.from_data(f) for (b, _), f in zip(self.sources, frames, strict=True)]
        parts += [b.from_pool() for b, _ in self.sources]
        x, g, y = (np.concatenate([part[k] for part in parts]) for k in range(3))
        inputs, y = self._normalised(x, g, y)
        width = self.config.frame + self.config.goal
        # Noise is drawn on the processor, and of all rows: alike on every device and in every process.
        noise = torch.randn(self.rows, width)[self._share].to(self.device)
        inputs.features[:n, :width] += self.settings.noise * noise
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self._half):
            begins = np.concatenate((begins, *(b.pool_age == 0 for b, _ in self.sources)))
            out, self._memory, _ = net(inputs, self._recalled(self._memory, begins))
        stepped, at = (out.detach()[n:] * net.output_std + net.output_mean).cpu().numpy(), 0
        for batches, _ in self.sources:
            batches.step_pool(stepped[at : at + len(batches.pool_frames)])
            at += len(batches.pool_frames)
        error = (((out - y) ** 2).clamp_max(100.0) * self.weights).mean(dim=1)
        if self.settings.planted:
            # Of roll-outs only: rows of the data show the network noise that its feet do not stand in.
            placed, wanted = (v[n:].float() * net.output_std + net.output_mean for v in (out, y))
            slip = planted_loss(self._tensor(x)[n:], placed, wanted)
            error = torch.cat((error[:n], error[n:] + self.settings.planted * slip))
        return error

    def _take_in(self) -> None:
        """Let a fresh take that has come in be drawn from."""
        if len(self.sources) > 1 and self.fresh is not None and (gone := self.fresh.poll()) is not None:
            ring = self.fresh.ring.data
            self.sources[1][0].replace(ring, divide(ring)[0], slice(*gone))

    @torch.no_grad()
    def validate(self, count: int = 1024) -> float:
        """One-step loss of the averaged network on held-back clips, in sequences of ``window`` frames."""
        net, sources = self.average, [(self.validation, max(1, round(count / self.window)))]
        memory, errors = net.start(sources[0][1]), []
        for (frames,), begins in sequences(sources, self.window):
            inputs, y = self._normalised(*self.validation.from_data(frames))
            with torch.autocast(self.device.type, torch.bfloat16, enabled=self._half):
                out, memory, _ = net(inputs, self._recalled(memory, begins))
            errors.append(((out - y) ** 2).mean())
        return float(torch.stack(errors).mean())

    def _parts(self) -> dict[str, Part]:
        return {"net": self.net, "average": self.average, "optimiser": self.optimiser}

    def save(self, path: Path) -> None:
        """Write everything needed to go on, whole or not at all."""
        write_checkpoint(path, self._parts(), {"step": self.step, "spent": self.spent})

    def load(self, path: Path) -> None:
        """Go on from what ``save`` wrote; WeightsError where that is damaged or of another network."""
        state = restore(path, self._parts(), ("step",))
        for group in self.optimiser.param_groups:
            group["fused"] = True
        self.step = state["step"]
        self.spend(float(state.get("spent", 0.0)))

    def spend(self, seconds: float) -> None:
        """Tell that training took ``seconds`` more; where minutes end it, they say how many steps there will
        be.
        """
        self.spent += seconds
        if (limit := 60 * self.settings.minutes) > 0:
            used = self.spent / limit
            self.total = self.step if used >= 1 else max(self.step + 1, round(self.step / max(used, 1e-3)))

    def export(self, path: Path) -> Path:
        """Write the averaged network as a weights file with its settings and the credits of its data."""
        stats = {k: getattr(self.average, k).cpu().numpy() for k in STATISTICS}
        parameters = {k: v.detach().cpu().numpy() for k, v in self.average.named_parameters()}
        return save_weights(
            path,
            parameters,
            stats,
            config=self.config,
            layout=layout_description(),
            credits=[line for line in CREDITS.read_text().splitlines() if line.strip()]
            if CREDITS.exists()
            else [],
            data=f"{'stitched' if self.settings.stitched else 'unstitched'} performances, "
            f"{self.settings.data_minutes:g} minutes, "
            f"seed {self.settings.seed}; {self.fresh.ring.written if self.fresh else 0} fresh takes in the "
            "last run",
            seeds={"data": self.settings.seed, "training": self.settings.seed},
            training={**asdict(self.settings), "steps_done": self.step},
            actions=self.actions,
            stance=self.stance,
            meaning=self.meaning,
            **self.origin,
        )
