"""The Periodic Autoencoder: it finds the cycle of a motion that has one, without labels."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from captures import walk

from nsm_core.body.clip import Clip
from nsm_core.data.annotation.proposal import arrays_of, propose
from nsm_core.errors import CaptureError
from nsm_core.training import periodic_phase


def waves(period: float, count: int = 240, seed: int = 0) -> np.ndarray:
    """Velocities (T, 69) that all repeat after ``period`` frames, with some noise."""
    rng = np.random.default_rng(seed)
    mix, shift = np.random.default_rng(1).normal(size=69), np.random.default_rng(2).uniform(0, 2 * np.pi, 69)
    t = np.arange(count)[:, None] + rng.uniform(0, 100)
    return (mix * np.sin(2 * np.pi * t / period + shift) + 0.05 * rng.normal(size=(count, 69))).astype(
        np.float32
    )


@pytest.fixture(scope="module")
def model() -> periodic_phase.PeriodicAutoencoder:
    fitted, loss = periodic_phase.train(
        [waves(p, seed=s) for s, p in enumerate((24, 30, 36, 27, 33))], minutes=5, most=100, batch=48
    )
    assert loss < 0.5
    return fitted


@pytest.mark.parametrize("period", [26, 32])
def test_the_phase_runs_once_a_cycle(model, period):
    phase = periodic_phase.unwrapped(*periodic_phase.phases(model, waves(period, seed=9)), floor=1e-3)
    assert phase.shape == (240,) and (np.diff(phase) > 0).all()
    assert abs((phase[-1] - phase[0]) / (239 / period) - 1) < 0.08


def test_where_nothing_moves_it_runs_at_one_hertz(model):
    still = np.zeros((120, 69), np.float32)
    phase, frequency, amplitude = periodic_phase.phases(model, still)
    assert np.isfinite(frequency).all()
    phase = periodic_phase.unwrapped(phase, frequency, np.zeros_like(amplitude), floor=0.1)
    np.testing.assert_allclose(np.diff(phase) * 30, 1, atol=1e-3)


def test_velocities_leave_out_where_the_body_goes():
    straight, turned = (
        Clip("w", *(x.astype(np.float32) for x in walk(3.0, turn, 3.2))) for turn in (0.0, 0.0)
    )
    moved = Clip("w", turned.hips_position + np.array((5, 3, 0), np.float32), turned.local_rotations)
    np.testing.assert_allclose(
        periodic_phase.velocities(straight), periodic_phase.velocities(moved), atol=1e-3
    )
    assert periodic_phase.velocities(straight).shape == (len(straight), 69)


def test_measured_phases_are_compared_with_the_rule():
    clips = [
        Clip(f"w{n}", *(x.astype(np.float32) for x in walk(d, 0.1, 5.3, rest=0.3)))
        for n, d in enumerate((4.0, 5.0))
    ]
    sheets = [arrays_of(propose(c)[0]) for c in clips]
    measured = periodic_phase.measure(clips, sheets, minutes=5, most=20)
    assert [len(m["phase"]) for m in measured] == [len(c) for c in clips] and set(measured[0]) == {
        "phase",
        "phase_mirrored",
    }
    assert all((np.diff(m[name]) > 0).all() for m in measured for name in m)
    line = periodic_phase.compare(sheets, [m["phase"] for m in measured])
    assert "cycles a minute" in line and "cycles apart" in line


def test_clips_that_are_too_short():
    with pytest.raises(CaptureError, match="at least 2 seconds"):
        periodic_phase.train([np.zeros((30, 69), np.float32)], 1)
