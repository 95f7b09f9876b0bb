"""Write composed takes as memory-mapped arrays, and cut network states out of them."""

from __future__ import annotations

import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..control.goals import SEAT_MEMORY
from ..conventions import DT, INTERACTIONS, STYLES
from ..errors import CaptureError
from ..features import CELLS, ENVIRONMENT, Surroundings, no_object
from ..furniture import cuboids
from ..rotations import Array, rotate_planar
from ..sensors.cuboid import interaction_sensor
from ..sensors.cylinder import environment_sensor_many
from ..series import KEY_STEP, KEYS, WINDOW, State
from .compose import Composer, load
from .library import stance
from .pool import Pool
from .take import Annotated, Take, annotate, goal_tables

_FIELDS: dict[str, tuple[tuple[int, ...], type]] = {
    "joint_position": ((23, 3), np.float32),
    "joint_forward": ((23, 3), np.float32),
    "joint_up": ((23, 3), np.float32),
    "joint_velocity": ((23, 3), np.float32),
    "root": ((3,), np.float32),
    "style": ((len(STYLES),), np.float32),
    "phase": ((), np.float32),
    "contact": ((5,), np.float32),
    "goal_position": ((KEYS, 3), np.float32),
    "goal_heading": ((KEYS,), np.float32),
    "goal_action": ((KEYS, 6), np.float32),
    "environment": ((ENVIRONMENT,), np.uint8),
    "object": ((), np.int32),
    "object_pose": ((4,), np.float32),
    "held": ((), np.bool_),
    "start": ((), np.int64),
    "end": ((), np.int64),
}
_OBJECT_FIELDS = ("object_cells", "object_occupancy")


def _sensed(take: Take, annotated: Annotated) -> Array:
    """The sensed thing of each frame (T,), -1 for none: the command's, and after it until its action's label has faded."""
    which = np.full(len(take), -1, np.int32)
    label = annotated.style[:, INTERACTIONS].max(axis=1)
    last = -1
    for t in range(len(take)):
        command = take.commands[annotated.command[t]]
        if command.thing >= 0:
            last = command.thing
        elif label[t] <= SEAT_MEMORY:
            last = -1
        which[t] = last
    return which


def _objects(take: Take, which: Array) -> tuple[Array, Array, Array, Array]:
    """Where the sensed thing's frame is (T, 4), whether the body holds it (T,), and all things' cells and occupancy, own frames."""
    poses, held = np.zeros((len(take), 4), np.float32), np.zeros(len(take), bool)
    cells, occupancy = np.zeros((len(take.things), CELLS, 3), np.float32), np.zeros((len(take.things), CELLS), np.float32)
    for n, thing in enumerate(take.things):
        f = thing.furniture
        volume = interaction_sensor(cuboids([(f, np.zeros(3), 0.0)]), f.centre, f.size, 0.0)
        cells[n] = volume.cells_world()
        # What is carried reads as a full box, as in takes (``props.Box.sensed``).
        occupancy[n] = 1 if thing.held is not None and f.kind != "leaf" else volume.occupancy
        mine = which == n
        poses[mine] = thing.track(len(take))[mine]
        if thing.held is not None and f.kind != "leaf":  # a leaf stays on its hinge, however the body strays
            held[mine] = thing.held[mine]
    return poses, held, cells, occupancy


def _environment(take: Take, root: Array) -> Array:
    """Environment sensor (T, 1408) at roots (T, 3): what stands, and what moves where it is in each frame."""
    still = [(p.furniture, p.position, p.heading) for p in take.obstacles]
    still += [(t.furniture, t.poses[:3], float(t.poses[3])) for t in take.things if not t.moves]
    values = environment_sensor_many(cuboids(still), root[:, :2], root[:, 2])
    for thing in take.things:
        if not thing.moves:
            continue
        change = np.flatnonzero(np.abs(np.diff(thing.poses, axis=0)).max(axis=1) > 1e-5) + 1
        for a, b in zip([0, *change], [*change, len(take)], strict=True):
            there = cuboids([(thing.furniture, thing.poses[a, :3], float(thing.poses[a, 3]))])
            np.maximum(values[a:b], environment_sensor_many(there, root[a:b, :2], root[a:b, 2]), out=values[a:b])
    return values


