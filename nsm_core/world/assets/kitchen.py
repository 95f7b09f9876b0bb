"""Kitchens by seed: cupboards, drawers, a fridge, a sink, shelves and a table, and light things in them.

World frame: the wall along which it stands is y = 0, everything is before it (-Y), the row begins at x = 0;
the floor is z = 0.  The same seed gives the same kitchen, with numpy's own stable generator.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from nsm_core.errors import GeometryError
from nsm_core.rotations import rotate_planar
from nsm_core.world.geometry.distance import Cuboids, DistanceQuery, Union
from nsm_core.world.scene.containers import Container, Shelf
from nsm_core.world.scene.containers.cupboards import make_container, table_of
from nsm_core.world.scene.furniture import Furniture, build, cuboids
from nsm_core.world.scene.furniture import make as make_furniture
from nsm_core.world.scene.props import Prop
from nsm_core.world.scene.small_things import SmallThing
from nsm_core.world.scene.solids import Scene

from .kitchen_filling import Filling, fill_board

_BESIDE = 0.012  # metres between pieces that stand side by side: doors turn clear of each other
_HAND = 0.07  # metres to either side of a thing's middle that a hand needs
_WIDE = 50.0  # metres of floor to every side
_WALL_HIGH, _WALL_THICK = 2.5, 0.1
_FREE_FLOOR = (1.3, 1.7)  # metres between the row and the table


@dataclass
class Standing:
    """Where a thing stands: the name of its container, the number of its board there, and the names of the
    ``blockers`` that were put before it by choice.
    """

    thing: SmallThing
    container: str
    board: int
    blockers: tuple[str, ...] = ()


@dataclass
class Kitchen:
    """A furnished kitchen, everything shut; ``containers`` and ``things`` by name, ``walls`` in the world."""

    seed: int
    walls: Furniture
    containers: dict[str, Container] = field(default_factory=dict)
    things: dict[str, Standing] = field(default_factory=dict)

    def scene(self) -> Scene:
        """Floor, walls and carcasses as what stands, moving parts and things as its props.

        The floor is solid here: hands go around it as well, and no front marches under it.
        """
        fixed: list[DistanceQuery] = [c.standing() for c in self.containers.values()]
        parts: list[Prop] = [p for c in self.containers.values() for p in c.parts]
        walls = cuboids([(self.walls, np.zeros(3), 0.0)])
        floor = Cuboids([((0, 0), 0.0, ((-_WIDE, -_WIDE, -1.0),), ((_WIDE, _WIDE, 0.0),))])
        return Scene(Union([walls, floor, *fixed]), [*parts, *(s.thing for s in self.things.values())])

    def board_of(self, name: str) -> tuple[Container, Shelf]:
        """The container and the board on which a thing stands."""
        standing = self.things[name]
        container = self.containers[standing.container]
        return container, container.boards[standing.board]

    def shut_by(self, name: str) -> list[str]:
        """Names of the parts of its container that must open before a hand gets at a thing: those before it,
        and a door beside it within a hand's breadth.
        """
        container, board = self.board_of(name)
        thing = self.things[name].thing
        own = rotate_planar(thing.middle - container.pose[:3], np.float64(-container.pose[3]))
        found = container.shut_by(board, own)
        for aside in (-_HAND, _HAND):
            found += [
                n
                for n in container.shut_by(board, own + (aside, 0, 0))
                if n not in found and container.part(n).kind == "hinged"
            ]
        return found

    def furnish(self, rng: np.random.Generator, fill: float, blocked: float) -> None:
        """Stand things on all boards, as ``make_kitchen`` says."""
        filling = Filling(rng, fill, blocked)
        for name, container in self.containers.items():
            for number, board in enumerate(container.boards):
                for thing, blockers in fill_board(filling, container, board):
                    self.things[thing.name] = Standing(thing, name, number, blockers)

    def open(self, container: str, part: str, opening: float) -> None:
        """Set how far a part is open, 0..1; what lies in a drawer goes with it.  Raises GeometryError on a
        part or container that is not there.
        """
        if container not in self.containers:
            raise GeometryError(f"There is no {container}; choose one of {', '.join(self.containers)}.")
        holder = self.containers[container]
        moved = holder.part(part)
        before = moved.to_world(np.zeros(3))
        moved.opening = float(np.clip(opening, 0.0, 1.0))
        shift = moved.to_world(np.zeros(3)) - before
        for standing in self.things.values():
            if standing.container == container and holder.boards[standing.board].rides == part:
                standing.thing.pose[:3] += shift


def make_kitchen(seed: int, fill: float = 0.7, blocked: float = 0.35) -> Kitchen:
    """Make the kitchen of a seed.

    ``fill`` 0..1: how densely boards are filled; ``blocked`` 0..1: the share of filled boards on which a
    thing at the back has another one before it by choice.  Things stand upright, free of contact with
    each other, exactly on their boards.
    """
    rng = np.random.default_rng([seed, 14])
    row = _row(rng)
    length = row[-1].pose[0] + row[-1].piece.size[0] / 2
    kitchen = Kitchen(seed, _walls(length))
    for container in [*row, *_over_the_row(rng, row), _table(rng, length)]:
        _named(kitchen, container)
    kitchen.furnish(rng, fill, blocked)
    return kitchen


def _named(kitchen: Kitchen, container: Container) -> None:
    """Add a container under a name of its own."""
    count = sum(c.kind == container.kind for c in kitchen.containers.values())
    container.name = container.kind if not count else f"{container.kind} {count + 1}"
    kitchen.containers[container.name] = container


def _row(rng: np.random.Generator) -> list[Container]:
    """What stands along the wall, from the left: cupboards of one depth and height, a fridge and shelves at
    the ends.
    """
    depth, height = float(rng.uniform(0.54, 0.58)), float(rng.uniform(0.84, 0.88))
    kinds = ["floor cupboard", "drawers", "sink", "oven"]
    kinds += [("floor cupboard", "drawers")[int(rng.integers(2))] for _ in range(int(rng.integers(0, 2)))]
    made = []
    for k in rng.permutation(len(kinds)):
        kind = "floor cupboard" if kinds[k] == "sink" else kinds[k]
        wide = {"width": float(rng.uniform(0.6, 0.9))} if kinds[k] == "sink" else {}
        piece = make_container(kind, rng, depth=depth, height=height, **wide)
        if kinds[k] == "sink":  # its basin takes the upper half
            piece.kind, piece.boards = "sink cupboard", piece.boards[:1]
            piece.piece = _without_shelves(piece, height)
            piece.boards = [Shelf(b.low, b.high, b.height, height - 0.24 - b.height) for b in piece.boards]
        made.append(piece)
    ends = [make_container("fridge", rng), make_container("rack", rng)]
    if rng.integers(2):
        ends.reverse()
    placed, x = [], 0.0
    for piece in [ends[0], *made, ends[1]]:
        size = piece.piece.size
        placed.append(piece.put((x + size[0] / 2, -size[1] / 2 - 0.005, 0.0, 0.0)))
        x += float(size[0]) + (_BESIDE if piece is ends[0] or piece is made[-1] else 0.002)
    return placed


def _without_shelves(container: Container, height: float) -> Furniture:
    """A carcass without its shelves and its top, so that a basin hangs into it."""
    p = container.piece
    wide = np.ptp((p.mins[:, 0].min(), p.maxs[:, 0].max())) - 0.05
    level = (p.maxs[:, 2] - p.mins[:, 2] < 0.03) & (p.maxs[:, 0] - p.mins[:, 0] > wide)
    keep = ~(level & (p.mins[:, 2] > 0.2))
    boxes = [
        (*_pair(a[0], b[0]), *_pair(a[1], b[1]), *_pair(a[2], b[2]))
        for a, b in zip(p.mins[keep], p.maxs[keep], strict=True)
    ]
    return build(p.kind, boxes, centred=False)


def _pair(a: float, b: float) -> tuple[float, float]:
    return float(a), float(b)


def _over_the_row(rng: np.random.Generator, row: list[Container]) -> list[Container]:
    """The worktop with its sink, cupboards on the wall over it, and a bin on it."""
    low = [c for c in row if c.kind not in ("fridge", "rack")]
    left, right = low[0].pose[0] - low[0].piece.size[0] / 2, low[-1].pose[0] + low[-1].piece.size[0] / 2
    height, middle = float(low[0].piece.size[2]), (left + right) / 2
    sink = next(c for c in low if c.kind == "sink cupboard")
    top = make_container(
        "worktop",
        rng,
        width=right - left - 0.002,
        sink=sink.pose[0] - middle,
        sink_width=min(0.5, float(sink.piece.size[0]) - 0.08),
    )
    depth = float(np.ptp((top.piece.mins[:, 1].min(), top.piece.maxs[:, 1].max())))
    top.put((middle, -depth / 2 - 0.004, height + 0.001, 0.0))
    level = height + 0.001 + float(top.boards[0].height)
    made = [top]
    edge, under = float(left), float(rng.uniform(1.4, 1.46))
    tall, deep = float(rng.uniform(0.58, 0.66)), float(rng.uniform(0.3, 0.36))
    least = tall / 2 - 0.05  # two levels, both within reach
    slid = int(rng.integers(3))  # which of them has slides
    while right - edge > 0.42:
        width = min(float(rng.uniform(0.45, 0.9)), right - edge)
        if len(made) > 1 and rng.random() < 0.15 and right - edge > width + 0.45:
            edge += width  # a gap, as over a window
            continue
        sliding = {"sliding": 1.0} if len(made) == 1 + slid else {}
        measures = {"width": width - 0.004, "depth": deep, "height": tall, "least": least}
        one = make_container("wall cupboard", rng, **measures, **sliding)
        made.append(one.put((edge + width / 2, -deep / 2 - 0.005, under, 0.0)))
        edge += width
    box = make_container("bin", rng)
    widest = max(top.boards, key=lambda b: float(b.size[0]))
    at = float(widest.low[0] + 0.04 + box.piece.size[0] / 2)
    if at + float(box.piece.size[0]) / 2 < widest.high[0]:
        made.append(box.put((middle + at, -float(box.piece.size[1]) / 2 - 0.06, level, 0.0)))
        _shorten(top, widest, float(at + box.piece.size[0] / 2 + 0.03))
    return made


def _shorten(top: Container, board: Shelf, low: float) -> None:
    """Leave the part of a board left of ``low`` to what stands there."""
    k = next(i for i, b in enumerate(top.boards) if b is board)
    if board.high[0] - low < 0.15:
        del top.boards[k]
    else:
        top.boards[k] = Shelf(np.array((low, board.low[1])), board.high, board.height, board.room)


def _table(rng: np.random.Generator, length: float) -> Container:
    """A table before the row, with room to walk around it."""
    piece = make_furniture(
        "table", rng, width=float(rng.uniform(1.0, 1.6)), depth=float(rng.uniform(0.65, 0.9))
    )
    away = 0.62 + float(rng.uniform(*_FREE_FLOOR)) + float(piece.size[1]) / 2
    return table_of(piece).put((length / 2 + float(rng.uniform(-0.3, 0.3)), -away, 0.0, 0.0))


def _walls(length: float) -> Furniture:
    """The wall behind the row and one at its left end."""
    back = (-0.6, length + 0.6, 0.0, _WALL_THICK, 0.0, _WALL_HIGH)
    return build("walls", [back], centred=False)
