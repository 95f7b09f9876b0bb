"""Rooms with something for every action, and random goals in them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from nsm_core.control.actions.registry import check_reachable
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, direction_to_heading, heading_to_direction, rotate_planar
from nsm_core.world.assets.pool import Pool
from nsm_core.world.geometry.distance import Cuboids, DistanceQuery
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene import furniture
from nsm_core.world.scene.door import make_door
from nsm_core.world.scene.furniture import Furniture
from nsm_core.world.scene.props import Box, Leaf

from ..furniture_goals import climb_goal, sit_goal
from . import rollout
from .carry import LOW, TABLE, box_at, make_crate, support
from .sit import AT_TABLE, SEATS, table_over

RADIUS = (3.0, 3.6)  # metres from the middle of the room to its things
UNDER_TABLE = 0.5  # share of the chairs and stools that stand partly under a table
_WAY_FREE = 0.45  # metres of room at places that are walked to


@dataclass
class Room:
    """Solids that stand (furniture, place, heading), and what can be done: a seat, a step, a box with places
    for it, a door.

    ``spots`` are box centres and facings (4,): where the box can be set down, the first where it stands.
    """

    still: list[tuple[Furniture, Array, float]] = field(default_factory=list)
    seat: tuple[Furniture, Array, float, bool] | None = None
    step: tuple[Furniture, Array, float] | None = None
    box: Box | None = None
    crate: Furniture | None = None
    spots: list[Array] = field(default_factory=list)
    leaf: Leaf | None = None

    @property
    def query(self) -> Cuboids:
        """All that stands as a collider."""
        return furniture.cuboids(self.still)


def make_room(rng: np.random.Generator, pool: Pool | None = None) -> Room:
    """Set things up in a ring that one walks about in: a seat, two tables with a box on one, a step, a door,
    a cabinet.
    """
    room = Room()
    turn = rng.uniform(-np.pi, np.pi)
    order = rng.permutation(6)
    for slot, what in enumerate(order):
        away = turn + slot * np.pi / 3 + rng.uniform(-0.12, 0.12)
        place = rng.uniform(*RADIUS) * heading_to_direction(np.array(away))
        inward = away + np.pi + rng.uniform(-0.5, 0.5)  # which way its front looks
        (_put_seat, _put_box, _put_table, _put_step, _put_door, _put_cabinet)[what](
            room, rng, pool, place, float(inward)
        )
    # A place on the floor for the box as well, in the middle.
    assert room.box is not None
    room.spots.append(
        np.array((*rng.uniform(-0.6, 0.6, 2), room.box.size[2] / 2, rng.uniform(-np.pi, np.pi)))
    )
    assert room.seat is not None
    piece, place, turn, _ = room.seat
    if piece.kind in AT_TABLE and rng.random() < UNDER_TABLE:
        table, at, _ = table_over(piece, rng)
        room.still.append((table, place + rotate_planar(at, np.float64(turn)), turn))
    return room


def _put_seat(room: Room, rng: np.random.Generator, pool: Pool | None, place: Array, inward: float) -> None:
    kind = str(rng.choice(SEATS))
    piece, known = rollout.draw_piece(pool, kind, rng)
    room.seat = (piece, place, inward, known)
    room.still.append((piece, place, inward))


def _crate(room: Room, rng: np.random.Generator, pool: Pool | None) -> Furniture:
    """The room's box as a piece; whoever asks first has it made."""
    if room.crate is None:
        room.crate = make_crate(rng, pool)
    return room.crate


def _put_box(room: Room, rng: np.random.Generator, pool: Pool | None, place: Array, inward: float) -> None:
    crate, facing = _crate(room, rng, pool), inward + np.pi
    top, still = support(rng, (0.0, LOW, TABLE)[int(rng.integers(3))], crate, place, facing, pool)
    room.still += still
    pose = np.array((*place, top + crate.size[2] / 2, facing))
    room.box = box_at(crate, pose)
    room.spots.insert(0, pose)


def _put_table(room: Room, rng: np.random.Generator, pool: Pool | None, place: Array, inward: float) -> None:
    crate, facing = _crate(room, rng, pool), inward + np.pi
    top, still = support(rng, TABLE, crate, place, facing, pool)
    room.still += still
    room.spots.append(np.array((*place, top + crate.size[2] / 2, facing)))


def _put_step(room: Room, rng: np.random.Generator, pool: Pool | None, place: Array, inward: float) -> None:
    kind = str(rng.choice(("step", "step", "low_wall")))
    measures = (
        {"height": rng.uniform(0.15, 0.5), "depth": rng.uniform(0.5, 1.0)}
        if kind == "step"
        else {"width": rng.uniform(0.9, 1.4)}
    )
    piece = furniture.make(kind, rng, **measures)
    room.step = (piece, place, inward)
    room.still.append(room.step)


