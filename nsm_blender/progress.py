"""How far a take is, told every few milliseconds, so that the window goes on while it is made."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import dataclass, field
from typing import TypeVar

import bpy
from mathutils import Matrix

from nsm_core.rotations import Array

from .world.beside import beside

_T = TypeVar("_T")


@dataclass
class Shown:
    """The newest frame of one of several characters, as ``Progress`` has that of one alone."""

    character: bpy.types.Object
    hips_world: Array
    local_rotations: Array
    moved: list[tuple[bpy.types.Object, Matrix]]


@dataclass
class Progress:
    """How far a take is: what is being done, 0..1 (below 0: nobody knows), and pose and moved objects of the
    newest frame where there is one.
    """

    stage: str
    fraction: float
    hips_world: Array | None = None  # (3,) Blender units
    local_rotations: Array | None = None  # (23, 4)
    # Objects and their world matrices.
    moved: list[tuple[bpy.types.Object, Matrix]] = field(default_factory=list)
    cast: list[Shown] = field(default_factory=list)  # of several characters, instead
    waits: bool = False  # a thread does the work: asking again at once only waits for it


def staged(
    stage: str, steps: Generator[float, None, _T], waits: bool = False
) -> Generator[Progress, None, _T]:
    """Progress of a stage from the share that its steps yield; their value."""
    with closing(steps):  # at once, not when nobody has them any more: they may put the frame back
        while True:
            try:
                share = next(steps)
            except StopIteration as stop:
                return stop.value
            yield Progress(stage, share, waits=waits)


def waited(stage: str, work: Callable[[Callable[[float], None]], _T]) -> Generator[Progress, None, _T]:
    """Progress of ``work`` that a thread does; its result."""
    return staged(stage, beside(work), waits=True)


def finish(steps: Generator[Progress, None, _T]) -> _T:
    """Run a take, or the part of one, to its end without showing anything; the value of its generator."""
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value
