"""The sidebar's settings, with the add-on at work."""

from __future__ import annotations

import pytest


@pytest.fixture
def settings(registered):
    return registered.nsm