def _put_door(room: Room, rng: np.random.Generator, pool: Pool | None, place: Array, inward: float) -> None:
    walls = {"near": float(rng.uniform(0.4, 0.8)), "far": float(rng.uniform(0.4, 0.8))}
    door = make_door(rng, **walls)
    heading = inward if rng.random() < 0.5 else inward + np.pi
    hinge = place - rotate_planar(np.array((door.width / 2, 0.0)), np.float64(heading))
    pose = np.array((*hinge, 0.0, heading))
    room.leaf = door.leaf(pose, float(rng.choice((-1.0, 1.0))))
    room.still.append((door.wall, pose[:3], float(heading)))


def _put_cabinet(
    room: Room, rng: np.random.Generator, pool: Pool | None, place: Array, inward: float
) -> None:
    kind = str(rng.choice(("cabinet", "sofa", "box", "desk", "shelf")))
    piece = pool.draw(kind, rng) if pool is not None else furniture.make(kind, rng)
    room.still.append((piece, place, inward))


def random_place(room: Room, rng: np.random.Generator, query: DistanceQuery, furthest: float = 3.0) -> Array:
    """A free place (2,) on the floor of a room; GoalError where there is none."""
    props = [p for p in (room.box, room.leaf) if p is not None]
    return rollout.start_about(rng, np.zeros(2), rollout.clear_of(query, props, _WAY_FREE), 0.0, furthest)[0]


def random_goals(room: Room, rng: np.random.Generator, count: int, hold: float = 0.5) -> list[Goal]:
    """Draw goals one after the other; the box goes to another spot each time, a door is passed from wherever
    one comes.
    """
    return [goal_of(room, str(rng.choice(tuple(OFFERS))), rng, hold) for _ in range(count)]


def goal_of(room: Room, action: str, rng: np.random.Generator, hold: float = 0.5) -> Goal:
    """A goal of one action in a room; a walk in one that has nothing for it."""
    heading = float(rng.uniform(-np.pi, np.pi))
    goal = OFFERS[action](room, hold)
    if goal is not None:
        return goal
    place = random_place(room, rng, room.query)
    away = place if float(np.linalg.norm(place)) > 0.1 else heading_to_direction(np.array(heading))
    return Goal(
        action,
        "place",
        np.append(place, 0.0),
        float(direction_to_heading(away)) if rng.random() < 0.5 else heading,
        hold,
    )


def _somewhere(room: Room, hold: float) -> Goal | None:
    return None


def _here(room: Room, hold: float) -> Goal | None:
    return Goal("idle", "here", np.zeros(3), 0.0, hold)


def _seat(room: Room, hold: float) -> Goal | None:
    return sit_goal(*room.seat, hold) if room.seat is not None else None


def _box(room: Room, hold: float) -> Goal | None:
    if room.box is None:
        return None
    room.spots.append(room.spots.pop(0))  # the first is where it stands now
    spot = room.spots[0]
    return Goal("carry", "Box", spot[:3], float(spot[3]), hold, prop=room.box)


def _door(room: Room, hold: float) -> Goal | None:
    if room.leaf is None:
        return None
    middle = room.leaf.to_world((room.leaf.width / 2, 0.0, 0.0), room.leaf.pose_at(0.0))
    return Goal("open", "Door", middle, 0.0, hold, prop=room.leaf)


def _step(room: Room, hold: float) -> Goal | None:
    return climb_goal(*room.step, np.zeros(2), hold) if room.step is not None else None


# What a room has for each action; None where one is sent to a random place.  The order is that of the draws
# of a seed.
OFFERS: dict[str, Callable[[Room, float], Goal | None]] = {
    "idle": _here,
    "walk": _somewhere,
    "run": _somewhere,
    "sit": _seat,
    "carry": _box,
    "open": _door,
    "climb": _step,
}


def reachable(
    make: Callable[[np.random.Generator], TakeRequest], seed: tuple[int, ...], tries: int = 8
) -> TakeRequest:
    """The first of the takes that ``make`` draws in which a way leads to every goal; GoalError where none of
    ``tries`` is one.
    """
    problem = GoalError("No take was drawn; allow at least one try.")
    for attempt in range(tries):
        try:
            asked = make(np.random.default_rng((*seed, attempt)))
            places = np.array([asked.start_position, *(g.position[:2] for g in asked.goals)])
            check_reachable(
                asked.goals,
                FloorPlan(asked.environment, (places.min(0) - 4, places.max(0) + 4)),
                np.asarray(asked.start_position),
            )
            return asked
        except GoalError as error:
            problem = error
    raise problem


__all__ = ["OFFERS", "Room", "goal_of", "make_room", "random_goals", "random_place", "reachable"]
