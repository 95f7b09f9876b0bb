"""A transition network rolled out over gaps, as it is trained (papers/001 sections 4.1, 6.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from nsm_core.body.skeleton import HIPS
from nsm_core.model.transitions.layout import PAST, POSE, TARGET_FRAMES
from nsm_core.model.transitions.representation import world_joints
from nsm_core.rotations import Array

from .gap_config import arrival_embedding, openness
from .rtn import TransitionNetwork


class GapBatch(Protocol):
    """B gaps of captures, as ``data.transitions.gaps`` has them: ``joints`` (B, PAST + frames + 2, 23, 3)
    world, what the network sees of them, and the patches (B, T, 169) around hips (B, T, 3).
    """

    @property
    def frames(self) -> int: ...
    @property
    def joints(self) -> Array: ...
    @property
    def poses(self) -> Array: ...
    @property
    def targets(self) -> Array: ...
    def patches(self, roots: Array) -> Array: ...


@dataclass
class RollOut:
    """What a network told of B gaps: standardised ``poses`` (B, frames + 1, 69), the target's the last, and
    world ``joints`` (B, frames + 1, 69), metres; ``truth`` and ``true_joints`` alike.
    """

    poses: Tensor
    joints: Tensor
    truth: Tensor
    true_joints: Tensor

    def error(self) -> Tensor:
        """Mean squared error over frames and numbers, in the standardised space (equation 17)."""
        return (self.poses - self.truth).square().mean()


def roll_out(
    net: TransitionNetwork,
    gaps: GapBatch,
    teacher: float = 0.0,
    noise: float = 0.0,
    generator: torch.Generator | None = None,
) -> RollOut:
    """Fill gaps; ``teacher`` is the share of frames at which the true one is read instead of the network's
    own, ``noise`` the deviation of that on the target's encoding.
    """
    config, count = net.config, len(gaps.joints)

    def standard(values: Tensor, name: str) -> Tensor:
        return (values - getattr(net, f"{name}_mean")) / getattr(net, f"{name}_std")

    def seen(roots: Tensor) -> Tensor | None:
        if not config.terrain:
            return None
        patches = gaps.patches(roots.detach().numpy().reshape(count, -1, 3))
        return standard(torch.from_numpy(patches), "patch")

    truth = standard(torch.from_numpy(gaps.poses.astype(np.float32)), "pose")
    joints = torch.from_numpy(gaps.joints.reshape(*gaps.joints.shape[:2], -1))
    goal = joints[:, -TARGET_FRAMES]
    target = torch.from_numpy(gaps.targets.astype(np.float32))
    size = POSE.size
    target = torch.cat((standard(target[:, :size], "pose"), standard(target[:, size:], "velocity")), dim=1)
    encoded_target = net.encoded_target(target)
    steps = PAST + gaps.frames
    left = steps - np.arange(steps)
    extra = _extra(net, left, count, noise, generator)

    past = joints[:, :PAST]
    roots = past[..., 3 * HIPS : 3 * HIPS + 3]
    patch = seen(roots)
    frames = net.encoded(truth[:, :PAST], patch.reshape(count, PAST, -1) if patch is not None else None)
    known = None if encoded_target is None else encoded_target[:, None].expand(-1, PAST, -1)
    future = net.encoded_future(
        known, standard(goal[:, None] - past, "offset"), None if extra is None else extra[:, :PAST]
    )
    gates = net.gates(frames, future)
    state = net.begin(truth[:, 0])
    for t in range(PAST):
        state = net.remembered(gates[:, t], state)
    told, placed = [], []
    pose, root = truth[:, PAST - 1], roots[:, -1]
    for t in range(PAST, steps + 1):
        if config.homing:
            share = 1 / (steps - t + 1)
            way = (goal[:, 3 * HIPS : 3 * HIPS + 3] - root) * share
            way = (way - net.pose_mean[:3]) / net.pose_std[:3]
            pose = torch.cat((way, pose[:, 3:] + share * (target[:, 3:size] - pose[:, 3:])), dim=1)
        pose = net.told(state[0], pose)
        physical = pose * net.pose_std + net.pose_mean
        root = root + physical[:, :3]
        world = world_joints(physical, root)
        told.append(pose)
        placed.append(world)
        if t == steps:
            break
        if teacher > 0:
            true = torch.rand((count, 1), generator=generator) < teacher
            pose = torch.where(true, truth[:, t], pose)
            world = torch.where(true, joints[:, t], world)
            root = world[:, 3 * HIPS : 3 * HIPS + 3]
        patch = seen(root)
        frame = net.encoded(pose, None if patch is None else patch.reshape(count, -1))
        future = net.encoded_future(
            encoded_target, standard(goal - world, "offset"), None if extra is None else extra[:, t]
        )
        state = net.remembered(net.gates(frame, future), state)
    return RollOut(
        torch.stack(told, 1), torch.stack(placed, 1), truth[:, PAST:], joints[:, PAST : -TARGET_FRAMES + 1]
    )


def _extra(
    net: TransitionNetwork, left: Array, count: int, noise: float, generator: torch.Generator | None
) -> Tensor | None:
    """What is added to the future context (B, T, 256): frames left, and noise that is the same all along but
    fades towards the target.
    """
    config = net.config
    if not config.varied:
        return None
    embedding = torch.from_numpy(arrival_embedding(left, config.context))[None]
    if not noise:
        return embedding.expand(count, -1, -1)
    drawn = noise * torch.randn((count, 1, config.context), generator=generator)
    return embedding + torch.from_numpy(openness(left))[None, :, None] * drawn


__all__ = ["GapBatch", "RollOut", "roll_out"]
