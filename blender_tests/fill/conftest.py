"""The comparison of whole files, which stands with the faults; and the add-on, registered once a file."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "faults"))


@pytest.fixture(scope="module")
def addon():
    """The add-on at work, and the walk that gaps are cut from made before any scene is opened."""
    from gaps import walk

    import nsm_blender

    walk()
    nsm_blender.register()
    yield
    nsm_blender.unregister()
