"""A short walk, and a capture of it in the names of Mixamo."""

from __future__ import annotations

import pytest
from captures import walk
from foreign_bvh import foreign
from rig_families import MIXAMO

from nsm_core.data.captures import reader


@pytest.fixture(scope="module")
def motion():
    hips, local = walk(1.2, 0.4, 1.2, rest=0.3)
    return hips[::3], local[::3]


@pytest.fixture(scope="module")
def plain(tmp_path_factory, motion) -> tuple[str, reader.Clip]:
    """The text of a capture in Mixamo's names, and its clip."""
    path = foreign(tmp_path_factory.mktemp("plain") / "a.bvh", motion, MIXAMO)
    return path.read_text(), reader.read_clip(path)
