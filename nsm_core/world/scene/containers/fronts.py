"""Doors, drawers, slides, lids and flaps of boxes, by the measures of the front that they shut.

Frame of the furniture: front -Y.  A front lies before the carcass, whose face is at ``face``, and turns about
its own outer edge, so that it stays clear of what stands beside it.
"""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array
from nsm_core.world.scene.furniture.piece import Part

from .moving_part import MovingPart, moving_part

PANEL = 0.018  # thickness of boards and fronts, metres
SLIT = 0.002  # metres that fronts keep from each other and from the carcass
_BAR, _STANDS_OFF = (
    0.012,
    0.035,
)  # thickness of a handle's bar and its middle's distance from the front, metres
_FROM_EDGE = 0.04  # metres from a door's free edge to its handle
_SWING, _FLAP, _LID = (float(np.radians(a)) for a in (90.0, 90.0, 80.0))
_IN_CARCASS = 0.012  # metres on each side of a drawer for its runners
_KEPT = 0.12  # metres of a drawer that stay in
_SHOWN = 0.1  # metres of a sliding panel that stay beside the other one, with its handle


def _arrays(boxes: list[Part]) -> tuple[Array, Array]:
    a = np.array(boxes, dtype=np.float32).reshape(-1, 3, 2)
    return a[..., 0], a[..., 1]


def _made(name: str, kind: str, boxes: list[Part], **how: object) -> MovingPart:
    mins, maxs = _arrays(boxes)
    return moving_part(name, kind, (mins, maxs), (mins.min(0), maxs.max(0)), **how)  # type: ignore[arg-type]


def door(
    name: str,
    x: tuple[float, float],
    z: tuple[float, float],
    face: float,
    hinge: int,
    thick: float = PANEL,
    hand: float = 1.1,
) -> MovingPart:
    """A door over ``x`` and ``z`` that hangs at its edge of lower (``hinge`` -1) or greater x (1), with a bar
    that stands near the free edge, as near to the height ``hand`` as the door lets it.
    """
    y0, y1 = face - SLIT - thick, face - SLIT
    edge, free = (x[0], x[1]) if hinge < 0 else (x[1], x[0])
    at = free + hinge * _FROM_EDGE
    low, high = z[0] + 0.08, z[1] - 0.08
    middle = float(np.clip(hand, min(low + 0.06, high), max(high - 0.06, low)))
    half = min(0.09, (high - low) / 2)
    bar = (at - _BAR / 2, at + _BAR / 2, y0 - _STANDS_OFF - _BAR / 2, y0, middle - half, middle + half)
    return _made(
        name,
        "hinged",
        [(*x, y0, y1, *z), *_bar(bar, upright=True)],
        axis=(0, 0, hinge),
        pivot=(edge, y0, 0),
        travel=_SWING,
        handle=(at, y0 - _STANDS_OFF, middle),
    )


def drawer(
    name: str, x: tuple[float, float], z: tuple[float, float], face: float, back: float
) -> tuple[MovingPart, tuple[Array, Array, float, float]]:
    """A drawer whose front covers ``x`` and ``z`` and whose box reaches to ``back``.

    Returns it and the part of its floor that comes out: corners (2,), (2,), height and metres up to its rim.
    """
    y0, y1 = face - SLIT - PANEL, face - SLIT
    a, b = x[0] + PANEL + _IN_CARCASS, x[1] - PANEL - _IN_CARCASS
    bottom, rim = z[0] + 0.022, z[1] - 0.03
    t = 0.012
    middle = (x[0] + x[1]) / 2
    half = min(0.09, (x[1] - x[0]) / 2 - 0.05)
    height = (z[0] + z[1]) / 2
    bar = (
        middle - half,
        middle + half,
        y0 - _STANDS_OFF - _BAR / 2,
        y0,
        height - _BAR / 2,
        height + _BAR / 2,
    )
    boxes = [
        (*x, y0, y1, *z),
        (a, b, y1, back, bottom, bottom + t),
        (a, a + t, y1, back, bottom + t, rim),
        (b - t, b, y1, back, bottom + t, rim),
        (a + t, b - t, back - t, back, bottom + t, rim),
        *_bar(bar, upright=False),
    ]
    made = _made(
        name,
        "drawer",
        boxes,
        axis=(0, -1, 0),
        pivot=(middle, y0, height),
        travel=back - y1 - _KEPT,
        handle=(middle, y0 - _STANDS_OFF, height),
        bar=(1, 0, 0),
    )
    # What stays in when it is open is out of reach.
    floor = np.array((a + t, y1)), np.array((b - t, back - _KEPT)), bottom + t, rim - bottom - t
    return made, floor