def take_arrays(take: Take) -> dict[str, Array]:
    """All arrays of one take; frame indices count from its own start."""
    a = annotate(take)
    position, heading, action = goal_tables(take, a)
    which = _sensed(take, a)
    poses, held, cells, occupancy = _objects(take, which)
    count = len(take)
    return {
        **{
            k: getattr(a, k) for k in ("joint_position", "joint_forward", "joint_up", "joint_velocity", "root", "style", "phase", "contact")
        },
        "goal_position": position,
        "goal_heading": heading,
        "goal_action": action,
        "environment": np.round(_environment(take, a.root) * 255).astype(np.uint8),
        "object": which,
        "object_pose": poses,
        "held": held,
        "start": np.zeros(count, np.int64),
        "end": np.full(count, count, np.int64),
        "object_cells": cells,
        "object_occupancy": occupancy,
    }


_composer: Composer | None = None


def _prepare(folder: str, objects: str | None, cache: str) -> None:
    global _composer
    _composer = Composer(load(folder), pool=_pool(objects, cache))


def _pool(objects: str | None, cache: str) -> Pool | None:
    """The pieces that may be trained on; without a folder of meshes parametric ones alone."""
    return None if objects is None else Pool.load(objects, cache=cache).training()


def _one(seed: int) -> tuple[int, dict[str, Array], list[tuple[str, int, int]]] | None:
    assert _composer is not None
    take = _composer.compose(seed)
    return None if take is None else (seed, take_arrays(take), take.provenance)


def export(
    captures: str,
    out: str | Path,
    minutes: float,
    seed: int = 0,
    workers: int = 2,
    progress: object = None,
    meshes: str | None = None,
) -> Path:
    """Compose takes until ``minutes`` of motion are there and write them below ``out``; returns the folder.

    ``meshes`` names a folder of furniture meshes (``dataset.pool``) that join the parametric pieces; those held back for
    testing are not used.  The same seed gives the same data.  Raises CaptureError where the capture folder is unusable.
    """
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    if not Path(captures).is_dir():
        raise CaptureError(f"{captures} is no folder; name the one with the captures.")
    load(captures)  # a damaged capture is told here, not as a broken pool of workers
    cache = str(out / "objects.npz")
    _pool(meshes, cache)  # converted once, before the workers ask for it
    wanted, frames, objects = int(minutes * 1800), 0, 0
    files = {k: open(out / f"{k}.bin", "wb") for k in (*_FIELDS, *_OBJECT_FIELDS)}
    provenance = {}
    try:
        with ProcessPoolExecutor(workers, initializer=_prepare, initargs=(captures, meshes, cache)) as pool:
            batch = seed
            while frames < wanted:
                for result in pool.map(_one, range(batch, batch + 16), chunksize=2):
                    if result is None or frames >= wanted:
                        continue
                    number, arrays, pieces = result
                    provenance[number] = {"start": frames, "pieces": pieces}
                    arrays["object"] = np.where(arrays["object"] >= 0, arrays["object"] + objects, -1)
                    arrays["start"], arrays["end"] = arrays["start"] + frames, arrays["end"] + frames
                    frames += len(arrays["root"])
                    objects += len(arrays["object_cells"])
                    for k, (_, dtype) in _FIELDS.items():
                        files[k].write(np.ascontiguousarray(arrays[k], dtype=dtype).tobytes())
                    for k in _OBJECT_FIELDS:
                        files[k].write(np.ascontiguousarray(arrays[k], dtype=np.float32).tobytes())
                batch += 16
                if callable(progress):
                    progress(frames, wanted)
    finally:
        for f in files.values():
            f.close()
    (out / "data.json").write_text(
        json.dumps({"frames": frames, "objects": objects, "seed": seed, "stance": stance(captures), "takes": provenance})
    )
    return out


