"""How far what a gap is filled with is from what was captured (papers/001 section 7.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.contacts import TOES
from nsm_core.body.interpolation import interpolated
from nsm_core.body.skeleton import TOE_HEIGHT, J, forward_kinematics
from nsm_core.conventions import FPS
from nsm_core.data.transitions.gaps import Gaps
from nsm_core.data.transitions.windows import Windows
from nsm_core.model.transitions.layout import PAST, TARGET_FRAMES
from nsm_core.model.transitions.representation import poses_of, turned
from nsm_core.rotations import Array

LOW = 0.025  # metres over where it stands under which a toe joint that moves slides, the lower the more


@dataclass(frozen=True)
class Errors:
    """Of the fills of gaps.

    ``mse``: mean squared error of standardised poses; ``aco``: centimetres off, mean over numbers and frames;
    ``profile`` (frames,) the same by frame; ``gap``: centimetres that joints are from the target at its
    frame, mean; ``slide`` and ``true_slide``: cm/s of toes near the ground, of fills and of captures.
    """

    mse: float
    aco: float
    profile: Array
    gap: float
    slide: float
    true_slide: float


def errors(gaps: Gaps, joints: Array, mean: Array, deviation: Array) -> Errors:
    """Of fills with world ``joints`` (B, frames + 1, 23, 3), the target's frame the last; ``mean`` and
    ``deviation`` (69,) standardise poses.
    """
    true = gaps.joints[:, PAST : -TARGET_FRAMES + 1]
    before = gaps.joints[:, PAST - 1 : PAST]
    parts = (np.concatenate((before, part), axis=1) for part in (joints, true))
    poses, wanted = ((poses_of(part)[:, 1:] - mean) / deviation for part in parts)
    off = 100 * np.abs(joints - true)[:, :-1]
    miss = 100 * np.linalg.norm(joints[:, -1] - true[:, -1], axis=-1)
    ground = [gaps.heights(part[:, :, TOES, :2].reshape(len(part), -1, 2)) for part in (joints, true)]
    slides = [
        slide(part[:, :-1], under.reshape(*part.shape[:2], 2)[:, :-1])
        for part, under in zip((joints, true), ground, strict=True)
    ]
    return Errors(
        float(((poses - wanted) ** 2).mean()),
        float(off.mean()),
        off.mean((0, 2, 3)),
        float(miss.mean()),
        *slides,
    )


def slide(joints: Array, ground: Array) -> float:
    """Centimetres a second that toe joints of (B, T, 23, 3) go sideways near the ``ground`` (B, T, 2), by
    2 - 2^(h / LOW) of their height h over where they stand.
    """
    toes = joints[:, :, TOES]
    over = np.clip((toes[..., 2] - ground - TOE_HEIGHT) / LOW, 0, 1)
    speed = np.linalg.norm(np.diff(toes[..., :2], axis=1), axis=-1) * FPS * 100
    return float((speed * (2 - 2 ** over[:, 1:])).mean())


def interpolation(windows: Windows, gaps: Gaps) -> Array:
    """World joints (B, frames + 1, 23, 3) of gaps that are interpolated (INT)."""
    out = np.empty((len(gaps.first), gaps.frames + 1, J, 3))
    for n, first in enumerate(gaps.first):
        ends = [first + PAST - 1, first + PAST + gaps.frames]
        hips, local = interpolated(
            (windows.hips[ends[0]], windows.hips[ends[1]]),
            (windows.local[ends[0]], windows.local[ends[1]]),
            gaps.frames,
        )
        out[n] = forward_kinematics(hips, local)[0]
    return turned(out, gaps.middle, gaps.angle)


__all__ = ["Errors", "errors", "interpolation", "slide"]
