"""What the add-on knows of an action: how its goal is found in a scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery

from ..world.bodies import GoalBody
from ..world.frame import WorldFrame
from ..world.surroundings import Surroundings
from ..world.tops import crossings
from .looks import Looks, unlikely
from .spec import GoalSpec

Place = tuple[Array, float]  # a ground point (2,) or a place (3,), core frame, and a heading


def on_top(body: GoalBody, lowest: float = -np.inf, highest: float = np.inf) -> Place:
    """A place (3,) to begin with on the middle of a body whose mesh shows none, in these heights where it has
    one there; its heading.
    """
    heights = np.append(crossings(body.vertices, body.triangles, np.zeros(2)), body.bounds[1][2])
    fitting = heights[(heights >= lowest) & (heights <= highest)]
    return body.to_core(
        np.array((0.0, 0.0, float(fitting.max() if len(fitting) else body.bounds[1][2])))
    ), float(body.yaw)


def _where_it_is(goal: Goal, before: Place, around: Surroundings) -> Place:
    return goal.position[:2], goal.heading


def _alone(target: bpy.types.Object) -> Sequence[bpy.types.Object]:
    return ()


def _nothing(spec: GoalSpec, scene: bpy.types.Scene) -> None:
    return None


def _room_enough(goal: Goal, solids: DistanceQuery) -> None:
    return None


@dataclass(frozen=True)
class Finder:
    """How the goal of an action is found.

    ``find(spec, scene, around, before)`` builds the core's goal, coming from ``before``; what is missing of
    the goal's objects has been told by then.  ``after(goal, before, around)`` is where it leaves the
    character.  ``require(spec, scene)`` raises GoalError before the scene is read, and
    ``room(goal, solids)`` where what stands there leaves none for it; ``parts(object)`` are those that move
    with the object, which ``swings`` to a side that the animator may change.  Of its goal point:
    ``somewhere(body)`` a place for it where the mesh shows none, ``under(goal)`` the metres by which it lies
    under the goal's place; an action whose points are others makes them by ``show(spec, goal or None, body,
    reason, scene, frame, told)``.  To guess the action of an object that is added: ``likely(looks)`` how much
    it looks made for this one, 0 not at all, and ``words`` of its name that speak for it; ``anything`` is
    what is done with all that is made for nothing, and ``loose`` tells that loose parts belong to its object.
    """

    find: Callable[[GoalSpec, bpy.types.Scene, Surroundings, Place], Goal]
    after: Callable[[Goal, Place, Surroundings], Place] = _where_it_is
    require: Callable[[GoalSpec, bpy.types.Scene], None] = _nothing
    room: Callable[[Goal, DistanceQuery], None] = _room_enough
    parts: Callable[[bpy.types.Object], Sequence[bpy.types.Object]] = _alone
    somewhere: Callable[[GoalBody], Place] = on_top
    under: Callable[[Goal], float] = lambda goal: 0.0
    swings: bool = False
    words: tuple[str, ...] = ()
    likely: Callable[[Looks], float] = unlikely
    anything: bool = False
    loose: bool = False
    show: (
        Callable[
            [GoalSpec, Goal | None, GoalBody, str, bpy.types.Scene, WorldFrame, list[str] | None],
            bpy.types.Object,
        ]
        | None
    ) = None
