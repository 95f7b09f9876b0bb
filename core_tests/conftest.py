"""Shared by the tests without Blender: the repository root on the path, and a network of full size."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from random_weights import LAYOUT, random_arrays

from nsm_core.model.inference.weights_file import save_weights
from nsm_core.model.networks.nsm_config import NsmConfig

# Files that take longest are begun first, so that no core waits for another one at the end.
LONG = (
    "test_composer", "test_codec", "test_report", "test_fresh_takes", "test_swap_objects", "test_training",
    "test_single_clips", "test_goldens", "test_dev", "test_take", "test_database", "test_standing",
    "test_far_ways",
)  # fmt: skip


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items) -> None:
    """On several cores the longest files begin first."""
    if config.pluginmanager.hasplugin("xdist"):
        items.sort(key=lambda item: LONG.index(item.path.stem) if item.path.stem in LONG else len(LONG))


@pytest.fixture(scope="session")
def full_weights(tmp_path_factory) -> Path:
    """Weights file of a network of the shipped size, random values."""
    config = NsmConfig()
    path = tmp_path_factory.mktemp("weights") / "full.npz"
    return save_weights(
        path, *random_arrays(config), config=config, layout=LAYOUT, credits=["nobody"], seeds={"init": 0}
    )


@pytest.fixture
def small_config() -> NsmConfig:
    """Sizes that train in no time."""
    return NsmConfig(
        frame=11, goal=7, environment=13, interaction=9, gating=6, outputs=10, encoder_frame=12,
        encoder_goal=5, encoder_environment=8, encoder_interaction=6, gating_hidden=7, hidden=16, experts=3,
    )  # fmt: skip
