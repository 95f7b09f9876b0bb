"""Doors and drawers that were opened to get at a thing are shut again, once no later goal needs them open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import bpy

from nsm_core.control.actions.unshut import SHUT
from nsm_core.control.goals import Goal
from nsm_core.errors import GoalError
from nsm_core.rotations import Array
from nsm_core.world.actions import BY_KEY
from nsm_core.world.scene.containers import Front

from ..world.surroundings import Surroundings
from .fronts import HALF, front_goal, is_front, shut_away
from .spec import GoalSpec


def last_needed(specs: Sequence[GoalSpec]) -> dict[bpy.types.Object, object]:
    """By the fronts of furniture that goals open, or find in their way: the last goal that does.  Goals that
    cannot be are passed over.
    """
    found: dict[bpy.types.Object, object] = {}
    for spec in specs:
        action = BY_KEY.get(spec.action)
        if spec.object is None or action is None:
            continue
        if action.pairs:
            found |= dict.fromkeys(shut_away(spec.object), spec)
        elif action.moved == "Openable" and is_front(spec.object):
            found[spec.object] = spec
    return found


def stands_open(target: bpy.types.Object, around: Surroundings) -> bool:
    """Whether a front stands open once the goals found so far are done, which were it that moved it."""
    front, end = around.left.get(target, (None, None))
    return isinstance(front, Front) and replace(front, pose=end).opening > HALF


def shut_again(goal: Goal, spec: GoalSpec, around: Surroundings) -> Goal:
    """The goal to put a thing down, with what was opened for it, or for things before it, shut then, unless a
    later goal needs it open or the thing has come to stand in it.  GoalError where no hand shuts it.
    """
    if not spec.close_after:
        return goal
    assert goal.picking is not None
    here, then = goal.picking.put.reach.place, list[Goal]()
    for target in around.opened:
        if around.last_needed.get(target, spec) is not spec or not stands_open(target, around):
            continue
        front, end = around.left[target]
        if isinstance(front, Front) and replace(front, pose=end).carries(goal.picking.pose):
            continue
        try:
            then.append(_shut(target, around, here))
        except GoalError as error:
            raise GoalError(
                f"{target.name} cannot be shut again once {spec.label} is put down: {error} Or switch Close "
                "After off, and it stays open."
            ) from error
        here = then[-1].pulling.reach.place
    return replace(goal, then=tuple(then))


def _shut(target: bpy.types.Object, around: Surroundings, here: Array) -> Goal:
    """The goal to shut a front whole; GoalError where a hand cannot."""
    goal = front_goal(target.name, target, 0.0, around, here)
    left = 0.0 if goal.pulling is None else goal.pulling.end
    if left > SHUT:
        raise GoalError(f"It would stay open by {left:.0%} of its range; choose another place for the thing.")
    return goal


__all__ = ["last_needed", "shut_again", "stands_open"]
