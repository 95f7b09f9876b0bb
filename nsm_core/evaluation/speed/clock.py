"""Clocks of the benchmark.

What runs on one thread is measured by the time that the processor has spent on it, which other programs
lengthen least; what runs on several, by the clock.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np


def median_ms(call: Callable[[], Any], count: int, clock: Callable[[], float] = time.thread_time) -> float:
    """Median time of ``count`` calls after a warm-up, milliseconds."""
    for _ in range(max(count // 10, 2)):
        call()
    times = []
    for _ in range(count):
        start = clock()
        call()
        times.append(clock() - start)
    return float(np.median(times)) * 1e3


def best_s(call: Callable[[], Any], count: int) -> float:
    """Shortest time by the clock of ``count`` calls after a warm-up, seconds."""
    call()
    times = []
    for _ in range(count):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def memory_bandwidth() -> float:
    """Bytes a second at which a matrix far larger than the caches is read by a matrix-vector product."""
    matrix, vector = np.ones((16384, 8192), dtype=np.float32), np.ones(8192, dtype=np.float32)
    return matrix.nbytes / (median_ms(lambda: matrix @ vector, 5) / 1e3)
