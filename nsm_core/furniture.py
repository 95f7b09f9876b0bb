"""Furniture made of boxes, for training data, the demo room and the tests.

Object frame: origin on the floor at the centre of the footprint, Z up, front -Y.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from .errors import GeometryError
from .rotations import Array
from .seats import Seat, hip_setback
from .sensors.query import Cuboids

Box = tuple[float, float, float, float, float, float]  # x0, x1, y0, y1, z0, z1


@dataclass
class Furniture:
    """A piece of furniture.

    ``vertices`` (V, 3) metres and ``triangles`` (F, 3) of closed boxes, facing outwards; ``mins``, ``maxs`` (M, 3) the
    same boxes exactly; all in the object frame.  ``seat`` is None where nobody can sit.
    """

    kind: str
    vertices: Array
    triangles: Array
    mins: Array
    maxs: Array
    seat: Seat | None

    @property
    def centre(self) -> Array:
        """Centre (3,) of the bounding box, object frame."""
        return (self.mins.min(0) + self.maxs.max(0)) / 2

    @property
    def size(self) -> Array:
        """Size (3,) of the bounding box, metres."""
        return self.maxs.max(0) - self.mins.min(0)


# Corners of a box as (x, y, z) choices of minimum or maximum, and its twelve triangles seen from outside.
_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
_TRIANGLES = np.array([t for a, b, c, d in _QUADS for t in ((a, b, c), (a, c, d))])


def box_mesh(mins: Array, maxs: Array) -> tuple[Array, Array]:
    """Closed mesh of boxes: vertices (8 M, 3) float32 and outward triangles (12 M, 3) of ``mins``, ``maxs`` (M, 3)."""
    mins, maxs = np.asarray(mins), np.asarray(maxs)
    corners = np.where(_CORNERS[None] == 1, maxs[:, None], mins[:, None]).astype(np.float32)
    triangles = _TRIANGLES[None] + 8 * np.arange(len(mins))[:, None, None]
    return corners.reshape(-1, 3), triangles.reshape(-1, 3)


def cuboids(placed: Iterable[tuple[Furniture, Array, float]]) -> Cuboids:
    """Collider of furniture at world positions (2,) or (3,), metres, and headings, radians."""
    return Cuboids([(position, heading, f.mins, f.maxs) for f, position, heading in placed])


def _build(kind: str, boxes: list[Box], seat: Seat | None = None) -> Furniture:
    a = np.array(boxes, dtype=np.float32).reshape(-1, 3, 2)
    mins, maxs = a[..., 0], a[..., 1]
    if (maxs - mins <= 0).any():
        raise GeometryError(f"These measures leave no room for every part of a {kind}; choose larger ones.")
    # The footprint is centred, whatever leans out at the back.
    shift = (mins.min(0) + maxs.max(0)) / 2 * np.array((1, 1, 0), np.float32)
    mins, maxs = mins - shift, maxs - shift
    if seat is not None:
        seat.point = (seat.point - shift).astype(np.float32)
    return Furniture(kind, *box_mesh(mins, maxs), mins, maxs, seat)


def _pick(rng: np.random.Generator, overrides: dict, **ranges: tuple[float, float]) -> dict[str, float]:
    """Draw every measure from its range, then let the caller's own values win."""
    drawn = {name: float(rng.uniform(*bounds)) for name, bounds in ranges.items()}
    for name in ranges:
        if overrides.get(name) is not None:
            drawn[name] = float(overrides.pop(name))
    return drawn


def _choose(rng: np.random.Generator, overrides: dict, name: str, options: tuple) -> object:
    drawn = options[int(rng.integers(len(options)))]
    return overrides.pop(name, drawn)


def _legs(w: float, d: float, top: float, thick: float, style: str) -> list[Box]:
    """Whatever carries a plate of ``w`` x ``d`` at height ``top``."""
    x, y = w / 2, d / 2
    if style == "solid":
        return [(-x, x, -y, y, 0, top)]
    if style == "pedestal":
        return [(-0.03, 0.03, -0.03, 0.03, 0.05, top), (-x * 0.8, x * 0.8, -0.03, 0.03, 0, 0.05), (-0.03, 0.03, -y * 0.8, y * 0.8, 0, 0.05)]
    if style == "sides":
        return [(-x, -x + thick, -y, y, 0, top), (x - thick, x, -y, y, 0, top)]
    return [(sx * x - (thick if sx > 0 else 0), sx * x + (thick if sx < 0 else 0),
             sy * y - (thick if sy > 0 else 0), sy * y + (thick if sy < 0 else 0), 0, top) for sx in (-1, 1) for sy in (-1, 1)]  # fmt: skip


