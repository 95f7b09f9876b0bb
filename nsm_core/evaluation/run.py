"""Print the figures of the shipped network: one command, fixed seeds, a table and a JSON file."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from ..control.goals import Goal
from ..control.stepping import Blending
from ..control.take import TakeRequest, TakeRunner
from ..conventions import FPS, STYLES
from ..errors import OutputError
from ..inference import Model, load_model
from ..rotations import heading_to_direction
from ..sensors.query import Cuboids
from .sitting import SEATS, Trial, run_trial, summarise, trials

_model: Model | None = None


def _prepare(weights: str | None) -> None:
    global _model
    _model = load_model(weights, backend="numpy")


def _sit(job: tuple[Trial, bool]) -> dict[str, float]:
    trial, bidirectional = job
    assert _model is not None
    _, report = run_trial(_model, trial, blending=Blending(bidirectional, bidirectional))
    return report


def _respond(direction: int) -> float:
    """Seconds from the order to walk in one of four directions until the walk label passes 0.9."""
    assert _model is not None
    heading = direction * np.pi / 2
    target = np.append(8 * heading_to_direction(np.array(heading)), 0)
    runner = TakeRunner(_model, TakeRequest(np.zeros(2), 0.0, [Goal("walk", "place", target, heading, 0.0)], Cuboids(), contact_ik=False))
    while runner.step() and runner.frames < 8 * FPS:
        d = runner.director
        if d.index == 0 and runner.state.style_past[0, -1, STYLES.index("walk")] > 0.9:
            return (runner.frames - d.results[0].start_frame) / FPS
    return float("nan")


def evaluate(
    weights: str | None = None, starts: int = 10, seats: int = len(SEATS), workers: int = 2, ablation: bool = True
) -> dict[str, dict]:
    """Run all trials; returns summaries by name, and every trial's figures under ``trials``."""
    chosen = trials(starts, seats)
    jobs = [(t, True) for t in chosen] + ([(t, False) for t in chosen] if ablation else [])
    # One thread a process: the matrices of one character are too small to share.
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    context = multiprocessing.get_context("spawn")
    reports: list[dict[str, float]] = []
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_prepare, initargs=(weights,)) as pool:
        for n, report in enumerate(pool.map(_sit, jobs), 1):
            reports.append(report)
            print(f"\rtrial {n} of {len(jobs)}", end="", flush=True)
        print()
        responses = list(pool.map(_respond, range(4)))
    main, other = reports[: len(chosen)], reports[len(chosen) :]
    result: dict[str, dict] = {"sit": summarise(main)}
    if other:
        result["sit, no bi-directional"] = summarise(other)
    result["idle to walk"] = {"seconds_mean": float(np.mean(responses))}
    result["trials"] = {f"{t.piece.kind} {t.seat}, start {n % starts}": r for n, (t, r) in enumerate(zip(chosen, main, strict=True))}
    return result


def table(result: dict[str, dict]) -> str:
    """The figures as text: ours, the paper's, the aim."""
    sit = result["sit"]
    rows = [
        ("reached, network alone within 10 cm and 10 deg", f"{sit['within_10cm_10deg_alone']:.0%}", "", "80 %"),
        ("reached, with contact IK within 3 cm and 3 deg", f"{sit['within_3cm_3deg_ik']:.0%}", "", "80 %"),
        ("sit PE cm, network alone (median)", f"{sit['network_pe_cm_median']:.2f}", "2.93", ""),
        ("sit RE deg, network alone (median)", f"{sit['network_re_deg_median']:.2f}", "0.92", ""),
        ("sit PE cm, with contact IK (median)", f"{sit['pe_cm_median']:.2f}", "", ""),
        ("sit RE deg, with contact IK (median)", f"{sit['re_deg_median']:.2f}", "", ""),
        ("seconds to sit (median)", f"{sit['seconds_median']:.2f}", "4.92", ""),
        ("planted share (median / worst)", f"{sit['planted_share_median']:.2f} / {sit['planted_share_worst']:.2f}", "", "0.6"),
        (
            "slide while moving cm/s, with IK (median / worst)",
            f"{sit['slide_moving_cm_s_median']:.1f} / {sit['slide_moving_cm_s_worst']:.1f}",
            "",
            "15",
        ),
        ("slide while moving cm/s, network alone", f"{sit['network_slide_moving_cm_s_median']:.1f}", "", ""),
        ("foot sliding cm/s (median)", f"{sit['foot_sliding_cm_s_median']:.1f}", "", ""),
        ("top speed of the hips m/s (worst)", f"{sit['top_speed_m_s_worst']:.2f}", "", "2.2"),
        ("times seated per take (worst)", f"{sit['sit_count_worst']:.0f}", "", "1"),
        (
            "knee / elbow bent backward deg (worst)",
            f"{sit['knee_backward_deg_worst']:.1f} / {sit['elbow_backward_deg_worst']:.1f}",
            "",
            "0",
        ),
        ("largest turn of a joint per frame deg (worst)", f"{sit['turn_per_frame_deg_worst']:.0f}", "", ""),
        ("deepest penetration cm (median / worst)", f"{sit['penetration_cm_median']:.1f} / {sit['penetration_cm_worst']:.1f}", "", ""),
        ("share of frames deeper than 3 cm (median)", f"{sit['penetration_share_median']:.2f}", "", ""),
        ("idle to walk s", f"{result['idle to walk']['seconds_mean']:.2f}", "1.49", ""),
        ("ms per frame, one thread", f"{sit['ms_per_frame_median']:.1f}", "", "33.3"),
    ]
    if "sit, no bi-directional" in result:
        other = result["sit, no bi-directional"]
        rows.append(("sit PE cm without bi-directional control", f"{other['network_pe_cm_median']:.2f}", "4.27", ""))
        rows.append(("sit RE deg without bi-directional control", f"{other['network_re_deg_median']:.2f}", "1.58", ""))
        rows.append(("reached alone without bi-directional control", f"{other['within_10cm_10deg_alone']:.0%}", "", ""))
    lines = [f"| {sit['trials']:.0f} trials on seats not seen in training | ours | paper | aim |", "|---|---|---|---|"]
    return "\n".join(lines + ["| " + " | ".join(r) + " |" for r in rows])


def main(arguments: list[str]) -> int:
    """Entry of ``dev.py evaluate``."""
    parser = argparse.ArgumentParser(prog="evaluate", description="Measure the network on fixed sitting trials.")
    parser.add_argument("--weights", default=None, help="weights file (default: the shipped one)")
    parser.add_argument("--starts", type=int, default=10)
    parser.add_argument("--seats", type=int, default=len(SEATS))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--no-ablation", action="store_true", help="skip the runs without bi-directional control")
    parser.add_argument("--out", default="out/evaluation.json")
    a = parser.parse_args(arguments)
    result = evaluate(a.weights, a.starts, a.seats, a.workers, not a.no_ablation)
    print(table(result))
    path = Path(a.out)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(result, indent=1))
    except OSError as error:
        raise OutputError(f"Cannot write {path} ({error.strerror or error}); choose a folder you may write to.") from error
    print(f"Wrote {path}.")
    return 0
