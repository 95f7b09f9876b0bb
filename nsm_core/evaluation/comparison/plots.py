"""The paper's figures 7, 10, 11 and 12, of ours."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.evaluation.pictures.drawing import pyplot
from nsm_core.files import output

from .entrants import ENTRANTS, GATES, NETWORKS
from .tables import Results, by_seed

_ACTIONS = ("walk", "run", "sit", "carry")
_GATED = ("idle", *_ACTIONS)


def draw_figures(results: Results, folder: Path) -> list[Path]:
    """Write the figures of those that have results; returns their paths."""
    made = []
    for name, draw in (
        ("figure_7_gating", _gating),
        ("figure_10_foot_sliding", _sliding),
        ("figure_11_angle_updates", _updates),
        ("figure_12_gate_features", _gates),
    ):
        path = folder / f"{name}.png"
        if draw(results, path):
            made.append(path)
    return made


def _save(figure: Any, path: Path) -> bool:
    figure.tight_layout()
    try:
        with output(path, "The figure") as temporary:
            figure.savefig(temporary, dpi=110, format="png")
    finally:
        pyplot().close(figure)
    return True


def _gating(results: Results, path: Path) -> bool:
    """Fig. 7: where the blending of experts, which stand on a circle, moves in each action."""
    shown = [
        (
            name,
            [
                t["gating"][name]
                for t in results.get("nsm", {"trials": []})["trials"]
                if name in t.get("gating", ())
            ],
        )
        for name in _GATED
    ]
    shown = [(name, ways[:6]) for name, ways in shown if ways]
    if not shown:
        return False
    plt = pyplot()
    figure, axes = plt.subplots(1, len(shown), figsize=(3.2 * len(shown), 3.5), squeeze=False)
    for axis, (name, ways) in zip(axes[0], shown, strict=True):
        experts = len(ways[0][0])
        angle = 2 * np.pi * np.arange(experts) / experts
        places = np.stack((np.cos(angle), np.sin(angle)), axis=1)
        axis.add_patch(plt.Circle((0, 0), 1, fill=False, color="#d9a400", lw=2))
        axis.plot(*places.T, "o", color="black", ms=7)
        for way in ways:
            axis.plot(*(np.array(way) @ places).T, lw=0.9, alpha=0.7)
        axis.set(title=name, xlim=(-1.15, 1.15), ylim=(-1.15, 1.15), aspect="equal")
        axis.axis("off")
    figure.suptitle("Blending of experts (Fig. 7)")
    return _save(figure, path)


def slid(trial: dict[str, Any], action: str) -> float | None:
    """Foot sliding of the network alone in an action, cm/s."""
    total, count = trial.get("slid", {}).get(action, (0.0, 0.0))
    return 100 * total / count if count else None


def updated(trial: dict[str, Any], action: str) -> float | None:
    """Mean turn of a joint in an action, degrees a second."""
    total, count = trial.get("updates", {}).get(action, (0.0, 0))
    return total / count if count else None


def _by_action(
    results: Results, value: Callable[[dict[str, Any], str], float | None], title: str, unit: str, path: Path
) -> bool:
    some = [e for e in (*NETWORKS, ENTRANTS["clips"], ENTRANTS["matching"]) if e.key in results]
    if not some:
        return False
    figure, axis = pyplot().subplots(figsize=(10, 4.2))
    width = 0.8 / len(some)
    for n, entrant in enumerate(some):
        trials = [t | {"part": "all"} for t in results[entrant.key]["trials"]]
        means = [by_seed(trials, "all", lambda t, name=name: value(t, name)) for name in _ACTIONS]  # type: ignore[misc]
        at = np.arange(len(_ACTIONS)) + (n - (len(some) - 1) / 2) * width
        axis.bar(
            at, [_mean(m) for m in means], width, yerr=[_deviation(m) for m in means], label=entrant.title
        )
    axis.set_xticks(range(len(_ACTIONS)), _ACTIONS)
    axis.set(ylabel=unit, title=title)
    axis.legend(fontsize=8, ncols=2)
    return _save(figure, path)


def _mean(values: list[float]) -> float:
    known = [v for v in values if np.isfinite(v)]
    return float(np.mean(known)) if known else 0.0


def _deviation(values: list[float]) -> float:
    known = [v for v in values if np.isfinite(v)]
    return float(np.std(known)) if known else 0.0


def _sliding(results: Results, path: Path) -> bool:
    """Fig. 10."""
    return _by_action(
        results, slid, "Foot sliding, network alone (paper: Fig. 10)", "cm/s of low ankles and toes", path
    )


def _updates(results: Results, path: Path) -> bool:
    """The graphs of Fig. 11: how much joints turn; what trembles turns more."""
    return _by_action(
        results, updated, "Joint angle updates, network alone (paper: Fig. 11)", "degrees a second", path
    )


def _gates(results: Results, path: Path) -> bool:
    """Fig. 12: motion detail against foot sliding, by what the gate is fed."""
    some = [e for e in (*GATES, ENTRANTS["nsm"]) if e.key in results]
    if not some:
        return False
    figure, axes = pyplot().subplots(1, 2, figsize=(11, 4.2))
    titles = [e.title if e.key != "nsm" else "labels, goals, distances [K]" for e in some]
    for axis, value, unit in (
        (axes[0], updated, "motion detail: joint angle update, degrees a second"),
        (axes[1], slid, "foot sliding, cm/s"),
    ):
        means = []
        for entrant in some:
            trials = [t | {"part": "all"} for t in results[entrant.key]["trials"]]
            means.append(by_seed(trials, "all", lambda t, value=value: value(t, "walk")))  # type: ignore[misc]
        axis.barh(titles, [_mean(m) for m in means], xerr=[_deviation(m) for m in means])
        axis.set_xlabel(unit)
        axis.invert_yaxis()
    axes[1].set_yticklabels([])
    figure.suptitle("What the gate is fed, times [K] or beside [C] the phase; walks, network alone (Fig. 12)")
    return _save(figure, path)
