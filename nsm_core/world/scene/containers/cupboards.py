"""Cupboards, drawers, shelves, fridges and bins of boxes, from drawn measures.

Frame: origin on the floor at the centre of the carcass's footprint, front -Y.  A lid turns about the pivot at
its back; what hangs on a wall has its height in its pose.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nsm_core.errors import GeometryError
from nsm_core.world.scene.furniture import Furniture, build, top_of
from nsm_core.world.scene.furniture.measures import pick
from nsm_core.world.scene.furniture.piece import Part

from .container import Container, Shelf
from .fronts import PANEL, SLIT, door, drawer, flap, lid, slides
from .moving_part import MovingPart

_PLINTH = 0.1  # metres of a floor cupboard's foot, which is set back
_SPLIT = 0.55  # metres of width from which on a cupboard has two doors
_TWIN = 0.002  # metres between two doors
_UP = np.array((0.0, 0.0, 1.0))

Measures = dict[str, float]


def carcass(w: float, d: float, z0: float, z1: float, shelves: list[float], t: float) -> list[Part]:
    """An open box of boards ``t`` thick from ``z0`` to ``z1``, open to the front, with shelves at heights of
    their tops.
    """
    x, y = w / 2, d / 2
    boxes = [(-x, -x + t, -y, y, z0, z1), (x - t, x, -y, y, z0, z1)]
    boxes += [(-x + t, x - t, -y, y, z0, z0 + t), (-x + t, x - t, -y, y, z1 - t, z1)]
    boxes += [(-x + t, x - t, y - t / 2, y, z0 + t, z1 - t)]
    return boxes + [(-x + t, x - t, -y + 0.02, y - t / 2, s - t, s) for s in shelves]


def _boards(w: float, d: float, z0: float, z1: float, shelves: list[float], t: float) -> list[Shelf]:
    floors = [z0 + t, *shelves]
    roofs = [*(s - t for s in shelves), z1 - t]
    low, high = np.array((-w / 2 + t, -d / 2 + 0.025)), np.array((w / 2 - t, d / 2 - t / 2))
    return [Shelf(low, high, a, b - a) for a, b in zip(floors, roofs, strict=True)]


def _shelves(z0: float, z1: float, t: float, least: float) -> list[float]:
    """Heights of the shelves that part a carcass evenly, each with ``least`` metres free."""
    count = max(int((z1 - z0 - 2 * t) / (least + t)), 1)
    return [float(z) for z in np.linspace(z0 + t, z1, count + 1)[1:-1]]


def _doors(w: float, z0: float, z1: float, face: float, hinge: int, hand: float = 1.1) -> list[MovingPart]:
    x = w / 2 - SLIT
    if w < _SPLIT:
        return [door("door", (-x, x), (z0 + SLIT, z1 - SLIT), face, hinge, hand=hand)]
    z = (z0 + SLIT, z1 - SLIT)
    left = door("left door", (-x, -_TWIN), z, face, -1, hand=hand)
    return [left, door("right door", (_TWIN, x), z, face, 1, hand=hand)]


def _sign(rng: np.random.Generator) -> int:
    return int(rng.integers(2)) * 2 - 1


def _container(kind: str, boxes: list[Part], parts: list[MovingPart], boards: list[Shelf]) -> Container:
    return Container(kind, kind, build(kind, boxes, centred=False), parts, boards)


def floor_cupboard(rng: np.random.Generator, o: Measures) -> Container:
    m = pick(rng, o, width=(0.4, 0.9), depth=(0.54, 0.58), height=(0.84, 0.88), least=(0.28, 0.34))
    w, d, h, hinge = m["width"], m["depth"], m["height"], _sign(rng)
    inside = _shelves(_PLINTH, h, PANEL, m["least"])
    boxes = carcass(w, d, _PLINTH, h, inside, PANEL)
    boxes += [(-w / 2, w / 2, -d / 2 + 0.05, d / 2, 0, _PLINTH)]
    parts = _doors(w, _PLINTH, h, -d / 2, hinge)
    return _container("floor cupboard", boxes, parts, _boards(w, d, _PLINTH, h, inside, PANEL))


def wall_cupboard(rng: np.random.Generator, o: Measures) -> Container:
    """Its pose has the height of its lower edge; ``sliding`` 1 gives it slides."""
    m = pick(rng, o, width=(0.45, 0.9), depth=(0.3, 0.36), height=(0.55, 0.75), least=(0.26, 0.32))
    sliding, hinge = bool(o.pop("sliding", 0)), _sign(rng)
    w, d, h = m["width"], m["depth"], m["height"]
    inside = _shelves(0.0, h, PANEL, m["least"])
    z = (SLIT, h - SLIT)
    parts = slides((-w / 2, w / 2), z, -d / 2) if sliding else _doors(w, 0.0, h, -d / 2, hinge, 0.0)
    boxes = carcass(w, d, 0.0, h, inside, PANEL)
    return _container("wall cupboard", boxes, parts, _boards(w, d, 0.0, h, inside, PANEL))


def drawers(rng: np.random.Generator, o: Measures) -> Container:
    m = pick(rng, o, width=(0.42, 0.7), depth=(0.54, 0.58), height=(0.84, 0.88))
    w, d, h, count = m["width"], m["depth"], m["height"], int(rng.integers(3, 5))
    edges = np.linspace(_PLINTH, h, count + 1)
    parts, boards = [], []
    for k in range(count):
        name, z = f"drawer {count - k}", (float(edges[k]) + SLIT, float(edges[k + 1]) - SLIT)
        part, (low, high, floor, rim) = drawer(name, (-w / 2, w / 2), z, -d / 2, d / 2 - 0.05)
        parts.append(part)
        boards.append(Shelf(low, high, floor, rim, _UP, name))
    boxes = carcass(w, d, _PLINTH, h, [], PANEL)
    boxes += [(-w / 2, w / 2, -d / 2 + 0.05, d / 2, 0, _PLINTH)]
    return _container("drawers", boxes, parts, boards)


def fridge(rng: np.random.Generator, o: Measures) -> Container:
    m = pick(rng, o, width=(0.56, 0.65), depth=(0.56, 0.62), height=(1.3, 1.85), least=(0.27, 0.33))
    w, d, h, t, hinge = m["width"], m["depth"], m["height"], 0.04, _sign(rng)
    inside = _shelves(0.05, h, t, m["least"])
    boxes = [*carcass(w, d, 0.05, h, inside, t), (-w / 2, w / 2, -d / 2, d / 2, 0, 0.05)]
    x = w / 2 - SLIT
    parts = [door("door", (-x, x), (0.06, h - SLIT), -d / 2, hinge, 0.05)]
    return _container("fridge", boxes, parts, _boards(w, d, 0.05, h, inside, t))


def oven(rng: np.random.Generator, o: Measures) -> Container:
    m = pick(rng, o, width=(0.58, 0.62), depth=(0.54, 0.58), height=(0.84, 0.88))
    w, d, h, t = m["width"], m["depth"], m["height"], 0.03
    z0 = 0.28
    boxes = [*carcass(w, d, z0, h, [], t), (-w / 2, w / 2, -d / 2, d / 2, 0, z0)]
    x = w / 2 - SLIT
    parts = [flap("flap", (-x, x), (z0 + 0.01, h - 0.12), -d / 2)]
    return _container("oven", boxes, parts, _boards(w, d, z0, h, [], t))


def rack(rng: np.random.Generator, o: Measures) -> Container:
    """Open shelves from a hand's height over the floor to as high as one reaches."""
    m = pick(rng, o, width=(0.6, 1.1), depth=(0.3, 0.38), height=(1.5, 2.0), least=(0.28, 0.36))
    w, d, h, t = m["width"], m["depth"], m["height"], 0.022
    inside = _shelves(0.12, h, t, m["least"])
    boxes = carcass(w, d, 0.12, h, inside, t)
    boxes += [(a, b, -d / 2, d / 2, 0, 0.12) for a, b in ((-w / 2, -w / 2 + t), (w / 2 - t, w / 2))]
    boards = _boards(w, d, 0.12, h, inside, t)
    return _container("rack", boxes, [], boards)