def _back(w: float, y: float, thick: float, low: float, top: float, style: str) -> list[Box]:
    """A back rest between the heights ``low`` and ``top`` whose front is at ``y``."""
    x = w / 2
    posts = [(-x, -x + 0.04, y, y + thick, low, top), (x - 0.04, x, y, y + thick, low, top)]
    if style == "frame":  # two posts and a rail at the top
        return posts + [(-x, x, y, y + thick, low + 0.6 * (top - low), top)]
    if style == "ladder":
        rails = np.linspace(low, top, 4)[1:]
        return posts + [(-x, x, y, y + thick, float(z) - 0.06, float(z)) for z in rails]
    return [(-x, x, y, y + thick, low, top)]


def _seat(width: float, depth: float, front: float, height: float, back: bool, arms: bool) -> Seat:
    point = np.array((0, front + hip_setback(depth), height), dtype=np.float32)
    return Seat(point, 0.0, height, width, depth, back, arms)


def _seating(
    kind: str, rng: np.random.Generator, o: dict, m: dict[str, float], back: bool, arms: bool, legs: str, style: str, plate: float
) -> Furniture:
    """Anything to sit on: ``m`` holds seat_height, width and depth of the free seat, back_height, thickness."""
    h, w, d, t = m["seat_height"], m["width"], m["depth"], m["thickness"]
    y0, y1 = -d / 2, d / 2
    arm = m.get("arm_width", 0.0) if arms else 0.0
    total_w, total_d = w + 2 * arm, d + (t if back else 0)
    rear = y1 + (t if back else 0)
    boxes = [(x0, x1, a + (y0 + rear) / 2, b + (y0 + rear) / 2, z0, z1)
             for x0, x1, a, b, z0, z1 in _legs(total_w, total_d, h - plate, 0.05 if w > 0.8 else 0.04, legs)]  # fmt: skip
    boxes.append((-total_w / 2, total_w / 2, y0, rear, h - plate, h))
    if back:
        boxes += _back(total_w, y1, t, h, h + m["back_height"], style)
    if arms:
        top = h + m["arm_height"]
        start = y0 + m.get("arm_start", 0.0) * d
        rail = _choose(rng, o, "arm_style", ("block", "rail") if arm < 0.09 else ("block",)) == "rail"
        for side in (-1, 1):
            x0, x1 = sorted((side * w / 2, side * (w / 2 + arm)))
            if rail:
                boxes += [(x0, x1, start, y1, top - 0.035, top), (x0, x1, start, start + 0.035, h, top - 0.035)]
            else:
                boxes.append((x0, x1, start, y1, h, top))
    return _build(kind, boxes, _seat(w, d, y0, h, back, arms))


def _chair(rng: np.random.Generator, o: dict) -> Furniture:
    m = _pick(rng, o, seat_height=(0.38, 0.55), width=(0.38, 0.52), depth=(0.38, 0.48), thickness=(0.025, 0.06), back_height=(0.3, 0.6))
    legs = _choose(rng, o, "legs", ("posts", "posts", "posts", "pedestal", "sides", "solid"))
    style = _choose(rng, o, "back_style", ("panel", "frame", "ladder"))
    return _seating("chair", rng, o, m, True, False, str(legs), str(style), float(o.pop("plate", rng.uniform(0.02, 0.08))))


def _armchair(rng: np.random.Generator, o: dict) -> Furniture:
    m = _pick(rng, o, seat_height=(0.36, 0.5), width=(0.46, 0.62), depth=(0.44, 0.6), thickness=(0.05, 0.22), back_height=(0.35, 0.6),
              arm_width=(0.04, 0.18), arm_height=(0.15, 0.26), arm_start=(0.0, 0.25))  # fmt: skip
    legs = _choose(rng, o, "legs", ("posts", "solid", "pedestal"))
    return _seating("armchair", rng, o, m, True, True, str(legs), "panel", float(o.pop("plate", rng.uniform(0.05, 0.2))))


def _sofa(rng: np.random.Generator, o: dict) -> Furniture:
    m = _pick(rng, o, seat_height=(0.36, 0.48), width=(1.1, 2.2), depth=(0.5, 0.68), thickness=(0.12, 0.28), back_height=(0.3, 0.5),
              arm_width=(0.1, 0.25), arm_height=(0.12, 0.26))  # fmt: skip
    arms = bool(_choose(rng, o, "arms", (True, True, True, False)))
    legs = _choose(rng, o, "legs", ("posts", "solid"))
    return _seating("sofa", rng, o, m, True, arms, str(legs), "panel", float(o.pop("plate", rng.uniform(0.1, 0.25))))


def _stool(rng: np.random.Generator, o: dict) -> Furniture:
    m = _pick(rng, o, seat_height=(0.38, 0.6), width=(0.3, 0.45), depth=(0.28, 0.42), thickness=(0.03, 0.03))
    return _seating("stool", rng, o, m, False, False, str(_choose(rng, o, "legs", ("posts", "pedestal", "solid", "sides"))), "panel", 0.04)


