"""How cost grows with the work: one series of each kind, its slope, and a plot.

A slope is that of a straight line through the logarithms of sizes and costs, over the larger half of the
sizes, where what is done once no longer counts: 1 is linear, 0 costs nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.control.request import TakeRequest
from nsm_core.control.take import TakeRunner
from nsm_core.evaluation.pictures.drawing import pyplot, save
from nsm_core.model.inference.model import model_of
from nsm_core.model.networks.nsm_config import NsmConfig
from nsm_core.model.networks.protocol import Model
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.geometry.mesh_reading import Reading
from nsm_core.world.scene.terrain import HeightMap, Terrain
from nsm_core.world.sensors.environment import environment_sensor

from .clock import median_ms
from .network import random_inputs, random_weights

Series = tuple[str, str, Sequence[int], list[float]]  # title, what is counted, how many, milliseconds


def measured(model: Model) -> list[Series]:
    """All series, the smallest sizes first."""
    kinds: list[tuple[str, str, Sequence[int], Callable[[int], float]]] = [
        ("reading a mesh", "triangles", (1_000, 10_000, 100_000, 1_000_000), _mesh),
        ("environment sensor", "colliders", (10, 30, 100, 300, 1_000, 3_000), _colliders),
        ("a step of the network", "characters", (1, 4, 16, 64, 128), lambda n: _characters(model, n)),
        ("a step of the network", "experts", (1, 2, 4, 8, 16), _experts),
        ("a take of walks", "goals of 4 m", (1, 2, 4, 6), lambda n: _take(model, n)),
        ("distances to ground", "steps of stairs", (1, 3, 6, 12, 24, 48), _steps),
    ]
    found = []
    for title, what, sizes, cost in kinds:
        found.append((title, what, sizes, [cost(size) for size in sizes]))
        print(f"  {title:24s}{slope(sizes, found[-1][3]):6.2f}  by {what}", flush=True)
    return found


def slope(sizes: Sequence[int], costs: Sequence[float]) -> float:
    """How cost grows with size, 1 where it is in proportion."""
    half = len(sizes) // 2
    return float(np.polyfit(np.log(sizes[half:]), np.log(costs[half:]), 1)[0])


def draw(found: Sequence[Series], path: str | Path) -> Path:
    """Plot all series, both axes logarithmic, each beside a line in proportion.  Raises OutputError."""
    plt = pyplot()
    fig, axes = plt.subplots(2, 3, figsize=(11, 6.4), layout="constrained")
    for ax, (title, what, sizes, costs) in zip(axes.flat, found, strict=True):
        ax.loglog(sizes, costs, "o-", color="tab:blue")
        ax.loglog(sizes, [costs[-1] * size / sizes[-1] for size in sizes], ":", color="grey", label="linear")
        ax.set_title(f"{title}: slope {slope(sizes, costs):.2f}", fontsize=10)
        ax.set_xlabel(what)
        ax.set_ylabel("ms")
        ax.legend(frameon=False, fontsize=8)
    return save(plt, fig, path)


def _mesh(triangles: int) -> float:
    side = round(np.sqrt(triangles / 2))
    x, y = np.meshgrid(np.linspace(0, 2, side + 1), np.linspace(0, 2, side + 1), indexing="ij")
    vertices = np.stack((x, y, 0.3 + 0.1 * np.sin(3 * x) * np.cos(2 * y)), -1).reshape(-1, 3)
    a = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1)
    faces = np.concatenate(
        (np.stack((a, a + 1, a + side + 1), 1), np.stack((a + 1, a + side + 2, a + side + 1), 1))
    )
    return _least(lambda: Reading.of(vertices, faces))


def _colliders(count: int) -> float:
    rng = np.random.default_rng(0)
    half = np.sqrt(count / 10)  # as many to the square metre, whatever their number
    query = Cuboids(
        ((*rng.uniform(-half, half, 2), 0.0), float(rng.uniform(-3, 3)), [(-0.2, -0.2, 0)], [(0.2, 0.2, 0.8)])
        for _ in range(count)
    )
    return median_ms(lambda: environment_sensor(query, np.zeros(2), 0.3), 20)


def _characters(model: Model, count: int) -> float:
    inputs, memory = random_inputs(model.config, count), model.start(count)
    return median_ms(lambda: model.step(inputs, memory), 9)


def _experts(count: int) -> float:
    return _characters(model_of(random_weights(NsmConfig(experts=count)), "numpy"), 1)


def _take(model: Model, count: int) -> float:
    def go() -> None:
        goals = [
            Goal("walk", "there", np.array((4.0 * (n % 2 == 0), 0.0, 0.0)), 0.0, 0.5) for n in range(count)
        ]
        runner = TakeRunner(model, TakeRequest(np.zeros(2), 0.0, goals, Cuboids()))
        while runner.step():
            pass

    return _least(go)


def _steps(count: int) -> float:
    rng = np.random.default_rng(0)
    stairs = Terrain(
        HeightMap(np.array((0.3 * n, 0.0)), 0.0, np.full((15, 50), 0.17 * (n + 1))) for n in range(count)
    )
    points: Array = rng.uniform((0, 0, 0), (0.3 * count, 1.0, 0.17 * count + 0.3), (500, 3))
    return median_ms(lambda: stairs.signed_distance(points, 0.15), 3)


def _least(work: Callable[[], object]) -> float:
    times = []
    for _ in range(2):
        begun = time.thread_time()
        work()
        times.append(1000 * (time.thread_time() - begun))
    return min(times)  # what else runs on the machine lengthens some
