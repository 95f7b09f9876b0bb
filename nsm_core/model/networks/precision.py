"""Which numbers a training multiplies: half precision where the processor has it, single where not."""

from __future__ import annotations

import time
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import torch


@cache
def half_precision_pays(device: torch.device) -> bool:
    """Whether products of bfloat16 are faster than those of float32 on ``device``: measured, since processors
    without such instructions emulate them at a seventh of the speed, and none says so; once, so that all
    trainings of a process are alike.
    """
    import torch

    if device.type != "cpu":
        return True

    def seconds(kind: torch.dtype) -> float:
        a, b = torch.ones(256, 1024, dtype=kind), torch.ones(512, 1024, dtype=kind)
        taken = []
        for _ in range(4):
            begun = time.perf_counter()
            torch.nn.functional.linear(a, b)
            taken.append(time.perf_counter() - begun)
        return min(taken)

    return seconds(torch.bfloat16) < seconds(torch.float32)
