"""Points to touch: in the middle of a thing's free side, as high as a hand reaches, or where the animator's
empty is.
"""

from __future__ import annotations

import bpy
import numpy as np

from nsm_core.control.actions.touch import AWAY, stand_of
from nsm_core.control.goals import Goal
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, heading_to_direction, rotate_planar

from ..world.bodies import GoalBody, place_of
from ..world.surroundings import Surroundings
from .finder import Finder, Place
from .looks import Looks
from .loose_parts import is_group
from .points import goal_point_of
from .spec import GoalSpec
from .walk import what_stands_at

LOWEST, HIGHEST = 0.4, 1.75  # metres over the floor that a standing person touches
_SMALL = 0.5  # metres
SIDES = (0.0, np.pi / 2, -np.pi / 2, np.pi)  # front, left, right and behind, as turns of the object's -Y
# Metres from the surface that count as on it; steps from the box around a mesh to its surface.
_ON_IT, _STEPS = 0.002, 40


def _find(spec: GoalSpec, scene: bpy.types.Scene, around: Surroundings, before: Place) -> Goal:
    """Build the goal to touch an object, or the very place of an empty; GoalError where no hand
    reaches it.
    """
    scale, marker = around.frame.scale, goal_point_of(scene, spec.object, spec.action)
    if marker is None and spec.object.type == "EMPTY" and not is_group(spec.object):
        marker = spec.object
    point, heading = (
        place_of(marker, around.frame) if marker is not None else _free_side(around.body(spec.object), around)
    )
    if not LOWEST <= point[2] <= HIGHEST:
        raise GoalError(
            f"{(marker or spec.object).name} is {point[2] * scale:.2f} m over the character's floor; a hand "
            "touches what is between "
            f"{LOWEST * scale:.2f} and {HIGHEST * scale:.2f} m: move it, or give it a goal point there."
        )
    return Goal(spec.action, spec.label, point, heading, spec.hold)


def _free_side(body: GoalBody, around: Surroundings) -> Place:
    """The point (3,) on the first side before which one can stand, its front first, and the heading there;
    core frame.
    """
    best: Place | None = None
    for turn in SIDES:
        point, heading = _on_side(body, turn)
        best = best or (point, heading)
        stand = point[:2] - AWAY[0] * heading_to_direction(np.array(heading))
        ground = float(around.ground.height(stand[None])[0])
        if what_stands_at(stand.astype(np.float64), ground, around) is None:
            return point, heading
    assert best is not None
    return best


def _on_side(body: GoalBody, turn: float) -> Place:
    """The point (3,) in the middle of one side, at a height that is reached where the side has one, and the
    heading that looks at it.
    """
    seen = rotate_planar(body.vertices.astype(np.float64), -np.float64(turn))
    low, high = seen.min(0), seen.max(0)
    height = float(
        np.clip((low[2] + high[2]) / 2, min(max(low[2], LOWEST), high[2]), max(min(high[2], HIGHEST), low[2]))
    )
    point = np.array(((low[0] + high[0]) / 2, low[1], height))
    solid, depth = body.solid_at(np.zeros(4)), high[1] - low[1]
    for _ in range(_STEPS):
        gap = float(solid.signed_distance(_to_core(body, point, turn)[None], 1.0)[0])
        if gap < _ON_IT or point[1] - low[1] + gap > depth:
            break
        point[1] += gap
    if gap > 2 * _ON_IT:  # one looks through it there: the nearest of its corners
        point = seen[np.linalg.norm(seen - point, axis=1).argmin()]
    return _to_core(body, point, turn), float(body.yaw + turn + np.pi)


def _to_core(body: GoalBody, point: Array, turn: float) -> Array:
    return body.to_core(rotate_planar(point, np.float64(turn)))


def _after(goal: Goal, before: Place, around: Surroundings) -> Place:
    stand, heading = stand_of(
        goal, around.plan(goal.position[:2].astype(np.float64), np.asarray(before[0], dtype=np.float64))
    )
    return stand.astype(np.float32), heading


def _likely(looks: Looks) -> float:
    """Small things that hang or stand within reach; without a word that says so, others are more likely."""
    middle = looks.base + looks.size[2] / 2
    return 0.2 if looks.size.max() < _SMALL and LOWEST <= middle <= HIGHEST else 0.0


FINDER = Finder(
    _find,
    after=_after,
    somewhere=lambda body: _on_side(body, 0.0),
    words=("button", "switch", "lever", "knob", "bell", "keypad", "handle"),
    likely=_likely,
)
