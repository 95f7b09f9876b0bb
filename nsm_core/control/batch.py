"""Takes stepped together, one step of the network for all of them; a take by itself is a batch of one."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from nsm_core.model.features.layout import Inputs
from nsm_core.model.inference.model import Model
from nsm_core.model.networks.config import Memory
from nsm_core.model.networks.protocol import Info
from nsm_core.rotations import Array


class Stepped(Protocol):
    """A take in the halves of its frame, as ``TakeRunner`` has them: what the network is given, and what
    becomes of its outputs.
    """

    model: Model
    memory: Memory  # (1, size) each

    def sense(self) -> Inputs[Array] | None:
        """What the network is given of the next frame (1, ...), None when the take is over."""
        ...

    def follow(self, outputs: Array, memory: Memory, info: Info, network_ms: float) -> None:
        """Make the frame of what a step of the network gave."""
        ...

    def mend(self) -> bool:
        """Go on with what only whole takes show; False when nothing is left of it."""
        ...


def step_together(takes: Sequence[Stepped]) -> list[bool]:
    """Make the next frame of every take, as ``TakeRunner.step`` does of one; for each, False when it is over.

    Takes may begin and end at different calls; each keeps its own rows of the network's memory.  Raises
    ValueError where they do not share one network, and GoalError where one of them cannot go on.
    """
    if any(take.model is not takes[0].model for take in takes):
        raise ValueError("takes that are stepped together need one network")
    sensed = [(take, inputs) for take in takes if (inputs := take.sense()) is not None]
    if sensed:
        start = time.perf_counter()
        moving = [take for take, _ in sensed]
        inputs = Inputs(*(np.concatenate(rows) for rows in zip(*(one for _, one in sensed), strict=True)))
        memory = {name: np.concatenate([take.memory[name] for take in moving]) for name in moving[0].memory}
        outputs, memory, info = moving[0].model.step(inputs, memory)
        each_ms = 1000 * (time.perf_counter() - start) / len(moving)
        for row, take in enumerate(moving):
            own = slice(row, row + 1)
            take.follow(
                outputs[own],
                {k: v[own] for k, v in memory.items()},
                {k: v[own] for k, v in info.items()},
                each_ms,
            )
    went_on = {id(take) for take, _ in sensed}
    return [id(take) in went_on or take.mend() for take in takes]
