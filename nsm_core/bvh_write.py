"""Write a motion of the 23-joint skeleton as a BVH file that this project and other programs read."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .conventions import FPS
from .errors import OutputError
from .rotations import Array, quat_to_matrix
from .skeleton import END_SITES, JOINTS, OFFSETS, PARENTS

_CENTIMETRES = 100.0


def write(path: str | Path, hips_position: Array, local_rotations: Array, fps: float = FPS) -> None:
    """Write hips (T, 3), metres, world, and parent-relative rotations (T, J, 4) as BVH.

    The file is in centimetres, Y up, facing +Z, channels ZYX, as the reader in this package and most
    programs expect.  Raises OutputError where the file cannot be written.
    """
    path = Path(path)
    text = "\n".join(("HIERARCHY", *_joint(0, 0), "MOTION", *_motion(hips_position, local_rotations, fps))) + "\n"
    try:
        path.write_text(text, encoding="ascii")
    except OSError as error:
        raise OutputError(f"{path} cannot be written ({error.strerror}); choose another folder or file name.") from error


def _y_up(v: Array) -> Array:
    """Vectors (..., 3) from Z up, facing -Y, to Y up, facing +Z."""
    return v[..., (0, 2, 1)] * np.array((1, 1, -1), dtype=v.dtype)


def _joint(index: int, depth: int) -> list[str]:
    """Lines of the hierarchy from one joint down."""
    tab, inner = "\t" * depth, "\t" * (depth + 1)
    name, offset = JOINTS[index], OFFSETS[index] if index else np.zeros(3)  # the root's place is in its channels
    place = _numbers(_y_up(np.asarray(offset)) * _CENTIMETRES)
    lines = [f"{tab}{'JOINT' if index else 'ROOT'} {name}", f"{tab}{{", f"{inner}OFFSET {place}"]
    rotations = "Zrotation Yrotation Xrotation"
    lines.append(f"{inner}CHANNELS 3 {rotations}" if index else f"{inner}CHANNELS 6 Xposition Yposition Zposition {rotations}")
    for child in (c for c, p in enumerate(PARENTS) if p == index):
        lines += _joint(child, depth + 1)
    if name in END_SITES:
        end = _numbers(_y_up(np.array(END_SITES[name])) * _CENTIMETRES)
        lines += [f"{inner}End Site", f"{inner}{{", f"{inner}\tOFFSET {end}", f"{inner}}}"]
    return [*lines, f"{tab}}}"]


def _motion(hips_position: Array, local_rotations: Array, fps: float) -> list[str]:
    """Lines of the motion section."""
    axes = local_rotations.astype(float).copy()
    axes[..., 1:] = _y_up(axes[..., 1:])
    angles = np.degrees(_euler_zyx(quat_to_matrix(axes)))
    rows = np.concatenate((_y_up(np.asarray(hips_position, float)) * _CENTIMETRES, angles.reshape(len(angles), -1)), axis=1)
    return [f"Frames: {len(rows)}", f"Frame Time: {1 / fps:.7f}", *(_numbers(row) for row in rows)]


def _euler_zyx(m: Array) -> Array:
    """Angles (..., 3) about Z, Y, X, radians, with ``m = Rz Ry Rx``; at the pole the turn about X is 0."""
    y = np.arcsin(np.clip(-m[..., 2, 0], -1, 1))
    pole = np.abs(m[..., 2, 0]) > 1 - 1e-9
    z = np.where(pole, np.arctan2(-m[..., 0, 1], m[..., 1, 1]), np.arctan2(m[..., 1, 0], m[..., 0, 0]))
    x = np.where(pole, 0.0, np.arctan2(m[..., 2, 1], m[..., 2, 2]))
    return np.stack((z, y, x), axis=-1)


def _numbers(values: Array) -> str:
    return " ".join(f"{v:.6f}" for v in values)
