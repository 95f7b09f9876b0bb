"""A clean scene for every test, and the repository root on the path."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

import bpy

from nsm_blender.leaving import leave


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items) -> None:
    """On several cores a file's tests stay together: they share what was made once."""
    if config.pluginmanager.hasplugin("xdist"):
        for item in items:
            item.add_marker(pytest.mark.xdist_group(item.path.stem))


def pytest_sessionfinish(session, exitstatus) -> None:
    session.config.nsm_exit_status = exitstatus


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config) -> None:
    """Everything is printed: end here, since Blender's own end as a package may never come (see
    ``leaving``).
    """
    status = getattr(config, "nsm_exit_status", None)
    if status is not None and not hasattr(config, "workerinput"):
        leave(int(status))


@pytest.fixture(autouse=True)
def empty_scene():
    """Start from an empty file with factory settings."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    yield bpy.context.scene
