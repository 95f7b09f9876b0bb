"""A take written as BVH reads back as it was."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core import bvh, bvh_write
from nsm_core.errors import OutputError
from nsm_core.rotations import quat_normalize


def test_round_trip(tmp_path):
    rng = np.random.default_rng(0)
    rotations = quat_normalize(rng.normal(size=(40, 23, 4)).astype(np.float32))
    half = np.sqrt(0.5)
    rotations[0], rotations[1], rotations[2] = (1, 0, 0, 0), (half, 0, half, 0), (half, 0, 0, -half)  # rest and two poles
    hips = rng.normal(size=(40, 3)).astype(np.float32)
    bvh_write.write(tmp_path / "take.bvh", hips, rotations)
    clip = bvh.read(tmp_path / "take.bvh")
    np.testing.assert_allclose(clip.hips_position, hips, atol=1e-6)
    np.testing.assert_allclose(np.abs((clip.local_rotations * rotations).sum(-1)), 1, atol=1e-5)


def test_a_folder_that_cannot_be_written_to(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        bvh_write.write(tmp_path / "file" / "take.bvh", np.zeros((1, 3)), np.tile(np.array((1.0, 0, 0, 0)), (1, 23, 1)))
