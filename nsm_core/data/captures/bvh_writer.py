"""Write a motion of the 23-joint skeleton as a BVH file that this project and other programs read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nsm_core.body.skeleton import END_SITES, JOINTS, OFFSETS, PARENTS, J
from nsm_core.conventions import FPS
from nsm_core.errors import OutputError
from nsm_core.files import atomic_path
from nsm_core.rotations import Array, quat_to_matrix, wrap_angle

_CENTIMETRES = 100.0
_NEAR_POLE = np.sin(np.radians(75))
# Orders of rotation channels, Y up: heading first; hinges of the legs bend about X, those of the arms about
# Y.
_ORDERS = ("YXZ", "YZX", "ZXY", "XZY", "XYZ", "ZYX")
_USUAL_ORDERS = {
    "Hips": ("YXZ", "YZX"),
    **dict.fromkeys(("Hip", "Knee", "Ankle", "Toe"), ("XZY", "XYZ", "YXZ", "ZXY", "YZX", "ZYX")),
    **dict.fromkeys(("Collar", "Shoulder", "Elbow", "Wrist"), ("YZX", "ZYX", "YXZ", "ZXY", "XZY", "XYZ")),
}


def write_bvh(
    path: str | Path,
    hips_position: Array,
    local_rotations: Array,
    fps: float = FPS,
    offsets: Array = OFFSETS,
) -> None:
    """Write hips (T, 3), metres, world, and parent-relative rotations (T, J, 4) as BVH, whole or not at all.

    ``offsets`` (J, 3), metres, are those of the joints where the body has other proportions than ours.

    The file is in centimetres, Y up, facing +Z.  The order of a joint's channels is the first of its usual
    ones that the motion keeps away from the pole (the hips' begins with the heading), and its angles go on
    beyond 180 degrees, so that no channel jumps.  Raises OutputError where the file cannot be written or the
    motion has no frames or values that are not numbers.
    """
    path = Path(path)
    finite = np.isfinite(hips_position).all() and np.isfinite(local_rotations).all()
    if not len(local_rotations) or not finite:
        raise OutputError(
            f"{path.name} is not written: its motion has "
            f"{'values that are not numbers' if not finite else 'no frames'}."
        )
    axes = local_rotations.astype(float)
    axes[..., 1:] = _y_up(axes[..., 1:])
    matrices = quat_to_matrix(axes)
    orders = [
        _order(
            matrices[:, j], _USUAL_ORDERS.get(JOINTS[j].removeprefix("Left").removeprefix("Right"), _ORDERS)
        )
        for j in range(J)
    ]
    angles = np.stack([_angles(matrices[:, j], order) for j, order in enumerate(orders)], axis=1)
    rows = np.concatenate(
        (_y_up(np.asarray(hips_position, float)) * _CENTIMETRES, np.degrees(angles).reshape(len(angles), -1)),
        axis=1,
    )
    head = ["MOTION", f"Frames: {len(rows)}", f"Frame Time: {1 / fps:.7f}"]
    text = (
        "\n".join(("HIERARCHY", *_joint(0, 0, orders, offsets), *head, *(_numbers(row) for row in rows)))
        + "\n"
    )
    try:
        with atomic_path(path) as temporary:
            temporary.write_text(text, encoding="ascii")
    except (OSError, ValueError) as error:  # a null byte in a path is a ValueError
        reason = getattr(error, "strerror", None) or str(error)
        raise OutputError(
            f"{path} cannot be written ({reason}); choose another folder or file name."
        ) from error


def _y_up(v: Array) -> Array:
    """Vectors (..., 3) from Z up, facing -Y, to Y up, facing +Z."""
    return v[..., (0, 2, 1)] * np.array((1, 1, -1), dtype=v.dtype)


def _joint(index: int, depth: int, orders: list[str], offsets: Array) -> list[str]:
    """Lines of the hierarchy from one joint down."""
    tab, inner = "\t" * depth, "\t" * (depth + 1)
    # The root's place is in its channels.
    name, offset = JOINTS[index], offsets[index] if index else np.zeros(3)
    place = _numbers(_y_up(np.asarray(offset)) * _CENTIMETRES)
    lines = [f"{tab}{'JOINT' if index else 'ROOT'} {name}", f"{tab}{{", f"{inner}OFFSET {place}"]
    rotations = " ".join(f"{axis}rotation" for axis in orders[index])
    lines.append(
        f"{inner}CHANNELS 3 {rotations}"
        if index
        else f"{inner}CHANNELS 6 Xposition Yposition Zposition {rotations}"
    )
    for child in (c for c, p in enumerate(PARENTS) if p == index):
        lines += _joint(child, depth + 1, orders, offsets)
    if name in END_SITES:
        size = float(offsets[0, 2] / OFFSETS[0, 2])  # by the height of the hips
        end = _numbers(_y_up(np.array(END_SITES[name])) * size * _CENTIMETRES)
        lines += [f"{inner}End Site", f"{inner}{{", f"{inner}\tOFFSET {end}", f"{inner}}}"]
    return [*lines, f"{tab}}}"]


def _order(m: Array, usual: tuple[str, ...]) -> str:
    """The first of the usual orders whose middle angle rotations (T, 3, 3) keep away from the pole, else the
    one that is kept farthest.
    """
    nearness = [np.abs(m[:, "XYZ".index(order[0]), "XYZ".index(order[2])]).max() for order in usual]
    return next(
        (order for order, near in zip(usual, nearness, strict=True) if near < _NEAR_POLE),
        usual[int(np.argmin(nearness))],
    )


def _angles(m: Array, order: str) -> Array:
    """Angles (T, 3), radians, about the axes of ``order`` with ``m = R0 R1 R2`` (T, 3, 3), each going on from
    frame to frame.
    """
    i, j, k = ("XYZ".index(axis) for axis in order)
    e = 1.0 if (j - i) % 3 == 1 else -1.0
    middle = np.arcsin(np.clip(e * m[:, i, k], -1, 1))
    first = np.arctan2(-e * m[:, j, k], m[:, k, k])
    # At the pole only the sum or difference of the outer angles is told: the first stays as it was.
    free = np.flatnonzero(np.abs(m[:, i, k]) < 1 - 1e-9)
    kept = (
        free[np.maximum(np.searchsorted(free, np.arange(len(m)), side="right") - 1, 0)]
        if len(free)
        else np.zeros(len(m), int)
    )
    first = first[kept] if len(free) else np.zeros(len(m))
    c, s = np.cos(first), np.sin(first)
    last = np.arctan2(e * (c * m[:, j, i] + e * s * m[:, k, i]), c * m[:, j, j] + e * s * m[:, k, j])
    plain = np.stack((first, middle, last), axis=1)
    # Every rotation has two triples of angles; whoever passes over the pole goes on in the other one.
    other = np.stack((first + np.pi, np.pi - middle, last + np.pi), axis=1)
    stay, change = (np.abs(wrap_angle(to[1:] - plain[:-1])).sum(1) for to in (plain, other))
    changed = np.concatenate(([False], np.cumsum(change < stay) % 2 == 1))
    return np.unwrap(np.where(changed[:, None], other, plain), axis=0)


def _numbers(values: Array) -> str:
    return " ".join(f"{v:.6f}" for v in values)
