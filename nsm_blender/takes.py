"""One take, from the scene to the keys: a generator that the panel, batch jobs and tests all drive."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, TypeVar

import bpy
import numpy as np
from mathutils import Matrix

from nsm_core.control.actions.door_grasp import require_room
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult, TakeRunner
from nsm_core.conventions import FPS
from nsm_core.errors import GoalError, NsmError, SkeletonError
from nsm_core.model.features.meaning import remark
from nsm_core.model.inference import model as inference_model
from nsm_core.rotations import Array
from nsm_core.world.actions import require_learned
from nsm_core.world.scene.props import Leaf

from .animation.kept import Kept, SceneState, restored_on_failure
from .goals.resolve import make_goal_point, moved_by, place_after, require_possible, resolve, sought
from .goals.spec import GoalSpec
from .keys.keying import KeyedTake, key_take_steps, key_things
from .keys.layers import require_keyable
from .keys.objects import MovedObject, require_movable, rides_along
from .keys.report import build_report
from .keys.shown import look_at
from .rigs.armature import read_pose, require_skeleton
from .world.beside import beside
from .world.evaluated import Snapshot
from .world.frame import WorldFrame, holds
from .world.ground import floor_under
from .world.surroundings import Surroundings

_T = TypeVar("_T")


@dataclass
class TakeSpec:
    """What to generate: goals for a character, where the keys start, and with which chance numbers."""

    character: bpy.types.Object
    goals: list[GoalSpec]
    name: str = ""
    start_frame: int = 1
    seed: int = 0
    contact_ik: bool = True

    def title(self) -> str:
        """Name of the take and of its action: as asked for, else after its goals."""
        return self.name or ", ".join(f"{g.action} {g.label}" for g in self.goals[:3])


@dataclass
class Progress:
    """How far a take is: what is being done, 0..1, and pose and moved objects of the newest frame where there
    is one.
    """

    stage: str
    fraction: float
    hips_world: Array | None = None  # (3,) Blender units
    local_rotations: Array | None = None  # (23, 4)
    # Objects and their world matrices.
    moved: list[tuple[bpy.types.Object, Matrix]] = field(default_factory=list)
    waits: bool = False  # a thread does the work: asking again at once only waits for it


@dataclass
class Take:
    """A finished take: its keys, its report, and the motion in the core's frame of the character."""

    keyed: KeyedTake
    report: dict[str, Any]
    result: TakeResult
    frame: WorldFrame


@lru_cache(maxsize=2)
def shipped_model(path: str | None = None) -> inference_model.Model:
    """Load the bundled network, once per session; WeightsError says what to do when it is missing."""
    return inference_model.load_model(path)


def _loading() -> threading.Thread:
    """Have the bundled network loaded while the scene is read; what goes wrong is told where the network is
    needed.
    """

    def load() -> None:
        with suppress(NsmError):
            shipped_model()

    thread = threading.Thread(target=load, daemon=True)
    thread.start()
    return thread


def generate(
    spec: TakeSpec, scene: bpy.types.Scene, model: inference_model.Model | None = None
) -> Generator[Progress, None, Take]:
    """Generate and key one take, yielding every few milliseconds; the generator's value is the Take.

    Nothing in the file changes before the keys are made, but for the current frame, which is put back.
    Raises SkeletonError, GoalError, GeometryError and WeightsError with a sentence for the animator.
    """
    require_character(spec.character, scene)
    require_keyable(spec.character)
    loading = _loading() if model is None else None
    request, frame, things = yield from prepare(spec, scene)
    for goal in request.goals:
        if isinstance(goal.prop, Leaf):
            require_room(goal.prop, request.environment)
    if loading is not None:
        model = yield from _waited("Loading the network", lambda _: loading.join() or shipped_model())
    require_learned((goal.action for goal in request.goals), model.metadata)
    runner = yield from _waited("Planning the ways", lambda _: TakeRunner(model, request))
    result = yield from _growing(runner, frame, things)
    yield Progress("Keying", 1.0)
    take = yield from key_and_check(spec, scene, request, result, frame, things)
    take.report["warnings"] += remark(model.metadata)
    return take


