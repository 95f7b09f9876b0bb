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

# Files that take longest are begun first, so that no core waits for another one at the end.
LONG = (
    "test_window", "test_demo", "test_interruptions", "test_takes", "test_acting", "test_batch",
    "test_extension", "test_carries", "test_api", "test_reading", "test_odd_doors",
)  # fmt: skip


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items) -> None:
    """On several cores the longest files begin first."""
    if config.pluginmanager.hasplugin("xdist"):
        items.sort(key=lambda item: LONG.index(item.path.stem) if item.path.stem in LONG else len(LONG))


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


@pytest.fixture
def registered(empty_scene):
    """The add-on at work in the empty scene; a take under way is ended with the test."""
    import nsm_blender
    from nsm_blender.ui import running

    nsm_blender.register()
    yield bpy.context.scene
    running.end_take()
    nsm_blender.unregister()


@pytest.fixture
def rigify():
    """Blender's own generator of rigs at work, where this Blender has it."""
    try:
        enabled = bpy.ops.preferences.addon_enable(module="rigify") == {"FINISHED"}
    except RuntimeError:
        enabled = False
    if not enabled:
        pytest.skip("this Blender has no Rigify")
    yield
    bpy.ops.preferences.addon_disable(module="rigify")


@pytest.fixture(autouse=True)
def empty_scene():
    """Start from an empty file with factory settings."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    yield bpy.context.scene
