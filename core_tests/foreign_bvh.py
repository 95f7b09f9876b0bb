"""Write motions as other programs do: any names, axes, units and rest poses, without the project's own
writer.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.body.skeleton import END_SITES, INDEX, JOINTS, PARENTS, J, forward_kinematics
from nsm_core.rotations import quat_conjugate, quat_mul, quat_rotate, quat_to_matrix

Y_UP = np.array(((1.0, 0, 0), (0, 0, 1), (0, -1, 0)))  # from Z up, facing -Y


def foreign(
    path: Path,
    motion: tuple[np.ndarray, np.ndarray],
    names: dict[str, str],
    unit: float = 0.01,
    size: float = 1.0,
    axes: np.ndarray = Y_UP,
    twists: dict[str, np.ndarray] | None = None,
    rest_frame: bool = False,
) -> Path:
    """Write a motion on the joints of ``names`` only.  ``unit``: metres a unit; ``size``: how much bigger the
    performer is;
    ``axes``: from our axes to the file's; ``twists``: world turns (4,) of joints' own axes in the T-pose, by
    joint."""
    hips, local = motion
    _, world = forward_kinematics(hips, local)
    kept = [j for j in range(J) if JOINTS[j] in names]
    turn = np.tile(np.array((1.0, 0, 0, 0)), (J, 1))
    for name, q in (twists or {}).items():
        turn[INDEX[name]] = q
    rest, _ = forward_kinematics(np.zeros(3), np.tile(np.array((1.0, 0, 0, 0)), (J, 1)))
    lines, order, channels = ["HIERARCHY"], [], {}

    def parent(j: int) -> int:
        while (j := PARENTS[j]) >= 0 and j not in kept:
            pass
        return j

    def numbers(v: np.ndarray) -> str:
        return " ".join(f"{x:.6f}" for x in v)

    def joint(j: int) -> None:
        p = parent(j)
        offset = quat_rotate(quat_conjugate(turn[p]), rest[j] - rest[p]) if p >= 0 else np.zeros(3)
        order.append(j)
        channels[j] = (
            "6 Xposition Yposition Zposition Yrotation Xrotation Zrotation"
            if p < 0
            else "3 Yrotation Xrotation Zrotation"
        )
        lines.extend(
            [
                f"{'JOINT' if p >= 0 else 'ROOT'} {names[JOINTS[j]]}",
                "{",
                f"OFFSET {numbers(axes @ offset * size / unit)}",
            ]
        )
        lines.append(f"CHANNELS {channels[j]}")
        for child in kept:
            if parent(child) == j:
                joint(child)
        if JOINTS[j] in END_SITES:
            end = quat_rotate(quat_conjugate(turn[j]), np.array(END_SITES[JOINTS[j]]))
            lines.extend(["End Site", "{", f"OFFSET {numbers(axes @ end * size / unit)}", "}"])
        lines.append("}")

    joint(0)
    turned = quat_mul(world, np.broadcast_to(turn, world.shape))
    if rest_frame:
        turned, hips = np.concatenate((turn[None], turned)), np.concatenate((hips[:1] * (0, 0, 1), hips))
    rows = []
    for t in range(len(hips)):
        row = [*(axes @ hips[t] * size / unit)]
        for j in order:
            p = parent(j)
            q = turned[t, j] if p < 0 else quat_mul(quat_conjugate(turned[t, p]), turned[t, j])
            m = axes @ quat_to_matrix(q) @ axes.T  # Ry Rx Rz
            row += np.degrees(
                (
                    np.arctan2(m[0, 2], m[2, 2]),
                    np.arcsin(np.clip(-m[1, 2], -1, 1)),
                    np.arctan2(m[1, 0], m[1, 1]),
                )
            ).tolist()
        rows.append(numbers(np.array(row)))
    path.write_text(
        "\n".join([*lines, "MOTION", f"Frames: {len(rows)}", "Frame Time: 0.0333333", *rows]) + "\n"
    )
    return path


def same(clip: Clip, other: Clip, frames: int | None = None) -> None:
    """That a clip is the other, or its first ``frames``, but for the digits of a file."""
    np.testing.assert_allclose(clip.hips_position, other.hips_position[:frames], atol=2e-3)
    np.testing.assert_allclose(
        np.abs((clip.local_rotations * other.local_rotations[:frames]).sum(-1)), 1, atol=1e-3
    )
