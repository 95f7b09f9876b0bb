"""One take, from the scene to the keys: a generator that the panel, batch jobs and tests all drive."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Any

import bpy

from nsm_core.control.take import TakeRequest, TakeResult, TakeRunner
from nsm_core.control.timing import played_in_time, retimed, rounds
from nsm_core.conventions import FPS
from nsm_core.errors import GoalError
from nsm_core.model.features.meaning import remark
from nsm_core.model.inference import model as inference_model
from nsm_core.rotations import Array
from nsm_core.world.actions import require_learned

from .animation.kept import Kept, restored_on_failure
from .arrival import goals_at_rest, goals_on_arrival
from .begin import FILL, note_begin, others_of
from .fill.lead import led_in
from .goals.resolve import require_room_for
from .keys.fingers import key_fingers
from .keys.keyed import KeyedTake, forget_gone
from .keys.keying import end_things, key_take_steps, key_things
from .keys.layers import require_keyable
from .keys.objects import MovedObject
from .keys.report import build_report
from .keys.root_motion import require_root
from .keys.shown import look_at
from .network import load_network, shipped_model
from .overlays.kept import remember_take
from .prepare import TakeSpec, prepare, require_character
from .progress import Progress, finish, staged, waited
from .world.beside import beside
from .world.frame import WorldFrame

__all__ = [
    "Progress",
    "Take",
    "TakeSpec",
    "finish",
    "generate",
    "key_and_check",
    "prepare",
    "shipped_model",
]


@dataclass
class Take:
    """A finished take: its keys, its report, and the motion in the core's frame of the character."""

    keyed: KeyedTake
    report: dict[str, Any]
    result: TakeResult
    frame: WorldFrame


def generate(
    spec: TakeSpec, scene: bpy.types.Scene, model: inference_model.Model | None = None
) -> Generator[Progress, None, Take]:
    """Generate and key one take, yielding every few milliseconds; the generator's value is the Take.

    Nothing in the file changes before the keys are made, but for the current frame, which is put back.
    Raises SkeletonError, GoalError, GeometryError and WeightsError with a sentence for the animator.
    """
    if spec.begin == FILL:
        return (yield from led_in(spec, scene, lambda spec: generate(spec, scene, model)))
    require_character(spec.character, scene)
    require_keyable(spec.character)
    require_root(spec.character, spec.root_motion)
    loading = load_network() if model is None else None
    request, frame, things = yield from prepare(spec, scene)
    for goal in request.goals:
        require_room_for(goal, request.environment)
    if loading is not None:
        model = yield from waited("Loading the network", lambda _: loading.join() or shipped_model())
    require_learned((goal.action for goal in request.goals), model.metadata)
    request, result = yield from _performed(spec, scene, model, request, frame, things)
    told = remark(model.metadata)  # before the keys: from then on nothing may fail any more
    yield Progress("Keying", 1.0)
    take = yield from key_and_check(spec, scene, request, result, frame, things)
    take.report["warnings"] += told
    return take


def key_and_check(
    spec: TakeSpec,
    scene: bpy.types.Scene,
    request: TakeRequest,
    result: TakeResult,
    frame: WorldFrame,
    things: dict[str, MovedObject],
    tracks: dict[str, Array] | None = None,
) -> Generator[Progress, None, Take]:
    """Key a finished motion, look at what the scene shows of it, and report: all or nothing, whatever is
    raised or closed.

    ``tracks`` are the poses (T, 4) of those things alone that are keyed with it, by their props' names; None:
    all, as ``result`` has them.
    """
    keep = request.start is not None or spec.lead > 0
    before = others_of(spec.character, scene) if keep else []
    with restored_on_failure(Kept(scene, [spec.character, *(t.object for t in things.values()), *before])):
        begin, title, hips = time.perf_counter(), spec.title(), frame.to_world(result.hips_position)
        steps = key_take_steps(
            spec.character,
            hips,
            result.local_rotations,
            spec.start_frame,
            FPS,
            title,
            scene,
            keep,
            spec.style(),
        )
        keyed = yield from staged("Making keys", steps)
        tracks = result.props if tracks is None else tracks
        moved = [(thing, tracks[thing.prop]) for thing in things.values() if thing.prop in tracks]
        yield from staged("Making keys", key_things(keyed, moved, FPS, title, scene, keep, spec.style()))
        key_fingers(keyed, result)
        if keep:
            end_things(keyed, before, title)
        stood = None if keep else (request.start_position, request.start_heading)
        note_begin(keyed, scene, frame, stood)
        keying_ms = (time.perf_counter() - begin) * 1000 / max(len(result.hips_position), 1)
        seen = yield from staged("Checking", look_at(keyed, result, frame, things, scene))
        report = yield from waited(
            "Checking", lambda _: build_report(title, result, seen, keyed, request, keying_ms)
        )
        remember_take(keyed, spec.start_frame, request, result, frame)
        forget_gone(keyed)
        return Take(keyed, report, result, frame)


def _performed(
    spec: TakeSpec,
    scene: bpy.types.Scene,
    model: inference_model.Model,
    request: TakeRequest,
    frame: WorldFrame,
    things: dict[str, MovedObject],
) -> Generator[Progress, None, tuple[TakeRequest, TakeResult]]:
    """Perform a take; anew where a goal's thing was elsewhere by then, or a goal is to be reached at another
    time.  The request as it was performed at last, and the result.
    """
    sought: dict[int, int] = {}
    request = replace(request, goals=(yield from goals_at_rest(spec, scene, frame, request, sought)))
    for number in range(rounds(request.goals) + 2 * len(request.movers) + 1):
        asked = request
        runner = yield from waited("Planning the ways", lambda _, asked=asked: TakeRunner(model, asked))
        yield from _growing("Fitting the times" if number else "Generating", runner, frame, things)
        results = runner.results
        goals = yield from goals_on_arrival(spec, scene, frame, request, results, sought)
        goals = retimed(request.goals, results) if goals is None else goals
        if goals is None:
            break
        request = replace(request, goals=goals)
    result = yield from waited("Solving", lambda _: runner.result())
    return asked, played_in_time(result, asked.goals)


def _growing(
    stage: str, runner: TakeRunner, frame: WorldFrame, things: dict[str, MovedObject]
) -> Generator[Progress, None, None]:
    """Progress of a motion that grows in a thread, as fast as it can, however long the window takes to
    draw.
    """
    newest: deque[tuple[float, Array, Array, dict[str, Array]]] = deque(maxlen=1)

    def grow(tell: Callable[[float], None]) -> None:
        while not runner.director.done and _step(runner):
            newest.append((min(runner.progress, 1.0), *runner.pose(), runner.prop_poses()))
            tell(runner.progress)

    steps, progress = beside(grow), Progress(stage, 0.0, waits=True)
    while True:
        try:
            next(steps)
        except StopIteration:
            return
        if newest:
            fraction, hips, rotations, poses = newest.pop()
            moved = [(thing.object, thing.world_at(poses[thing.prop])) for thing in things.values()]
            progress = Progress(stage, fraction, frame.to_world(hips), rotations, moved, waits=True)
        yield progress


def _step(runner: TakeRunner) -> bool:
    """Step a take; a goal that cannot be reached is named in the error."""
    try:
        return runner.step()
    except GoalError as error:
        name = runner.director.goals[max(runner.director.index, 0)].name
        raise GoalError(f"{name}: {error}") from error
