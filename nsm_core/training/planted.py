"""Feet that stand are to stand still: a loss on where a step of the roll-out really puts them.

A mean squared error over 605 standardised numbers hardly feels a foot that glides a centimetre a frame:
places are spread over decimetres, and where a chain of bones ends is no output at all.  This loss is taken
on the ankles and toes as ``rollout_step.advance`` places them, with its half-and-half integration and its
bone lengths, wherever the true step has the foot in contact.
"""

from __future__ import annotations

import numpy as np
import torch

from nsm_core.body.skeleton import INDEX, LEVELS, OFFSETS
from nsm_core.conventions import DT, FOOT_CONTACTS
from nsm_core.model.features.layout import FRAME, OUTPUT

FEET = [[INDEX[f"{side}Ankle"], INDEX[f"{side}Toe"]] for side in ("Right", "Left")]
SLIP = 0.01  # metres a frame that count as one deviation does elsewhere


def _leg_chains() -> list[tuple[int, int]]:
    """Joints from the hips to both toes with their parents, parents first."""
    parent = {int(j): int(p) for joints, parents in LEVELS for j, p in zip(joints, parents, strict=True)}
    wanted: set[int] = set()
    for joint in (j for side in FEET for j in side):
        while joint in parent:
            wanted.add(joint)
            joint = parent[joint]
    return [(int(j), parent[int(j)]) for joints, _ in LEVELS for j in joints if int(j) in wanted]


_CHAINS = _leg_chains()
_LENGTHS = np.linalg.norm(OFFSETS, axis=1)


def planted_loss(x: torch.Tensor, predicted: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """Squared slip (B,) of standing ankles and toes, in units of ``SLIP``, mean over their coordinates.

    ``x`` (B, 4018) inputs, ``predicted`` and ``target`` (B, 605) outputs, all physical and in the root frame
    of the inputs.  0 for a body with no foot in contact in ``target``.
    """

    def joints(v: torch.Tensor, begin: int) -> torch.Tensor:
        return v[:, begin : begin + 3 * len(OFFSETS)].unflatten(1, (len(OFFSETS), 3))

    position, velocity = (OUTPUT.slices[n].start for n in ("joint_position", "joint_velocity"))
    before = joints(x, FRAME.slices["joint_position"].start)
    moved = 0.5 * (before + DT * joints(predicted, velocity)) + 0.5 * joints(predicted, position)
    placed = {0: moved[:, 0]}
    for joint, above in _CHAINS:  # ``restore_bone_lengths``, for the legs
        bone = moved[:, joint] - placed[above]
        length = bone.norm(dim=-1, keepdim=True).clamp_min(1e-6)
        placed[joint] = placed[above] + bone * (float(_LENGTHS[joint]) / length)
    wanted, stands = joints(target, position), target[:, OUTPUT.slices["contact"]][:, FOOT_CONTACTS] > 0.5
    total = torch.zeros_like(target[:, 0])
    for side, feet in enumerate(FEET):
        slip = torch.stack([placed[j] - wanted[:, j] for j in feet], dim=1) / SLIP
        total = total + stands[:, side] * (slip**2).clamp_max(100.0).mean(dim=(1, 2))
    return total / len(FEET)
