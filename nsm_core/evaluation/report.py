"""The figures of a network: trials of fixed seeds, tables and a JSON file."""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from nsm_core.conventions import STYLES
from nsm_core.files import output
from nsm_core.model.features.layout import INPUT, Inputs
from nsm_core.model.features.rollout_step import Blending
from nsm_core.model.inference.model import Model, load_model
from nsm_core.model.networks.config import Memory
from nsm_core.model.networks.protocol import Info
from nsm_core.rotations import Array
from nsm_core.world.assets.pool import Pool

from .trials import stress
from .trials.rollout import Report, slides
from .trials.suite import ABLATIONS, PARTS, Figures, Row, travel_rows
from .trials.together import TOGETHER, together, told

Job = tuple[str, str | None, Any]  # part, ablation, trial

POOL_CACHE = "runs/pool.npz"  # where ``python -m nsm_core pool`` keeps it too

_model: Model | None = None


class Blind:
    """A network that gets nothing from one of its sensors, as if there were nothing to sense."""

    def __init__(self, model: Model, sensor: str) -> None:
        """``sensor`` is "environment" or "interaction"."""
        self.model, self.backend, self.config, self.metadata = (
            model,
            model.backend,
            model.config,
            model.metadata,
        )
        self.slice = INPUT.slices[sensor]

    def start(self, batch: int = 1) -> Memory:
        """As the network starts."""
        return self.model.start(batch)

    def step(self, inputs: Inputs[Array], memory: Memory) -> tuple[Array, Memory, Info]:
        """Predict as ``Model.step`` says, the sensor's part of the input at zero."""
        x = inputs.features.copy()
        x[:, self.slice] = 0
        return self.model.step(inputs._replace(features=x), memory)


def without(model: Model, ablation: str | None) -> tuple[Model, dict[str, object]]:
    """The network and the options of a take for one of ``ABLATIONS``; None leaves all as it is."""
    if ablation == "no bi-directional control":
        return model, {"blending": Blending(False, False)}
    return (model, {}) if ablation is None else (Blind(model, ablation.split()[0]), {})


def _prepare(weights: str | None) -> None:
    global _model
    _model = load_model(weights, backend="numpy")


def reports_of(model: Model, jobs: Sequence[Job], most: int = TOGETHER) -> list[Report]:
    """Figures of trials of one ablation, at most ``most`` at once; what breaks off is a figure too."""
    (ablation,) = {ablation for _, ablation, _ in jobs}
    model, more = without(model, ablation)
    made = together((PARTS[part].run(model, trial, **more) for part, _, trial in jobs), most)
    return [_broken(one) if isinstance(one, Exception) else one[1] for one in made]


def _broken(error: Exception) -> Report:
    return {"failed": 1.0, "reached": 0.0, "error": f"{type(error).__name__}: {error}"}  # type: ignore[dict-item]