def _bench(rng: np.random.Generator, o: dict) -> Furniture:
    m = _pick(rng, o, seat_height=(0.38, 0.52), width=(0.9, 1.8), depth=(0.3, 0.48), thickness=(0.03, 0.05), back_height=(0.3, 0.5))
    back = bool(_choose(rng, o, "back", (False, True)))
    return _seating("bench", rng, o, m, back, False, str(_choose(rng, o, "legs", ("posts", "sides", "solid"))), "ladder", 0.05)


def _table(rng: np.random.Generator, o: dict) -> Furniture:
    m = _pick(rng, o, height=(0.68, 0.8), width=(0.7, 2.0), depth=(0.6, 1.0))
    w, d, h = m["width"], m["depth"], m["height"]
    boxes = _legs(w, d, h - 0.04, 0.06, str(_choose(rng, o, "legs", ("posts", "posts", "pedestal", "sides"))))
    return _build("table", boxes + [(-w / 2, w / 2, -d / 2, d / 2, h - 0.04, h)])


def _desk(rng: np.random.Generator, o: dict) -> Furniture:
    m = _pick(rng, o, height=(0.7, 0.78), width=(1.0, 1.8), depth=(0.55, 0.8), drawers=(0.3, 0.45))
    w, d, h = m["width"], m["depth"], m["height"]
    x, y, top = w / 2, d / 2, h - 0.03
    side = -1 if _choose(rng, o, "drawer_side", ("left", "right")) == "right" else 1
    chest = sorted((side * x, side * (x - m["drawers"])))
    plate = sorted((-side * x, -side * (x - 0.04)))
    boxes = [(-x, x, -y, y, top, h), (*chest, -y, y, 0, top), (*plate, -y, y, 0, top), (-x, x, y - 0.02, y, 0.25, top)]
    return _build("desk", boxes)


def _block(kind: str, **ranges: tuple[float, float]) -> Callable[[np.random.Generator, dict], Furniture]:
    def build(rng: np.random.Generator, o: dict) -> Furniture:
        m = _pick(rng, o, **ranges)
        w, d = m["width"], m["depth"]
        return _build(kind, [(-w / 2, w / 2, -d / 2, d / 2, 0, m["height"])])

    return build


def _shelf(rng: np.random.Generator, o: dict) -> Furniture:
    m = _pick(rng, o, width=(0.6, 1.4), depth=(0.25, 0.4), height=(0.8, 2.0))
    w, d, h = m["width"], m["depth"], m["height"]
    x, y, t = w / 2, d / 2, 0.025
    boards = np.linspace(0.05, h - t, max(3, round(h / 0.35)))
    boxes = [(-x, -x + t, -y, y, 0, h), (x - t, x, -y, y, 0, h), (-x + t, x - t, y - 0.01, y, 0, h)]
    return _build("shelf", boxes + [(-x + t, x - t, -y, y - 0.01, float(z), float(z) + t) for z in boards])


MAKERS: dict[str, Callable[[np.random.Generator, dict], Furniture]] = {
    "chair": _chair, "armchair": _armchair, "sofa": _sofa, "stool": _stool, "bench": _bench,
    "table": _table, "desk": _desk, "shelf": _shelf,
    "cabinet": _block("cabinet", width=(0.4, 1.6), depth=(0.35, 0.6), height=(0.7, 2.0)),
    "box": _block("box", width=(0.25, 0.6), depth=(0.25, 0.6), height=(0.2, 0.6)),
    "wall": _block("wall", width=(1.0, 4.0), depth=(0.08, 0.2), height=(2.2, 2.8)),
}  # fmt: skip
KINDS = tuple(MAKERS)
SEAT_KINDS = ("chair", "armchair", "sofa", "stool", "bench")


def make(kind: str, rng: np.random.Generator, **overrides: object) -> Furniture:
    """Make a piece of furniture of a kind in ``KINDS``; measures not given are drawn from ``rng``.

    ``overrides`` in metres: width, depth, height or seat_height, back_height, thickness, arm_width, arm_height,
    arm_start (share of the depth), plate; and legs ("posts", "pedestal", "sides", "solid"), back_style ("panel",
    "frame", "ladder"), arm_style ("block", "rail"), arms, back, drawer_side.  On a seat, width and depth are those
    of the free surface.  Raises GeometryError on an unknown kind or measure, or on measures that do not fit together.
    """
    if kind not in MAKERS:
        raise GeometryError(f"There is no furniture of the kind {kind!r}; choose one of {', '.join(KINDS)}.")
    left = dict(overrides)
    made = MAKERS[kind](rng, left)
    if left:
        raise GeometryError(f"A {kind} has no measure {', '.join(sorted(left))}; leave it out.")
    return made
