"""Speed of the network: one character by layer, batches of characters, and training."""

from __future__ import annotations

import time
from functools import partial

import numpy as np

from nsm_core.conventions import DT
from nsm_core.model.features.layout import Inputs
from nsm_core.model.networks.config import NetworkConfig
from nsm_core.model.networks.nsm_numpy import NumpyNsm
from nsm_core.model.networks.protocol import Model, Weights
from nsm_core.model.networks.registry import kind_of
from nsm_core.rotations import Array
from nsm_core.threads import threads as threads_of

from .clock import best_s, median_ms, memory_bandwidth

BATCHES = (1, 8, 64, 256)


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


def report_frame(ours: Model, theirs: Model | None, frames: int) -> dict[str, float]:
    """One character, one frame: milliseconds by layer, beside those of reading the weights once."""
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
    print(
        f"  weights {size / 1e6:.1f} MB read at {bandwidth / 1e9:.1f} GB/s from memory: {ideal:.2f} ms; "
        f"the step takes {total / ideal:.2f} x that (under 1 where caches keep the weights)"
    )
    told = {**stages, "whole": total, "weights_mb": size / 1e6, "memory_floor": ideal}
    if theirs:
        told["torch"] = median_ms(lambda: theirs.step(inputs, memory), frames)
        y, other = ours.step(inputs, memory)[0], theirs.step(inputs, memory)[0]
        told["difference_from_torch"] = float(np.abs(y - other).max())
        print(
            f"  eager torch module {told['torch']:.3f} ms: the step takes {total / told['torch']:.2f} x that"
        )
        print(f"  largest difference of the two {told['difference_from_torch']:.1e}")
    print(f"  real time {DT * 1e3:.1f} ms: {DT * 1e3 / total:.1f} x faster")
    return told


def report_batches(models: list[Model], count: int, several: int = 2) -> dict[str, dict[str, float]]:
    """Characters stepped per second, by back end: on one thread, and numpy's on ``several``, whose best run
    counts.
    """
    names = [m.backend for m in models]
    print("\ncharacters per second " + "".join(f"{n:>10s}" for n in (*names, f"{several} threads")))
    told = {}
    for size in BATCHES:
        inputs, memory = random_inputs(models[0].config, size), models[0].start(size)
        rates = [size / median_ms(partial(m.step, inputs, memory), count) * 1e3 for m in models]
        with threads_of(several):
            rates.append(size / best_s(partial(models[0].step, inputs, memory), 3 * count))
        print(f"  {size:4d} at once        " + "".join(f"{rate:10.0f}" for rate in rates))
        told[str(size)] = dict(zip((*names, "several_threads"), rates, strict=True))
    return told


def report_training(config: NetworkConfig, threads: int, batch: int = 512) -> float:
    """Training samples per second, in bfloat16 where that is faster: forward, backward and AdamW."""
    import torch

    from nsm_core.model.networks.allocator import keep_freed_memory
    from nsm_core.model.networks.precision import half_precision_pays

    half = half_precision_pays(torch.device("cpu"))
    keep_freed_memory()
    net = kind_of(config.network).module(config)
    optimiser = torch.optim.AdamW(net.parameters(), lr=1e-4, fused=True)
    x, gating, target = (torch.randn(batch, n) for n in (config.inputs, config.gating, config.outputs))
    memory = net.start(batch)

    def step() -> None:
        with torch.autocast("cpu", torch.bfloat16, enabled=half):
            loss = torch.nn.functional.mse_loss(net(Inputs(x, gating), memory)[0], target)
        loss.backward()
        optimiser.step()
        optimiser.zero_grad(set_to_none=True)

    rate = batch / median_ms(step, 20, time.perf_counter) * 1e3
    kind = "bfloat16" if half else "float32"
    print(f"\ntraining at batch {batch}, {kind}, {threads} thread(s): {rate:.0f} samples a second")
    return rate
