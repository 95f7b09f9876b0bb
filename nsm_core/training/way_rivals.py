"""Training of what the planner of hands' ways is compared with: networks with two of its three fields, the
whole one for as many steps, and the diffusion policy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from nsm_core.data.reaches.library import WayLibrary
from nsm_core.model.networks.field_config import FieldConfig

from .hand_fields import FieldSettings, FieldTrainer
from .way_diffusion import DiffusionTrainer

_DIFFUSED = 4  # steps of the diffusion policy to one of the fields', which takes longer


def train_rivals(
    library: WayLibrary,
    config: FieldConfig,
    settings: FieldSettings,
    steps: int,
    fields: dict[str, Path],
    diffusion: Path,
    tell: Callable[[str], None],
) -> None:
    """Train those whose file is not there yet, each for so many ``steps``: networks of ``fields`` without the
    one that they are named by (whole: ""), and the ``diffusion`` policy.
    """
    for without, path in fields.items():
        if path.exists():
            continue
        trainer = FieldTrainer(library, config, replace(settings, without=without))
        trainer.minutes, trainer.steps = math.inf, steps
        error = 0.0
        while trainer.done < 1:
            error += (trainer.learn()[0] - error) / min(trainer.step, 100)
        trainer.export(path)
        tell(f"{path.name}: error {error:.4f} after {steps} steps")
    if not diffusion.exists():
        rows = FieldTrainer.learnt_rows(library, settings)
        policy, error = DiffusionTrainer(library, rows, settings.seed), 0.0
        for step in range(_DIFFUSED * steps):
            error += (policy.learn(step, _DIFFUSED * steps) - error) / min(step + 1, 100)
        policy.net.save(diffusion)
        tell(f"{diffusion.name}: error {error:.4f} after {_DIFFUSED * steps} steps")


__all__ = ["train_rivals"]
