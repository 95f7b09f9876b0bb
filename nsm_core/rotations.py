"""Rotations as (..., 4) quaternions (w, x, y, z) and (..., 3, 3) matrices; planar headings.

Everything is vectorised over leading axes and keeps the dtype of its input.  A frame has few rotations, and
there every call counts; a take has many, and there every pass over memory does: the products stand in both
ways.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from . import components

Array = np.ndarray[Any, np.dtype[Any]]
Scalars = Array | float | np.floating[Any]  # one number, or one for each of many

_FEW = 512  # numbers up to which the calls cost more than the memory


def _products() -> tuple[Array, Array, Array]:
    """The bilinear forms of the few: (4, 16) of a quaternion's matrix, (16, 9) of its rotation less identity,
    (9, 3) of a cross product.
    """
    matrix, rotation, cross = np.zeros((4, 16)), np.zeros((4, 4, 3, 3)), np.zeros((3, 3, 3))
    units = ((0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0))
    signs = ((1, -1, -1, -1), (1, 1, -1, 1), (1, 1, 1, -1), (1, -1, 1, 1))
    for row in range(4):
        for column in range(4):
            matrix[units[row][column], 4 * row + column] = signs[row][column]
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[a, b, c], cross[b, a, c] = 1, -1
        rotation[0, 1 + c, a, b], rotation[0, 1 + c, b, a] = -2, 2  # 2 w (u x v)
        rotation[1 + a, 1 + a, b, b], rotation[1 + a, 1 + a, c, c] = -2, -2  # 2 u x (u x v)
        rotation[1 + a, 1 + b, a, b], rotation[1 + b, 1 + a, b, a] = 2, 2
    return matrix, rotation.reshape(16, 9), cross.reshape(9, 3)


def _candidates() -> Array:
    """Form (9, 16) that takes a rotation matrix to its quaternion's outer square (4, 4), four times, less
    identity.
    """
    out = np.zeros((3, 3, 4, 4))
    for k in range(3):
        out[k, k] = np.diag([1.0, *(1.0 if k == j else -1.0 for j in range(3))])
        i, j = (k + 1) % 3, (k + 2) % 3
        out[j, i, 0, 1 + k] = out[j, i, 1 + k, 0] = 1  # 4 w x = m21 - m12
        out[i, j, 0, 1 + k] = out[i, j, 1 + k, 0] = -1
        out[i, j, 1 + i, 1 + j] = out[i, j, 1 + j, 1 + i] = out[j, i, 1 + i, 1 + j] = out[
            j, i, 1 + j, 1 + i
        ] = 1  # 4 x y = m01 + m10
    return out.reshape(9, 16)


_CANDIDATES = _candidates()
_MATRIX, _ROTATION, _CROSS = (
    {np.dtype(t): form.astype(t) for t in (np.float32, np.float64)} for form in _products()
)


def cross(a: Array, b: Array) -> Array:
    """Cross product (..., 3) of vectors (..., 3)."""
    if a.size + b.size <= _FEW and a.dtype in _CROSS and b.dtype in _CROSS:
        pairs = a[..., :, None] * b[..., None, :]
        return pairs.reshape(*pairs.shape[:-2], 9) @ _CROSS[pairs.dtype]
    return components.packed(components.cross(components.split(a), components.split(b)))


def quat_normalize(q: Array) -> Array:
    """Scale (..., 4) quaternions to unit length; a zero quaternion becomes the identity."""
    n = np.linalg.norm(q, axis=-1, keepdims=True)
    identity = np.zeros_like(q)
    identity[..., 0] = 1
    return np.where(n > 1e-12, q / np.maximum(n, 1e-12), identity)


def quat_mul(a: Array, b: Array) -> Array:
    """Hamilton product of (..., 4) quaternions: rotate by ``b`` first, then by ``a``."""
    if a.size + b.size <= _FEW and a.dtype in _MATRIX:
        matrix = a @ _MATRIX[a.dtype]
        return (matrix.reshape(*a.shape, 4) @ b[..., None])[..., 0]
    return components.packed(components.product(components.split(a), components.split(b)))


def quat_conjugate(q: Array) -> Array:
    """Inverse of unit quaternions (..., 4)."""
    return q * np.array((1, -1, -1, -1), dtype=q.dtype)


def quat_rotate(q: Array, v: Array) -> Array:
    """Rotate (..., 3) vectors by (..., 4) unit quaternions."""
    if q.size + v.size <= _FEW and q.dtype in _ROTATION:
        pairs = q[..., :, None] * q[..., None, :]
        turn = pairs.reshape(*q.shape[:-1], 16) @ _ROTATION[q.dtype]
        return v + (turn.reshape(*q.shape[:-1], 3, 3) @ v[..., None])[..., 0]
    return components.packed(components.turned(components.split(q), components.split(v)))


def quat_from_axis_angle(axis: Array, angle: Scalars) -> Array:
    """Quaternion (..., 4) of a turn by ``angle`` (...) radians about unit ``axis`` (..., 3)."""
    axis, half = np.asarray(axis), np.asarray(angle)[..., None] / 2
    return np.concatenate((np.cos(half) * np.ones_like(axis[..., :1]), np.sin(half) * axis), axis=-1)


def quat_from_rotvec(r: Array) -> Array:
    """Quaternion (..., 4) of rotation vectors (..., 3), radians."""
    angle = np.linalg.norm(r, axis=-1, keepdims=True)
    k = np.sinc(angle / (2 * np.pi)) / 2  # sin(angle / 2) / angle, finite at zero
    return np.concatenate((np.cos(angle / 2), k * r), axis=-1)


def quat_to_rotvec(q: Array) -> Array:
    """Shortest rotation vector (..., 3), radians, of unit quaternions (..., 4)."""
    q = np.where(q[..., :1] < 0, -q, q)
    s = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(s, q[..., :1])
    return np.where(s > 1e-9, angle / np.maximum(s, 1e-9), 2.0) * q[..., 1:]


def quat_from_matrix(m: Array) -> Array:
    """Quaternion (..., 4) of rotation matrices (..., 3, 3), by the largest of four candidates."""
    candidates = (m.reshape(*m.shape[:-2], 9) @ _CANDIDATES.astype(m.dtype, copy=False)).reshape(
        *m.shape[:-2], 4, 4
    )
    candidates = candidates + np.eye(4, dtype=m.dtype)
    diagonal = np.diagonal(candidates, axis1=-2, axis2=-1)
    best = np.argmax(diagonal, axis=-1)
    return quat_normalize(np.take_along_axis(candidates, best[..., None, None], axis=-2)[..., 0, :])


def quat_to_matrix(q: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    return components.packed((
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    )).reshape(*q.shape[:-1], 3, 3)  # fmt: skip


def quat_slerp(a: Array, b: Array, t: Scalars) -> Array:
    """Interpolate (..., 4) unit quaternions along the shorter arc by ``t`` (...) in 0..1."""
    relative = quat_to_rotvec(quat_mul(quat_conjugate(a), b))
    return quat_mul(a, quat_from_rotvec(np.asarray(t)[..., None] * relative))


def matrix_from_forward_up(forward: Array, up: Array) -> Array:
    """Rotation matrices (..., 3, 3) with -Y along ``forward`` exactly and Z near ``up``, both (..., 3)."""
    y = -forward / np.maximum(np.linalg.norm(forward, axis=-1, keepdims=True), 1e-9)
    x = cross(y, up)
    x = x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-9)
    return np.stack((x, y, cross(x, y)), axis=-1)


def heading_to_direction(heading: Scalars) -> Array:
    """Facing direction (..., 2) of headings (...), radians; heading 0 faces -Y."""
    return np.stack((np.sin(heading), -np.cos(heading)), axis=-1)


def direction_to_heading(direction: Array) -> Array:
    """Heading (...) in radians of horizontal directions (..., 2 or 3)."""
    return np.arctan2(direction[..., 0], -direction[..., 1])


def heading_quat(heading: Scalars) -> Array:
    """Quaternion (..., 4) of a turn about Z by heading (...) radians."""
    heading = np.asarray(heading)
    zero = np.zeros_like(heading)
    return np.stack((np.cos(heading / 2), zero, zero, np.sin(heading / 2)), axis=-1)


def rotate_planar(v: Array, heading: Scalars) -> Array:
    """Turn the first two of (..., 2 or 3) components about Z by headings (...), radians."""
    c, s = np.cos(heading), np.sin(heading)
    x = c * v[..., 0] - s * v[..., 1]
    out = np.empty((*x.shape, v.shape[-1]), dtype=x.dtype)
    out[..., 0], out[..., 1], out[..., 2:] = x, s * v[..., 0] + c * v[..., 1], v[..., 2:]
    return out


def wrap_angle(angle: Scalars) -> Array:
    """Wrap radians into -pi..pi."""
    return (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi
