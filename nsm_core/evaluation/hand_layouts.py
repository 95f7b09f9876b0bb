"""Layouts on which ways of hands are judged: kitchens that nothing was learnt from, plain, and reshaped with
pieces of furniture of kinds that no kitchen has (papers/002 section 8.2.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from nsm_core.data.reaches.ways import HandTask, quickest, tasks_to
from nsm_core.rotations import Array
from nsm_core.world.assets.kitchen import Kitchen, make_kitchen
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.containers import Container, MovingPart, Shelf, moving_part
from nsm_core.world.scene.furniture import build
from nsm_core.world.scene.furniture.piece import Part

FIRST = 20_000  # seed of the first kitchen that is judged on: far from those that ways are learnt in
RESHAPED = (0.7, 1.5)  # of its width, depth and height
_FILL, _BLOCKED = 0.85, 0.5  # densely packed
_NOVEL = 4  # of how many reshaped layouts one is a piece of a kind that no kitchen has
_GRASPS = 6  # that are tried at a thing


def layouts(count: int, reshaped: bool) -> Iterator[HandTask]:
    """So many layouts by seed, each with one thing that a hand comes to, empty and laden in turn, where fast
    marching finds a way.
    """
    seed, found = 0, 0
    while found < count:
        kitchen, rng = judged_kitchen(seed, reshaped, found)
        task = _task(kitchen, rng, laden=found % 2 == 1)
        seed += 1
        if task is not None:
            found += 1
            yield task


def judged_kitchen(
    seed: int, reshaped: bool, number: int | None = None
) -> tuple[Kitchen, np.random.Generator]:
    """A densely filled kitchen that nothing was learnt from, and what else is drawn of its ``seed``, 0 and
    up; ``reshaped``, every fourth by its ``number`` (the seed) of a kind that no kitchen has.
    """
    seed, number = FIRST + seed, seed if number is None else number
    rng = np.random.default_rng((seed, 31))
    return (_made(seed, rng, number) if reshaped else make_kitchen(seed, _FILL, _BLOCKED)), rng


def _made(seed: int, rng: np.random.Generator, number: int) -> Kitchen:
    scale = rng.uniform(*RESHAPED, size=3)
    kitchen = make_kitchen(seed)
    kitchen.things.clear()
    if number % _NOVEL == 0:
        piece = NOVEL[number // _NOVEL % len(NOVEL)](rng)
        kitchen.containers = {piece.name: piece.put((0.0, -1.5, 0.0, 0.0))}
    else:
        kitchen.containers = {name: scaled(piece, scale) for name, piece in kitchen.containers.items()}
    kitchen.furnish(rng, _FILL, _BLOCKED)
    return kitchen


def _task(kitchen: Kitchen, rng: np.random.Generator, laden: bool) -> HandTask | None:
    """The first thing by chance that a hand gets at; what shuts it away stays open."""
    names = list(kitchen.things)
    for k in rng.permutation(len(names)):
        name = names[int(k)]
        shut, container = kitchen.shut_by(name), kitchen.things[name].container
        for part in shut:
            kitchen.open(container, part, 1.0)
        for _, pair in zip(range(_GRASPS), tasks_to(kitchen, name), strict=False):
            if quickest(pair[laden]) is not None:
                return pair[laden]
        for part in shut:
            kitchen.open(container, part, 0.0)
    return None


def scaled(container: Container, scale: Array) -> Container:
    """The same container ``scale`` (3,) times as wide, deep and high, and so far from the room's corner; its
    things are not.
    """
    piece = container.piece
    boxes = [
        tuple(float(v) for v in np.stack((low * scale, high * scale), 1).ravel())
        for low, high in zip(piece.mins, piece.maxs, strict=True)
    ]
    made = replace(
        container,
        piece=build(piece.kind, boxes, centred=False),  # type: ignore[arg-type]
        parts=[_scaled_part(part, scale) for part in container.parts],
        boards=[
            replace(
                board,
                low=board.low * scale[:2],
                high=board.high * scale[:2],
                height=float(board.height * scale[2]),
                room=float(board.room * scale[2]),
            )
            for board in container.boards
        ],
    )
    return made.put((*container.pose[:3] * scale, container.pose[3]))


def _scaled_part(part: MovingPart, scale: Array) -> MovingPart:
    query = part.query
    assert isinstance(query, Cuboids)
    lows = np.concatenate([g.centres - g.halves for g in query.groups]) * scale
    highs = np.concatenate([g.centres + g.halves for g in query.groups]) * scale
    far = 1.0 if part.turns else float(np.linalg.norm(part.axis * scale))
    return moving_part(
        part.name,
        part.kind,
        (lows, highs),
        (lows.min(0), highs.max(0)),
        part.axis,
        part.pivot * scale,
        part.travel * far,
        part.handle * scale,
        part.away,
        part.bar,
    )


def _pigeonholes(rng: np.random.Generator) -> Container:
    """A rack of open holes beside and over each other."""
    across, up = int(rng.integers(2, 4)), int(rng.integers(2, 4))
    w, h, d, t = (
        float(rng.uniform(0.26, 0.4)),
        float(rng.uniform(0.28, 0.4)),
        float(rng.uniform(0.25, 0.4)),
        0.02,
    )
    low = float(rng.uniform(0.4, 0.7))
    x = -across * w / 2
    boxes: list[Part] = [(x, -x, d / 2 - 0.015, d / 2, low, low + up * h + t)]
    boxes += [(x, -x, -d / 2, d / 2, low + k * h, low + k * h + t) for k in range(up + 1)]
    boxes += [
        (x + k * w - t / 2, x + k * w + t / 2, -d / 2, d / 2, low, low + up * h + t)
        for k in range(across + 1)
    ]
    boards = [
        _board(
            x + i * w + t / 2, x + (i + 1) * w - t / 2, -d / 2 + 0.02, d / 2 - 0.015, low + j * h + t, h - t
        )
        for i in range(across)
        for j in range(up)
    ]
    return _piece("pigeonholes", boxes, boards)


def _crate(rng: np.random.Generator) -> Container:
    """A crate on a stand, open above and lower in front."""
    w, d, t = float(rng.uniform(0.4, 0.7)), float(rng.uniform(0.35, 0.5)), 0.018
    low, deep, front = (
        float(rng.uniform(0.6, 0.9)),
        float(rng.uniform(0.12, 0.25)),
        float(rng.uniform(0.06, 0.12)),
    )
    x, y = w / 2, d / 2
    boxes: list[Part] = [(-x, x, -y, y, low - t, low), (-x, -x + t, -y, y, low, low + deep)]
    boxes += [(x - t, x, -y, y, low, low + deep), (-x, x, y - t, y, low, low + deep)]
    boxes += [(-x, x, -y, -y + t, low, low + front), (-0.1, 0.1, -0.1, 0.1, 0.0, low - t)]
    return _piece("crate", boxes, [_board(-x + t, x - t, -y + t, y - t, low, 2.0)])


def _hooded(rng: np.random.Generator) -> Container:
    """A bench under a hood, shut at one side, with a rail along its front."""
    w, d = float(rng.uniform(0.6, 1.0)), float(rng.uniform(0.4, 0.6))
    low, room = float(rng.uniform(0.75, 1.0)), float(rng.uniform(0.35, 0.5))
    side = -1 if rng.integers(2) else 1
    x, y, t = w / 2, d / 2, 0.03
    wall = (-x, -x + t) if side < 0 else (x - t, x)
    boxes: list[Part] = [(-x, x, -y, y, low - t, low), (-x, x, -y, y, low + room, low + room + 0.15)]
    boxes += [(*wall, -y, y, low, low + room), (-x, x, -y, -y + 0.02, low + 0.05, low + 0.07)]
    boxes += [(-x, x, y - 0.02, y, 0.0, low + room)]
    return _piece("hooded bench", boxes, [_board(-x + 2 * t, x - 2 * t, -y + 0.06, y - 0.03, low, room)])


def _tiers(rng: np.random.Generator) -> Container:
    """Steps that go up to the back, as of a flower stand, with posts between them."""
    w, deep = float(rng.uniform(0.5, 0.9)), float(rng.uniform(0.16, 0.24))
    low, rise = float(rng.uniform(0.5, 0.7)), float(rng.uniform(0.14, 0.26))
    x, boxes, boards = w / 2, list[Part](), list[Shelf]()
    for k in range(3):
        y, z = -0.3 + k * deep, low + k * rise
        boxes.append((-x, x, y, y + deep, z - 0.02, z))
        boxes += [(s * x - 0.015, s * x + 0.015, y, y + 0.03, 0.0, low + 2 * rise + 0.2) for s in (-1, 0, 1)]
        boards += [
            _board(a, b, y + 0.035, y + deep, z, 2.0) for a, b in ((-x + 0.02, -0.02), (0.02, x - 0.02))
        ]
    return _piece("tiers", boxes, boards)


def _board(x0: float, x1: float, y0: float, y1: float, height: float, room: float) -> Shelf:
    return Shelf(np.array((x0, y0)), np.array((x1, y1)), height, room)


def _piece(kind: str, boxes: list[Part], boards: list[Shelf]) -> Container:
    return Container(kind, kind, build(kind, boxes, centred=False), [], boards)


NOVEL: tuple[Callable[[np.random.Generator], Container], ...] = (_pigeonholes, _crate, _hooded, _tiers)

__all__ = ["layouts", "scaled"]
