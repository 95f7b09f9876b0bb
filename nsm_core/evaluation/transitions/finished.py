"""Gaps as they are keyed, after target blend and solver, and captures made whole again from a pose a second
(papers/001 sections 5.1 and 7.4): what an animator gets, of actors held out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.body.contacts import TOES
from nsm_core.control.inbetween import Gap, fill
from nsm_core.control.super_resolution import compress, decompress
from nsm_core.data.transitions.windows import Windows
from nsm_core.model.inference.transition_model import TransitionModel
from nsm_core.model.transitions.layout import PAST, TARGET_FRAMES
from nsm_core.rotations import Array

from .measures import slide as toe_slide

FRAMES, GAPS, MOTIONS = 30, 40, 10
INT, NETWORK, VARIED = "interpolation", "network", "a variation"


@dataclass(frozen=True)
class Finished:
    """Of gaps as they are keyed, means.

    ``off`` centimetres, mean over numbers; ``slide`` cm/s of toes near the ground; ``jolt`` cm a frame
    squared, the largest of joints at both seams; ``differs`` centimetres from what the network fills without
    a seed.
    """

    off: float
    slide: float
    jolt: float
    differs: float


def finished(windows: Windows, model: TransitionModel) -> dict[str, Finished]:
    """Fill GAPS gaps of a second and judge what comes out, by method; "captures" are what was cut out."""
    whole = PAST + FRAMES + TARGET_FRAMES
    found: dict[str, list[tuple[float, ...]]] = {}
    for index in _spread(windows.chosen(True, whole), GAPS):
        clip = _clip(windows, index, whole)
        under = partial(windows.grounds[index, 0].height, windows.maps)
        gap = Gap(clip[:PAST], clip[-TARGET_FRAMES:], FRAMES, under)
        places = clip.world()[0]
        mean = fill(gap, model).clip.world()[0]
        made = {
            "captures": places[PAST:-TARGET_FRAMES],
            INT: fill(gap, None).clip.world()[0],
            NETWORK: mean,
            VARIED: fill(Gap(gap.past, gap.target, FRAMES, under, seed=1), model).clip.world()[0],
        }
        for name, joints in made.items():
            found.setdefault(name, []).append(_judged(joints, places, gap, mean))
    return {name: Finished(*np.mean(values, axis=0).tolist()) for name, values in found.items()}


def _judged(joints: Array, places: Array, gap: Gap, mean: Array) -> tuple[float, float, float, float]:
    assert gap.ground is not None
    under = gap.ground(joints[:, TOES, :2].reshape(-1, 2).astype(np.float64)).reshape(1, -1, 2)
    ends = places[PAST - 2 : PAST], places[-TARGET_FRAMES:]
    jolts = np.linalg.norm(np.diff(np.concatenate((ends[0], joints, ends[1])), n=2, axis=0), axis=-1)
    return (
        100 * float(np.abs(joints - places[PAST:-TARGET_FRAMES]).mean()),
        toe_slide(joints[None], under),
        100 * float(max(jolts[:2].max(), jolts[-2:].max())),
        100 * float(np.abs(joints - mean).mean()),
    )


def decompressed(windows: Windows, model: TransitionModel) -> dict[str, float]:
    """Centimetres by which MOTIONS of the longest windows are off that are kept as a pose a second, by
    method.
    """
    whole = int(windows.length[windows.held].max())
    off: dict[str, list[float]] = {INT: [], NETWORK: []}
    for index in _spread(windows.chosen(True, whole), MOTIONS):
        clip = _clip(windows, index, whole)
        for name, network in ((INT, None), (NETWORK, model)):
            made = decompress(compress(clip), network).world()[0]
            off[name].append(100 * float(np.abs(made - clip.world()[0][: len(made)]).mean()))
    return {name: float(np.mean(values)) for name, values in off.items() if values}


def _spread(chosen: Array, most: int) -> Array:
    return chosen[np.unique(np.linspace(0, len(chosen) - 1, min(most, len(chosen))).astype(int))]


def _clip(windows: Windows, index: int, frames: int) -> Clip:
    span = slice(int(windows.start[index]), int(windows.start[index]) + frames)
    return Clip("captured", windows.hips[span], windows.local[span])


def text(gaps: Mapping[str, Finished], whole: Mapping[str, float]) -> str:
    """Both as text."""
    lines = [f"As keyed, {FRAMES} frames", f"{'':18s}{'cm off':>8s}{'slide':>8s}{'jolt':>8s}{'differs':>8s}"]
    lines += [f"{n:18s}{g.off:8.2f}{g.slide:8.1f}{g.jolt:8.2f}{g.differs:8.2f}" for n, g in gaps.items()]
    told = ", ".join(f"{name} {off:.2f}" for name, off in whole.items())
    return "\n".join([*lines, f"A pose a second made whole again, cm off: {told}"])


__all__ = ["Finished", "decompressed", "finished", "text"]
