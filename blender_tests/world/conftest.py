"""Nothing is known of a scene before a test that asks for it."""

from __future__ import annotations

import pytest

from nsm_blender.world import colliders
from nsm_blender.world.solids import READINGS


@pytest.fixture
def nothing_read_before():
    READINGS.clear()
    colliders.forget()