def slides(x: tuple[float, float], z: tuple[float, float], face: float) -> list[MovingPart]:
    """Two panels on two tracks that pass each other; each has an upright bar at its outer edge."""
    middle, made = (x[0] + x[1]) / 2, []
    height, half = (z[0] + z[1]) / 2, min(0.08, (z[1] - z[0]) / 2 - 0.05)
    for name, sign, track in (("left", -1, 1), ("right", 1, 0)):
        y1 = face - SLIT - track * (PANEL + 2 * SLIT)
        y0 = y1 - PANEL
        outer, inner = x[0 if sign < 0 else 1], middle - sign * 0.02
        at = outer - sign * _FROM_EDGE
        bar = (at - _BAR / 2, at + _BAR / 2, y0 - _STANDS_OFF - _BAR / 2, y0, height - half, height + half)
        made.append(
            _made(
                f"{name} slide",
                "sliding",
                [(min(outer, inner), max(outer, inner), y0, y1, *z), *_bar(bar, upright=True)],
                axis=(-sign, 0, 0),
                pivot=(at, y0, height),
                travel=abs(outer - middle) - _SHOWN,
                handle=(at, y0 - _STANDS_OFF, height),
            )
        )
    return made


def flap(name: str, x: tuple[float, float], z: tuple[float, float], face: float) -> MovingPart:
    """A front that turns down about its lower edge, as an oven's does; its bar lies along the upper one."""
    y0, y1 = face - SLIT - 2 * PANEL, face - SLIT
    at, middle = z[1] - 0.05, (x[0] + x[1]) / 2
    half = (x[1] - x[0]) / 2 - 0.06
    bar = (middle - half, middle + half, y0 - _STANDS_OFF - _BAR / 2, y0, at - _BAR / 2, at + _BAR / 2)
    return _made(
        name,
        "lid",
        [(*x, y0, y1, *z), *_bar(bar, upright=False)],
        axis=(1, 0, 0),
        pivot=(middle, y0, z[0]),
        travel=_FLAP,
        handle=(middle, y0 - _STANDS_OFF, at),
        bar=(1, 0, 0),
    )


def lid(name: str, x: tuple[float, float], y: tuple[float, float], top: float) -> MovingPart:
    """A lid on ``top`` that turns up about its back edge and is held by its front edge, which stands out."""
    middle, front = (x[0] + x[1]) / 2, y[0] - 0.025
    z0, z1 = top + SLIT, top + SLIT + PANEL
    return _made(
        name,
        "lid",
        [(*x, front, y[1], z0, z1)],
        axis=(-1, 0, 0),
        pivot=(middle, y[1], z1),
        travel=_LID,
        handle=(middle, front + 0.02, (z0 + z1) / 2),
        bar=(1, 0, 0),
    )


def _bar(box: Part, upright: bool) -> list[Part]:
    """A handle: the bar over the whole length of a box, and the two feet that it stands off the front by."""
    x0, x1, y0, y1, z0, z1 = box
    y, foot = y0 + _BAR, _BAR
    if upright:
        return [(x0, x1, y0, y, z0, z1), (x0, x1, y, y1, z0, z0 + foot), (x0, x1, y, y1, z1 - foot, z1)]
    return [(x0, x1, y0, y, z0, z1), (x0, x0 + foot, y, y1, z0, z1), (x1 - foot, x1, y, y1, z0, z1)]
