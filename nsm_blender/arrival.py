"""Goals at things that move: each is looked for where its thing is when the character arrives."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace

import bpy
import numpy as np

from nsm_core.control.goals import Goal, GoalResult
from nsm_core.control.take import TakeRequest
from nsm_core.conventions import FPS
from nsm_core.errors import GoalError
from nsm_core.world.scene.movers import Mover

from .animation.kept import SceneState
from .animation.rate import scene_fps
from .goals.resolve import moved_by, place_after, resolve
from .goals.spec import GoalSpec
from .prepare import TakeSpec, surroundings_of, timed
from .progress import Progress
from .rigs.mount import go_to
from .world.frame import WorldFrame

_SAME = 0.01  # metres and radians by which a thing may have moved and still be where it was looked for
_EARLY = 15  # frames before the end of an arrival in which its thing has to rest
_SPARE = 0.3  # seconds that one who waits for a thing to rest leaves between


def goals_at_rest(
    spec: TakeSpec, scene: bpy.types.Scene, frame: WorldFrame, request: TakeRequest, sought: dict[int, int]
) -> Generator[Progress, None, list[Goal]]:
    """The goals, with those at things that move looked for where these first come to rest; see
    ``goals_on_arrival``.
    """
    goals = list(request.goals)
    for k, asked in enumerate(spec.goals):
        mover = _carried_by(asked, request.movers)
        rests = 0 if mover is None else mover.at_rest_from(0)
        if rests is None:
            raise _restless(goals[k], spec, "it is on the move all the time")
        if rests:
            sought[k] = rests
            goals[k] = yield from _found_at(spec, scene, frame, replace(request, goals=goals), k, rests)
    return goals


def _restless(goal: Goal, spec: TakeSpec, how: str) -> GoalError:
    return GoalError(
        f"{spec.character.name} cannot come to rest at {goal.name}: {how}; have it stop in time, or choose "
        "another object."
    )


def goals_on_arrival(
    spec: TakeSpec,
    scene: bpy.types.Scene,
    frame: WorldFrame,
    request: TakeRequest,
    results: Sequence[GoalResult],
    sought: dict[int, int],
) -> Generator[Progress, None, list[Goal] | None]:
    """The goals with the first one whose thing was elsewhere when it was reached looked for there; None where
    all are right.

    ``results`` are of the take as it was performed last; ``sought`` the frames of the network, by the goals'
    numbers, in which goals were looked for, and is kept up to date.  GoalError where a thing does not rest.
    """
    for k, (asked, goal, result) in enumerate(zip(spec.goals, request.goals, results, strict=True)):
        mover = _carried_by(asked, request.movers)
        if mover is None:
            continue
        early = max(result.end_frame - _EARLY, 0)
        rests = mover.at_rest_from(early)
        if rests is None:
            number = spec.start_frame + result.end_frame / FPS * scene_fps(scene)
            raise _restless(goal, spec, f"it moves at frame {number:.0f} and after that")
        there = max(rests, result.end_frame)
        wait = max(0.0, (rests - early) / FPS + _SPARE) if rests > early else 0.0
        moved = np.abs(mover.pose_at(there) - mover.pose_at(sought.get(k, 0))).max() > _SAME
        if not moved and not wait:
            continue
        sought[k] = there
        found = yield from _found_at(spec, scene, frame, request, k, there)
        found = replace(found, wait=goal.wait + wait, pace=goal.pace)
        return [*request.goals[:k], found, *request.goals[k + 1 :]]
    return None


def _carried_by(asked: GoalSpec, movers: Sequence[Mover]) -> Mover | None:
    names = {o.name_full for o in (asked.object, asked.to) if o is not None}
    return next((mover for mover in movers if names & mover.parts), None)


def _found_at(
    spec: TakeSpec, scene: bpy.types.Scene, frame: WorldFrame, request: TakeRequest, k: int, there: int
) -> Generator[Progress, None, Goal]:
    """Goal ``k`` in the scene as it is in the network's frame ``there``."""
    asked, number = spec.goals[k], spec.start_frame + there / FPS * scene_fps(scene)
    own = _carried_by(asked, request.movers)
    others = [o for m in request.movers if m is not own for o in scene.objects if o.name_full in m.parts]
    state = SceneState(scene, spec.character)
    try:
        around = yield from surroundings_of(
            replace(spec, start_frame=number), scene, frame, [*moved_by(spec.goals), *others]
        )
        before = np.asarray(request.start_position), float(request.start_heading)
        for goal in request.goals[:k]:
            before = place_after(goal, before, around)
        go_to(scene, number)
        return timed(resolve(asked, scene, frame, before, around), asked, spec, scene)
    finally:
        state.restore()
