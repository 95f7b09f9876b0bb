"""Speed of whole takes and of a steered character, by stage."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from nsm_core.control.request import TakeRequest
from nsm_core.control.take import TakeRunner
from nsm_core.conventions import DT, FPS
from nsm_core.evaluation.trials import carry, climb, locomotion, sit
from nsm_core.evaluation.trials import open as doors
from nsm_core.model.networks.protocol import Model

STAGES = {  # as a take names them
    "sensing": "sensors",
    "planning": "goals",
    "network": "network",
    "state": "blending",
    "pose": "ik",
}


def trial_requests() -> dict[str, Callable[[], TakeRequest]]:
    """A take of each action, by its name."""
    return {
        "walk in a room": lambda: locomotion.request(locomotion.trials(1)[0]),
        "sit": lambda: sit.request(sit.trials(1, 1)[0]),
        "carry": lambda: carry.request(carry.trials(1, 1)[0]),
        "open, push": lambda: doors.request(doors.trials(1, 1)[0]),
        "open, pull": lambda: doors.request(doors.trials(1, 3)[2]),
        "climb": lambda: climb.request(climb.trials(1, 2)[1]),
    }


def timed_take(model: Model, request: TakeRequest) -> tuple[int, dict[str, float]]:
    """Frames of a take and, by stage, the median milliseconds a frame that the processor spends on it; the
    ``solver`` of the whole take on average.
    """
    runner = TakeRunner(model, request)
    runner.clock = time.thread_time
    frames: list[dict[str, float]] = []
    while True:
        before = dict(runner.spent_ms)
        inputs = runner.sense()
        if inputs is None:
            break
        begun = runner.clock()
        outputs = model.step(inputs, runner.memory)
        runner.follow(*outputs, 1000 * (runner.clock() - begun))
        frames.append({stage: spent - before[stage] for stage, spent in runner.spent_ms.items()})
    while runner.mend():
        pass
    spent = {name: float(np.median([frame[key] for frame in frames])) for name, key in STAGES.items()}
    spent["solver"] = (runner.spent_ms["ik"] - before["ik"]) / len(frames)
    return len(frames), spent


def report_takes(model: Model) -> dict[str, dict[str, float]]:
    """One take of each action: milliseconds a frame by stage, as the processor spends them.

    Sensing is the scene as it is felt; planning, the goals and the ways to them; state, the network's input
    and output; pose, what makes of it the pose that is kept; the solver goes over the whole take at its end.
    """
    names = [*STAGES, "solver"]
    print(f"\none take, ms a frame  frames{''.join(f'{n:>10s}' for n in names)}     whole  x real time")
    told = {}
    for name, request in trial_requests().items():
        frames, spent = timed_take(model, request())
        whole = sum(spent.values())
        values = "".join(f"{spent[n]:10.2f}" for n in names)
        print(f"  {name:18s}{frames:8d}{values}{whole:10.2f}{DT * 1e3 / whole:13.1f}", flush=True)
        told[name] = {"frames": frames, **spent, "whole": whole, "real_time": DT * 1e3 / whole}
    return told


def report_steered(model: Model, seconds: int = 20) -> dict[str, float]:
    """One character that is steered between furniture: milliseconds a frame, and their share of real time.

    Every second it is led another way, at a walk or at a run, and now and then it stands.
    """
    from nsm_core.control.actions.steer import RUNS, WALKS
    from nsm_core.control.live import LiveTake
    from nsm_core.rotations import heading_to_direction

    live, rng = LiveTake(model, locomotion.request(locomotion.trials(1)[0])), np.random.default_rng(0)
    times = []
    for frame in range(seconds * FPS):
        if frame % FPS == 0:
            pace = float(rng.choice((0.0, WALKS, WALKS, RUNS)))
            live.steering.velocity = pace * heading_to_direction(np.array(rng.uniform(-np.pi, np.pi)))
        start = time.thread_time()
        live.step()
        times.append(1e3 * (time.thread_time() - start))
    mean, late = float(np.mean(times)), float(np.percentile(times, 99))
    print(
        f"\nsteered live, ms a frame: {mean:.2f} on average, {late:.2f} in the slowest of a hundred, "
        f"{max(times):.2f} at most; {mean / (DT * 1e3):.0%} of real time at {FPS} frames a second"
    )
    return {"mean": mean, "slowest_of_a_hundred": late, "most": max(times), "real_time": DT * 1e3 / mean}
