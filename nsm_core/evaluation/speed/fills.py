"""Speed of filling missing frames, from what a script hands over to frames that can be keyed."""

from __future__ import annotations

from functools import partial

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.control.inbetween import Gap, fill
from nsm_core.control.request import TakeRequest
from nsm_core.control.take import TakeRunner
from nsm_core.conventions import FPS
from nsm_core.evaluation.trials import locomotion
from nsm_core.model.inference.transition_model import TransitionModel
from nsm_core.model.networks.protocol import Model
from nsm_core.model.transitions.layout import PAST, TARGET_FRAMES
from nsm_core.rotations import Array

from .clock import median_ms

FRAMES = (10, 30, 60)  # that are missing


def report_fills(model: Model, network: TransitionModel) -> dict[str, dict[str, float]]:
    """Gaps in the middle of a walk of ``model``, on level ground: the processor's milliseconds of the
    network, of all (network, pose, feet, solver), and how many times faster than it plays that is.
    """
    walked = _walk(model, locomotion.request(locomotion.trials(1)[0]))
    print("\nmissing frames filled      network  all, ms  x real time")
    told = {}
    for frames in FRAMES:
        first = (len(walked) - frames) // 2
        gap = Gap(
            walked[first - PAST : first], walked[first + frames : first + frames + TARGET_FRAMES], frames
        )
        past, target = (side.world()[0] for side in (gap.past, gap.target))
        alone = median_ms(partial(network.predict, past, target, frames, _level), 10)
        whole = median_ms(partial(fill, gap, network), 10)
        ratio = 1e3 * frames / FPS / whole
        print(f"  {frames:<22d}{alone:10.1f}{whole:9.1f}{ratio:13.1f}", flush=True)
        told[str(frames)] = {"network": alone, "whole": whole, "real_time": ratio}
    return told


def _level(places: Array) -> Array:
    return np.zeros(len(places))


def _walk(model: Model, request: TakeRequest) -> Clip:
    runner = TakeRunner(model, request)
    while runner.step():
        pass
    return Clip("walk", *runner.motion())


__all__ = ["report_fills"]
