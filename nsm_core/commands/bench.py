"""Speed of the network and of whole takes: by stage, per character, and as ratios that hold on other
machines.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import subprocess
import sys
from typing import Any

import numpy as np

from nsm_core.evaluation.speed import growth
from nsm_core.evaluation.speed.fills import report_fills
from nsm_core.evaluation.speed.network import random_weights, report_batches, report_frame, report_training
from nsm_core.evaluation.speed.record import add
from nsm_core.evaluation.speed.takes import report_steered, report_takes
from nsm_core.model.inference.model import BUNDLED, model_of
from nsm_core.model.inference.transition_model import load_transitions
from nsm_core.model.inference.weights_file import load_weights
from nsm_core.model.networks.nsm_config import NsmConfig

THREAD_VARIABLES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


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
    parser.add_argument("--json", help="file that the figures are added to")
    parser.add_argument("--growth", metavar="PNG", help="also plot how cost grows with the work")
    options = parser.parse_args(arguments)
    wanted = {name: str(options.threads) for name in THREAD_VARIABLES}
    if any(os.environ.get(name) != value for name, value in wanted.items()):
        # The matrix library reads these once, when it is loaded: start over with them set.
        command = [sys.executable, "-m", "nsm_core", "bench", *arguments]
        return subprocess.run(command, env={**os.environ, **wanted}).returncode
    path = options.weights or (BUNDLED if BUNDLED.exists() else None)
    weights = load_weights(path) if path else random_weights(NsmConfig())
    print(
        f"weights {path or 'random, of the default size'}; {options.threads} thread(s), the processor's "
        f"time; median of {options.frames} frames"
    )
    ours = model_of(weights, "numpy")
    theirs = model_of(weights, "torch") if importlib.util.find_spec("torch") else None
    if theirs:
        import torch

        torch.set_num_threads(options.threads)
    told: dict[str, Any] = {
        "threads": options.threads,
        "network_ms": report_frame(ours, theirs, options.frames),
    }
    count = max(options.frames // 20, 5)
    told["characters_per_s"] = report_batches([m for m in (ours, theirs) if m], count)
    ratios = {
        "network_over_memory_floor": told["network_ms"]["whole"] / told["network_ms"]["memory_floor"],
        "character_frames_per_s_64": told["characters_per_s"]["64"]["several_threads"],
    }
    if "stance" in ours.metadata and not options.no_takes:
        told["takes_ms"] = report_takes(ours)
        told["steered_ms"] = report_steered(ours)
        told["fills_ms"] = report_fills(ours, load_transitions())
        ratios["fill_of_60_frames_s"] = told["fills_ms"]["60"]["whole"] / 1e3
        ratios["real_time_over_frame"] = float(np.median([t["real_time"] for t in told["takes_ms"].values()]))
    if options.training and theirs:
        told["training_samples_per_s"] = report_training(ours.config, options.threads)
    if options.growth:
        print("\nhow cost grows, 1 in proportion to")
        found = growth.measured(ours)
        growth.draw(found, options.growth)
        told["growth"] = [
            {"of": title, "by": what, "sizes": list(sizes), "ms": costs, "slope": growth.slope(sizes, costs)}
            for title, what, sizes, costs in found
        ]
        ratios["steepest_growth"] = max(each["slope"] for each in told["growth"])
    print("\nfigures that hold on other machines, and what is asked of them")
    add(options.json, "core", told, ratios)
    return 0
