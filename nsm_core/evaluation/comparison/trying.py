"""An entrant's trials: the suite's sits, carries and orders, drawn anew for every seed of evaluation."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.body.skeleton import forward_kinematics
from nsm_core.control.take import TakeResult
from nsm_core.conventions import FPS, STYLES
from nsm_core.evaluation.measures.motion import jerk
from nsm_core.evaluation.measures.objects import leading_action, slide_by_action
from nsm_core.evaluation.trials import carry, locomotion, sit
from nsm_core.evaluation.trials.rollout import SEED
from nsm_core.evaluation.trials.suite import PARTS
from nsm_core.evaluation.trials.together import together
from nsm_core.model.features.rollout_step import Blending
from nsm_core.model.inference.model import Model, load_model
from nsm_core.rotations import Array, quat_conjugate, quat_mul, quat_to_rotvec
from nsm_core.world.assets.pool import Pool

from .captured import CapturedModel

SETTINGS = 5  # seats, and kinds of carries, of a seed
_APART = 1000  # between the seeds of trials
_SHOWN = 120  # frames of gating that are kept of an action, of the first of trials stepped together
_AT_ONCE = 8
Figures = dict[str, Any]
Job = tuple[int, str, Any]  # seed of evaluation, part, trial

_model: Model | None = None


def jobs_of(seeds: Sequence[int], starts: int, pool: Pool | None) -> list[Job]:
    """All trials: ``starts`` sits and carries a seed over ``SETTINGS`` objects each, and orders."""
    jobs: list[Job] = []
    settings = min(SETTINGS, starts)
    each = max(1, round(starts / settings))
    for seed in seeds:
        own = SEED + _APART * seed
        drawn: dict[str, list[Any]] = {
            "sit": sit.trials(each, settings, pool=pool, seed=own),
            "carry": carry.trials(each, settings, pool=pool, seed=own),
            "response": locomotion.orders(starts, pool, own),
        }
        jobs += [(seed, part, trial) for part, trials in drawn.items() for trial in trials]
    return jobs


def blending_of(model: Model) -> Blending:
    """How roll-outs of a network were stepped when it was trained, and takes of it are therefore."""
    told = model.metadata.get("training", {}).get("rollout", {}).get("blending")
    return Blending(**told) if told else Blending()


def trials_of(
    path: str, kind: str, jobs: Sequence[Job], workers: int, tell: Callable[[int, int], None] | None = None
) -> list[Figures]:
    """Figures of every job, in order, of a weights file's network or of data played back as ``kind``."""
    shares = [list(jobs[k : k + _AT_ONCE]) for k in range(0, len(jobs), _AT_ONCE)]
    figures: list[Figures] = []
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    with ProcessPoolExecutor(
        workers, multiprocessing.get_context("spawn"), initializer=_prepare, initargs=(path, kind)
    ) as processes:
        for some in processes.map(_try, shares):
            figures += some
            if tell is not None:
                tell(len(figures), len(jobs))
    return figures


def model_at(path: str, kind: str) -> Model:
    """The network of a weights file, or a folder of data played back as ``kind`` ("clips", "matching")."""
    return CapturedModel.open(path, kind) if Path(path).is_dir() else load_model(path, backend="numpy")


def _prepare(path: str, kind: str) -> None:
    global _model
    _model = model_at(path, kind)


def _try(jobs: list[Job]) -> list[Figures]:
    assert _model is not None
    return figures_of(_model, jobs)


def figures_of(model: Model, jobs: Sequence[Job]) -> list[Figures]:
    """Figures of trials stepped together; what breaks off counts as not reached."""
    blending = blending_of(model)
    made = together((PARTS[part].run(model, trial, blending=blending) for _, part, trial in jobs), _AT_ONCE)
    result: list[Figures] = []
    for (seed, part, trial), one in zip(jobs, made, strict=True):
        told: Figures = {"seed": seed, "part": part, "name": trial.name}
        if isinstance(one, Exception):
            result.append(told | {"reached": 0.0, "error": f"{type(one).__name__}: {one}"})
        else:
            take, report = one
            result.append(told | report | observed(take, gating=not result))
    return result


def observed(take: TakeResult, gating: bool = True) -> Figures:
    """What the paper's figures show of the network's own motion, by action: sums of foot sliding, angle
    updates in degrees a second, and, if asked for, its ``gating``.
    """
    lead = leading_action(take.action)
    positions = forward_kinematics(take.network_hips, take.network_rotations)[0]
    turns = quat_mul(quat_conjugate(take.network_rotations[:-1]), take.network_rotations[1:])
    updates = np.degrees(np.linalg.norm(quat_to_rotvec(turns), axis=-1).mean(axis=1)) * FPS
    slid = slide_by_action(positions, take.action)
    found: Figures = {"jerk_alone_m_s3": jerk(positions), "slid": {k: v.tolist() for k, v in slid.items()}}
    found["updates"] = {
        STYLES[k]: [float(updates[lead[1:] == k].sum()), int((lead[1:] == k).sum())] for k in np.unique(lead)
    }
    if gating and take.experts.shape[1] > 1:
        found["gating"] = {
            STYLES[k]: _rounded(take.experts[lead == k][1 : 1 + _SHOWN]) for k in np.unique(lead)
        }
    return found


def _rounded(values: Array) -> list[list[float]]:
    return np.round(values.astype(float), 3).tolist()
