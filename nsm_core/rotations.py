"""Rotations as (..., 4) quaternions (w, x, y, z) and (..., 3, 3) matrices; planar headings.

Everything is vectorised over leading axes and keeps the dtype of its input.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def quat_normalize(q: Array) -> Array:
    """Scale (..., 4) quaternions to unit length; a zero quaternion becomes the identity."""
    n = np.linalg.norm(q, axis=-1, keepdims=True)
    identity = np.zeros_like(q)
    identity[..., 0] = 1
    return np.where(n > 1e-12, q / np.maximum(n, 1e-12), identity)


def quat_mul(a: Array, b: Array) -> Array:
    """Hamilton product of (..., 4) quaternions: rotate by ``b`` first, then by ``a``."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack(
        (
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ),
        axis=-1,
    )


def quat_conjugate(q: Array) -> Array:
    """Inverse of unit quaternions (..., 4)."""
    return q * np.array((1, -1, -1, -1), dtype=q.dtype)


def quat_rotate(q: Array, v: Array) -> Array:
    """Rotate (..., 3) vectors by (..., 4) unit quaternions."""
    u = q[..., 1:]
    t = 2 * np.cross(u, v)
    return v + q[..., :1] * t + np.cross(u, t)


def quat_from_axis_angle(axis: Array, angle: Array) -> Array:
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
    m00, m11, m22 = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    candidates = np.stack(
        (
            np.stack((1 + m00 + m11 + m22, m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]), -1),
            np.stack((m[..., 2, 1] - m[..., 1, 2], 1 + m00 - m11 - m22, m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0]), -1),
            np.stack((m[..., 0, 2] - m[..., 2, 0], m[..., 0, 1] + m[..., 1, 0], 1 - m00 + m11 - m22, m[..., 1, 2] + m[..., 2, 1]), -1),
            np.stack((m[..., 1, 0] - m[..., 0, 1], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1], 1 - m00 - m11 + m22), -1),
        ),
        axis=-2,
    )
    diagonal = np.stack((candidates[..., 0, 0], candidates[..., 1, 1], candidates[..., 2, 2], candidates[..., 3, 3]), -1)
    best = np.argmax(diagonal, axis=-1)
    return quat_normalize(np.take_along_axis(candidates, best[..., None, None], axis=-2)[..., 0, :])


def quat_to_matrix(q: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quat_slerp(a: Array, b: Array, t: Array) -> Array:
    """Interpolate (..., 4) unit quaternions along the shorter arc by ``t`` (...) in 0..1."""
    relative = quat_to_rotvec(quat_mul(quat_conjugate(a), b))
    return quat_mul(a, quat_from_rotvec(np.asarray(t)[..., None] * relative))


def matrix_from_forward_up(forward: Array, up: Array) -> Array:
    """Rotation matrices (..., 3, 3) with -Y along ``forward`` exactly and Z near ``up``, both (..., 3)."""
    y = -forward / np.maximum(np.linalg.norm(forward, axis=-1, keepdims=True), 1e-9)
    x = np.cross(y, up)
    x = x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-9)
    return np.stack((x, y, np.cross(x, y)), axis=-1)


def heading_to_direction(heading: Array) -> Array:
    """Facing direction (..., 2) of headings (...), radians; heading 0 faces -Y."""
    return np.stack((np.sin(heading), -np.cos(heading)), axis=-1)


def direction_to_heading(direction: Array) -> Array:
    """Heading (...) in radians of horizontal directions (..., 2 or 3)."""
    return np.arctan2(direction[..., 0], -direction[..., 1])


def heading_quat(heading: Array) -> Array:
    """Quaternion (..., 4) of a turn about Z by heading (...) radians."""
    heading = np.asarray(heading)
    zero = np.zeros_like(heading)
    return np.stack((np.cos(heading / 2), zero, zero, np.sin(heading / 2)), axis=-1)


def rotate_planar(v: Array, heading: Array) -> Array:
    """Turn the first two of (..., 2 or 3) components about Z by headings (...), radians."""
    c, s = np.cos(heading), np.sin(heading)
    turned = np.stack((c * v[..., 0] - s * v[..., 1], s * v[..., 0] + c * v[..., 1]), axis=-1)
    return turned if v.shape[-1] == 2 else np.concatenate((turned, v[..., 2:]), axis=-1)


def wrap_angle(angle: Array) -> Array:
    """Wrap radians into -pi..pi."""
    return (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi
