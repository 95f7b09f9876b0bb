"""Scenes of several characters: run them, one JSON line each, and print the table; goes on where it was
stopped.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from nsm_core.evaluation.trials.crowd import COUNTS, SCENES, figures, run_scene
from nsm_core.model.inference.model import load_model


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core crowd``."""
    parser = argparse.ArgumentParser(prog="crowd", description="Try scenes of several characters.")
    parser.add_argument("--weights", default=None, help="weights file (default: the shipped one)")
    parser.add_argument("--scenes", default=f"0:{SCENES}", help="FIRST:LAST, the last one not included")
    parser.add_argument("--out", default="out/crowd.jsonl", help="one line a scene; those in it are not run")
    a = parser.parse_args(arguments)
    first, last = (int(n) for n in a.scenes.split(":"))
    out = Path(a.out)
    out.parent.mkdir(parents=True, exist_ok=True)
    lines = out.read_text(encoding="utf-8").splitlines() if out.exists() else []
    known = {r["scene"]: r for r in map(json.loads, lines)}
    model = load_model(a.weights, backend="numpy")
    for number in range(first, last):
        if number not in known:
            report = known[number] = run_scene(model, number)
            with out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(report) + "\n")
            print(f"{number}: {report.get('error') or _line(report)}", flush=True)
    for count in (*COUNTS, 0):
        chosen = [r for r in known.values() if not count or r["characters"] == count]
        print(
            f"{count or 'all'} characters: " + ", ".join(f"{k} {v:.4g}" for k, v in figures(chosen).items())
        )
    return 0


def _line(report: dict[str, object]) -> str:
    goals = report["goals"]
    assert isinstance(goals, list)
    missed = "; ".join(
        f"{g['who']} {g['action']}: {g['reason'] or 'no time'}" for g in goals if not g["reached"]
    )
    return (
        f"{report['kind']}, {report['characters']} characters, {len(goals)} goals, "
        f"deepest {report['deepest_cm']:.1f} cm, {report['ms_per_frame']:.0f} ms a frame"
        + (f", not reached: {missed}" if missed else "")
    )
