"""Which captures are walked, run, sat down and stood with: by labels where there are sidecars, else by name
and measure.
"""

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

from .labelled import as_told, grasps, sit_downs, walks_and_runs
from .segment import Segment, SitDown

# Clips whose names hold one of these words are left out of level walking: they hop, skip, crouch or carry.
_LEFT_OUT = tuple(
    "hop skip leap jump crouch box run swing sway dribble pickup pick_up use_item talk interact push squat "
    "lift".split()
)
_WALK_SOURCES = ("accad_female1", "accad_male1", "accad_male2", "cmu", "opencap", "quaternius")
_SIT_CLIPS = ("opencap_sts1", "opencap_stsasym1", "opencap_stsweaklegs1", "quaternius_sit_full")
_QUIET, _HANGING = (
    0.12,
    0.2,
)  # m/s of any joint in a quiet stand; metres between hips and hanging wrists, in height


def _is_level_walk(clip: Clip) -> bool:
    if any(word in clip.name for word in _LEFT_OUT):
        return False
    hips = clip.hips_position
    speed = np.linalg.norm(np.diff(hips[:, :2], axis=0), axis=1).mean() * FPS
    return bool(hips[:, 2].min() > 0.8 and speed < 2.0)


def _pieces(folder: CaptureFolder) -> list[Labelled]:
    return [as_told(piece) for piece in folder.labelled]


def load_walks(folder: CaptureFolder) -> list[Clip]:
    """Read the level idle and walking clips below the capture folder: by labels where there are sidecars,
    else by name and measure.
    """
    other = (
        "cmu_02_04",
        "cmu_02_05",
        "cmu_02_06",
        "cmu_02_07",
        "cmu_02_08",
        "cmu_02_09",
        "cmu_02_10",
        "cmu_06",
        "cmu_01_",
        "cmu_03_",
    )
    captures = folder.unlabelled(*_WALK_SOURCES)
    named = [
        folder.read(c)
        for c in captures
        if not (c.path.parent.name == "cmu" and f"{c.file.stem}_".startswith(other))
    ]
    return [c for c in named if _is_level_walk(c)] + [
        c for piece in _pieces(folder) for c in walks_and_runs(piece)[0]
    ]


_RUN_LEFT_OUT = tuple("hop skip leap jump crouch box side hop2 jump2 quick".split())


def load_runs(folder: CaptureFolder) -> list[Clip]:
    """Read the clips that run, start to run or stop running: by labels where there are sidecars, else by name
    and measure.
    """
    runs = ("run", "jog", "cmu_02_03", "cmu_09")
    captures = [c for c in folder.unlabelled(*_WALK_SOURCES) if any(r in c.path.stem for r in runs)]
    clips = [folder.read(c) for c in captures if not any(word in c.path.stem for word in _RUN_LEFT_OUT)]
    clips = [c for c in clips if c.hips_position[:, 2].min() > 0.6]
    return clips + [c for piece in _pieces(folder) for c in walks_and_runs(piece)[1]]


# Frame of a quiet stand whose arms the sitters get: the chair captures have no hand markers and hold the arms
# folded. A folder without it gives the longest quiet stand of its own.
_NEUTRAL_ARMS = ("accad_male1", "male1_a1_stand", 90)
_ARM_JOINTS = [INDEX[s + n] for s in ("Right", "Left") for n in ("Collar", "Shoulder", "Elbow", "Wrist")]


def stance(folder: CaptureFolder) -> dict[str, object]:
    """The quiet stand that takes start from: hips height, metres, and local rotations (23 x 4), facing -Y."""
    clip = neutral(folder)
    _, heading = clip.root()
    hips, rotations = transform(clip.hips_position, clip.local_rotations, np.zeros(2), -heading)
    return {"hips_height": float(hips[0, 2]), "local_rotations": np.round(rotations[0], 5).tolist()}


def neutral(folder: CaptureFolder) -> Clip:
    """One frame of a quiet stand with hanging arms; CaptureError where nobody stands still."""
    source, name, frame = _NEUTRAL_ARMS
    known = folder.find(f"clips/{source}/{name}.bvh")
    if known is not None:
        return folder.read(known)[frame : frame + 1]
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
    """Cut out sit-downs that start and end standing: by labels where there are sidecars, else by name and
    height; may be empty.
    """
    sits: list[SitDown] = []
    labels = [cut for piece in _pieces(folder) for cut in sit_downs(piece)]
    named = [c for c in folder.unlabelled() if c.file.stem in _SIT_CLIPS]
    if not named and not labels:
        return sits
    arms = neutral(folder).local_rotations[0, _ARM_JOINTS]
    for capture in named:
        clip = folder.read(capture)
        height = gaussian_smooth(clip.hips_position[:, 2], 2.0)
        seat = np.percentile(height, 5)
        standing = np.percentile(height, 97)
        low = height < seat + 0.03
        edges = np.flatnonzero(np.diff(np.concatenate(([False], low, [False])).astype(int)))
        for down, up in zip(edges[::2], edges[1::2], strict=True):
            if up - down < 4:
                continue
            before = np.flatnonzero(height[:down] > standing - 0.03)
            after = np.flatnonzero(height[up:] > standing - 0.03)
            if not len(before) or not len(after):
                continue
            start, end = int(before[-1]), int(up + after[0])
            cut = Clip(
                f"{clip.name}@{start}",
                clip.hips_position[start : end + 1],
                clip.local_rotations[start : end + 1],
            )
            sits.append(SitDown(rest_hands_on_thighs(cut, arms), int(down - start), int(up - start)))
    return sits + [replace(sit, clip=rest_hands_on_thighs(sit.clip, arms)) for sit in labels]


_WORDS = ("pickupbox", "pick_up_box", "lift_box", "putdownbox", "put_down_box")
_LEVEL, _LEAST, _DRIFT = (
    0.02,
    0.25,
    0.07,
)  # metres: upright again, least drop of the chest, most drift of a standing foot
_CHEST = INDEX["Chest4"]


def load_bends(folder: CaptureFolder) -> list[Segment]:
    """Cut pick-ups and put-downs into halves that lead from upright (frame 0) to low; the arms hang.  May be
    empty.

    By the hands' contacts where there are sidecars, else by names.
    """
    named = [
        c for c in folder.unlabelled() if any(w in c.path.stem for w in _WORDS) and "run" not in c.path.stem
    ]
    found: list[tuple[Clip, int | None]] = [(folder.read(c), None) for c in named]
    found += [(piece.clip, frame) for piece in _pieces(folder) for frame in grasps(piece)]
    halves: dict[str, Segment] = {}
    if not found:
        return []
    arms = neutral(folder)
    for clip, grasp in found:
        height = gaussian_smooth(clip.world()[0][:, _CHEST, 2], 2.0)
        near = 0 if grasp is None else max(grasp - FPS, 0)
        low = near + int(height[near : None if grasp is None else grasp + FPS].argmin())
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
