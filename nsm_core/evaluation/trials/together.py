"""Trials rolled out side by side: every frame is one step of the network for all of them.

A trial is a generator that yields the take of which it wants a frame, is sent whether there was one, and
returns its figures.  What it raises, or its take does, is its own: the others go on.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from typing import TypeVar

from nsm_core.control.batch import step_together
from nsm_core.control.take import TakeRequest, TakeResult, TakeRunner
from nsm_core.conventions import FPS
from nsm_core.model.features.layout import Inputs
from nsm_core.model.inference.model import Model
from nsm_core.model.networks.config import Memory
from nsm_core.model.networks.protocol import Info
from nsm_core.rotations import Array

TOGETHER = 16  # takes that are stepped at once: by then the network's share of a frame hardly falls any more
LONGEST = 300.0  # seconds of a take

T = TypeVar("T")
Trying = Generator[TakeRunner, bool, T]


def rolled(model: Model, asked: TakeRequest, limit: float = LONGEST) -> Trying[TakeResult]:
    """Ask for a take's frames to its end, at most ``limit`` seconds; GoalError as of ``TakeRunner``."""
    runner = TakeRunner(model, asked)
    while runner.frames < limit * FPS and (yield runner):
        pass
    return runner.result()


def together(trials: Iterable[Trying[T]], most: int = TOGETHER) -> list[T | Exception]:
    """What each of ``trials`` returned, or the error that it broke off with, in their order.

    ``most`` of them go on at once; where one ends, the next begins.  Raises ValueError where they do not
    share one network.
    """
    outcomes: dict[int, T | Exception] = {}
    going: dict[int, tuple[Trying[T], TakeRunner]] = {}
    waiting = enumerate(trials)

    def resume(number: int, trial: Trying[T], ask: Callable[[], TakeRunner]) -> None:
        going.pop(number, None)
        try:
            going[number] = trial, ask()
        except StopIteration as end:
            outcomes[number] = end.value
        except Exception as error:  # any: a fault in one trial must not cost the others
            outcomes[number] = error

    while True:
        while len(going) < most and (following := next(waiting, None)) is not None:
            resume(*following, following[1].__next__)
        if not going:
            return [outcomes[number] for number in sorted(outcomes)]
        held = {number: _Held(runner) for number, (_, runner) in going.items()}
        went_on = step_together(tuple(held.values()))
        for (number, take), went in zip(held.items(), went_on, strict=True):
            trial, fault = going[number][0], take.fault
            if fault is None:
                resume(number, trial, lambda trial=trial, went=went: trial.send(went))  # type: ignore[misc]
            else:
                resume(number, trial, lambda trial=trial, fault=fault: trial.throw(fault))  # type: ignore[misc]


def told(outcome: T | Exception) -> T:
    """What a trial returned; raises what it broke off with."""
    if isinstance(outcome, Exception):
        raise outcome
    return outcome


def alone(trial: Trying[T]) -> T:
    """What a trial by itself returns; raises what it broke off with."""
    return told(together([trial])[0])


class _Held:
    """One frame of a take whose error is kept for its own trial instead of ending the step of all."""

    def __init__(self, take: TakeRunner) -> None:
        self.take, self.model, self.memory = take, take.model, take.memory
        self.fault: Exception | None = None

    def sense(self) -> Inputs[Array] | None:
        try:
            return self.take.sense()
        except Exception as error:
            self.fault = error
            return None

    def follow(self, outputs: Array, memory: Memory, info: Info, network_ms: float) -> None:
        try:
            self.take.follow(outputs, memory, info, network_ms)
        except Exception as error:
            self.fault = error

    def mend(self) -> bool:
        try:
            return self.fault is None and self.take.mend()
        except Exception as error:
            self.fault = error
            return False
