"""A take that is steered while it is recorded: what keys ask for each frame, solved and keyed as a whole."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator
from dataclasses import replace

import bpy
import numpy as np

from nsm_core.control.actions.steer import RUNS, WALKS
from nsm_core.control.goals import Goal
from nsm_core.control.live import LiveTake
from nsm_core.conventions import DT, FPS
from nsm_core.errors import GoalError
from nsm_core.model.features.meaning import remark
from nsm_core.model.inference import model as inference_model
from nsm_core.world.actions import Aim, require_action, require_learned

from .keys.layers import require_keyable
from .network import load_network, shipped_model
from .prepare import TakeSpec, prepare, require_character
from .progress import Progress, waited
from .takes import Take, key_and_check

_SIDES = {  # what keys add to where one goes: ahead of the camera, to its right
    "W": (1, 0), "UP_ARROW": (1, 0), "S": (-1, 0), "DOWN_ARROW": (-1, 0),
    "D": (0, 1), "RIGHT_ARROW": (0, 1), "A": (0, -1), "LEFT_ARROW": (0, -1),
}  # fmt: skip
_TURNS = {"Q": 1.0, "E": -1.0}
_SHIFTS = {"LEFT_SHIFT", "RIGHT_SHIFT"}
_DIGITS = ("ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE")
_ENDS = {"SPACE", "RET", "NUMPAD_ENTER"}
_TURN = 2.0  # rad/s that the turning keys ask for
_MOST = 3  # frames that are made up for at once; what is later is slow motion
HELP = "WASD or arrows: go   Shift: run   Q/E: turn   1-9, G: do a goal   Space or Enter: key it"


class Controls:
    """The keys of one who steers: fed with events, asked every frame; it knows no window.

    ``view`` is the heading in which the camera looks over the floor; ``clock`` tells seconds.  ``said`` is
    a sentence for whoever watches, ``active`` the number of the queue's chosen goal.
    """

    def __init__(self, active: int = 1, clock: Callable[[], float] = time.perf_counter) -> None:
        self.view, self.active, self.over, self.said = 0.0, active, False, ""
        self._down: set[str] = set()
        self._asked: int | None = None
        self._bend, self._facing = 0.0, None
        self._clock, self._next = clock, 0.0

    def event(self, key: str, value: str) -> bool:
        """Hear of a key by Blender's names for it and for what befell it; whether it is one that steers."""
        pressed = value == "PRESS"
        if key == "WINDOW_DEACTIVATE":  # what is let go elsewhere is not heard of
            self._down.clear()
            return False
        if key in _ENDS:
            self.over = self.over or pressed
        elif key in _DIGITS or key == "G":
            if pressed:
                self._asked = self.active if key == "G" else _DIGITS.index(key) + 1
        elif key in _SIDES or key in _TURNS or key in _SHIFTS:
            if pressed:
                self._down.add(key)
            elif value == "RELEASE":  # a click comes after it, too
                self._down.discard(key)
        else:
            return False
        return True

    def asked(self) -> int | None:
        """The number of the goal that was asked for since the last call."""
        number, self._asked = self._asked, None
        return number

    @property
    def steers(self) -> bool:
        """Whether a key is down that moves or turns."""
        return any(key in _SIDES or key in _TURNS for key in self._down)

    def lead(self, live: LiveTake) -> None:
        """Tell a take what the keys ask for in its next frame."""
        ahead, right = (sum(_SIDES[k][i] for k in self._down if k in _SIDES) for i in (0, 1))
        turn = sum(_TURNS[k] for k in self._down if k in _TURNS)
        wanted = live.steering
        if ahead or right:
            self._bend, self._facing = self._bend + turn * _TURN / 2 * DT, None
            way = self.view - math.atan2(right, ahead) + self._bend
            pace = RUNS if self._down & _SHIFTS else WALKS
            wanted.velocity = pace * np.array((math.sin(way), -math.cos(way)))
        else:
            self._bend = 0.0
            wanted.velocity = np.zeros(2)
            if turn:
                facing = live.heading if self._facing is None else self._facing
                # A turn is led no further ahead than a body follows.
                self._facing = live.heading + float(
                    np.clip(_wrapped(facing + turn * _TURN * DT - live.heading), -1.2, 1.2)
                )
        wanted.heading = self._facing

    def due(self) -> int:
        """How many frames of 30 Hz are due by now."""
        now = self._clock()
        if not self._next:
            self._next = now
        count = int((now - self._next) * FPS + 1e-6)
        if count > _MOST:
            self._next, count = now - _MOST * DT, _MOST
        self._next += count * DT
        return count


def steer(
    spec: TakeSpec, scene: bpy.types.Scene, controls: Controls, model: inference_model.Model | None = None
) -> Generator[Progress, None, Take]:
    """Record what ``controls`` steer until they are over, then solve, key and report it; as
    ``takes.generate``.

    The goals of ``spec`` are those that can be asked for, by their number; there need be none.
    """
    require_character(spec.character, scene)
    require_keyable(spec.character)
    loading = load_network() if model is None else None
    request, frame, things = yield from prepare(spec, scene, needs_goals=False)
    if loading is not None:
        model = yield from waited("Loading the network", lambda _: loading.join() or shipped_model())
    require_learned(("walk", "run", *(goal.action for goal in request.goals)), model.metadata)
    live = yield from waited("Planning the ways", lambda _: LiveTake(model, request))
    runner = live.runner
    controls.due()
    while not controls.over:
        for _ in range(controls.due()):
            _hear(controls, live, request.goals, spec)
            live.step()
        hips, rotations = runner.pose()
        poses = runner.prop_poses()
        moved = [(t.object, t.world_at(poses[t.prop])) for t in things.values() if t.prop in poses]
        does = live.performs.name if live.performs else "steered"
        text = f"Recording {runner.frames / FPS:.1f} s, {does}"
        yield Progress(text, -1.0, frame.to_world(hips), rotations, moved, waits=True)
    live.stop()
    result = yield from waited("Solving", lambda _: runner.result())
    told = remark(model.metadata)
    yield Progress("Keying", 1.0)
    asked = replace(request, goals=runner.director.goals)
    moved_things = {name: thing for name, thing in things.items() if thing.prop in result.props}
    take = yield from key_and_check(spec, scene, asked, result, frame, moved_things)
    take.report["warnings"] += told
    return take


def _hear(controls: Controls, live: LiveTake, goals: list[Goal], spec: TakeSpec) -> None:
    """Hand over to the goal that is asked for, or back to who steers."""
    number = controls.asked()
    if number is not None:
        controls.said = ""
        if not 1 <= number <= len(goals):
            controls.said = f"There is no goal {number} among the {len(goals)} that are enabled."
        else:
            goal, asked = goals[number - 1], spec.goals[number - 1]
            if require_action(goal.action).aim is Aim.PLACE and asked.object is None and goal.way is None:
                goal = replace(goal, heading=live.heading_to(goal.position))
            try:
                live.hand_over(goal)
            except GoalError as error:
                controls.said = str(error)
    elif controls.steers:
        live.take_back()
    controls.lead(live)


def _wrapped(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi


__all__ = ["HELP", "Controls", "steer"]