@dataclass(frozen=True)
class Dataset:
    """Arrays of N frames of takes back to back, memory-mapped; ``frames`` (n,) are those a state can be cut at."""

    arrays: dict[str, Array]
    frames: Array

    @classmethod
    def open(cls, folder: str | Path, in_memory: bool = True) -> Dataset:
        """Open what ``export`` wrote; CaptureError where it is incomplete."""
        folder = Path(folder)
        try:
            meta = json.loads((folder / "data.json").read_text())
        except (OSError, ValueError) as error:
            raise CaptureError(f"{folder} holds no finished training data; compose it again.") from error
        shapes = {k: ((meta["frames"], *s), d) for k, (s, d) in _FIELDS.items()}
        shapes |= {"object_cells": ((meta["objects"], CELLS, 3), np.float32), "object_occupancy": ((meta["objects"], CELLS), np.float32)}
        arrays = {
            k: np.memmap(folder / f"{k}.bin", dtype=d, mode="r", shape=s) if s[0] else np.zeros(s, d) for k, (s, d) in shapes.items()
        }
        if in_memory:
            arrays = {k: np.array(v) for k, v in arrays.items()}
        n = np.arange(meta["frames"])
        return cls(arrays, n[(arrays["end"] - n > WINDOW + 1)])

    def state(self, frames: Array) -> State:
        """States (B) at ``frames`` (B,) of the takes (section 3.1)."""
        a = self.arrays
        start, end = a["start"][frames], a["end"][frames]
        past = np.maximum(frames[:, None] + np.arange(-WINDOW, 1), start[:, None])
        future = np.minimum(frames[:, None] + np.arange(1, KEYS // 2 + 1) * KEY_STEP, end[:, None] - 1)
        before = np.arange(-WINDOW, 1)[None] + frames[:, None] - past  # frames reached out of the take, counted at idle speed
        return State(
            a["joint_position"][frames],
            a["joint_forward"][frames],
            a["joint_up"][frames],
            a["joint_velocity"][frames],
            a["root"][past],
            a["style"][past],
            (a["phase"][past] + before * DT) % 1.0,
            a["root"][future],
            a["style"][future],
            a["phase"][future] % 1.0,
            a["goal_position"][frames],
            a["goal_heading"][frames],
            a["goal_action"][frames],
        )

    def surroundings(self, frames: Array, root: Array, drift: tuple[Array, Array] | None = None) -> Surroundings:
        """What the sensors told at ``frames`` (B,); characters without an object get empty cells at ``root`` (B, 3).

        ``drift``: how far characters have strayed from the takes, planar shifts (B, 2) and turns (B,); what they hold strays
        with them.
        """
        a = self.arrays
        cells, occupancy = no_object(root)
        which = a["object"][frames]
        has = np.flatnonzero(which >= 0)
        poses = a["object_pose"][frames[has]]
        if drift is not None:
            held = np.flatnonzero(a["held"][frames[has]])
            rows = has[held]
            true = a["root"][frames[rows]]
            about = rotate_planar(poses[held, :2] - true[:, :2], drift[1][rows])
            poses[held, :2] = true[:, :2] + about + drift[0][rows]
            poses[held, 3] += drift[1][rows]
        local = a["object_cells"][which[has]]
        cells[has] = rotate_planar(local, poses[:, None, 3]) + poses[:, None, :3]
        occupancy[has] = a["object_occupancy"][which[has]]
        return Surroundings(a["environment"][frames].astype(np.float32) / 255, cells, occupancy)


__all__ = ["Dataset", "export", "take_arrays"]
