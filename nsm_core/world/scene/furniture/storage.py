"""Tables, storage, boxes, steps and walls, from drawn measures."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .measures import choose, pick, supports
from .piece import Furniture, build


def table(rng: np.random.Generator, o: dict[str, Any]) -> Furniture:
    m = pick(rng, o, height=(0.68, 0.8), width=(0.7, 2.0), depth=(0.6, 1.0))
    w, d, h = m["width"], m["depth"], m["height"]
    boxes = supports(
        w, d, h - 0.04, 0.06, str(choose(rng, o, "legs", ("posts", "posts", "pedestal", "sides")))
    )
    return build("table", boxes + [(-w / 2, w / 2, -d / 2, d / 2, h - 0.04, h)])


def desk(rng: np.random.Generator, o: dict[str, Any]) -> Furniture:
    m = pick(rng, o, height=(0.7, 0.78), width=(1.0, 1.8), depth=(0.55, 0.8), drawers=(0.3, 0.45))
    w, d, h = m["width"], m["depth"], m["height"]
    x, y, top = w / 2, d / 2, h - 0.03
    side = -1 if choose(rng, o, "drawer_side", ("left", "right")) == "right" else 1
    chest_from, chest_to = sorted((side * x, side * (x - m["drawers"])))
    plate_from, plate_to = sorted((-side * x, -side * (x - 0.04)))
    boxes = [
        (-x, x, -y, y, top, h),
        (chest_from, chest_to, -y, y, 0, top),
        (plate_from, plate_to, -y, y, 0, top),
        (-x, x, y - 0.02, y, 0.25, top),
    ]
    return build("desk", boxes)


def block(
    kind: str, **ranges: tuple[float, float]
) -> Callable[[np.random.Generator, dict[str, Any]], Furniture]:
    def maker(rng: np.random.Generator, o: dict[str, Any]) -> Furniture:
        m = pick(rng, o, **ranges)
        w, d = m["width"], m["depth"]
        return build(kind, [(-w / 2, w / 2, -d / 2, d / 2, 0, m["height"])])

    return maker


def shelf(rng: np.random.Generator, o: dict[str, Any]) -> Furniture:
    m = pick(rng, o, width=(0.6, 1.4), depth=(0.25, 0.4), height=(0.8, 2.0))
    w, d, h = m["width"], m["depth"], m["height"]
    x, y, t = w / 2, d / 2, 0.025
    boards = np.linspace(0.05, h - t, max(3, round(h / 0.35)))
    boxes = [(-x, -x + t, -y, y, 0, h), (x - t, x, -y, y, 0, h), (-x + t, x - t, y - 0.01, y, 0, h)]
    return build("shelf", boxes + [(-x + t, x - t, -y, y - 0.01, float(z), float(z) + t) for z in boards])


def step(rng: np.random.Generator, o: dict[str, Any]) -> Furniture:
    """One block, or a flight of ``steps`` that rises towards the back."""
    m = pick(rng, o, width=(0.6, 2.0), depth=(0.35, 1.2), height=(0.15, 0.6))
    w, d, h, count = m["width"], m["depth"], m["height"], max(int(o.pop("steps", 1)), 1)
    edges = np.linspace(-d / 2, d / 2, count + 1)
    treads = zip(edges[:-1], edges[1:], strict=True)
    return build(
        "step",
        [(-w / 2, w / 2, float(a), float(b), 0, h * (k + 1) / count) for k, (a, b) in enumerate(treads)],
    )


def hole_wall(rng: np.random.Generator, o: dict[str, Any]) -> Furniture:
    """A wall with an opening as large as a door somewhere along it."""
    m = pick(rng, o, width=(2.0, 4.0), depth=(0.08, 0.2), height=(2.2, 2.6),
             opening_width=(0.8, 1.2), opening_height=(2.0, 2.2), along=(0.0, 1.0))  # fmt: skip
    x, y, h, gap = m["width"] / 2, m["depth"] / 2, m["height"], m["opening_width"]
    top = min(m["opening_height"], h - 0.05)
    # At least a post of this width stands on either side.
    post = min(0.2, (2 * x - gap) / 4)
    left = -x + post + m["along"] * (2 * x - gap - 2 * post)
    piece = build(
        "hole_wall",
        [(-x, left, -y, y, 0, h), (left + gap, x, -y, y, 0, h), (left, left + gap, -y, y, top, h)],
    )
    piece.opening = (left, left + gap, top)
    return piece
