"""Times of arrival: against distances known exactly, around walls, and against fast marching itself."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.errors import GeometryError
from nsm_core.world.geometry.eikonal import NEVER, arrival_times

CELL = 0.025


def grid(n: int, cell: float) -> np.ndarray:
    axis = (np.arange(n) + 0.5) * cell
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1)


def sphere(points: np.ndarray, radius: float) -> np.ndarray:
    centre = points.reshape(-1, 3).mean(0)
    return np.linalg.norm(points - centre, axis=-1) - radius


@pytest.mark.parametrize("speed", [1.0, 0.4])
def test_a_front_from_a_sphere_is_its_distance(speed):
    errors = []
    for n, cell in ((16, 2 * CELL), (32, CELL)):
        far = sphere(grid(n, cell), 0.1)
        times = arrival_times(
            np.full(far.shape, 1 / speed), np.where(far < 2 * cell, far / speed, np.inf), cell
        )
        errors.append(np.abs(times * speed - far).max())
    assert errors[1] < CELL and errors[1] < 0.75 * errors[0]  # first order


def test_a_plane_front_is_exact_through_layers_of_any_speed():
    slowness = np.ones((4, 5, 40))
    slowness[:, :, 20:] = 7.0
    start = np.full(slowness.shape, np.inf)
    start[:, :, 0] = 0.0
    times = arrival_times(slowness, start, 0.1)
    np.testing.assert_allclose(
        times, np.broadcast_to(np.cumsum(slowness, 2) * 0.1 - 0.1, times.shape), rtol=1e-6
    )


def test_a_front_goes_around_a_wall_and_never_into_a_closed_room():
    n = 32
    slowness = np.ones((n, n, 3))
    slowness[16, : n - 4] = np.inf
    start = np.full(slowness.shape, np.inf)
    start[4, 4] = 0.0
    times = arrival_times(slowness, start, CELL)
    straight = 24 * CELL
    corner = (np.hypot(12, 24) + np.hypot(12, 24)) * CELL
    assert times[28, 4, 1] == pytest.approx(corner, rel=0.06) and times[28, 4, 1] > 2 * straight
    assert (times[16, : n - 4] == NEVER).all()
    slowness[16] = np.inf
    assert (arrival_times(slowness, start, CELL)[17:] == NEVER).all()


def test_every_time_solves_its_own_equation():
    rng = np.random.default_rng(0)
    slowness = np.exp(rng.normal(0, 1.5, (12, 13, 14)))
    slowness[rng.random(slowness.shape) < 0.15] = np.inf
    start = np.full(slowness.shape, np.inf)
    start[5, 5, 5] = 0.3
    slowness[5, 5, 5] = 1.0
    times = arrival_times(slowness, start, CELL)
    assert times[5, 5, 5] == 0.3
    t = np.pad(times, 1, constant_values=NEVER)
    inner = (slice(1, -1),) * 3
    square = np.zeros(times.shape)
    for axis in range(3):
        least = np.minimum(np.roll(t, 1, axis), np.roll(t, -1, axis))[inner]
        square += np.maximum(times - least, 0) ** 2
    solved = np.isfinite(slowness) & (times < NEVER)
    solved[5, 5, 5] = False
    assert solved.mean() > 0.7
    np.testing.assert_allclose(np.sqrt(square[solved]), slowness[solved] * CELL, rtol=1e-3)


def test_it_is_the_solution_of_fast_marching():
    skfmm = pytest.importorskip("skfmm")
    far = sphere(grid(24, CELL), 0.1)
    speed = 0.2 + np.random.default_rng(1).random(far.shape)
    theirs = skfmm.travel_time(far, speed, CELL, order=1)
    near = np.abs(far) < CELL
    ours = arrival_times(1 / speed, np.where(near | (far < 0), np.abs(theirs), np.inf), CELL)
    np.testing.assert_allclose(ours[far > 0], theirs[far > 0], rtol=0.02)


def test_what_is_no_front_is_refused():
    ones = np.ones((3, 3, 3))
    for slowness, start in ((ones, ones * np.inf), (ones[:2], ones), (-ones, ones)):
        with pytest.raises(GeometryError, match="A front needs"):
            arrival_times(slowness, start, CELL)
