"""Train the networks of the comparison one after the other and judge them by the same trials."""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

from nsm_core.data.export import export
from nsm_core.errors import NsmError
from nsm_core.evaluation.comparison.entrants import ENTRANTS, Entrant
from nsm_core.evaluation.comparison.plots import draw_figures
from nsm_core.evaluation.comparison.tables import tables
from nsm_core.evaluation.comparison.trying import Job, blending_of, jobs_of, model_at, trials_of
from nsm_core.evaluation.pictures.sheets import sheet
from nsm_core.evaluation.report import held_back_pool, write_report
from nsm_core.evaluation.trials.suite import PARTS
from nsm_core.evaluation.trials.together import alone
from nsm_core.files import output
from nsm_core.model.inference.model import Model
from nsm_core.model.inference.network_of import network_of
from nsm_core.model.inference.weights_file import load_weights
from nsm_core.training.log import Log

from . import train


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core rivals``; the same command goes on where it was stopped."""
    parser = argparse.ArgumentParser(prog="rivals", description=__doc__)
    parser.add_argument("captures", help="folder with BVH captures")
    parser.add_argument("--objects", default=None, help="folder of furniture meshes")
    parser.add_argument("--run", default="runs/rivals", help="folder of everything that is made")
    parser.add_argument("--minutes", type=float, default=30.0, help="of training for each network")
    parser.add_argument("--steps", type=int, default=None, help="of training for each, in place of minutes")
    parser.add_argument("--data-minutes", type=float, default=260.0, help="of performances to train on")
    parser.add_argument("--data", default=None, help="folder of data that is composed already")
    parser.add_argument(
        "--only", default=",".join(ENTRANTS), help="who takes part, with commas: " + ", ".join(ENTRANTS)
    )
    parser.add_argument("--seeds", type=int, default=3, help="seeds of evaluation")
    parser.add_argument("--starts", type=int, default=10, help="sits and carries of a seed")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--device", default="cpu", help="where networks are trained")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--width", type=float, default=1.0, help="as in training: all alike")
    parser.add_argument("--fresh", type=float, default=None, help="as in training")
    parser.add_argument("--no-training", action="store_true", help="judge what is trained already")
    parser.add_argument("--no-evaluation", action="store_true", help="train alone")
    a = parser.parse_args(arguments)
    keys = [key.strip() for key in a.only.split(",") if key.strip()]
    if unknown := [key for key in keys if key not in ENTRANTS]:
        parser.error(f"there is no {', '.join(unknown)}; choose from {', '.join(ENTRANTS)}")
    run = Path(a.run)
    data = Path(a.data) if a.data else run / "data"
    if not (data / "data.json").exists():
        print(f"Composing {a.data_minutes:g} minutes of performances ...", flush=True)
        export(a.captures, data, a.data_minutes, meshes=a.objects, workers=a.workers)
    chosen = [ENTRANTS[key] for key in keys]
    if not a.no_training:
        for entrant in chosen:
            _train(entrant, a, run, data)
    if not a.no_evaluation:
        for entrant in chosen:
            _judge(entrant, a, run, data)
    _report(run)
    return 0


def _weights(entrant: Entrant, run: Path) -> Path:
    return run / f"{entrant.key}.npz"


def _train(entrant: Entrant, a: argparse.Namespace, run: Path, data: Path) -> None:
    """Train one, or go on with it; what is trained stands as a weights file that only a finished run
    writes.
    """
    if entrant.captured or _weights(entrant, run).exists():
        return
    print(f"\n{entrant.title}:", flush=True)
    given = [a.captures, "--run", str(run / entrant.key), "--weights", str(_weights(entrant, run))]
    given += ["--minutes", str(a.minutes)] if a.steps is None else ["--steps", str(a.steps)]
    given += ["--data-minutes", str(a.data_minutes)]
    given += ["--device", a.device, "--threads", str(a.threads), "--width", str(a.width)]
    given += ["--data", str(data)] if entrant.stitched else []
    given += ["--objects", a.objects] if a.objects else []
    given += ["--fresh", str(a.fresh)] if a.fresh is not None else []
    try:
        train.main([*given, *entrant.arguments])
    except NsmError as error:  # the others are trained all the same
        print(f"{entrant.title}: {error}", flush=True)


def _judge(entrant: Entrant, a: argparse.Namespace, run: Path, data: Path) -> None:
    """Run one's trials and write their figures, unless they are there."""
    path, made = data if entrant.captured else _weights(entrant, run), _figures(entrant, run)
    if made.exists() or not path.exists():
        return
    jobs = jobs_of(range(a.seeds), a.starts, held_back_pool(a.objects))

    def tell(done: int, of: int) -> None:
        print(f"\r{entrant.title}: {done} of {of} trials", end="", flush=True)

    trials = trials_of(str(path), entrant.key, jobs, a.workers, tell)
    print()
    _draw(entrant, model_at(str(path), entrant.key), jobs, run)
    write_report({**_about(entrant, path, run), "trials": trials}, made)


def _draw(entrant: Entrant, model: Model, jobs: list[Job], run: Path) -> None:
    """Sheets of the first sit and the first carry as the entrant alone does them, without the solver (as the
    pictures of the paper's Fig. 11).
    """
    for part in ("sit", "carry"):
        trial = next(t for _, p, t in jobs if p == part)
        more = {"contact_ik": False, "blending": blending_of(model)}
        try:
            take, report = alone(PARTS[part].run(model, trial, **more))
        except NsmError as error:
            print(f"{entrant.title}, {part}: {error}")
            continue
        request = PARTS[part].request
        assert request is not None
        title = f"{entrant.title}, {part}, {'reached' if report['reached'] else 'not reached'}, no solver"
        sheet(request(trial, **more), take, run / "figures" / f"{entrant.key}_{part}.png", title)


def _figures(entrant: Entrant, run: Path) -> Path:
    return run / "figures" / f"{entrant.key}.json"


def _about(entrant: Entrant, path: Path, run: Path) -> dict[str, Any]:
    if entrant.captured:
        return {"title": entrant.title}
    weights = load_weights(path)
    _, config = network_of(weights)
    rows = Log(run / entrant.key / "log.csv").rows()
    return {
        "title": entrant.title,
        "parameters": sum(math.prod(shape) for shape in config.parameter_shapes().values()),
        "minutes": weights.metadata["training"]["minutes"],
        "steps": weights.metadata["training"]["steps_done"],
        "validation": float(rows[-1, 4]) if len(rows) else None,
    }


def _report(run: Path) -> None:
    """Print and write the tables of all that has been judged, and draw the figures."""
    results = {
        key: json.loads(_figures(entrant, run).read_text(encoding="utf-8"))
        for key, entrant in ENTRANTS.items()
        if _figures(entrant, run).exists()
    }
    if not results:
        return
    text = tables(results)
    print(f"\n{text}")
    with output(run / "tables.md", "The tables") as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    for path in draw_figures(results, run):
        print(f"Wrote {path}.")
