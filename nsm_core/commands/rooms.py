"""The benchmark of rooms: run them, one JSON line each, print the table and draw the worst; goes on where it
was stopped.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from nsm_core.body.skeleton import forward_kinematics
from nsm_core.evaluation.pictures.figures import path_sheet
from nsm_core.evaluation.pictures.sheets import sheet
from nsm_core.evaluation.report import held_back_pool
from nsm_core.evaluation.trials.room_goals import ACTIONS, ROOMS, badness, rooms_table, run_room
from nsm_core.evaluation.trials.together import TOGETHER, alone, together
from nsm_core.files import output
from nsm_core.model.inference.model import Model, load_model
from nsm_core.world.assets.pool import Pool
from nsm_core.world.geometry.distance import Cuboids


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core rooms``."""
    parser = argparse.ArgumentParser(prog="rooms", description="Try generated rooms, one goal each.")
    parser.add_argument("--weights", default=None, help="weights file (default: the shipped one)")
    parser.add_argument("--rooms", default=f"0:{ROOMS}", help="FIRST:LAST, the last one not included")
    parser.add_argument("--assets", default=None, help="folder of meshes whose held-back part furnishes them")
    parser.add_argument("--out", default="out/rooms", help="folder; rooms in its rooms.jsonl are not run")
    parser.add_argument("--worst", type=int, default=10, help="takes that are drawn")
    a = parser.parse_args(arguments)
    first, last = (int(n) for n in a.rooms.split(":"))
    out = Path(a.out)
    out.mkdir(parents=True, exist_ok=True)
    lines = out / "rooms.jsonl"
    known = _known(lines)
    model, pool = load_model(a.weights, backend="numpy"), held_back_pool(a.assets)
    left = [seed for seed in range(first, last) if seed not in known]
    for k in range(0, len(left), TOGETHER):
        seeds = left[k : k + TOGETHER]
        made = together(run_room(model, seed, pool) for seed in seeds)
        with lines.open("a", encoding="utf-8") as file:
            for seed, one in zip(seeds, made, strict=True):
                known[seed] = {"room": seed, "action": ACTIONS[seed % len(ACTIONS)], **_figures(one)}
                file.write(json.dumps(known[seed]) + "\n")
        print(f"\r{first + len(known)} of {last} rooms", end="", flush=True)
    chosen = {seed: known[seed] for seed in range(first, last)}
    text = rooms_table([(r["action"], _measured(r)) for r in chosen.values()])
    print(f"\n{text}")
    with output(out / "rooms.md", "The table") as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    for report in chosen.values():
        if report.get("error"):
            print(f"room {report['room']}: {report['error']}")
    worst = sorted((s for s, r in chosen.items() if not r.get("failed")), key=lambda s: -badness(chosen[s]))
    for place, seed in enumerate(worst[: a.worst]):
        _draw(model, seed, pool, out / f"worst_{place:02d}_room_{seed}.png")
    return 0


def _known(lines: Path) -> dict[int, dict[str, Any]]:
    """Rooms that have been run; half a line at the end is of a run that was stopped."""
    found = {}
    for line in lines.read_text(encoding="utf-8").splitlines() if lines.exists() else ():
        try:
            report = json.loads(line)
        except ValueError:
            continue
        found[report["room"]] = report
    return found


def _figures(one: Any) -> dict[str, Any]:
    """Figures of a take, plain; of one that broke off, why."""
    if isinstance(one, Exception):
        return {"failed": 1.0, "reached": 0.0, "success": 0.0, "error": f"{type(one).__name__}: {one}"}
    return {name: value if math.isfinite(value) else None for name, value in one[2].items()}


def _measured(report: dict[str, Any]) -> dict[str, Any]:
    """A room's figures without what names it."""
    return {name: value for name, value in report.items() if name not in ("room", "action")}


def _draw(model: Model, seed: int, pool: Pool | None, path: Path) -> None:
    """Make a take again and draw it from the side and the front, and its way beside it."""
    asked, take, report = alone(run_room(model, seed, pool))
    action = asked.goals[0].action
    title = (
        f"room {seed}: {action}, {'success' if report['success'] else 'no success'}, "
        f"{report['penetration_cm']:.0f} cm deep, {report['slide_moving_cm_s']:.0f} cm/s slide"
    )
    print(f"Wrote {sheet(asked, take, path, title)}.")
    still = asked.environment if isinstance(asked.environment, Cuboids) else None
    positions = forward_kinematics(take.hips_position, take.local_rotations)[0]
    path_sheet(positions, path.with_name(f"{path.stem}_plan.png"), roots=take.root, boxes=still, title=title)