def key_and_check(
    spec: TakeSpec,
    scene: bpy.types.Scene,
    request: TakeRequest,
    result: TakeResult,
    frame: WorldFrame,
    things: dict[str, MovedObject],
) -> Generator[Progress, None, Take]:
    """Key a finished motion, look at what the scene shows of it, and report: all or nothing, whatever is
    raised or closed.
    """
    with restored_on_failure(Kept(scene, [spec.character, *(thing.object for thing in things.values())])):
        begin, title, hips = time.perf_counter(), spec.title(), frame.to_world(result.hips_position)
        steps = key_take_steps(
            spec.character, hips, result.local_rotations, spec.start_frame, FPS, title, scene
        )
        keyed = yield from _shown("Making keys", steps)
        moved = [(thing, result.props[thing.prop]) for thing in things.values()]
        yield from _shown("Making keys", key_things(keyed, moved, FPS, title, scene))
        keying_ms = (time.perf_counter() - begin) * 1000 / max(len(result.hips_position), 1)
        shown = yield from _shown("Checking", look_at(keyed, result, frame, things, scene))
        report = yield from _waited(
            "Checking", lambda _: build_report(title, result, shown, keyed, request, keying_ms)
        )
        return Take(keyed, report, result, frame)


def _shown(
    stage: str, steps: Generator[float, None, _T], waits: bool = False
) -> Generator[Progress, None, _T]:
    """Progress of a stage from the share that its steps yield; their value."""
    while True:
        try:
            share = next(steps)
        except StopIteration as stop:
            return stop.value
        yield Progress(stage, share, waits=waits)


def _waited(stage: str, work: Callable[[Callable[[float], None]], _T]) -> Generator[Progress, None, _T]:
    """Progress of ``work`` that a thread does; its result."""
    return _shown(stage, beside(work), waits=True)


def _growing(
    runner: TakeRunner, frame: WorldFrame, things: dict[str, MovedObject]
) -> Generator[Progress, None, TakeResult]:
    """Progress of a motion that grows in a thread, as fast as it can, however long the window takes to draw;
    its result.
    """
    newest: deque[tuple[float, Array, Array, dict[str, Array]]] = deque(maxlen=1)

    def grow(tell: Callable[[float], None]) -> TakeResult:
        while _step(runner):
            newest.append((min(runner.progress, 1.0), *runner.pose(), runner.prop_poses()))
            tell(runner.progress)
        return runner.result()

    steps, progress = beside(grow), Progress("Generating", 0.0, waits=True)
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value
        if newest:
            fraction, hips, rotations, poses = newest.pop()
            moved = [(thing.object, thing.world_at(poses[thing.prop])) for thing in things.values()]
            progress = Progress("Generating", fraction, frame.to_world(hips), rotations, moved, waits=True)
        yield progress


def _step(runner: TakeRunner) -> bool:
    """Step a take; a goal that cannot be reached is named in the error."""
    try:
        return runner.step()
    except GoalError as error:
        name = runner.director.goals[max(runner.director.index, 0)].name
        raise GoalError(f"{name}: {error}") from error


def finish(steps: Generator[Progress, None, _T]) -> _T:
    """Run a take, or the part of one, to its end without showing anything; the value of its generator."""
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value


def prepare(
    spec: TakeSpec, scene: bpy.types.Scene
) -> Generator[Progress, None, tuple[TakeRequest, WorldFrame, dict[str, MovedObject]]]:
    """Gather what a take needs from the scene as it is at the take's first frame, in slices; the current
    frame is put back.

    The last of the generator's value are the objects that it moves, by their names.
    """
    require_character(spec.character, scene)
    if not spec.goals:
        raise GoalError("There is no goal to go to; add one to the list, or enable one.")
    state = SceneState(scene, spec.character)
    try:
        _go_to(scene, spec.start_frame)
        frame, start = start_of(spec.character, scene)
        moving = moved_by(spec.goals)
        moving_alone = [o for o in moving if not rides_along(o, moving)]
        require_possible(spec.goals, scene)
        for target in moving_alone:
            require_movable(target, spec.character)
        around = yield from surroundings_of(spec, scene, frame, moving)
        goals = yield from _shown(
            "Finding the goals",
            beside(lambda _: resolve_goals(spec.goals, scene, frame, start, around), touches=True),
        )
        _go_to(scene, spec.start_frame)
        things = {
            target.name: MovedObject.of(target, frame, around.left[target][0]) for target in moving_alone
        }
        environment, ground = around.query, around.ground
    finally:
        state.restore()
    request = TakeRequest(
        start_position=start[0],
        start_heading=start[1],
        goals=goals,
        environment=environment,
        seed=spec.seed,
        contact_ik=spec.contact_ik,
        ground=ground,
    )
    return request, frame, things


