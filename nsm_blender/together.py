"""Takes of several characters in one scene, generated together: each sees the others, and all are keyed or
none.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field

import bpy

from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.control.together.frames import Frame
from nsm_core.control.together.group import Cast, GroupRunner
from nsm_core.errors import GoalError, NsmError
from nsm_core.model.features.meaning import remark
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array
from nsm_core.world.actions import require_learned

from .animation.kept import Kept, restored_on_failure
from .begin import FILL
from .goals.resolve import moved_by, require_room_for
from .goals.spec import GoalSpec
from .keys.layers import require_keyable
from .keys.objects import MovedObject
from .keys.root_motion import require_root
from .prepare import Company, TakeSpec, prepare, require_character
from .progress import Progress, Shown, waited
from .takes import Take, key_and_check, shipped_model
from .world.beside import beside
from .world.frame import WorldFrame


@dataclass
class GroupSpec:
    """The takes of several characters, in the order in which they go first where nothing else decides."""

    takes: list[TakeSpec]
    goals: list[GoalSpec] = field(init=False)

    def __post_init__(self) -> None:
        self.goals = [goal for take in self.takes for goal in take.goals]
        characters = [take.character for take in self.takes]
        twice = next((c for c in characters if c is not None and characters.count(c) > 1), None)
        if twice is not None:
            raise GoalError(f"{twice.name} is asked for twice; put all its goals into one list.")
        if len({take.start_frame for take in self.takes}) > 1:
            raise GoalError("Characters that act together begin at one frame; give all the same start frame.")

    @property
    def character(self) -> bpy.types.Object:
        """The first of the characters."""
        return self.takes[0].character


@dataclass
class _Part:
    """What one of the takes was prepared to."""

    spec: TakeSpec
    request: TakeRequest
    frame: WorldFrame
    things: dict[str, MovedObject]


def generate_together(
    group: GroupSpec, scene: bpy.types.Scene, model: Model | None = None
) -> Generator[Progress, None, list[Take]]:
    """Generate and key the takes of several characters; the generator's value is the Takes, in their order.

    Their reports hold ``waits``: when each gave way, to whom and where, as sentences.  Nothing changes before
    the keys are made, and where one cannot be keyed, none is.  Raises as ``takes.generate``, with the name of
    the character.
    """
    for spec in group.takes:
        if spec.begin == FILL:
            raise GoalError(
                "Characters that act together begin with their pose or a quiet stand; choose another start."
            )
        require_character(spec.character, scene)
        with _named(spec):
            require_keyable(spec.character)
            require_root(spec.character, spec.root_motion)
    company = Company([spec.character for spec in group.takes], moved_by(group.goals))
    parts: list[_Part] = []
    for spec in group.takes:
        with _named(spec):
            part = _Part(spec, *(yield from prepare(spec, scene, company)))
            for goal in part.request.goals:
                require_room_for(goal, part.request.environment)
        parts.append(part)
    if model is None:
        model = yield from waited("Loading the network", lambda _: shipped_model())
    require_learned((goal.action for part in parts for goal in part.request.goals), model.metadata)
    unit = parts[0].frame.scale
    casts = [
        Cast(p.spec.character.name, p.request, Frame(p.frame.scale / unit, p.frame.floor / unit))
        for p in parts
    ]
    runner = yield from waited("Planning the ways", lambda _: GroupRunner(model, casts))
    results = yield from _growing(runner, parts)
    told = remark(model.metadata)  # before the keys: from then on nothing may fail any more
    waited_for = [[wait.sentence() for wait in waits] for waits in runner.waits()]
    yield Progress("Keying", 1.0)
    takes = yield from _keyed(runner, parts, results, scene)
    for take, waits in zip(takes, waited_for, strict=True):
        take.report["waits"] = waits
        take.report["warnings"] += told
    return takes


def _growing(runner: GroupRunner, parts: Sequence[_Part]) -> Generator[Progress, None, list[TakeResult]]:
    """Progress of motions that grow in a thread; their results."""
    newest: deque[tuple[float, list[tuple[Array, Array, dict[str, Array]]]]] = deque(maxlen=1)

    def grow(tell: Callable[[float], None]) -> list[TakeResult]:
        while runner.step():
            newest.append((min(runner.progress, 1.0), runner.poses()))
            tell(runner.progress)
        return runner.results()

    steps, progress = beside(grow), Progress("Generating", 0.0, waits=True)
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value
        if newest:
            fraction, poses = newest.pop()
            cast = [
                Shown(
                    part.spec.character,
                    part.frame.to_world(hips),
                    rotations,
                    [(thing.object, thing.world_at(props[thing.prop])) for thing in part.things.values()],
                )
                for part, (hips, rotations, props) in zip(parts, poses, strict=True)
            ]
            progress = Progress("Generating", fraction, cast=cast, waits=True)
        yield progress


def _keyed(
    runner: GroupRunner, parts: Sequence[_Part], results: Sequence[TakeResult], scene: bpy.types.Scene
) -> Generator[Progress, None, list[Take]]:
    """Key all takes, or none: a thing that several move is keyed once, by the first of them."""
    takes = []
    with ExitStack() as kept:
        for part in parts:
            targets = [part.spec.character, *(thing.object for thing in part.things.values())]
            kept.enter_context(restored_on_failure(Kept(scene, targets)))
        keyed: set[bpy.types.Object] = set()
        for number, (part, result) in enumerate(zip(parts, results, strict=True)):
            own = [thing for thing in part.things.values() if thing.object not in keyed]
            keyed |= {thing.object for thing in own}
            tracks = {thing.prop: runner.track_of(number, thing.prop) for thing in own}
            with _named(part.spec):
                take = yield from key_and_check(
                    part.spec, scene, part.request, result, part.frame, part.things, tracks
                )
            takes.append(take)
    return takes


class _named:
    """Have an error begin with the name of the character."""

    def __init__(self, spec: TakeSpec) -> None:
        self.name = spec.character.name

    def __enter__(self) -> None:
        pass

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        if isinstance(error, NsmError) and self.name not in str(error):
            raise type(error)(f"{self.name}: {error}") from error


__all__ = ["GroupSpec", "generate_together"]
