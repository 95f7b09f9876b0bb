"""Table 3 of papers/002 on our layouts: the learnt planner, its rivals and its variants beside the paper's
values; and what the encoder's guess and the number of steps are worth.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from nsm_core.control.hand_plan import hand_scene, known_end, plan_way
from nsm_core.data.reaches.ways import HandTask
from nsm_core.model.inference.field_model import STEPS, FieldModel, load_fields
from nsm_core.model.networks.field_config import CONDITION
from nsm_core.model.networks.field_numpy import cells_of, seen_of
from nsm_core.rotations import Array
from nsm_core.world.planning.hand_fields import NEAREST
from nsm_core.world.scene.wrist import WristPose

from .hand_layouts import layouts
from .hand_rivals import a_star, fast_marching, minimum_jerk, straight
from .hand_ways import Judged, Planner, judge

DIFFUSION = "rival_diffusion.npz"  # the diffusion policy in a folder of rivals
LAYOUTS = 168  # as many as the paper's
WITHOUT = ("target", "obstacles")  # the two-channel networks, by the field that they lack
# Unsmoothness, safety distance in cm and success in % of the paper, plain and reshaped.
PAPER = {
    "planner": ((4.30, 8.66, 98.8), (4.85, 7.82, 95.8)),
    "minimum jerk": ((4.07, 7.64, 100.0), (5.01, 7.48, 96.4)),
    "diffusion": ((4.74, 6.88, 82.9), (5.55, 6.09, 71.9)),
    "planner without obstacles": ((4.21, 8.15, 97.6), (5.26, 7.34, 89.9)),
    "planner without target": ((4.32, 7.09, 91.7), (5.58, 5.74, 78.6)),
}


def learnt(model: FieldModel, steps: int = STEPS, guess: bool = True, keep_off: bool = True) -> Planner:
    """The learnt planner with its weights."""

    def plan(task: HandTask) -> Array | None:
        wrist = WristPose(task.to_own(task.wrist.place), task.rotation)
        like = known_end(wrist, task.laden)
        around = hand_scene(task.space, like, task.thing if task.laden else None)
        way = plan_way(model, around, task.condition, task.task, like, steps, guess, keep_off)
        return task.to_world(way.path) if way.arrived else None

    return plan


def planners(model: FieldModel, folder: Path | None) -> dict[str, Planner]:
    """All that are compared, by name; those learnt for comparison where ``folder`` has them."""
    found: dict[str, Planner] = {
        "planner": learnt(model),
        "planner as the paper goes": learnt(model, keep_off=False),
        "planner without descent": learnt(model, steps=1),
        "fast marching": fast_marching,
        "A*": a_star,
        "minimum jerk": minimum_jerk,
        "straight": straight,
    }
    if folder is None:
        return found
    for name, path in rival_paths(folder).items():
        if path.exists():
            found[f"planner without {name}" if name else "planner, as briefly learnt"] = learnt(
                load_fields(path)
            )
    if (folder / DIFFUSION).exists():
        found["diffusion"] = _diffusion(folder / DIFFUSION)
    return found


def rival_paths(folder: Path) -> dict[str, Path]:
    """Where networks that were learnt to compare lie, by the field that they lack ("": none)."""
    return {name: folder / f"rival_{name or 'whole'}.npz" for name in (*WITHOUT, "")}


def _diffusion(path: Path) -> Planner:
    from nsm_core.model.networks.way_diffusion import denoised, load_diffusion

    net = load_diffusion(path)

    def plan(task: HandTask) -> Array:
        cells = cells_of(task.space.target, task.space.obstacles, np.full(2, 1 / NEAREST))
        seen = seen_of(cells, task.condition, task.task, np.ones(CONDITION.size))
        return task.to_world(denoised(net, seen, task.to_own(task.wrist.place)))

    return plan


def tables(
    compared: dict[str, Planner], count: int, tell: Callable[[str], None]
) -> Iterator[tuple[str, str, Judged]]:
    """Judge all on so many layouts, plain and then reshaped; the set, the name and what was found of each."""
    for number, name in enumerate(("plain", "reshaped")):
        tasks = list(layouts(count, reshaped=bool(number)))
        tell(f"\n{len(tasks)} layouts, {name}; in brackets the paper's values, taken on other scenes\n")
        tell("| ways | acceleration, m/s2 | safety, cm | success, % | s |\n|---|---|---|---|---|")
        for who, planner in compared.items():
            judged = judge(planner, tasks)
            tell(_row(who, judged, PAPER.get(who, (None, None))[number]))
            yield name, who, judged


def descent(model: FieldModel, tasks: Sequence[HandTask], tell: Callable[[str], None]) -> None:
    """What steps from the encoder's guess, and from none, come to: fields' error, and ways."""
    tell("| begun at | steps | error | success, % | s |\n|---|---|---|---|---|")
    for guess in (True, False):
        for steps in (1, 5, 10, 20, 40, 100):
            judged = judge(learnt(model, steps, guess), tasks)
            error, begun = _error(model, tasks, steps, guess), "a guess" if guess else "chance"
            success = f"{100 * judged.success:.1f}"
            tell(f"| {begun} | {steps} | {error:.3f} | {success} | {judged.seconds:.2f} |")


def _error(model: FieldModel, tasks: Sequence[HandTask], steps: int, guess: bool) -> float:
    """Mean error of the known fields with the codes that are found."""
    errors = []
    for task in tasks:
        wrist = WristPose(task.to_own(task.wrist.place), task.rotation)
        around = hand_scene(task.space, known_end(wrist, task.laden), task.thing if task.laden else None)
        errors.append(
            min(model.find_code(around.known, task.condition, task.task, steps, guess=guess).errors)
        )
    return sum(errors) / len(errors)


def _row(name: str, judged: Judged, paper: tuple[float, float, float] | None) -> str:
    ours = judged.acceleration, 100 * judged.room, 100 * judged.success
    cells = [f"{a:.2f} ({b:.2f})" if paper else f"{a:.2f}" for a, b in zip(ours, paper or ours, strict=True)]
    return f"| {name} | " + " | ".join(cells) + f" | {judged.seconds:.2f} |"


__all__ = ["LAYOUTS", "descent", "DIFFUSION", "learnt", "planners", "rival_paths", "tables"]
