"""Several takes of the same goals, one seed after another: all of them, or nothing."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import bpy

from nsm_core.model.inference import model as inference_model

from .animation.kept import Kept, restored_on_failure
from .goals.resolve import moved_by
from .keys.keyed import take_off
from .prepare import TakeSpec
from .progress import Progress
from .takes import Take, generate


def generate_variations(
    spec: TakeSpec, scene: bpy.types.Scene, model: inference_model.Model | None = None
) -> Generator[Progress, None, list[Take]]:
    """Generate ``spec.variations`` takes, each from the scene as it is now; the generator's value are all.

    The last one plays at the end; the others' actions are in the file, with no user but what keeps them.
    Whatever is raised or closed on the way, none of them is left.  Raises as ``takes.generate``.
    """
    count, made = max(spec.variations, 1), []
    with restored_on_failure(Kept(scene, [spec.character, *moved_by(spec.goals)])):
        for number in range(count):
            if made:
                take_off(made[-1].keyed)
            steps = generate(replace(spec, seed=spec.seed + number, variations=1), scene, model)
            made.append((yield from _told(steps, number, count)))
    return made


def _told(steps: Generator[Progress, None, Take], number: int, count: int) -> Generator[Progress, None, Take]:
    """Progress of one take of several; how far all are."""
    share = 0.0
    while True:
        try:
            progress = next(steps)
        except StopIteration as stop:
            return stop.value
        if progress.stage == "Generating":
            share = max(share, 0.9 * progress.fraction)
        if progress.stage != "Keying":  # at which a session puts the pose back
            progress = replace(progress, stage=f"{number + 1} of {count}: {progress.stage}")
        yield replace(progress, fraction=(number + share) / count)