def show_goal_points(
    spec: TakeSpec, scene: bpy.types.Scene
) -> Generator[Progress, None, tuple[list[bpy.types.Object], list[str]]]:
    """Show the goal points of a take's goals, reading the scene in slices: the points, and what is to be told
    of them.

    The goals are looked for in the scene as it is now.  One that has no point is told in its sentence, the
    others are shown.
    """
    frame, start = start_of(spec.character, scene)
    now = replace(spec, start_frame=scene.frame_current)
    around = yield from surroundings_of(now, scene, frame, moved_by(spec.goals))
    told: list[str] = []
    found = []
    for goal in spec.goals:
        steps = beside(lambda _, goal=goal: sought(goal, scene, frame, start, around), touches=True)
        try:
            found.append((goal, *(yield from _shown("Finding the goals", steps))))
        except NsmError as error:
            told.append(str(error))
    points = []
    for goal, aim, reason in found:  # all at the end: what is broken off before has made none
        try:
            points.append(make_goal_point(goal, scene, frame, around, aim, reason, told))
        except NsmError as error:
            told.append(str(error))
    return points, told


def surroundings_of(
    spec: TakeSpec, scene: bpy.types.Scene, frame: WorldFrame, moving: list[bpy.types.Object]
) -> Generator[Progress, None, Surroundings]:
    """Read what is solid around a take at its first frame: the meshes are copied in slices, the rest is done
    by a thread.
    """

    def evaluated() -> bpy.types.Depsgraph:
        _go_to(scene, spec.start_frame)  # whatever the window has done between two slices
        return bpy.context.evaluated_depsgraph_get()

    steps = Snapshot.take(evaluated)
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            around = Surroundings(scene, frame, spec.character, moving, stop.value)
            break
        yield Progress("Reading the scene", 0.0)
    goals = [o for g in spec.goals for o in (g.object, g.to) if o is not None and holds(scene, o)]
    yield from _waited("Reading the scene", around.reading(*goals))
    _go_to(scene, spec.start_frame)
    return around


def _go_to(scene: bpy.types.Scene, frame: int) -> None:
    if scene.frame_current != frame or scene.frame_subframe:
        scene.frame_set(frame)


def resolve_goals(
    specs: list[GoalSpec],
    scene: bpy.types.Scene,
    frame: WorldFrame,
    start: tuple[Array, float],
    around: Surroundings,
) -> list[Goal]:
    """Build the core's goals in their order; each knows from where the character comes and what was moved by
    then.
    """
    goals: list[Goal] = []
    before = start
    for spec in specs:
        goals.append(resolve(spec, scene, frame, before, around))
        before = place_after(goals[-1], before, around)
    return goals


def start_of(
    character: bpy.types.Object | None, scene: bpy.types.Scene
) -> tuple[WorldFrame, tuple[Array, float]]:
    """The character's frame, and its ground point (2,) and heading in it as posed now; SkeletonError if it
    cannot act.
    """
    require_character(character, scene)
    frame, pose = WorldFrame.of(character), read_pose(character)
    here = np.array((*pose.position[:2], frame.floor))
    frame = replace(frame, floor=floor_under(here, frame.scale, scene, own_objects(character, scene)))
    return frame, (frame.to_core(np.append(pose.position, 0.0))[:2].astype(np.float32), pose.heading)


def own_objects(character: bpy.types.Object, scene: bpy.types.Scene) -> set[bpy.types.Object]:
    """The character's armature, its children and every mesh that it deforms."""
    own = {character, *character.children_recursive}
    for candidate in scene.objects:
        if any(m.type == "ARMATURE" and m.object == character for m in candidate.modifiers):
            own.add(candidate)
    return own


def require_character(character: bpy.types.Object | None, scene: bpy.types.Scene) -> None:
    """Raise SkeletonError unless ``character`` is a usable armature in the scene."""
    if character is None:
        raise SkeletonError("No character is chosen; choose its armature, or add the bundled character.")
    if not holds(scene, character):
        raise SkeletonError(
            f"The character {character.name} is no longer in the scene; choose another one, or add the "
            "bundled character."
        )
    require_skeleton(character)
