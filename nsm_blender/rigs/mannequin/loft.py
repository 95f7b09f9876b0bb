"""Smooth closed bodies from a few measured cross-sections: the clay the mannequin is made of."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from nsm_core.rotations import Array

_Z_UP = np.eye(3)


@dataclass
class LoftPart:
    """A closed mesh with one material and weights on joints: ``vertices`` (V, 3), ``faces`` of 3 or 4
    indices.
    """

    vertices: Array
    faces: list[tuple[int, ...]]
    material: int
    weights: dict[str, Array] = field(default_factory=dict)  # joint name to (V,)

    def rigid(self, joint: str) -> LoftPart:
        """Hang the whole part on one joint."""
        self.weights = {joint: np.ones(len(self.vertices))}
        return self

    def blend(self, axis: int, stops: list[tuple[float, str]]) -> LoftPart:
        """Weight by the coordinate on ``axis``: full weight at each stop (metres, joint), smooth in
        between.
        """
        places = np.array([s for s, _ in stops])
        order = np.argsort(places)
        s = np.clip(self.vertices[:, axis], places.min(), places.max())
        self.weights = {joint: np.zeros(len(s)) for _, joint in stops}
        for low, high in zip(order[:-1], order[1:], strict=True):
            inside = (s >= places[low]) & (s < places[high])
            t = (s[inside] - places[low]) / (places[high] - places[low])
            t = t * t * (3 - 2 * t)
            self.weights[stops[low][1]][inside] += 1 - t  # one joint may hold two stops
            self.weights[stops[high][1]][inside] += t
        self.weights[stops[order[-1]][1]][s == places.max()] = 1
        return self

    def mirrored(self) -> LoftPart:
        """The part on the other side of x = 0, on the other side's joints."""
        weights = {_other_side(name): w for name, w in self.weights.items()}
        return LoftPart(self.vertices * (-1, 1, 1), [f[::-1] for f in self.faces], self.material, weights)


def loft(
    sections: list[tuple[float, ...]],
    material: int,
    axes: Array = _Z_UP,
    origin: tuple[float, float, float] = (0, 0, 0),
    caps: tuple[float, float] = (0.01, 0.01),
    roundness: tuple[float, float] = (2.0, 2.0),
    spacing: float = 0.032,
    ring: int = 24,
) -> LoftPart:
    """Skin cross-sections along an axis, with domed ends.

    Each section is (s, cu, cv, a, below, above), metres: at ``s`` along the third of ``axes`` (rows U, V, S)
    an oval around (cu, cv) that reaches ``a`` to both sides in U, ``below`` towards -V and ``above`` towards
    +V.  ``caps`` are the heights of the end domes; ``roundness`` the superellipse exponents of the -V and +V
    halves (2 is an ellipse, more is squarer); ``spacing`` the ring distance and ``ring`` the vertices around.
    """
    table = np.array(sections, dtype=np.float64)
    table = table if table[0, 0] < table[-1, 0] else table[::-1]
    rows = _interpolate(table, spacing)
    rows = np.concatenate((_dome(rows[0], -caps[0]), rows, _dome(rows[-1], caps[1])[::-1]))
    angle = np.arange(ring) * (2 * np.pi / ring)
    c, s = np.cos(angle), np.sin(angle)
    exponent = np.where(s < 0, 2 / roundness[0], 2 / roundness[1])
    c, s = np.sign(c) * np.abs(c) ** exponent, np.sign(s) * np.abs(s) ** exponent
    u = rows[:, 1:2] + rows[:, 3:4] * c
    v = rows[:, 2:3] + np.where(s < 0, rows[:, 4:5], rows[:, 5:6]) * s
    along = np.broadcast_to(rows[:, :1], u.shape)
    local = np.stack((u, v, along), axis=-1).reshape(-1, 3)
    poles = np.array(
        [(rows[0, 1], rows[0, 2], table[0, 0] - caps[0]), (rows[-1, 1], rows[-1, 2], table[-1, 0] + caps[1])]
    )
    vertices = np.concatenate((local, poles)) @ np.asarray(axes, float) + origin
    return LoftPart(
        vertices, _ring_faces(len(rows), ring, np.linalg.det(np.asarray(axes, float)) < 0), material
    )


def ball(
    centre: Array, radius: float | tuple[float, float, float], material: int, ring: int = 20
) -> LoftPart:
    """A sphere or ellipsoid with half-axes ``radius`` around ``centre`` (3,), metres."""
    sphere = loft([(-1e-3, 0, 0, 1, 1, 1), (1e-3, 0, 0, 1, 1, 1)], material, caps=(1, 1), ring=ring)
    return LoftPart(sphere.vertices * radius + np.asarray(centre), sphere.faces, material)


def frame_along(direction: Array, up: tuple[float, float, float] = (0, 0, 1)) -> Array:
    """Axes (3, 3), rows U, V, S for ``loft``: S along ``direction``, V as near ``up`` as it can be."""
    s = np.asarray(direction, float) / np.linalg.norm(direction)
    v = np.asarray(up, float) - np.dot(up, s) * s
    v /= np.linalg.norm(v)
    return np.stack((np.cross(v, s), v, s))


def _interpolate(table: Array, spacing: float) -> Array:
    """Sections resampled every ``spacing`` metres by a cubic Hermite spline through all columns."""
    s, y = table[:, 0], table[:, 1:]
    slope = np.diff(y, axis=0) / np.diff(s)[:, None]
    tangent = np.concatenate((slope[:1], (slope[1:] + slope[:-1]) / 2, slope[-1:]))
    rows = []
    for k in range(len(s) - 1):
        h = s[k + 1] - s[k]
        t = np.linspace(0, 1, max(2, int(np.ceil(h / spacing)) + 1))[: None if k == len(s) - 2 else -1, None]
        value = (2 * t**3 - 3 * t**2 + 1) * y[k] + (t**3 - 2 * t**2 + t) * h * tangent[k]
        value += (3 * t**2 - 2 * t**3) * y[k + 1] + (t**3 - t**2) * h * tangent[k + 1]
        rows.append(np.concatenate((s[k] + t * h, value), axis=1))
    return np.concatenate(rows)


def _dome(row: Array, height: float, steps: int = 4) -> Array:
    """Rings that close an end, from nearly the pole to nearly the last section."""
    angle = np.linspace(np.pi / 2, 0, steps + 2)[1:-1]
    rows = np.repeat(row[None], steps, axis=0)
    rows[:, 0] += height * np.sin(angle)
    rows[:, 3:] *= np.cos(angle)[:, None]
    return rows


def _ring_faces(rings: int, ring: int, flipped: bool) -> list[tuple[int, ...]]:
    first, last = rings * ring, rings * ring + 1
    faces = []
    for k in range(ring):
        n = (k + 1) % ring
        faces.append((first, n, k))
        faces.append((last, (rings - 1) * ring + k, (rings - 1) * ring + n))
        faces += [
            (r * ring + k, r * ring + n, (r + 1) * ring + n, (r + 1) * ring + k) for r in range(rings - 1)
        ]
    return [f[::-1] for f in faces] if flipped else faces


def _other_side(name: str) -> str:
    if name.startswith("Left"):
        return "Right" + name[4:]
    return "Left" + name[5:] if name.startswith("Right") else name
