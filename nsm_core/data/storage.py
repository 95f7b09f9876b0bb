"""Takes as arrays back to back, on disk or in memory: their fields, and the network's states cut out
of them.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.conventions import DT, STYLES
from nsm_core.distances import IDLE_PERIOD
from nsm_core.errors import CaptureError
from nsm_core.model.features.codec import SensorReading, no_object
from nsm_core.model.features.layout import CELLS, ENVIRONMENT
from nsm_core.model.features.meaning import Meaning, differences, sentence_part
from nsm_core.model.features.state import KEY_STEP, KEYS, WINDOW, State
from nsm_core.rotations import Array, rotate_planar
from nsm_core.validate import read_text, table, whole

MOST_ROWS = 1 << 31  # frames or objects

FIELDS: dict[str, tuple[tuple[int, ...], type]] = {
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
    "validates": ((), np.bool_),
    "start": ((), np.int64),
    "end": ((), np.int64),
}
OBJECT_FIELDS = ("object_cells", "object_occupancy")


def described(folder: str | Path) -> dict[str, Any]:
    """What ``data.json`` says of the arrays beside it, its numbers checked; CaptureError where it is missing
    or damaged.

    ``frames`` and ``objects`` count rows, ``stance`` is how the captures stand, ``meaning`` what was in force
    when the data were composed (data of older versions do not tell) and ``takes`` what each is made of.
    """
    path = Path(folder) / "data.json"
    if not path.is_file():
        raise CaptureError(f"{folder} holds no finished training data; compose it again.")
    try:
        meta = json.loads(read_text(path, CaptureError, "compose the data again"))
        table(meta, "data.json", CaptureError)
        for key in ("frames", "objects"):
            whole(meta.get(key), f"data.json: {key}", CaptureError, 0, MOST_ROWS)
        for key in ("stance", "meaning", "takes"):
            table(meta.get(key, {}), f"data.json: {key}", CaptureError)
    except (CaptureError, ValueError, RecursionError) as error:
        raise CaptureError(
            f"{folder} holds no finished training data (data.json is damaged); compose it again."
        ) from error
    return meta


def require_meaning(folder: str | Path) -> Meaning | None:
    """What the data in ``folder`` mean, None where they do not tell; CaptureError where this version composes
    other data.
    """
    told = described(folder).get("meaning")
    found = [*differences(told, "features"), *differences(told, "distances")]
    if found:
        raise CaptureError(
            f"{folder} holds training data composed with {sentence_part(found)}; compose it again in "
            "another folder."
        )
    return told


def empty_arrays(frames: int, objects: int) -> dict[str, Array]:
    """Zeros for so many frames and objects."""
    arrays: dict[str, Array] = {k: np.zeros((frames, *shape), dtype) for k, (shape, dtype) in FIELDS.items()}
    return {
        **arrays,
        "object_cells": np.zeros((objects, CELLS, 3), np.float32),
        "object_occupancy": np.zeros((objects, CELLS), np.float32),
    }


@dataclass(frozen=True)
class Dataset:
    """Arrays of N frames of takes back to back, memory-mapped; ``frames`` (n,) are those a state can be cut
    at.

    ``arrays["validates"]`` (N,) tells the frames of captured clips that are held back from training.
    """

    arrays: dict[str, Array]
    frames: Array

    @classmethod
    def open(cls, folder: str | Path) -> Dataset:
        """Open what ``export`` wrote, as a stream from the disk; CaptureError where it is incomplete."""
        folder = Path(folder)
        meta = described(folder)
        shapes = {k: ((meta["frames"], *s), d) for k, (s, d) in FIELDS.items()}
        shapes |= {
            "object_cells": ((meta["objects"], CELLS, 3), np.float32),
            "object_occupancy": ((meta["objects"], CELLS), np.float32),
        }
        for k, (s, d) in shapes.items():
            needs = math.prod(s) * np.dtype(d).itemsize
            if not (folder / f"{k}.bin").is_file() or (folder / f"{k}.bin").stat().st_size != needs:
                raise CaptureError(
                    f"{folder} holds training data that was cut short or is of another version ({k}.bin); "
                    "compose it again."
                )
        try:
            # Plain views of the maps: indexing a memmap object costs more than what it reads.
            arrays = {
                k: np.asarray(np.memmap(folder / f"{k}.bin", dtype=d, mode="r", shape=s))
                if s[0]
                else np.zeros(s, d)
                for k, (s, d) in shapes.items()
            }
        except (OSError, ValueError) as error:
            raise CaptureError(
                f"{folder} holds training data that cannot be read ({error}); compose it again."
            ) from error
        # What is drawn by index must not point elsewhere; the values themselves are too many to be read
        # before they are used.
        n, start, end, thing = np.arange(meta["frames"]), arrays["start"], arrays["end"], arrays["object"]
        if not (
            (start >= 0)
            & (start <= n)
            & (n < end)
            & (end <= meta["frames"])
            & (thing >= -1)
            & (thing < meta["objects"])
        ).all():
            raise CaptureError(
                f"{folder} holds training data whose takes or objects are not where they say; compose it "
                "again."
            )
        return cls(arrays, cls.usable(arrays))

    @staticmethod
    def usable(arrays: dict[str, Array]) -> Array:
        """Frames (n,) that have a second of their take ahead of them and of the frame after them."""
        n = np.arange(len(arrays["end"]))
        return n[arrays["end"] - n > WINDOW + 1]

    def state(self, frames: Array) -> State:
        """States (B) at ``frames`` (B,) of the takes (section 3.1)."""
        a = self.arrays
        start, end = a["start"][frames], a["end"][frames]
        past = np.maximum(frames[:, None] + np.arange(-WINDOW, 1), start[:, None])
        future = np.minimum(frames[:, None] + np.arange(1, KEYS // 2 + 1) * KEY_STEP, end[:, None] - 1)
        # Frames reached out of the take, counted at idle speed.
        before = np.arange(-WINDOW, 1)[None] + frames[:, None] - past
        return State(
            a["joint_position"][frames],
            a["joint_forward"][frames],
            a["joint_up"][frames],
            a["joint_velocity"][frames],
            a["root"][past],
            a["style"][past],
            (a["phase"][past] + before * DT / IDLE_PERIOD) % 1.0,
            a["root"][future],
            a["style"][future],
            a["phase"][future] % 1.0,
            a["goal_position"][frames],
            a["goal_heading"][frames],
            a["goal_action"][frames],
        )

    def surroundings(
        self, frames: Array, root: Array, drift: tuple[Array, Array] | None = None
    ) -> SensorReading:
        """What the sensors told at ``frames`` (B,); characters without an object get empty cells at ``root``
        (B, 3).

        ``drift``: how far characters have strayed from the takes, planar shifts (B, 2) and turns (B,); what
        they hold strays with them.
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
        return SensorReading(a["environment"][frames].astype(np.float32) / 255, cells, occupancy)
