"""What the delta transformer is shown of a gap, and how what it tells of it becomes a motion.

All that it is shown is known before it is asked, so training and filling read it by the same lines in numpy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from nsm_core.body.skeleton import HIPS, J
from nsm_core.model.transitions.layout import PAST, TARGET_FRAMES
from nsm_core.model.transitions.representation import world_joints
from nsm_core.rotations import Array

from .gap_config import arrival_embedding

JOINTS_REACH = 8.0  # frames after which interpolated joints are a deviation off, counted as in ``reach``


@dataclass(frozen=True)
class ShownGap:
    """B gaps of ``frames`` missing frames, T = PAST + frames + 2 with past and target.

    ``tokens`` (B, T, seen) standardised; ``when`` (T, width): frames since the past and to the target,
    embedded; ``left`` (T,) those to the target.  ``base`` (B, frames + 1, 69): hips in the world and joints
    seen from them, metres, interpolated and the target's; ``reach`` (frames + 1, 69): metres that what is
    told, 1 being much, is worth at each frame: nothing at the target.
    """

    tokens: Array
    when: Array
    left: Array
    base: Array
    reach: Array


def shown(
    joints: Array,
    frames: int,
    width: int,
    statistics: Mapping[str, Array],
    patches: Callable[[Array], Array] | None,
) -> ShownGap:
    """Of world ``joints`` (B, PAST + 2, 23, 3): past, target and the frame behind it; ``patches`` gives those
    (B, T, 169), metres, around hips (B, T, 3).
    """
    ends = joints[:, PAST - 1 : PAST + 1]
    share = (np.arange(1, frames + 1, dtype=np.float32) / (frames + 1))[:, None, None]
    between = ends[:, :1] + share * (ends[:, 1:] - ends[:, :1])
    whole = np.concatenate((joints[:, :PAST], between, joints[:, PAST:]), axis=1)
    pace = np.diff(whole, axis=1)
    # At the target what is behind it says how fast it is, at the first frame what comes after.
    pace = np.concatenate((pace[:, :1], pace[:, : PAST + frames - 1], pace[:, -1:], pace[:, -1:]), axis=1)
    hips, count = whole[:, :, HIPS], whole.shape[:2]
    rest = np.delete(whole, HIPS, axis=2) - hips[:, :, None]

    def standard(values: Array, name: str, part: slice = slice(None)) -> Array:
        values = values.reshape(*count, -1)
        return np.asarray((values - statistics[f"{name}_mean"][part]) / statistics[f"{name}_std"][part])

    parts = [
        (hips - ends[:, :1, HIPS]) / statistics["offset_std"][3 * HIPS : 3 * HIPS + 3],
        standard(pace, "velocity"),
        standard(rest, "pose", slice(3, None)),
    ]
    if patches is not None:
        parts.append(standard(patches(hips), "patch"))
    since = np.arange(count[1]) - (PAST - 1)
    left = frames + 1 - since
    when = [arrival_embedding(n, width // 2) for n in (since, left)]
    base = np.concatenate((hips, rest.reshape(*count, -1)), axis=-1)[:, PAST : -TARGET_FRAMES + 1]
    # Interpolation is off the more the further both ends are away.
    far = (since * left / (since + left))[PAST : -TARGET_FRAMES + 1, None]
    worth = np.concatenate((np.ones(3), np.full(3 * (J - 1), 1 / JOINTS_REACH)))
    return ShownGap(
        np.concatenate(parts, axis=-1).astype(np.float32),
        np.concatenate(when, axis=-1),
        left,
        base,
        (far * worth * statistics["pose_std"]).astype(np.float32),
    )


def placed(told: Any, base: Any, reach: Any) -> Any:
    """World joints (B, frames + 1, 69), metres, of what was ``told`` (B, frames + 1, 69), arrays or tensors;
    ``base`` and ``reach`` are those of ``ShownGap``.
    """
    own = base + told * reach
    return world_joints(own, own[..., :3])


__all__ = ["ShownGap", "placed", "shown"]
