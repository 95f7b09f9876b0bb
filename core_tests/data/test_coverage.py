"""What is told of motion where captured pieces meet."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.conventions import FPS
from nsm_core.data.coverage import ABOUT, at_seams
from nsm_core.data.storage import Dataset


def hopped(jump: float) -> tuple[Dataset, list]:
    """Two takes of joints that go 1 m/s, all but one foot high over the floor; in the first the pieces meet
    at frame 30, from which one joint is ``jump`` metres on.
    """
    joints = np.zeros((120, 23, 3))
    joints[..., 2] = 1.0
    joints[:, :, 1] = np.arange(120)[:, None] / FPS
    joints[30:60, 4, 0] += jump
    contact = np.zeros((120, 5))
    start = np.repeat([0, 60], 60)
    takes = [
        {"start": 0, "pieces": [("a", 0, 30, 30), ("b", 9, 39, 30)]},
        {"start": 60, "pieces": [("a", 0, 60, 60)]},
    ]
    return Dataset({"joint_position": joints, "contact": contact, "start": start}, np.arange(0)), takes


def test_the_report_finds_what_jumps_where_pieces_meet():
    data, takes = hopped(0.01)
    found = at_seams(data, takes)
    assert found is not None and found.count == 1
    assert found.acceleration == pytest.approx(0.01 * FPS**2)  # there, and back again
    assert found.jerk == pytest.approx(2 * 0.01 * FPS**3)
    assert found.glides == found.stand == 0
    smooth = at_seams(*hopped(0.0))
    assert smooth is not None and smooth.acceleration == pytest.approx(0, abs=1e-6)
    takes[0]["pieces"] = [("a", 0, ABOUT - 1, ABOUT - 1), ("b", 0, 40, 61 - ABOUT)]
    assert at_seams(data, takes) is None


def test_the_report_tells_feet_that_glide_from_those_that_stand():
    data, takes = hopped(0.0)
    data.arrays["joint_position"][:, :, 2] = 0.02  # all feet, at 1 m/s
    data.arrays["contact"][:, 4] = 1  # one of them is told to stand
    found = at_seams(data, takes)
    assert found is not None and found.glides == 1 and found.stand == pytest.approx(100)
