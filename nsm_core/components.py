"""Vectors and quaternions as tuples of their components: numbers where there is one pose, arrays (...) where
there are many.

A call of numpy costs as much as thirty products of plain numbers, so that what follows from one pose by many
small steps is worked out in numbers, and the same lines serve whole takes with arrays.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

Vector = tuple[Any, Any, Any]
Quaternion = tuple[Any, Any, Any, Any]


class Numbers:
    """Functions of plain numbers."""

    sqrt, expm1, copysign = math.sqrt, math.expm1, math.copysign
    least, most = min, max

    @staticmethod
    def where(condition: bool, one: float, other: float) -> float:
        return one if condition else other


class Arrays:
    """The same of arrays."""

    sqrt, expm1, copysign = np.sqrt, np.expm1, np.copysign
    least, most, where = np.minimum, np.maximum, np.where


Kind = type[Numbers] | type[Arrays]


def clamp(x: float, low: float, high: float) -> float:
    """A number kept within two, as ``np.clip`` does, which costs fifty times as much for one."""
    return min(max(x, low), high)


def split(values: np.ndarray[Any, np.dtype[Any]]) -> Any:
    """Components of vectors or quaternions (..., N), N arrays (...)."""
    return tuple(values[..., k] for k in range(values.shape[-1]))


def packed(components: tuple[Any, ...]) -> np.ndarray[Any, np.dtype[Any]]:
    """Components of one shape (...) along a new last axis; the inverse of ``split``."""
    out = np.empty((*np.shape(components[0]), len(components)), dtype=np.result_type(components[0]))
    for k, component in enumerate(components):
        out[..., k] = component
    return out


def product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Hamilton product: the turn by ``b`` first, then by ``a``."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def inverse(q: Quaternion) -> Quaternion:
    """Inverse of a unit quaternion."""
    return q[0], -q[1], -q[2], -q[3]


def turned(q: Quaternion, v: Vector) -> Vector:
    """A vector turned by a unit quaternion."""
    w, x, y, z = q
    vx, vy, vz = v
    tx, ty, tz = 2 * (y * vz - z * vy), 2 * (z * vx - x * vz), 2 * (x * vy - y * vx)
    return vx + w * tx + (y * tz - z * ty), vy + w * ty + (z * tx - x * tz), vz + w * tz + (x * ty - y * tx)


def cross(a: Vector, b: Vector) -> Vector:
    ax, ay, az = a
    bx, by, bz = b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def dot(a: Vector, b: Vector) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def along(a: Vector, way: Vector, far: Any) -> Vector:
    """``a`` and so ``far`` along ``way``."""
    return a[0] + far * way[0], a[1] + far * way[1], a[2] + far * way[2]


def times(a: Vector, factor: Any) -> Vector:
    return a[0] * factor, a[1] * factor, a[2] * factor


def unit(of: Kind, v: Vector) -> Vector:
    """A vector scaled to length 1, one that is zero left as it is; ``of`` is ``Numbers`` or ``Arrays``."""
    x, y, z = v
    size = of.most(of.sqrt(x * x + y * y + z * z), 1e-9)
    return x / size, y / size, z / size


def unit_turn(of: Kind, q: Quaternion) -> Quaternion:
    """The same of a quaternion."""
    w, x, y, z = q
    size = of.most(of.sqrt(w * w + x * x + y * y + z * z), 1e-9)
    return w / size, x / size, y / size, z / size


def length(of: Kind, v: Vector) -> Any:
    return of.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
