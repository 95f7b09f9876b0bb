"""Ways of hands on disk: a file for each kitchen, so that making them may stop at any time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nsm_core import npz
from nsm_core.errors import CaptureError
from nsm_core.files import output
from nsm_core.model.networks.field_config import CONDITION, TASK
from nsm_core.rotations import Array
from nsm_core.world.planning.hand_fields import CELL, SIDE

from .ways import HandWay, ways_in

CELLS = round(SIDE / CELL)
LONGEST = 120  # frames of a way that are kept, the last ones
_NAMES = {name: "f" for name in ("target", "obstacles", "arrival", "path", "rotation")}
_NAMES |= {"condition": "f", "task": "f", "length": "i", "laden": "b"}


@dataclass(frozen=True)
class WayLibrary:
    """W ways: fields ``target``, ``obstacles``, ``arrival`` (W, N, N, N) in half precision; ``condition``
    (W, 4) of a way that is gone as it is stored, and ``task`` (W, 9), as ``field_config.TASK``; ``path``
    (W, LONGEST, 3) and ``rotation`` (W, 3, 3) of the wrist, its last ``length`` (W,) frames; ``laden`` (W,);
    and the ``kitchen`` (W,) of each.
    """

    target: Array
    obstacles: Array
    arrival: Array
    condition: Array
    task: Array
    path: Array
    rotation: Array
    length: Array
    laden: Array
    kitchen: Array

    def asked(self, rows: Array, backwards: Array, mirrored: Array) -> tuple[Array, Array]:
        """Conditions (S, 4) and tasks (S, 9) of ways ``rows`` (S,), float32.

        Of those gone ``backwards`` (S,) the condition alone is another: to take a hand away after placing is
        the way to pick, backwards, and to bring a thing the way to take it out.  Those ``mirrored`` (S,) have
        the X of their frame turned round, and are of the other hand.
        """
        condition = self.condition[rows].copy()
        condition[backwards, 2:] = 1 - condition[backwards, 2:]
        condition[mirrored, 1] = 1 - condition[mirrored, 1]
        task = self.task[rows].reshape(len(rows), -1, 3).copy()
        task[mirrored, :, 0] *= -1
        return condition, task.reshape(len(rows), -1)


def make_library(folder: Path, kitchens: int, things: int, tell: Callable[[str], None]) -> None:
    """Make the ways of so many kitchens, those that ``folder`` lacks."""
    folder.mkdir(parents=True, exist_ok=True)
    for seed in range(kitchens):
        path = folder / f"kitchen_{seed:04d}.npz"
        if path.exists():
            continue
        arrays = _stacked(list(ways_in(seed, things)))
        with output(path, "The ways") as temporary, open(temporary, "wb") as file:
            np.savez(file, **arrays)
        if seed % 10 == 9:
            tell(f"{seed + 1} of {kitchens} kitchens")


def load_library(folder: Path) -> WayLibrary:
    """Read all that ``make_library`` has made; CaptureError where there is nothing or something else."""
    parts = []
    for path in sorted(folder.glob("kitchen_*.npz")):
        try:
            arrays = npz.read_arrays(path, _NAMES, 1 << 30)
            if set(arrays) != set(_NAMES):
                raise ValueError("another format")
        except (OSError, ValueError, npz.DamagedArrays) as error:
            raise CaptureError(
                f"{path} holds no ways of hands ({error}); delete it to have them made again."
            ) from error
        arrays["kitchen"] = np.full(len(arrays["laden"]), int(path.stem[-4:]))
        parts.append(arrays)
    if not any(len(p["laden"]) for p in parts):
        raise CaptureError(f"{folder} holds no ways of hands; make some first.")
    return WayLibrary(**{name: np.concatenate([p[name] for p in parts]) for name in parts[0]})


def _stacked(ways: list[HandWay]) -> dict[str, Array]:
    paths = np.zeros((len(ways), LONGEST, 3), np.float32)
    for row, way in zip(paths, ways, strict=True):
        part = way.path[-LONGEST:]
        row[-len(part) :] = part
        row[: -len(part)] = part[0]

    def cells(name: str) -> Array:
        values = [getattr(way.fields, name) for way in ways]
        return np.array(values, np.float16).reshape(-1, *(CELLS,) * 3)

    return {
        "target": cells("target"),
        "obstacles": cells("obstacles"),
        "arrival": cells("arrival"),
        "condition": np.array([way.task.condition for way in ways], np.float32).reshape(-1, CONDITION.size),
        "task": np.array([way.task.task for way in ways], np.float32).reshape(-1, TASK.size),
        "path": paths,
        "rotation": np.array([way.task.rotation for way in ways], np.float32).reshape(-1, 3, 3),
        "length": np.array([min(len(way.path), LONGEST) for way in ways], np.int32),
        "laden": np.array([way.task.laden for way in ways], bool),
    }


__all__ = ["LONGEST", "WayLibrary", "load_library", "make_library"]
