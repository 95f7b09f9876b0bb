"""Several processes of one training (``torchrun``): each learns from its share of every batch, and all take
the same step.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import timedelta

import numpy as np
import torch
import torch.distributed as distributed

from nsm_core.errors import WeightsError

# What the others wait for the first one at most, which composes the data.
_PATIENCE = timedelta(days=2)


@dataclass(frozen=True)
class Ranks:
    """Which of the processes of a training this one is; alone where nobody has started several."""

    rank: int = 0
    count: int = 1
    local: int = 0  # among those of the same machine

    @classmethod
    def joined(cls, device: str) -> Ranks:
        """Join the processes that ``torchrun`` has started, to train on ``device``; WeightsError where they
        cannot meet.
        """
        count = int(os.environ.get("WORLD_SIZE", 1))
        if count == 1:
            return cls()
        try:
            backend = "nccl" if device.startswith("cuda") else "gloo"
            distributed.init_process_group(backend, timeout=_PATIENCE)
        except (RuntimeError, ValueError, AttributeError) as error:  # AttributeError: torch was built without
            raise WeightsError(
                f"The {count} processes of this training cannot meet ({error}); start them with torchrun, or "
                "train with one."
            ) from error
        return cls(distributed.get_rank(), count, int(os.environ.get("LOCAL_RANK", 0)))

    @property
    def first(self) -> bool:
        """Whether this process writes the files and tells of the training."""
        return self.rank == 0

    def device(self, name: str) -> str:
        """The device of this process: where several train on graphics cards, one card each."""
        return f"cuda:{self.local}" if self.count > 1 and name == "cuda" else name

    @property
    def share(self) -> slice:
        """Which rows of a batch are this process's: every so many-th."""
        return slice(self.rank, None, self.count)

    def alike(self, *networks: torch.nn.Module) -> None:
        """Give all processes the first one's numbers."""
        if self.count > 1:
            for network in networks:
                for values in network.state_dict().values():
                    distributed.broadcast(values, 0)

    def added(self, values: torch.Tensor) -> torch.Tensor:
        """The sum of ``values`` over all processes."""
        if self.count > 1:
            distributed.all_reduce(values)
        return values

    def add_gradients(self, parameters: Iterable[torch.nn.Parameter]) -> None:
        """Replace every gradient by its sum over all processes, sent as one piece."""
        gradients = [p.grad for p in parameters if p.grad is not None]
        if self.count > 1 and gradients:
            whole = self.added(torch.cat([g.reshape(-1) for g in gradients]))
            for gradient, part in zip(gradients, whole.split([g.numel() for g in gradients]), strict=True):
                gradient.copy_(part.view_as(gradient))

    def wait(self) -> None:
        """Go on when all processes have come here."""
        if self.count > 1:
            distributed.barrier()

    def leave(self) -> None:
        """Part from the others; a second call changes nothing."""
        if self.count > 1 and distributed.is_initialized():
            distributed.destroy_process_group()

    def draws(self, rng: np.random.Generator, *seed: int) -> np.random.Generator:
        """The generator of what each process draws for itself: ``rng`` where there is only one, so that it
        draws as ever.
        """
        return rng if self.count == 1 else np.random.default_rng((*seed, 1 + self.rank))


ALONE = Ranks()
