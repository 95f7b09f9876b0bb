"""Tables like the paper's 2 and 3, ours beside the paper's: means over evaluation seeds and their spread."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .entrants import ABLATIONS, CAPTURED, ENTRANTS, GATES, NETWORKS, RESPONSES, Entrant

Results = dict[str, dict[str, Any]]  # by entrant: its trials, steps and parameters
_PRECISION = (
    ("sit", "network_pe_cm", "network_re_deg"),
    ("carry", "network_hand_pe_cm", "network_hand_re_deg"),
)
_SOLVED = (("sit", "pe_cm", "re_deg"), ("carry", "hand_pe_cm", "hand_re_deg"))


def tables(results: Results) -> str:
    """All tables of those that have results, as text."""
    parts = [_response(results), _precision(results), _motion(results), _sizes(results)]
    return "\n\n".join(parts)


def by_seed(
    trials: Sequence[dict[str, Any]], part: str, value: Callable[[dict[str, Any]], Any]
) -> list[float]:
    """Mean of a figure over the trials of a part that have it, for every seed of evaluation."""
    means = []
    for seed in sorted({t["seed"] for t in trials}):
        found = [value(t) for t in trials if t["seed"] == seed and t["part"] == part]
        known = [float(v) for v in found if v is not None and np.isfinite(v)]
        means.append(float(np.mean(known)) if known else float("nan"))
    return means


def spread(values: Sequence[float], digits: int = 2) -> str:
    """Mean of the seeds' means and their standard deviation, "-" where no trial has the figure."""
    known = [v for v in values if np.isfinite(v)]
    return f"{np.mean(known):.{digits}f} ± {np.std(known):.{digits}f}" if known else "-"


def _named(key: str) -> Callable[[dict[str, Any]], Any]:
    return lambda trial: trial.get(key)


def _paper(values: tuple[float, ...], n: int) -> str:
    return f" ({values[n]:.2f})" if n < len(values) and np.isfinite(values[n]) else ""


def _rows(
    results: Results, some: Sequence[Entrant], cells: Callable[[Entrant, list[dict[str, Any]]], list[str]]
) -> list[str]:
    return [
        "| " + " | ".join((e.title, *cells(e, results[e.key]["trials"]))) + " |"
        for e in some
        if e.key in results
    ]


def _head(title: str, *columns: str) -> list[str]:
    return [f"| {title} | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]


def _response(results: Results) -> str:
    """Table 2."""

    def cells(entrant: Entrant, trials: list[dict[str, Any]]) -> list[str]:
        return [
            spread(by_seed(trials, "response", _named(key))) + _paper(entrant.response, n)
            for n, key in enumerate(RESPONSES)
        ] + [spread([100 * v for v in by_seed(trials, "response", _named("reached"))], 0)]

    head = _head(
        "response s (paper)", "idle to walk", "idle to run", "walk to sit", "run to sit", "answered %"
    )
    return "\n".join(head + _rows(results, (*NETWORKS, *ABLATIONS, *CAPTURED), cells))


def _precision(results: Results) -> str:
    """Table 3: the network alone, then with the solver."""

    def alone(entrant: Entrant, trials: list[dict[str, Any]]) -> list[str]:
        told = []
        for n, (part, pe, re) in enumerate(_PRECISION):
            for k, key in enumerate((pe, re)):
                told.append(spread(by_seed(trials, part, _named(key))) + _paper(entrant.precision, 2 * n + k))
            told.append(spread([100 * v for v in by_seed(trials, part, _named("reached"))], 0))
        return told

    def solved(entrant: Entrant, trials: list[dict[str, Any]]) -> list[str]:
        return [spread(by_seed(trials, part, _named(key))) for part, *keys in _SOLVED for key in keys]

    some = (*NETWORKS, *ABLATIONS, *CAPTURED)
    columns = ("sit PE cm", "sit RE deg", "carry PE cm", "carry RE deg")
    head = _head("network alone (paper)", *columns[:2], "sit reached %", *columns[2:], "carry reached %")
    lines = [*head, *_rows(results, some, alone), ""]
    return "\n".join([*lines, *_head("with the solver", *columns), *_rows(results, some, solved)])


def _motion(results: Results) -> str:
    """How it moves, over sits and carries."""

    def cells(entrant: Entrant, trials: list[dict[str, Any]]) -> list[str]:
        both = [t | {"part": "all"} for t in trials if t["part"] != "response"]
        figures = (
            ("network_slide_moving_cm_s", 1, 1.0),
            ("slide_moving_cm_s", 1, 1.0),
            ("jerk_alone_m_s3", 0, 1.0),
            ("jerk_m_s3", 0, 1.0),
            ("penetration_share", 1, 100.0),
        )
        return [
            spread([scale * v for v in by_seed(both, "all", _named(key))], digits)
            for key, digits, scale in figures
        ]

    head = _head(
        "sits and carries",
        "slide while moving cm/s, alone",
        "solved",
        "jerk m/s³, alone",
        "solved",
        "frames deeper than 3 cm %, solved",
    )
    return "\n".join(head + _rows(results, (*NETWORKS, *ABLATIONS, *GATES, *CAPTURED), cells))


def _sizes(results: Results) -> str:
    """What each is, and how long it was trained."""

    def cells(entrant: Entrant, trials: list[dict[str, Any]]) -> list[str]:
        about = results[entrant.key]
        told = (about["parameters"] / 1e6, about["minutes"], about["steps"], about["validation"])
        return [f"{v:.{d}f}" for v, d in zip(told, (2, 0, 0, 3), strict=True)]

    head = _head("trained", "parameters, million", "minutes", "steps", "validation loss")
    networks = [e for e in ENTRANTS.values() if not e.captured]
    return "\n".join(head + _rows(results, networks, cells))