def shares(jobs: Sequence[Job], workers: int) -> list[list[int]]:
    """Numbers of the jobs that are handed to a worker at a time: of one ablation, enough to be stepped
    together and few enough that no worker is idle and all end at about the same time.
    """
    several = min(TOGETHER, math.ceil(len(jobs) / workers))
    size = min(max(len(jobs) // (4 * workers), several, 1), 4 * TOGETHER)
    alike: dict[str | None, list[int]] = {}
    for number, (_, ablation, _) in enumerate(jobs):
        alike.setdefault(ablation, []).append(number)
    return [group[k : k + size] for group in alike.values() for k in range(0, len(group), size)]


def _reports(jobs: list[Job]) -> list[Report]:
    assert _model is not None
    return reports_of(_model, jobs)


def _stress(seeds: Sequence[int]) -> list[stress.Outcome]:
    assert _model is not None
    return [told(one) for one in together(stress.run_seed(_model, seed) for seed in seeds)]


def run_stress(weights: str | None, seconds: float, workers: int, quiet: bool = False) -> dict[str, Any]:
    """Roll random goals out until ``seconds`` of motion are there; see ``stress.summarise``."""
    outcomes: list[stress.Outcome] = []
    with pool_of_workers(weights, workers) as processes:
        # In batches, so that it ends soon after there is enough.
        while sum(o.seconds for o in outcomes) < seconds and len(outcomes) < 100 + seconds:
            first = len(outcomes)
            seeds = [range(at, at + 8) for at in range(first, first + 8 * workers, 8)]
            for some in processes.map(_stress, seeds):
                outcomes += some
                if not quiet:
                    print(
                        f"\r{sum(o.seconds for o in outcomes):.0f} of {seconds:.0f} s of random goals",
                        end="",
                        flush=True,
                    )
    if not quiet:
        print()
    return stress.summarise(outcomes)


def held_back_pool(assets: str | None) -> Pool | None:
    """The pieces of a mesh folder that training never draws; None without a folder.  Its conversion is kept
    for the next time.
    """
    return Pool.load(assets, cache=POOL_CACHE).held_back() if assets else None


def pool_of_workers(weights: str | None, workers: int) -> ProcessPoolExecutor:
    """Processes that each hold the network."""
    # One thread a process: the matrices of one character are too small to share.
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    return ProcessPoolExecutor(
        workers, mp_context=multiprocessing.get_context("spawn"), initializer=_prepare, initargs=(weights,)
    )


def evaluate(
    weights: str | None = None,
    only: Sequence[str] = tuple(PARTS),
    starts: int = 10,
    workers: int = 2,
    ablations: bool = True,
    assets: str | None = None,
    quiet: bool = False,
) -> dict[str, Any]:
    """Run the trials of the parts ``only``: summaries by part (and "part, ablation"), every trial's figures
    under ``trials``.
    """
    if not only:
        return {"trials": []}
    pool = held_back_pool(assets)
    jobs: list[Job] = []
    for name in only:
        chosen = PARTS[name].trials(starts, pool)
        for ablation in (None, *(PARTS[name].ablations if ablations else ())):
            jobs += [(name, ablation, t) for t in chosen]
    made: dict[int, Report] = {}
    began, numbers = time.perf_counter(), shares(jobs, workers)
    with pool_of_workers(weights, workers) as processes:
        handed = ([jobs[n] for n in some] for some in numbers)
        for some, figures in zip(numbers, processes.map(_reports, handed), strict=True):
            made |= zip(some, figures, strict=True)
            if not quiet:
                spent = time.perf_counter() - began
                print(f"\r{len(made)} of {len(jobs)} trials, {spent:.0f} s", end="", flush=True)
    reports = [made[n] for n in range(len(jobs))]
    if not quiet:
        print()
    result: dict[str, Any] = {}
    for name, ablation in dict.fromkeys((p, a) for p, a, _ in jobs):
        mine = [r for (p, a, _), r in zip(jobs, reports, strict=True) if (p, a) == (name, ablation)]
        result[name if ablation is None else f"{name}, {ablation}"] = PARTS[name].summarise(mine)
    result["trials"] = [
        {"part": p, "ablation": a, "setting": t.setting, "name": t.name, **r}
        for (p, a, t), r in zip(jobs, reports, strict=True)
    ]
    return result


def tables(result: dict[str, Any]) -> str:
    """One table a part: ours, the paper's, the aim; then the messages of trials that broke off."""
    lines: list[str] = []
    for name, part in PARTS.items():
        if name not in result:
            continue
        summary = Figures(result[name])
        rows = part.rows(summary) + (
            travel_rows(summary, _slide_of_data(result, name)) if part.travels else []
        )
        rows += _settings(name, result)
        for ablation in ABLATIONS:
            rows += _ablation_rows(name, ablation, Figures(result.get(f"{name}, {ablation}", {})))
        lines += [
            "",
            f"| {summary['trials']:.0f} trials: {part.title} | ours | paper | aim |",
            "|---|---|---|---|",
        ]
        lines += ["| " + " | ".join(r) + " |" for r in rows]
    lines += ["", _slides(result)]
    if "stress" in result:
        lines += ["", stress.stress_table(result["stress"])]
    messages: dict[str, int] = {}
    for trial in result.get("trials", ()):
        if trial.get("error"):
            key = f"{trial['part']}{', ' + trial['ablation'] if trial['ablation'] else ''}: {trial['error']}"
            messages[key] = messages.get(key, 0) + 1
    lines += (
        ["", *(f"broke off {count} x {message}" for message, count in messages.items())] if messages else []
    )
    lines += [f"{t['part']}: {t['touched']}" for t in result.get("trials", ()) if t.get("touched")]
    return "\n".join(lines).strip("\n")


def _slide_of_data(result: dict[str, Any], part: str) -> float | None:
    """Foot slide, cm/s, that the training data has in such frames as the trials of ``part`` show: weighted by
    their labels.
    """
    data = result.get("data") or {}
    trials = [t for t in result.get("trials", ()) if t["part"] == part and not t["ablation"]]
    counts = {name: sum(t.get(f"slide_{name}_count") or 0.0 for t in trials) for name in STYLES}
    known = {name: count for name, count in counts.items() if count and name in data}
    return sum(data[name] * count for name, count in known.items()) / sum(known.values()) if known else None


def _slides(result: dict[str, Any]) -> str:
    """Foot slide by action over all trials of all parts, and the training data's own where it is known."""
    trials = [t for t in result.get("trials", ()) if not t["ablation"]]
    ours, data = slides(trials), result.get("data") or {}
    if not ours and not data:
        return ""
    lines = ["| foot sliding cm/s, by action | ours | training data | aim |", "|---|---|---|---|"]
    for name in (*STYLES, "all"):
        if name in ours or name in data:
            own, base = (f"{v:.1f}" if v is not None else "" for v in (ours.get(name), data.get(name)))
            lines.append(
                f"| {name} | {own} | {base} | {f'{data[name] + 2:.1f}' if name in data else 'data + 2'} |"
            )
    return "\n".join(lines)


def _settings(part: str, result: dict[str, Any]) -> list[Row]:
    """A line for each setting of a part: how many of its trials went well."""
    key = PARTS[part].done
    groups: dict[tuple[Any, str], list[float]] = {}
    for trial in result.get("trials", ()):
        if trial["part"] == part and not trial["ablation"]:
            groups.setdefault((trial["setting"], trial["name"]), []).append(float(trial.get(key) or 0))
    return (
        [(f"{key}: {name}", f"{sum(g):.0f} of {len(g)}", "", "") for (_, name), g in groups.items()]
        if len(groups) > 1
        else []
    )


def _ablation_rows(part: str, ablation: str, s: Figures) -> list[Row]:
    if not s:
        return []
    pe, re = PARTS[part].ablations[ablation]
    alone = PARTS[part].alone
    note = "" if ablation.startswith("no ") else " at run time, not retrained"
    return [
        (f"{ablation}{note}: PE cm, network alone", f"{s[f'{alone}_pe_cm_mean']:.2f}", pe, ""),
        (f"{ablation}{note}: RE deg, network alone", f"{s[f'{alone}_re_deg_mean']:.2f}", re, ""),
        (f"{ablation}{note}: reached", f"{s['reached']:.0%}", "", ""),
    ]


def write_report(result: dict[str, Any], path: Path) -> None:
    """Write figures as JSON; OutputError where that fails."""
    with output(path, "The figures") as temporary:
        temporary.write_text(json.dumps(_plain(result), indent=1, allow_nan=False))
    print(f"Wrote {path}.")


def _plain(value: Any) -> Any:
    """What JSON can hold: None for what is not a number."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_plain(v) for v in value]
    return value if not isinstance(value, float) or math.isfinite(value) else None
