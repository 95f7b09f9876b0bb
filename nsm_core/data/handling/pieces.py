"""Captured pieces that performances of picking and placing are made of: reaches, squats and steps aside."""

from __future__ import annotations

import numpy as np

from nsm_core.body.clip import Clip, smoothed_root
from nsm_core.body.contacts import TOES
from nsm_core.body.skeleton import ARMS, HIPS
from nsm_core.conventions import FPS
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.matching.segment import Segment
from nsm_core.data.matching.source import Source, gather
from nsm_core.errors import CaptureError
from nsm_core.rotations import Array, rotate_planar

# Kinds of pieces, and what a capture's name holds that shows one: who took them named them so, and no
# sidecar has a label for them.
NAMED = {"reach": ("reach_",), "squat": ("_squat_",), "step": ("_idle_step_", "_strafe_")}
OUT = 0.3  # metres by which a wrist leaves its place at least, in a reach
DEEP = 0.25  # metres by which hips come down at least, in a squat
SHUFFLE = 0.12  # metres that a foot moves at most while one reaches or squats
MOST_SQUATS = 30  # the deepest
_WRISTS = [arm[2] for arm in ARMS]


def gathered(folder: CaptureFolder) -> Source:
    """Walks of a capture folder, and its reaches, squats and steps as segments, each with its mirror image.

    Segments "reach" and "squat" have the mark "there", the frame at which the wrist or the hips are
    furthest, and "reach" the mark "side", 0 where the right hand reaches, 1 where the left does, counted
    from the first frame as marks are.  CaptureError where there is no reach.
    """
    clips: dict[str, list[Clip]] = {kind: [] for kind in NAMED}
    for capture in folder.captures:
        for kind, names in NAMED.items():
            if any(name in capture.path.stem for name in names):
                clips[kind].append(folder.read(capture))
    reaches = [s for s in map(_reach, clips["reach"]) if s is not None]
    if not reaches:
        raise CaptureError(
            f"{folder} holds no reach; add captures of somebody who stands and reaches, named *reach_*."
        )
    squats = sorted((s for s in map(_squat, clips["squat"]) if s is not None), key=_lowest)
    steps = [Segment(clip, {}) for clip in clips["step"] if len(clip) > FPS]
    return gather(folder, {"reach": reaches, "squat": squats[:MOST_SQUATS], "step": steps})


def local_wrists(clip: Clip) -> Array:
    """Wrists (T, 2, 3), right and left, seen from the planar root."""
    positions = clip.world()[0]
    root, heading = smoothed_root(positions)
    wrists = positions[:, _WRISTS].astype(np.float64)
    wrists[..., :2] -= root[:, None]
    return rotate_planar(wrists, -heading[:, None])


def side_of(clip: Clip) -> int:
    """Hand that goes furthest from where it is at first: 0 right, 1 left."""
    wrists = local_wrists(clip)
    return int(np.argmax(np.linalg.norm(wrists - wrists[:1], axis=-1).max(0)))


def _reach(clip: Clip) -> Segment | None:
    """A clip that reaches, its mark "there" where the hand that goes furthest rests longest away; None where
    none does, or where feet go elsewhere.
    """
    if _shuffles(clip):
        return None
    wrists = local_wrists(clip)[:, side_of(clip)]
    away = np.linalg.norm(wrists - wrists[0], axis=-1)
    if away.max() < OUT:
        return None
    speed = np.linalg.norm(np.gradient(wrists, axis=0), axis=-1)
    there = int(np.argmin(np.where(away > 0.9 * away.max(), speed, np.inf)))
    return Segment(clip, {"there": there}) if FPS // 2 < there < len(clip) - FPS // 2 else None


def _squat(clip: Clip) -> Segment | None:
    height = clip.hips_position[:, 2]
    there = int(np.argmin(height))
    inside = FPS // 2 < there < len(clip) - FPS // 2
    deep = inside and min(height[0], height[-1]) - height[there] > DEEP
    return Segment(clip, {"there": there}) if deep and not _shuffles(clip) else None


def _shuffles(clip: Clip) -> bool:
    toes = clip.world()[0][:, TOES, :2]
    return bool(np.linalg.norm(toes - toes[:1], axis=-1).max() > SHUFFLE)


def _lowest(piece: Segment) -> float:
    return float(piece.clip.world()[0][:, HIPS, 2].min())


__all__ = ["gathered", "local_wrists", "side_of"]
