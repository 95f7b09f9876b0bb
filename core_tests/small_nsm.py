"""A network of the real kind that a few steps train, for the tests of training."""

from __future__ import annotations

from nsm_core.model.networks.nsm_config import NsmConfig
from nsm_core.training.batches import statistics
from nsm_core.training.trainer import Trainer

CONFIG = NsmConfig(
    encoder_frame=48,
    encoder_goal=16,
    encoder_environment=24,
    encoder_interaction=16,
    gating_hidden=16,
    hidden=48,
    experts=3,
)


def prepared(trainer: Trainer, frames: int = 1000) -> Trainer:
    """The trainer with statistics of fewer frames than a real run takes, its average at its network."""
    trainer.net.set_statistics(floor=1e-4, **statistics(trainer.batches, frames))
    trainer.average.refresh(trainer.net)
    return trainer
