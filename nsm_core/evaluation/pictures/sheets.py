"""Contact sheets of every action's first trials, from the side and from the front, with what moves where it
is.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.body.skeleton import forward_kinematics
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.errors import NsmError
from nsm_core.evaluation.trials.rollout import props_of
from nsm_core.evaluation.trials.suite import PARTS
from nsm_core.evaluation.trials.together import alone
from nsm_core.files import output
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.actions import BY_KEY
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.props import Prop

from .drawing import corners_of, pyplot
from .figures import figure_sheet, path_sheet

TILES, ROWS = 12, 3


def prop_corners(prop: Prop, poses: Array) -> Array:
    """Corners (T, M, 8, 3), world metres, of a prop's boxes where it has the pose ``poses`` (T, 4)."""
    corners = corners_of(prop.query) if isinstance(prop.query, Cuboids) else np.zeros((0, 8, 3))
    turned = rotate_planar(
        np.broadcast_to(corners, (len(poses), *corners.shape)), np.asarray(poses)[:, None, None, 3]
    )
    return turned + np.asarray(poses)[:, None, None, :3]


def moving_corners(asked: TakeRequest, take: TakeResult) -> Array | None:
    """Corners (T, M, 8, 3) of all props of a take, None where it has none."""
    parts = [
        prop_corners(prop, take.props[name]) for name, prop in props_of(asked).items() if name in take.props
    ]
    return np.concatenate(parts, axis=1) if parts else None


def sheet(asked: TakeRequest, take: TakeResult, path: Path, title: str, rows: int = ROWS) -> Path:
    """Draw one take from the side (above) and from the front (below) as one PNG; returns its path."""
    positions = forward_kinematics(take.hips_position, take.local_rotations)[0]
    still = asked.environment if isinstance(asked.environment, Cuboids) else None
    # Who carries looks another way at the box than at its place: seen from beside or before itself, wherever
    # it looks.
    camera = (
        "character"
        if any(BY_KEY[g.action].needs_destination for g in asked.goals)
        else float(_main(asked).heading)
    )
    images = []
    with tempfile.TemporaryDirectory() as folder:
        for view in ("side", "front"):
            part = Path(folder) / f"{view}.png"
            figure_sheet(
                positions,
                part,
                view=view,
                boxes=still,
                roots=take.root,
                title=f"{title}, {view}",
                tiles=TILES,
                rows=rows,
                camera=camera,
                contacts=take.contacts,
                moving=moving_corners(asked, take),
            )
            images.append(pyplot().imread(part))
    width = min(i.shape[1] for i in images)
    with output(path, "The picture") as temporary:
        pyplot().imsave(temporary, np.concatenate([i[:, :width] for i in images]), format="png")
    return path


def _main(asked: TakeRequest) -> Goal:
    """The goal that a take is about, the first at an object: who walks off from a seat is seen as the seat
    stands.
    """
    return next((g for g in asked.goals if BY_KEY[g.action].needs_object), asked.goals[-1])


def draw_sheets(
    model: Model, folder: str | Path, only: Sequence[str], pool: Any = None, most: int = 6
) -> list[Path]:
    """Roll out the first trial of each setting of the parts ``only`` (at most ``most`` each) and draw it;
    returns the paths.

    Beside every sheet lies a plan of the way.
    """
    made, folder = [], Path(folder)
    for name in only:
        part = PARTS[name]
        seen: set[Any] = set()
        if part.request is None:
            continue
        for trial in part.trials(1, pool):
            if trial.setting in seen or len(seen) >= most:
                continue
            seen.add(trial.setting)
            title = f"{name} {trial.setting}: {trial.name}"
            stem = (
                folder
                / f"{name}_{trial.setting}_{trial.name.replace(' ', '_').replace(',', '').replace('.', '')}"
            )
            try:
                asked = part.request(trial)
                take, report = alone(part.run(model, trial))
            except NsmError as error:
                print(f"{title}: {error}")
                continue
            made.append(
                sheet(
                    asked,
                    take,
                    stem.with_suffix(".png"),
                    f"{title}, {'reached' if report['reached'] else 'not reached'}",
                )
            )
            positions = forward_kinematics(take.hips_position, take.local_rotations)[0]
            goal = np.append(_main(asked).position[:2], _main(asked).heading)
            still = asked.environment if isinstance(asked.environment, Cuboids) else None
            path_sheet(
                positions,
                stem.with_name(stem.name + "_plan.png"),
                roots=take.root,
                boxes=still,
                goals=goal,
                title=title,
            )
            print(made[-1])
    return made