def bin_with_lid(rng: np.random.Generator, o: Measures) -> Container:
    """A box to keep bread in, say, that opens upwards."""
    m = pick(rng, o, width=(0.34, 0.44), depth=(0.2, 0.23), height=(0.15, 0.18))
    w, d, h, t = m["width"], m["depth"], m["height"], 0.012
    x, y = w / 2, d / 2
    boxes: list[Part] = [(-x, x, -y, y, 0, t), (-x, -x + t, -y, y, t, h), (x - t, x, -y, y, t, h)]
    boxes += [(-x + t, x - t, -y, -y + t, t, h), (-x + t, x - t, y - t, y, t, h)]
    board = Shelf(np.array((-x + t, -y + t)), np.array((x - t, y - t)), t, h - t, _UP)
    return _container("bin", boxes, [lid("lid", (-x, x), (-y, y), h)], [board])


def worktop(rng: np.random.Generator, o: Measures) -> Container:
    """A plate over floor cupboards, with a sink let into it where ``sink`` (its middle's x) is given.

    Its pose has the height of its under side; without ``sink_width`` and ``sink_depth`` these are drawn.
    """
    m = pick(rng, o, width=(1.5, 3.5), depth=(0.6, 0.64), thick=(0.035, 0.045), sink_width=(0.4, 0.52),
             sink_depth=(0.36, 0.42), deep=(0.16, 0.2))  # fmt: skip
    w, d, t = m["width"], m["depth"], m["thick"]
    x, y = w / 2, d / 2
    if "sink" not in o:
        board = Shelf(np.array((-x, -y)), np.array((x, y)), t, 0.44)
        return _container("worktop", [(-x, x, -y, y, 0, t)], [], [board])
    middle, half, deep = float(o.pop("sink")), m["sink_width"] / 2, m["deep"]
    a, b, front, back = middle - half, middle + half, -y + 0.08, -y + 0.08 + m["sink_depth"]
    s = 0.004
    boxes: list[Part] = [
        (-x, a, -y, y, 0, t),
        (b, x, -y, y, 0, t),
        (a, b, -y, front, 0, t),
        (a, b, back, y, 0, t),
    ]
    boxes += [(a, b, front, back, -deep, -deep + s), (a, a + s, front, back, -deep + s, t)]
    boxes += [(b - s, b, front, back, -deep + s, t), (a + s, b - s, front, front + s, -deep + s, t)]
    boxes += [(a + s, b - s, back - s, back, -deep + s, t)]
    tap = (back + y) / 2
    boxes += [(middle - 0.015, middle + 0.015, tap - 0.015, tap + 0.015, t, t + 0.26)]
    boxes += [(middle - 0.012, middle + 0.012, tap - 0.2, tap - 0.015, t + 0.236, t + 0.26)]
    boards = [Shelf(np.array(p), np.array(q), t, 0.44) for p, q in (((-x, -y), (a, y)), ((b, -y), (x, y)))]
    return _container("worktop", boxes, [], [one for one in boards if one.size.min() > 0.15])


