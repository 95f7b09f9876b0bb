"""Which captures are walked, run, sat down and stood with: what their sidecars say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nsm_core.body.clip import Clip, transform
from nsm_core.body.contacts import detect_foot_contacts
from nsm_core.body.ik.two_bone import place_wrists
from nsm_core.body.skeleton import ARMS, FEET, HIPS, INDEX, forward_kinematics
from nsm_core.conventions import FPS
from nsm_core.data.captures.folder import CaptureFolder, Labelled
from nsm_core.errors import CaptureError
from nsm_core.rotations import Array, quat_normalize, rotate_planar
from nsm_core.signals import align_quaternions, gaussian_smooth, intervals

from .labelled import CHEST, as_told, grasps, sit_downs, walks_and_runs
from .segment import Segment, SitDown

# m/s of any joint in a quiet stand; metres between hips and hanging wrists, in height.
_QUIET, _HANGING = 0.12, 0.2


def _pieces(folder: CaptureFolder) -> list[Labelled]:
    return [as_told(piece) for piece in folder.labelled]


def load_walks(folder: CaptureFolder) -> list[Clip]:
    """Read the stretches that stand and walk on level ground; may be empty."""
    return [c for piece in _pieces(folder) for c in walks_and_runs(piece)[0]]


def load_runs(folder: CaptureFolder) -> list[Clip]:
    """Read the stretches that run, start to run or stop running; may be empty."""
    return [c for piece in _pieces(folder) for c in walks_and_runs(piece)[1]]


_ARM_JOINTS = [INDEX[s + n] for s in ("Right", "Left") for n in ("Collar", "Shoulder", "Elbow", "Wrist")]


def stance(folder: CaptureFolder) -> dict[str, object]:
    """The quiet stand that takes start from: hips height, metres, and local rotations (23 x 4), facing -Y."""
    clip = neutral(folder)
    _, heading = clip.root()
    hips, rotations = transform(clip.hips_position, clip.local_rotations, np.zeros(2), -heading)
    return {"hips_height": float(hips[0, 2]), "local_rotations": np.round(rotations[0], 5).tolist()}


def neutral(folder: CaptureFolder) -> Clip:
    """One frame of a quiet stand with hanging arms: the first that a sidecar names, else amid the longest.

    CaptureError where nobody stands still.
    """
    for piece in folder.labelled:
        frame = piece.sheet.use.stand
        if frame is not None:
            return piece.clip[frame : frame + 1]
    best: tuple[int, Clip] | None = None
    for clip in load_walks(folder):
        positions, _ = clip.world()
        quiet = (np.linalg.norm(np.gradient(positions, axis=0), axis=-1) * FPS < _QUIET).all(axis=1)
        wrists = positions[:, [arm[2] for arm in ARMS]]
        quiet &= detect_foot_contacts(positions).all(axis=1) & (
            np.abs(wrists[..., 2] - positions[:, HIPS, None, 2]) < _HANGING
        ).all(axis=1)
        for a, b in intervals(quiet):
            if best is None or b - a > best[0]:
                best = b - a, clip[(a + b) // 2 : (a + b) // 2 + 1]
    if best is None:
        raise CaptureError(
            f"nobody stands still with hanging arms in {folder}; add a capture of a quiet stand and run "
            "`python -m nsm_core annotate`."
        )
    return best[1]


def rest_hands_on_thighs(clip: Clip, arms: Array) -> Clip:
    """Let the arms (8, 4), local rotations, hang while standing and lay the hands on the thighs while seated.

    The wrists follow from where they hang to a point over the middle of the thigh as the hips come down.
    """
    rotations = clip.local_rotations.copy()
    rotations[:, _ARM_JOINTS] = arms
    positions, _ = forward_kinematics(clip.hips_position, rotations)
    height = gaussian_smooth(positions[:, HIPS, 2], 3.0)
    w = np.clip((height.max() - 0.05 - height) / max(float(np.ptp(height)) - 0.1, 0.1), 0, 1)
    w = (w * w * (3 - 2 * w))[:, None]
    for side, (name, arm) in enumerate(zip(("Right", "Left"), ARMS, strict=True)):
        hip, knee, wrist = (
            positions[:, INDEX[name + "Hip"]],
            positions[:, INDEX[name + "Knee"]],
            positions[:, arm[2]],
        )
        thigh = hip + 0.55 * (knee - hip) + np.array((0, 0, 0.085))
        rotations = place_wrists(
            clip.hips_position, rotations, side, (wrist + w * (thigh - wrist)).astype(np.float32)
        )
    smooth = gaussian_smooth(align_quaternions(rotations[:, _ARM_JOINTS]), 2.0)
    rotations[:, _ARM_JOINTS] = quat_normalize(smooth)
    return replace(clip, local_rotations=rotations.astype(np.float32))


def load_sits(folder: CaptureFolder) -> list[SitDown]:
    """Cut out sit-downs that start and end standing; may be empty."""
    sits = [cut for piece in _pieces(folder) for cut in sit_downs(piece)]
    if not sits:
        return []
    arms = neutral(folder).local_rotations[0, _ARM_JOINTS]
    return [replace(sit, clip=rest_hands_on_thighs(sit.clip, arms)) for sit in sits]


# Metres: upright again, least drop of the chest, most drift of a standing foot.
_LEVEL, _LEAST, _DRIFT = 0.02, 0.25, 0.07


def load_bends(folder: CaptureFolder) -> list[Segment]:
    """Cut pick-ups and put-downs into halves that lead from upright (frame 0) to low; the arms hang.

    They are where both hands take or leave something, within a second; may be empty.
    """
    found = [(piece.clip, frame) for piece in _pieces(folder) for frame in grasps(piece)]
    halves: dict[str, Segment] = {}
    if not found:
        return []
    arms = neutral(folder)
    for clip, grasp in found:
        height = gaussian_smooth(clip.world()[0][:, CHEST, 2], 2.0)
        near = max(grasp - FPS, 0)
        low = near + int(height[near : grasp + FPS].argmin())
        upright = float(np.percentile(height, 97)) - _LEVEL
        bottom = np.flatnonzero(height < height[low] + 0.02)
        before, after = np.flatnonzero(height[:low] > upright), np.flatnonzero(height[low:] > upright)
        spans = []
        if len(before):
            spans.append((int(before[-1]), int(bottom[bottom > before[-1]][0]), 1))
        if len(after):
            end = low + int(after[0])
            spans.append((int(bottom[bottom < end][-1]), end, -1))
        for first, last, way in spans:
            half = replace(clip[first : last + 1][::way], name=f"{clip.name}@{first}")
            if (
                len(half) >= 20
                and np.ptp(height[first : last + 1]) > _LEAST
                and _stands(half)
                and half.name not in halves
            ):
                halves[half.name] = Segment(hang_arms(half, arms), {})
    return list(halves.values())


def _stands(clip: Clip) -> bool:
    toes = clip.world()[0][:, [leg[3] for leg in FEET], :2]
    return bool(np.linalg.norm(toes - np.median(toes, axis=0), axis=-1).max() < _DRIFT)


def hang_arms(clip: Clip, neutral: Clip) -> Clip:
    """Give a bend the arms of a quiet stand (one frame) that hang straight down from wherever the shoulders
    go.
    """
    still, _ = neutral.world()
    offset = rotate_planar(
        still[0, [a[2] for a in ARMS]] - still[0, [a[0] for a in ARMS]], -neutral.root()[1][0]
    )
    rotations = clip.local_rotations.copy()
    rotations[:, _ARM_JOINTS] = neutral.local_rotations[0, _ARM_JOINTS]
    positions, world = forward_kinematics(clip.hips_position, rotations)
    heading = clip.root()[1][0]
    for side, arm in enumerate(ARMS):
        wrist = (positions[:, arm[0]] + rotate_planar(offset[side], heading)).astype(np.float32)
        hand = np.repeat(world[:1, arm[2]], len(clip), axis=0)
        rotations = place_wrists(clip.hips_position, rotations, side, wrist, hand)
    return replace(clip, local_rotations=rotations.astype(np.float32))
