"""Write composed takes, with what the sensors tell in each frame, as arrays to be memory-mapped."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from nsm_core.body.clip import MIRRORED
from nsm_core.conventions import INTERACTIONS
from nsm_core.distances import BOX_READS, SEAT_MEMORY
from nsm_core.errors import CaptureError
from nsm_core.files import output
from nsm_core.model.features.layout import CELLS, ENVIRONMENT
from nsm_core.model.features.meaning import meaning
from nsm_core.rotations import Array
from nsm_core.world.assets.pool import Pool
from nsm_core.world.scene.furniture import Furniture, cuboids
from nsm_core.world.sensors.environment import environment_sensor_many
from nsm_core.world.sensors.interaction import interaction_sensor

from .captures.folder import CaptureFolder
from .matching.selection import stance
from .scenarios.composer import Composer, load
from .scenarios.registry import drawn
from .scenarios.take import Annotated, ComposedTake, Piece, annotate, goal_tables
from .storage import FIELDS, OBJECT_FIELDS

_LEVEL = 0.01  # metres of the floor's height that are read at once
HELD_BACK_CLIPS = 20  # one clip in so many is kept for validation


def is_held_back(clip: str) -> bool:
    """Whether a clip, and its mirror image with it, is kept for validation: by the name of its file,
    wherever that lies, so that it is the same ones in all data.
    """
    name = clip.rsplit("/", 1)[-1].rstrip(MIRRORED)
    return int(hashlib.sha256(f"validates {name}".encode()).hexdigest(), 16) % HELD_BACK_CLIPS == 0


def _validates(take: ComposedTake) -> Array:
    """Which frames (T,) were captured in clips that are held back."""
    flags = [np.full(piece.frames, is_held_back(piece.clip)) for piece in take.provenance]
    return np.concatenate(flags) if flags else np.zeros(len(take), bool)


def _sensed(take: ComposedTake, annotated: Annotated) -> Array:
    """The sensed thing of each frame (T,), -1 for none: the command's, and after it until its action's label
    has faded.
    """
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


def _objects(take: ComposedTake, which: Array) -> tuple[Array, Array, Array, Array]:
    """Where the sensed thing's frame is (T, 4), whether the body holds it (T,), and all things' cells and
    occupancy, own frames.
    """
    poses, held = np.zeros((len(take), 4), np.float32), np.zeros(len(take), bool)
    cells, occupancy = (
        np.zeros((len(take.things), CELLS, 3), np.float32),
        np.zeros((len(take.things), CELLS), np.float32),
    )
    for n, thing in enumerate(take.things):
        f = thing.furniture
        volume = interaction_sensor(cuboids([(f, np.zeros(3), 0.0)]), f.centre, f.size, 0.0)
        cells[n] = volume.cells_world()
        # What is carried reads as a full box, as in takes (``props.Box.sensed``).
        occupancy[n] = BOX_READS if thing.held is not None and f.kind != "leaf" else volume.occupancy
        mine = which == n
        poses[mine] = thing.track(len(take))[mine]
        if thing.held is not None and f.kind != "leaf":  # a leaf stays on its hinge, however the body strays
            held[mine] = thing.held[mine]
    return poses, held, cells, occupancy


def _environment(take: ComposedTake, root: Array) -> Array:
    """Environment sensor (T, 1408) at roots (T, 3): what stands, and what moves where it is in each frame."""
    still = [(p.furniture, p.position, p.heading) for p in take.obstacles]
    still += [(t.furniture, t.poses[:3], float(t.poses[3])) for t in take.things if not t.moves]
    if take.level is None:
        values = environment_sensor_many(cuboids(still), root[:, :2], root[:, 2])
    else:
        values = _on_levels(take, take.level, still, root)
    for thing in take.things:
        if not thing.moves:
            continue
        change = np.flatnonzero(np.abs(np.diff(thing.poses, axis=0)).max(axis=1) > 1e-5) + 1
        for a, b in zip([0, *change], [*change, len(take)], strict=True):
            there = cuboids([(thing.furniture, thing.poses[a, :3], float(thing.poses[a, 3]))])
            near = slice(a, b) if take.level is None else _on_level_of(take.level, a, b)
            np.maximum(
                values[near], environment_sensor_many(there, root[near, :2], root[near, 2]), out=values[near]
            )
    return values


def _on_level_of(level: Array, first: int, end: int) -> slice:
    """Of the frames ``first`` to ``end`` those about their middle in which the floor stays as high."""
    middle = (first + end - 1) // 2
    off = np.flatnonzero(np.abs(level[first:end] - level[middle]) > 0.01) + first
    before, after = off[off < middle], off[off > middle]
    return slice(int(before[-1]) + 1 if len(before) else first, int(after[0]) if len(after) else end)


def _on_levels(
    take: ComposedTake, level: Array, still: list[tuple[Furniture, Array, float]], root: Array
) -> Array:
    """Environment sensor (T, 1408) of one whose floor rises and sinks, among pieces that stand on the floor
    of who comes nearest to them, and flights.
    """
    settled = np.flatnonzero(~take.rises())
    settled = settled if len(settled) else np.arange(len(take))
    solids = [(p.furniture, np.asarray(p.position), p.heading) for p in take.flights]
    for piece, position, heading in still:
        away = np.linalg.norm(root[settled, :2] - position[:2], axis=1)
        solids.append((piece, np.append(position[:2], level[settled[away.argmin()]]), heading))
    values = np.empty((len(take), ENVIRONMENT), np.float32)
    changes = np.flatnonzero(np.diff(np.round(level / _LEVEL))) + 1
    for a, b in zip([0, *changes], [*changes, len(take)], strict=True):
        down = np.array((0.0, 0.0, float(level[a:b].mean())))
        there = cuboids([(piece, place - down, heading) for piece, place, heading in solids])
        values[a:b] = environment_sensor_many(there, root[a:b, :2], root[a:b, 2])
    return values


def take_arrays(take: ComposedTake) -> dict[str, Array]:
    """All arrays of one take; frame indices count from its own start."""
    a = annotate(take)
    position, heading, action = goal_tables(take, a)
    which = _sensed(take, a)
    poses, held, cells, occupancy = _objects(take, which)
    count = len(take)
    return {
        **{
            k: getattr(a, k)
            for k in (
                "joint_position",
                "joint_forward",
                "joint_up",
                "joint_velocity",
                "root",
                "style",
                "phase",
                "contact",
            )
        },
        "goal_position": position,
        "goal_heading": heading,
        "goal_action": action,
        "environment": np.round(_environment(take, a.root) * 255).astype(np.uint8),
        "object": which,
        "object_pose": poses,
        "held": held,
        "validates": _validates(take),
        "start": np.zeros(count, np.int64),
        "end": np.full(count, count, np.int64),
        "object_cells": cells,
        "object_occupancy": occupancy,
    }


_composer: Composer | None = None


def _prepare(folder: str, objects: str | None, cache: str, stitch: bool) -> None:
    global _composer
    _composer = Composer(load(folder), pool=pool_of(objects, cache), stitch=stitch)


def pool_of(objects: str | None, cache: str) -> Pool | None:
    """The pieces that may be trained on; without a folder of meshes parametric ones alone."""
    return None if objects is None else Pool.load(objects, cache=cache).training()


def _one(seed: int) -> tuple[int, dict[str, Array], list[Piece]] | None:
    assert _composer is not None
    take = _composer.compose(seed)
    return None if take is None else (seed, take_arrays(take), take.provenance)


def export(
    captures: str,
    out: str | Path,
    minutes: float,
    seed: int = 0,
    workers: int = 2,
    progress: Callable[[int, int], None] | None = None,
    tell: Callable[[str], None] | None = None,
    meshes: str | None = None,
    stitch: bool = True,
) -> Path:
    """Compose takes until ``minutes`` of motion are there and write them below ``out``; returns the folder.

    ``meshes`` names a folder of furniture meshes (``dataset.pool``) that join the parametric pieces; those
    held back for testing are not used; ``stitch`` False leaves captured pieces by themselves.  The same seed
    gives the same data.  ``tell`` is called with every note on a capture that was read other than its file
    says.  Raises CaptureError where the capture folder is unusable.
    """
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    if not Path(captures).is_dir():
        raise CaptureError(f"{captures} is no folder; name the one with the captures.")
    index = CaptureFolder(captures)
    load(index)  # a damaged capture is told here, not as a broken pool of workers
    if tell is not None:
        for note in index.notes():
            tell(note)
    cache = str(out / "objects.npz")
    pool_of(meshes, cache)  # converted once, before the workers ask for it
    wanted, frames, objects = int(minutes * 1800), 0, 0
    files = {k: open(out / f"{k}.bin", "wb") for k in (*FIELDS, *OBJECT_FIELDS)}
    provenance = {}
    try:
        with ProcessPoolExecutor(
            workers, initializer=_prepare, initargs=(captures, meshes, cache, stitch)
        ) as pool:
            batch = seed
            while frames < wanted:
                for result in pool.map(_one, range(batch, batch + 16)):
                    if frames >= wanted:  # those that no worker has begun are dropped with the iterator
                        break
                    if result is None:
                        continue
                    number, arrays, pieces = result
                    provenance[number] = {"start": frames, "pieces": pieces}
                    arrays["object"] = np.where(arrays["object"] >= 0, arrays["object"] + objects, -1)
                    arrays["start"], arrays["end"] = arrays["start"] + frames, arrays["end"] + frames
                    frames += len(arrays["root"])
                    objects += len(arrays["object_cells"])
                    for k, (_, dtype) in FIELDS.items():
                        files[k].write(np.ascontiguousarray(arrays[k], dtype=dtype).tobytes())
                    for k in OBJECT_FIELDS:
                        files[k].write(np.ascontiguousarray(arrays[k], dtype=np.float32).tobytes())
                batch += 16
                if progress is not None:
                    progress(frames, wanted)
    finally:
        for f in files.values():
            f.close()
    with output(out / "data.json", "The training data") as temporary:  # what vouches for the arrays beside it
        about = {
            "frames": frames,
            "objects": objects,
            "seed": seed,
            "stance": stance(index),
            "meaning": meaning() | {"draws": drawn()},
        }
        temporary.write_text(json.dumps({**about, "takes": provenance}))
    return out


__all__ = ["export", "take_arrays"]