def table_of(piece: Furniture) -> Container:
    """A table, or whatever else has a free level top, as a container without parts."""
    height, corners = top_of(piece)
    height = float(piece.maxs[np.abs(piece.maxs[:, 2] - height) < 2e-3, 2].max())  # to the last digit
    board = Shelf(corners[0].astype(np.float64), corners[1].astype(np.float64), height, 0.6)
    return Container(piece.kind, piece.kind, piece, [], [board])


CUPBOARDS: dict[str, Callable[[np.random.Generator, Measures], Container]] = {
    "floor cupboard": floor_cupboard,
    "wall cupboard": wall_cupboard,
    "drawers": drawers,
    "fridge": fridge,
    "oven": oven,
    "rack": rack,
    "bin": bin_with_lid,
    "worktop": worktop,
}


def make_container(kind: str, rng: np.random.Generator, **overrides: float) -> Container:
    """Make a container of a kind in ``CUPBOARDS``, shut, at the origin; measures in metres that are not given
    are drawn from ``rng``.  Raises GeometryError on an unknown kind or measure.
    """
    if kind not in CUPBOARDS:
        raise GeometryError(f"There is no container of the kind {kind!r}; choose {', '.join(CUPBOARDS)}.")
    left = dict(overrides)
    made = CUPBOARDS[kind](rng, left)
    if left:
        raise GeometryError(f"A {kind} has no measure {', '.join(sorted(left))}; leave it out.")
    return made
