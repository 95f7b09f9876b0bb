"""Slopes of costs."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.evaluation.speed.growth import draw, slope


@pytest.mark.parametrize("power", (0.0, 1.0, 2.0))
def test_a_slope_is_the_power_of_the_size_once_work_that_is_done_once_no_longer_counts(power):
    sizes = (1, 10, 1_000, 10_000, 100_000)
    assert slope(sizes, [5.0 + 2.0 * size**power for size in sizes]) == pytest.approx(power, abs=0.02)


def test_every_series_is_plotted(tmp_path):
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    series = [(f"work {n}", "things", (1, 10, 100), [1.0, 2.0, 15.0 * n]) for n in range(1, 7)]
    picture = draw(series, tmp_path / "growth.png").read_bytes()
    assert picture.startswith(b"\x89PNG") and len(picture) > 10_000
    steeper = [(*each[:3], [1.0, 2.0, 900.0]) for each in series]
    assert draw(steeper, tmp_path / "other.png").read_bytes() != picture
    assert np.isfinite(slope((1, 10, 100), series[0][3]))
