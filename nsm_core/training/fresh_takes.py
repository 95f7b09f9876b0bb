"""Takes composed while the network learns, each as it was drawn and with its objects switched (papers/000
section 5.2).

A process of its own composes takes that the stored data does not hold, and shows each a second time on other
objects of the pool.  They pass through a ring of slots in memory, from which batches are drawn as from the
stored takes.
"""

from __future__ import annotations

import multiprocessing
import os
import queue
from dataclasses import dataclass
from typing import Any

import numpy as np

from nsm_core.data.augmentation.swap_objects import switched
from nsm_core.data.export import pool_of, take_arrays
from nsm_core.data.scenarios.composer import Composer, load
from nsm_core.data.storage import OBJECT_FIELDS, Dataset, empty_arrays
from nsm_core.errors import CaptureError
from nsm_core.rotations import Array
from nsm_core.threads import one_thread

SEEDS_APART = 1_000_000  # between the seeds of stored and of fresh takes
LONGEST, THINGS = 1400, 8  # frames and things of a take that a slot holds; what is longer is cut
_PATIENCE = 600.0  # seconds to wait for the first takes


@dataclass(frozen=True)
class FreshSettings:
    """How fresh takes are made: ``share`` of each batch that they fill (0 for none) and ``slots`` of the
    ring.
    """

    share: float = 0.25
    slots: int = 64


def both(composer: Composer, seed: int) -> list[dict[str, Array]]:
    """Arrays of the take of ``seed`` and of the same on other objects; fewer where the draw or the switch did
    not work out.
    """
    take = composer.compose(seed)
    if take is None:
        return []
    other = switched(take, composer.pool, seed)
    return [take_arrays(t) for t in (take, other) if t is not None]


def _compose_on(
    captures: str, meshes: str | None, cache: str, stitch: bool, seed: int, out: multiprocessing.Queue[Any]
) -> None:
    """The process: compose take after take from ``seed`` on until it is ended."""
    if hasattr(os, "nice"):
        os.nice(5)  # the network's steps come first
    composer = Composer(load(captures), pool=pool_of(meshes, cache), stitch=stitch)
    with one_thread():
        while True:
            for arrays in both(composer, seed):
                out.put(arrays)
            seed += 1


class Ring:
    """A data set of the newest takes: slots of equal size that are written one after the other."""

    def __init__(self, slots: int) -> None:
        self.slots, self.next, self.written = slots, 0, 0
        self.data = Dataset(empty_arrays(slots * LONGEST, slots * THINGS), np.zeros(0, np.int64))

    def write(self, arrays: dict[str, Array]) -> tuple[int, int]:
        """Put a take (``dataset.export.take_arrays``) into the next slot; returns the frames that it
        replaces, first to one past last.
        """
        first, thing = self.next * LONGEST, self.next * THINGS
        count, things = min(len(arrays["root"]), LONGEST), min(len(arrays["object_cells"]), THINGS)
        a = self.data.arrays
        for name, values in arrays.items():
            if name in OBJECT_FIELDS:
                a[name][thing : thing + things] = values[:things]
            else:
                a[name][first : first + count] = values[:count]
        which = arrays["object"][:count]
        a["object"][first : first + count] = np.where((which >= 0) & (which < things), which + thing, -1)
        a["start"][first : first + LONGEST] = first
        a["end"][first : first + LONGEST] = first + count
        self.next = (self.next + 1) % self.slots
        self.written += 1
        self.data = Dataset(a, Dataset.usable(a))
        return first, first + LONGEST


class FreshTakes:
    """The process and its ring.  Use ``poll`` between steps and ``close`` at the end."""

    def __init__(
        self, captures: str, meshes: str | None, cache: str, seed: int, slots: int, stitch: bool = True
    ) -> None:
        """``seed`` is that of the first take; ``cache`` the converted meshes.  Waits for the first takes;
        CaptureError without any.
        """
        context = multiprocessing.get_context("spawn")
        self.ring = Ring(slots)
        self._queue: multiprocessing.Queue[Any] = context.Queue(maxsize=4)
        arguments = (captures, meshes, cache, stitch, seed, self._queue)
        self._process = context.Process(target=_compose_on, args=arguments, daemon=True)
        self._process.start()
        while self.ring.written < min(8, slots):
            self.ring.write(self._first())

    def _first(self) -> dict[str, Array]:
        waited = 0.0
        while waited < _PATIENCE:
            try:
                return self._queue.get(timeout=1.0)
            except queue.Empty:
                waited += 1.0
                if not self._process.is_alive():
                    break
        self.close()
        raise CaptureError("no fresh take was composed; train with --fresh 0, on the stored takes alone.")

    def poll(self) -> tuple[int, int] | None:
        """Take in one new take if there is one; returns the frames of the ring that it has replaced.

        Raises CaptureError where the process has died.
        """
        try:
            return self.ring.write(self._queue.get_nowait())
        except queue.Empty:
            if self._process.is_alive():
                return None
            raise CaptureError(
                "the process that composes fresh takes has ended; run the same command again to go on."
            ) from None

    def close(self) -> None:
        """End the process."""
        self._process.terminate()
        self._process.join()
