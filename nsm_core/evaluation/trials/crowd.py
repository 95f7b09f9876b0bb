"""Scenes of two, three and five characters: rooms with something for every action, a door and a seat that
several want.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest
from nsm_core.control.together.group import Cast, GroupRunner
from nsm_core.conventions import FPS
from nsm_core.errors import GoalError
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array
from nsm_core.world.actions import BY_KEY
from nsm_core.world.scene import furniture
from nsm_core.world.scene.door import make_door

from ..furniture_goals import sit_goal
from . import rollout
from .rooms import Room, goal_of, make_room

SCENES = 60
COUNTS = (2, 3, 5)  # characters of one scene after the other
KINDS = ("mixed", "one seat", "one door")
NAMES = ("Anna", "Ben", "Chloe", "Dan", "Eve")
APART = 1.3  # metres between the places where characters begin, and between those where they end
LONGEST = 180.0  # seconds of a scene
_WALL, _HALF = 4.0, 3.2  # metres of wall beside a door that all pass; half the side of the rooms beyond it
_ACTIONS = ("sit", "walk", "carry", "climb", "run", "open")


def scene(number: int, attempt: int = 0) -> list[Cast]:
    """The characters of a scene, the same at every call; GoalError where it has too little room."""
    rng = np.random.default_rng((rollout.SEED, 17, number, attempt))
    count, kind = COUNTS[number % 3], KINDS[(number // 3) % 3]
    return (_one_door if kind == "one door" else _ring)(count, kind, rng)


def _ring(count: int, kind: str, rng: np.random.Generator) -> list[Cast]:
    room = make_room(rng)
    solids = room.query
    props = [p for p in (room.box, room.leaf) if p is not None]
    free = rollout.clear_of(solids, props, 0.45)
    starts: list[Array] = []
    ends: list[Array] = []
    headings = []
    things = [spot[:2] for spot in room.spots]
    things += [thing[1] for thing in (room.seat, room.step) if thing is not None]
    for _ in range(count):
        starts.append(_place(rng, free, starts, 2.4))
        ends.append(_place(rng, free, [*ends, *things], 2.4))  # nobody ends where others have to do something
        headings.append(float(rng.uniform(-np.pi, np.pi)))
    casts = []
    for n in range(count):
        goals = [goal_of(room, str(rng.choice(_ACTIONS)), rng) for _ in range(int(rng.integers(1, 3)))]
        if kind == "one seat" and n < 2:
            goals[0] = goal_of(room, "sit", rng, hold=1.5)
        goals = [g for g in goals if BY_KEY[g.action].needs_object] or goals[:1]
        goals.append(_walk(ends[n], rng))
        casts.append(_cast(n, starts[n], headings[n], goals, solids, rng))
    return casts


def _one_door(count: int, _kind: str, rng: np.random.Generator) -> list[Cast]:
    """Two rooms, a door between them that most pass, from either side, and a seat in each."""
    door = make_door(rng, near=_WALL, far=_WALL)
    leaf = door.leaf((-door.width / 2, 0.0, 0.0, 0.0), float(rng.choice((-1.0, 1.0))))
    still: list[tuple[furniture.Furniture, Array, float]] = [
        (door.wall, np.array((-door.width / 2, 0.0)), 0.0)
    ]
    seats = []
    for side in (-1.0, 1.0):
        piece = furniture.make(str(rng.choice(("chair", "armchair", "stool"))), rng)
        at = np.array((rng.uniform(-2.8, 2.8), side * rng.uniform(2.6, 3.2)))
        if abs(at[0]) < 1.2:
            at[0] = np.copysign(1.2, at[0])
        turn = float(0.0 if side > 0 else np.pi) + float(rng.uniform(-0.4, 0.4))
        still.append((piece, at, turn))
        seats.append((piece, at, turn, True))
    solids = furniture.cuboids(still)
    room = Room(still=still, leaf=leaf)
    free = rollout.clear_of(solids, (leaf,), 0.45)
    sides = [(-1.0, 1.0)[n % 2] for n in range(count)]
    starts: list[Array] = []
    ends: list[Array] = []
    casts = []
    for n, side in enumerate(sides):
        through = n < 2 or rng.random() < 0.6
        starts.append(_place(rng, free, starts, _HALF, side))
        last = -side if through else side
        ends.append(_place(rng, free, ends, _HALF, last))
        goals = [goal_of(room, "open", rng)] if through else []
        if rng.random() < 0.5:
            goals.append(sit_goal(*seats[int(last > 0)], 1.0))
        goals.append(_walk(ends[n], rng))
        casts.append(_cast(n, starts[n], float(rng.uniform(-np.pi, np.pi)), goals, solids, rng))
    return casts


def _place(rng: np.random.Generator, free: Any, others: list[Array], half: float, side: float = 0.0) -> Array:
    """A place (2,) that is free, off the others, and in the room on a ``side`` of the door."""
    for _ in range(600):
        at = rng.uniform(-half, half, 2)
        if side:
            at[1] = side * rng.uniform(1.5, half)
        if free(at) and all(np.linalg.norm(at - o) > APART for o in others):
            return at
    raise GoalError("There is no free place left for another character.")


def _walk(place: Array, rng: np.random.Generator) -> Goal:
    return Goal("walk", "place", np.append(place, 0.0), float(rng.uniform(-np.pi, np.pi)), 0.3)


def _cast(
    n: int, start: Array, heading: float, goals: list[Goal], solids: Any, rng: np.random.Generator
) -> Cast:
    asked = TakeRequest(start, heading, goals, solids, seed=int(rng.integers(1 << 30)))
    return Cast(NAMES[n], asked)


def drawn(model: Model, number: int, tries: int = 12) -> GroupRunner:
    """The first try at a scene in which a way leads to every goal."""
    for attempt in range(tries):
        try:
            return GroupRunner(model, scene(number, attempt))
        except GoalError as error:
            problem = error
    raise problem


def run_scene(model: Model, number: int) -> dict[str, Any]:
    """Roll one scene out; its figures, as JSON can hold them."""
    group, begin = drawn(model, number), time.process_time()
    try:
        while any(not p.done for p in group.players) and group.frames < LONGEST * FPS:
            group.step()
    except GoalError as error:
        return {"scene": number, "characters": len(group.players), "error": str(error)}
    grown = time.process_time()
    over = all(p.done for p in group.players)
    results = group.results() if over else [p.runner.result() for p in group.players]
    end = time.process_time()
    frames = sum(p.runner.frames for p in group.players)
    waits = [(w.frames / FPS, p.name, w.sentence()) for p in group.players for w in p.waits]
    return {
        "scene": number,
        "kind": KINDS[(number // 3) % 3],
        "characters": len(group.players),
        "over": over,
        "goals": [
            {"who": p.name, "action": g.action, "reached": g.reached, "reason": g.reason}
            for p, r in zip(group.players, results, strict=True)
            for g in r.goals
        ],
        "deepest_cm": 100 * max(group.depths.values(), default=0.0),
        "waits": [(seconds, f"{who} {sentence}") for seconds, who, sentence in waits],
        "starved": sum(p.starved for p in group.players),
        "ms_per_frame": 1000 * (end - begin) / frames,
        "growing_ms_per_frame": 1000 * (grown - begin) / frames,
    }


def figures(reports: Iterable[dict[str, Any]]) -> dict[str, float]:
    """Figures over scenes: share of goals reached, deepest pair, longest wait, starved goals, ms a frame."""
    done = [r for r in reports if "error" not in r]
    goals = [g for r in done for g in r["goals"]]
    deep = np.array([r["deepest_cm"] for r in done] or [np.nan])
    return {
        "scenes": len(done),
        "characters": sum(r["characters"] for r in done),
        "goals": len(goals),
        "reached_share": float(np.mean([g["reached"] for g in goals])) if goals else float("nan"),
        "deepest_cm": float(deep.max()),
        "scenes_deeper_than_3_cm": int((deep > 3.0).sum()),
        "longest_wait_s": max((w[0] for r in done for w in r["waits"]), default=0.0),
        "starved": sum(r["starved"] for r in done),
        "not_over": sum(not r["over"] for r in done),
        "ms_per_frame": float(np.median([r["ms_per_frame"] for r in done] or [np.nan])),
    }


__all__ = ["SCENES", "drawn", "figures", "run_scene", "scene"]
