"""Things to sit on, from drawn measures."""

from __future__ import annotations

from typing import Any

import numpy as np

from .measures import choose, pick, supports
from .piece import Furniture, Part, Seat, build, hip_setback


def _back(w: float, y: float, thick: float, low: float, top: float, style: str) -> list[Part]:
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
    kind: str,
    rng: np.random.Generator,
    o: dict[str, Any],
    m: dict[str, float],
    back: bool,
    arms: bool,
    legs: str,
    style: str,
    plate: float,
) -> Furniture:
    """Anything to sit on: ``m`` holds seat_height, width and depth of the free seat, back_height,
    thickness.
    """
    h, w, d, t = m["seat_height"], m["width"], m["depth"], m["thickness"]
    y0, y1 = -d / 2, d / 2
    arm = m.get("arm_width", 0.0) if arms else 0.0
    total_w, total_d = w + 2 * arm, d + (t if back else 0)
    rear = y1 + (t if back else 0)
    boxes = [
        (x0, x1, a + (y0 + rear) / 2, b + (y0 + rear) / 2, z0, z1)
        for x0, x1, a, b, z0, z1 in supports(total_w, total_d, h - plate, 0.05 if w > 0.8 else 0.04, legs)
    ]
    boxes.append((-total_w / 2, total_w / 2, y0, rear, h - plate, h))
    if back:
        boxes += _back(total_w, y1, t, h, h + m["back_height"], style)
    if arms:
        top = h + m["arm_height"]
        start = y0 + m.get("arm_start", 0.0) * d
        rail = choose(rng, o, "arm_style", ("block", "rail") if arm < 0.09 else ("block",)) == "rail"
        for side in (-1, 1):
            x0, x1 = sorted((side * w / 2, side * (w / 2 + arm)))
            if rail:
                boxes += [
                    (x0, x1, start, y1, top - 0.035, top),
                    (x0, x1, start, start + 0.035, h, top - 0.035),
                ]
            else:
                boxes.append((x0, x1, start, y1, h, top))
    return build(kind, boxes, _seat(w, d, y0, h, back, arms))


def chair(rng: np.random.Generator, o: dict[str, Any]) -> Furniture:
    m = pick(
        rng,
        o,
        seat_height=(0.38, 0.55),
        width=(0.38, 0.52),
        depth=(0.38, 0.48),
        thickness=(0.025, 0.06),
        back_height=(0.3, 0.6),
    )
    legs = choose(rng, o, "legs", ("posts", "posts", "posts", "pedestal", "sides", "solid"))
    style = choose(rng, o, "back_style", ("panel", "frame", "ladder"))
    return _seating(
        "chair", rng, o, m, True, False, str(legs), str(style), float(o.pop("plate", rng.uniform(0.02, 0.08)))
    )


def armchair(rng: np.random.Generator, o: dict[str, Any]) -> Furniture:
    m = pick(
        rng,
        o,
        seat_height=(0.36, 0.5),
        width=(0.46, 0.62),
        depth=(0.44, 0.6),
        thickness=(0.05, 0.22),
        back_height=(0.35, 0.6),
        arm_width=(0.04, 0.18),
        arm_height=(0.15, 0.26),
        arm_start=(0.0, 0.25),
    )
    legs = choose(rng, o, "legs", ("posts", "solid", "pedestal"))
    return _seating(
        "armchair", rng, o, m, True, True, str(legs), "panel", float(o.pop("plate", rng.uniform(0.05, 0.2)))
    )


def sofa(rng: np.random.Generator, o: dict[str, Any]) -> Furniture:
    m = pick(
        rng,
        o,
        seat_height=(0.36, 0.48),
        width=(1.1, 2.2),
        depth=(0.5, 0.68),
        thickness=(0.12, 0.28),
        back_height=(0.3, 0.5),
        arm_width=(0.1, 0.25),
        arm_height=(0.12, 0.26),
    )
    arms = bool(choose(rng, o, "arms", (True, True, True, False)))
    legs = choose(rng, o, "legs", ("posts", "solid"))
    return _seating(
        "sofa", rng, o, m, True, arms, str(legs), "panel", float(o.pop("plate", rng.uniform(0.1, 0.25)))
    )


def stool(rng: np.random.Generator, o: dict[str, Any]) -> Furniture:
    m = pick(rng, o, seat_height=(0.38, 0.6), width=(0.3, 0.45), depth=(0.28, 0.42), thickness=(0.03, 0.03))
    return _seating(
        "stool",
        rng,
        o,
        m,
        False,
        False,
        str(choose(rng, o, "legs", ("posts", "pedestal", "solid", "sides"))),
        "panel",
        0.04,
    )


def bench(rng: np.random.Generator, o: dict[str, Any]) -> Furniture:
    m = pick(
        rng,
        o,
        seat_height=(0.38, 0.52),
        width=(0.9, 1.8),
        depth=(0.3, 0.48),
        thickness=(0.03, 0.05),
        back_height=(0.3, 0.5),
    )
    back = bool(choose(rng, o, "back", (False, True)))
    return _seating(
        "bench",
        rng,
        o,
        m,
        back,
        False,
        str(choose(rng, o, "legs", ("posts", "sides", "solid"))),
        "ladder",
        0.05,
    )
