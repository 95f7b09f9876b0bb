"""Masks grow over all cells that are near enough along every axis, and never past the edge."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.world.geometry.dilation import grown


@pytest.mark.parametrize("shape", [(9,), (7, 11), (6, 5, 8)])
@pytest.mark.parametrize("n", [0, 1, 3])
def test_cells_near_a_set_one_are_set(shape, n):
    mask = np.random.default_rng(len(shape) + n).random(shape) < 0.04
    mask.flat[-1] = True
    before, found = mask.copy(), grown(mask, n)
    apart = np.abs(np.argwhere(np.ones(shape))[:, None] - np.argwhere(mask)).max(-1).min(-1)
    assert np.array_equal(found, (apart <= n).reshape(shape)) and np.array_equal(mask, before)
