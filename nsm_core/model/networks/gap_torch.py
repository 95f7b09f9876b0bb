"""Networks that fill gaps, of whichever kind, as they are trained and judged."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from nsm_core.model.transitions.layout import PAST, POSE, TARGET_FRAMES

from .delta import DeltaNetwork
from .delta_config import DeltaConfig
from .delta_frames import placed, shown
from .gap_config import GapConfig, openness
from .rtn import TransitionNetwork
from .rtn_config import TransitionConfig
from .rtn_rollout import GapBatch, RollOut, roll_out

GapNetwork = TransitionNetwork | DeltaNetwork


def gap_network(config: GapConfig) -> GapNetwork:
    """An untrained network of such sizes."""
    if isinstance(config, DeltaConfig):
        return DeltaNetwork(config)
    assert isinstance(config, TransitionConfig)
    return TransitionNetwork(config)


def filled(
    net: GapNetwork,
    gaps: GapBatch,
    teacher: float = 0.0,
    noise: float = 0.0,
    generator: torch.Generator | None = None,
) -> RollOut:
    """Fill gaps, as ``roll_out`` does; a network that tells all frames at once reads no true one."""
    if isinstance(net, TransitionNetwork):
        return roll_out(net, gaps, teacher, noise, generator)
    count, config = len(gaps.joints), net.config
    known = np.delete(gaps.joints, np.s_[PAST : PAST + gaps.frames], axis=1)
    statistics = {name: values.numpy() for name, values in net.named_buffers()}
    seen = shown(known, gaps.frames, config.width, statistics, gaps.patches if config.terrain else None)
    extra = torch.from_numpy(seen.when)
    if noise:
        drawn = noise * torch.randn((count, 1, config.width), generator=generator)
        extra = extra + torch.from_numpy(openness(seen.left))[:, None] * drawn
    told = net(torch.from_numpy(seen.tokens), extra)
    joints: Tensor = placed(told, torch.from_numpy(seen.base), torch.from_numpy(seen.reach))
    mean, deviation = net.pose_mean, net.pose_std
    before = torch.from_numpy(gaps.joints[:, PAST - 1].reshape(count, 1, -1))
    hips = torch.cat((before, joints), dim=1)[..., :3]
    rest = joints[..., 3:] - joints[..., :3].repeat(1, 1, POSE.size // 3 - 1)
    poses = (torch.cat((hips.diff(dim=1), rest), dim=-1) - mean) / deviation
    truth = (torch.from_numpy(gaps.poses[:, PAST:].astype(np.float32)) - mean) / deviation
    true = torch.from_numpy(gaps.joints[:, PAST : -TARGET_FRAMES + 1].reshape(count, gaps.frames + 1, -1))
    return RollOut(poses, joints, truth, true)


__all__ = ["GapNetwork", "filled", "gap_network"]
