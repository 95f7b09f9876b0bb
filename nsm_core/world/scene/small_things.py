"""Twenty kinds of light things that stand in kitchens, from drawn measures; none over 25 cm or 3 kg.

Frame: origin under the middle of what it stands on, Z up, a handle towards +X.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import Cuboids, DistanceQuery, Union
from nsm_core.world.geometry.revolved import Revolved

from .furniture.piece import Part, box_mesh
from .props import LightThing, sense

LARGEST, HEAVIEST = 0.25, 3.0  # metres along any axis and kilograms that one hand takes

Outline = list[tuple[float, float]]


@dataclass
class SmallThing(LightThing):
    """A light thing of a ``kind``; its frame is told above.

    ``outline`` (K, 2) radii and heights of its round part, None without, and ``mins``, ``maxs`` (M, 3) of its
    boxes.
    """

    kind: str = ""
    outline: Array | None = None
    mins: Array = None  # type: ignore[assignment]
    maxs: Array = None  # type: ignore[assignment]

    def mesh(self) -> tuple[Array, Array]:
        """Vertices (V, 3) float32 and triangles (F, 3), own frame."""
        made = [Revolved(self.outline).mesh()] if self.outline is not None else []
        made += [box_mesh(self.mins, self.maxs)] if len(self.mins) else []
        offsets = np.cumsum([0, *(len(v) for v, _ in made)])
        triangles = [t + n for (_, t), n in zip(made, offsets, strict=False)]
        return np.concatenate([v for v, _ in made]), np.concatenate(triangles)


@dataclass
class _Shape:
    mass: float
    outline: Outline | None = None
    boxes: tuple[Part, ...] = ()
    handle: int = 0  # how many of the last boxes are the handle


def _hollow(r0: float, r1: float, h: float, wall: float, foot: float = 0.006) -> Outline:
    """A vessel of radius ``r0`` at its foot and ``r1`` at its rim, open above."""
    return [(0, 0), (r0, 0), (r1, h), (r1 - wall, h), (max(r0 - wall, 0.005), foot), (0, foot)]


def _solid(*rings: tuple[float, float]) -> Outline:
    """What is full from its foot to its top, by radius and height of its rings."""
    return [(0, rings[0][1]), *rings, (0, rings[-1][1])]


def _ear(r: float, z0: float, z1: float, out: float, thick: float = 0.011) -> tuple[Part, ...]:
    """A handle at the side, as a mug has it: two arms and a bar."""
    y = thick / 2
    a, b = r - 0.004, r + out
    return (
        (a, b, -y, y, z1 - thick, z1),
        (a, b, -y, y, z0, z0 + thick),
        (b - thick, b, -y, y, z0 + thick, z1 - thick),
    )


def _block(x: float, y: float, z: float) -> tuple[Part, ...]:
    return ((-x / 2, x / 2, -y / 2, y / 2, 0.0, z),)


Draw = Callable[[float, float], float]


def _mug(u: Draw) -> _Shape:
    r, h = u(0.038, 0.045), u(0.085, 0.105)
    return _Shape(0.35, _hollow(r, r, h, 0.005), _ear(r, 0.2 * h, 0.85 * h, 0.036), 3)


def _cup(u: Draw) -> _Shape:
    r, h = u(0.04, 0.046), u(0.058, 0.07)
    return _Shape(0.2, _hollow(0.6 * r, r, h, 0.004), _ear(0.92 * r, 0.25 * h, 0.9 * h, 0.03, 0.009), 3)


def _glass(u: Draw) -> _Shape:
    r = u(0.03, 0.038)
    return _Shape(0.25, _hollow(0.85 * r, r, u(0.1, 0.15), 0.004))


def _bowl(u: Draw) -> _Shape:
    r = u(0.065, 0.09)
    return _Shape(0.4, _hollow(0.5 * r, r, u(0.05, 0.075), 0.006))


def _plate(u: Draw) -> _Shape:
    r = u(0.095, 0.12)
    return _Shape(0.5, [(0, 0), (0.55 * r, 0), (r, 0.03), (r, 0.034), (0.57 * r, 0.006), (0, 0.006)])


def _plates(u: Draw) -> _Shape:
    r, h = u(0.095, 0.12), u(0.045, 0.07)
    return _Shape(30 * h, [(0, 0), (0.55 * r, 0), (r, 0.03), (r, h), (0.57 * r, h - 0.026), (0, h - 0.026)])


def _jar(u: Draw) -> _Shape:
    r, h = u(0.035, 0.046), u(0.1, 0.16)
    lid = (0.85 * r, h - 0.018), (0.85 * r, h)
    return _Shape(0.6, _solid((r, 0), (r, h - 0.03), *lid))


def _bottle(u: Draw) -> _Shape:
    r, h = u(0.033, 0.042), u(0.21, 0.248)
    return _Shape(0.9, _solid((r, 0), (r, 0.6 * h), (0.016, 0.78 * h), (0.016, h)))


def _tin(u: Draw) -> _Shape:
    r = u(0.033, 0.046)
    return _Shape(0.45, _solid((r, 0), (r, h := u(0.08, 0.12)), (0.97 * r, h)))


def _canister(u: Draw) -> _Shape:
    r, h = u(0.042, 0.049), u(0.14, 0.2)
    return _Shape(0.7, _solid((r, 0), (r, h), (0.012, h), (0.012, h + 0.025)))


def _teapot(u: Draw) -> _Shape:
    r, h = u(0.06, 0.072), u(0.1, 0.125)
    body = _solid((0.7 * r, 0), (r, 0.4 * h), (0.6 * r, 0.85 * h), (0.012, 0.88 * h), (0.012, h))
    spout = (-r - 0.035, -0.8 * r, -0.009, 0.009, 0.5 * h, 0.75 * h)
    return _Shape(0.9, body, (spout, *_ear(0.85 * r, 0.25 * h, 0.78 * h, 0.045)), 3)


def _kettle(u: Draw) -> _Shape:
    r, h = u(0.07, 0.082), u(0.11, 0.13)
    body = _solid((r, 0), (r, 0.55 * h), (0.5 * r, h))
    a, y, top = 0.6 * r, 0.008, h + u(0.055, 0.07)
    bow = ((-a, -a + 0.012, -y, y, 0.75 * h, top), (a - 0.012, a, -y, y, 0.75 * h, top),
           (-a, a, -y, y, top, top + 0.014))  # fmt: skip
    return _Shape(1.3, body, bow, 3)


def _saucepan(u: Draw) -> _Shape:
    r, h = u(0.055, 0.063), u(0.07, 0.09)
    return _Shape(
        0.8, _hollow(r, r, h, 0.004), ((r - 0.003, r + 0.115, -0.009, 0.009, h - 0.025, h - 0.011),), 1
    )


def _cereal(u: Draw) -> _Shape:
    return _Shape(0.4, None, _block(u(0.15, 0.19), u(0.05, 0.07), u(0.21, 0.248)))


def _carton(u: Draw) -> _Shape:
    side = u(0.06, 0.072)
    return _Shape(1.05, None, _block(side, side, u(0.19, 0.235)))


def _spice(u: Draw) -> _Shape:
    r, h = u(0.018, 0.024), u(0.085, 0.11)
    return _Shape(0.12, _solid((r, 0), (r, 0.75 * h), (0.85 * r, 0.78 * h), (0.85 * r, h)))


def _mill(u: Draw) -> _Shape:
    r, h = u(0.024, 0.03), u(0.14, 0.2)
    return _Shape(0.3, _solid((r, 0), (0.65 * r, 0.6 * h), (0.9 * r, 0.75 * h), (0.4 * r, h)))


def _caddy(u: Draw) -> _Shape:
    return _Shape(0.25, None, _block(u(0.08, 0.1), u(0.06, 0.08), u(0.1, 0.14)))


def _loaf(u: Draw) -> _Shape:
    return _Shape(0.5, None, _block(u(0.18, 0.24), u(0.075, 0.09), u(0.07, 0.09)))


def _book(u: Draw) -> _Shape:
    return _Shape(0.8, None, _block(u(0.035, 0.05), u(0.16, 0.19), u(0.21, 0.248)))


THINGS: dict[str, Callable[[Draw], _Shape]] = {
    "mug": _mug,
    "cup": _cup,
    "glass": _glass,
    "bowl": _bowl,
    "plate": _plate,
    "plate stack": _plates,
    "jar": _jar,
    "bottle": _bottle,
    "tin": _tin,
    "canister": _canister,
    "teapot": _teapot,
    "kettle": _kettle,
    "saucepan": _saucepan,
    "cereal box": _cereal,
    "carton": _carton,
    "spice jar": _spice,
    "pepper mill": _mill,
    "tea caddy": _caddy,
    "loaf": _loaf,
    "cookbook": _book,
}


def make_thing(
    kind: str, rng: np.random.Generator, pose: ArrayLike = (0, 0, 0, 0), name: str = ""
) -> SmallThing:
    """Make a thing of a kind in ``THINGS`` at ``pose`` (4,): x, y, z of its foot and heading; its name is its
    kind if not given.  Raises GeometryError on an unknown kind.
    """
    if kind not in THINGS:
        raise GeometryError(f"There is no thing of the kind {kind!r}; choose {', '.join(THINGS)}.")
    shape = THINGS[kind](lambda a, b: float(rng.uniform(a, b)))
    boxes = np.array(shape.boxes, dtype=np.float32).reshape(-1, 3, 2)
    mins, maxs = boxes[..., 0], boxes[..., 1]
    parts: list[DistanceQuery] = []
    corners = []
    if shape.outline is not None:
        parts.append(round_part := Revolved(shape.outline))
        corners.append(round_part.bounds)
    if len(boxes):
        parts.append(Cuboids([((0, 0, 0), 0.0, mins, maxs)]))
        corners.append((mins.min(0).astype(np.float64), maxs.max(0).astype(np.float64)))
    low, high = np.min([c[0] for c in corners], axis=0), np.max([c[1] for c in corners], axis=0)
    query = Union(parts) if len(parts) > 1 else parts[0]
    held = slice(len(boxes) - shape.handle, None)
    handle = np.array((mins[held].min(0), maxs[held].max(0))) if shape.handle else None
    return SmallThing(
        name or kind,
        query,
        sense(query, low, high),
        np.asarray(pose, dtype=np.float64),
        low,
        high,
        shape.mass,
        handle,
        kind,
        None if shape.outline is None else np.array(shape.outline),
        mins,
        maxs,
    )
