"""Speed of the network and of whole takes: by stage, per character, and as ratios that hold on other
machines.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from nsm_core.conventions import DT, FPS
from nsm_core.model.features.layout import Inputs
from nsm_core.model.inference.model import BUNDLED, Model, model_of
from nsm_core.model.inference.weights_file import load_weights
from nsm_core.model.networks.config import NetworkConfig
from nsm_core.model.networks.nsm_config import NsmConfig
from nsm_core.model.networks.nsm_numpy import NumpyNsm
from nsm_core.model.networks.protocol import Weights
from nsm_core.model.networks.registry import kind_of
from nsm_core.rotations import Array

THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
BATCHES = (1, 8, 64, 256)


def main(arguments: list[str]) -> int:
    """Print the tables; returns the exit code.  Raises WeightsError on a bad weights file."""
    parser = argparse.ArgumentParser(prog="python -m nsm_core bench", description=__doc__)
    parser.add_argument(
        "--weights", help="weights file (default: the bundled one, or random values of its size)"
    )
    parser.add_argument("--threads", type=int, default=1, help="threads of the matrix library (default 1)")
    parser.add_argument("--frames", type=int, default=300, help="frames measured per row (default 300)")
    parser.add_argument("--training", action="store_true", help="also measure training steps (needs PyTorch)")
    parser.add_argument("--no-takes", action="store_true", help="measure the network alone")
    options = parser.parse_args(arguments)
    wanted = {name: str(options.threads) for name in THREAD_VARIABLES}
    if any(os.environ.get(name) != value for name, value in wanted.items()):
        # The matrix library reads these once, when it is loaded: start over with them set.
        command = [sys.executable, "-m", "nsm_core", "bench", *arguments]
        return subprocess.run(command, env={**os.environ, **wanted}).returncode
    path = options.weights or (BUNDLED if BUNDLED.exists() else None)
    weights = load_weights(path) if path else random_weights(NsmConfig())
    print(
        f"weights {path or 'random, of the default size'}; {options.threads} thread(s); median of "
        f"{options.frames} frames"
    )
    ours = model_of(weights, "numpy")
    theirs = model_of(weights, "torch") if importlib.util.find_spec("torch") else None
    if theirs:
        import torch

        torch.set_num_threads(options.threads)
    report_frame(ours, theirs, options.frames)
    report_batches([m for m in (ours, theirs) if m], max(options.frames // 20, 5))
    if "stance" in ours.metadata and not options.no_takes:
        report_takes(ours)
        report_steered(ours)
    if options.training and theirs:
        report_training(ours.config, options.threads)
    return 0


def random_weights(config: NetworkConfig) -> Weights:
    """Weights of the given size with random values, to measure speed before anything is trained."""
    rng = np.random.default_rng(0)
    parameters, statistics = {}, {}
    for name, shape in config.shapes().items():
        if name.endswith(("_mean", "_std")):
            statistics[name] = np.full(shape, float(name.endswith("_std")), dtype=np.float32)
        else:
            parameters[name] = (rng.standard_normal(shape) / np.sqrt(shape[-1])).astype(np.float32)
    return Weights(parameters, statistics, {"network": config.network, "config": config.to_dict()})


def random_inputs(config: NetworkConfig, batch: int) -> Inputs[Array]:
    """Inputs of ``batch`` characters, standard normal."""
    rng = np.random.default_rng(batch)
    return Inputs(
        rng.standard_normal((batch, config.inputs), np.float32),
        rng.standard_normal((batch, config.gating), np.float32),
    )


def median_ms(call: Callable[[], Any], count: int) -> float:
    """Median time of ``count`` calls after a warm-up, milliseconds."""
    for _ in range(max(count // 10, 2)):
        call()
    times = []
    for _ in range(count):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return float(np.median(times)) * 1e3


def memory_bandwidth() -> float:
    """Bytes a second at which a matrix far larger than the caches is read by a matrix-vector product."""
    matrix, vector = np.ones((16384, 8192), dtype=np.float32), np.ones(8192, dtype=np.float32)
    return matrix.nbytes / (median_ms(lambda: matrix @ vector, 5) / 1e3)


def report_frame(ours: Model, theirs: Model | None, frames: int) -> None:
    """One character, one frame: stages and ratios."""
    inputs, memory = random_inputs(ours.config, 1), ours.start()
    total = median_ms(lambda: ours.step(inputs, memory), frames)
    stages: dict[str, float] = {}
    if isinstance(ours, NumpyNsm):
        coefficients, encoded = ours.gate(inputs.gating), ours.encode(inputs.features)
        stages = {
            "gating network": median_ms(lambda: ours.gate(inputs.gating), frames),
            "encoders": median_ms(lambda: ours.encode(inputs.features), frames),
            "blended experts": median_ms(lambda: ours.mix(encoded, coefficients), frames),
        }
    print("\none character, one frame        ms")
    for name, value in stages.items():
        print(f"  {name:26s}{value:8.3f}")
    print(f"  {'whole, with normalisation':26s}{total:8.3f}")
    size = 4 * sum(int(np.prod(shape)) for shape in ours.config.shapes().values())
    bandwidth = memory_bandwidth()
    ideal = size / bandwidth * 1e3
    print("\nratios, same run")
    print(
        f"  weights {size / 1e6:.1f} MB read at {bandwidth / 1e9:.1f} GB/s from memory: {ideal:.2f} ms",
        end="; ",
    )
    print(f"ours takes {total / ideal:.2f} x that (under 1 where caches keep the weights)")
    if theirs:
        eager = median_ms(lambda: theirs.step(inputs, memory), frames)
        print(f"  eager torch module {eager:.3f} ms: ours takes {total / eager:.2f} x that")
        y, other = ours.step(inputs, memory)[0], theirs.step(inputs, memory)[0]
        print(f"  largest difference of the two {np.abs(y - other).max():.1e}")
    print(f"  real time {DT * 1e3:.1f} ms: {DT * 1e3 / total:.1f} x faster")


def report_takes(model: Model) -> None:
    """One take of each action: milliseconds a frame by stage, and ratios of the same run.

    Sensing is the scene as it is felt; planning, the goals and the ways to them; state, the network's input
    and output; correction, what makes of its pose the one that is kept.
    """
    from nsm_core.control.take import roll
    from nsm_core.evaluation.trials import carry, climb, locomotion, sit
    from nsm_core.evaluation.trials import open as doors

    asked = {
        "walk in a room": locomotion.request(locomotion.trials(1)[0]),
        "sit": sit.request(sit.trials(1, 1)[0]),
        "carry": carry.request(carry.trials(1, 1)[0]),
        "open, push": doors.request(doors.trials(1, 1)[0]),
        "open, pull": doors.request(doors.trials(1, 3)[2]),
        "climb": climb.request(climb.trials(1, 2)[1]),
    }
    columns = {
        "sensing": "sensors",
        "planning": "goals",
        "network": "network",
        "state": "blending",
        "correction": "ik",
    }
    print(
        "\none take, ms a frame  frames"
        + "".join(f"{name:>11s}" for name in columns)
        + "      whole  correction/network  x real time"
    )
    for name, request in asked.items():
        take = roll(model, request)
        ms = [take.stage_ms[stage] for stage in columns.values()]
        ratio = take.stage_ms["ik"] / take.stage_ms["network"]
        values = "".join(f"{value:11.2f}" for value in ms)
        print(
            f"  {name:18s}{len(take.root):8d}{values}{sum(ms):11.2f}{ratio:20.2f}{DT * 1e3 / sum(ms):13.1f}"
        )


def report_steered(model: Model, seconds: int = 20) -> None:
    """One character that is steered between furniture: milliseconds a frame, and their share of real time.

    Every second it is led another way, at a walk or at a run, and now and then it stands.
    """
    from nsm_core.control.actions.steer import RUNS, WALKS
    from nsm_core.control.live import LiveTake
    from nsm_core.evaluation.trials import locomotion
    from nsm_core.rotations import heading_to_direction

    live, rng = LiveTake(model, locomotion.request(locomotion.trials(1)[0])), np.random.default_rng(0)
    times = []
    for frame in range(seconds * FPS):
        if frame % FPS == 0:
            pace = float(rng.choice((0.0, WALKS, WALKS, RUNS)))
            live.steering.velocity = pace * heading_to_direction(np.array(rng.uniform(-np.pi, np.pi)))
        start = time.perf_counter()
        live.step()
        times.append(1e3 * (time.perf_counter() - start))
    mean, late = float(np.mean(times)), float(np.percentile(times, 99))
    print(
        f"\nsteered live, ms a frame: {mean:.2f} on average, {late:.2f} in the slowest of a hundred, "
        f"{max(times):.2f} at most; {mean / (DT * 1e3):.0%} of real time at {FPS} frames a second"
    )


def report_batches(models: list[Model], count: int) -> None:
    """Characters stepped per second, by back end."""
    print("\ncharacters per second " + "".join(f"{m.backend:>10s}" for m in models))
    for size in BATCHES:
        inputs, memory = random_inputs(models[0].config, size), models[0].start(size)
        rates = [size / median_ms(partial(m.step, inputs, memory), count) * 1e3 for m in models]
        print(f"  {size:4d} at once        " + "".join(f"{rate:10.0f}" for rate in rates))


def report_training(config: NetworkConfig, threads: int, batch: int = 512) -> None:
    """Training samples per second in bfloat16: forward, backward and AdamW."""
    import torch

    from nsm_core.model.networks.allocator import keep_freed_memory

    keep_freed_memory()
    net = kind_of(config.network).module(config)
    optimiser = torch.optim.AdamW(net.parameters(), lr=1e-4, fused=True)
    x, gating, target = (torch.randn(batch, n) for n in (config.inputs, config.gating, config.outputs))
    memory = net.start(batch)

    def step() -> None:
        with torch.autocast("cpu", torch.bfloat16):
            loss = torch.nn.functional.mse_loss(net(Inputs(x, gating), memory)[0], target)
        loss.backward()
        optimiser.step()
        optimiser.zero_grad(set_to_none=True)

    print(
        f"\ntraining at batch {batch}, bfloat16, {threads} thread(s): "
        f"{batch / median_ms(step, 20) * 1e3:.0f} samples a second"
    )
