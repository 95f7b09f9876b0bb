"""The pool of captured frames that performances are stitched from.

A library holds every usable clip and its mirror image back to back, with what stitching needs per frame:
the smoothed planar root, the pose in the root frame and the foot contacts.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nsm_core.body.clip import Clip, transform
from nsm_core.body.ik.foot_lock import detect_foot_contacts, intervals
from nsm_core.body.ik.two_bone import place_wrists
from nsm_core.body.skeleton import ARMS, HIPS, INDEX, forward_kinematics, root_of
from nsm_core.conventions import FPS
from nsm_core.data.captures.folder import labelled, name_in, read_capture, unlabelled
from nsm_core.errors import CaptureError
from nsm_core.rotations import Array, quat_normalize, rotate_planar

from .labelled import sit_downs, walks_and_runs

# Clips whose names hold one of these words are left out of level walking: they hop, skip, crouch or carry.
_LEFT_OUT = tuple(
    "hop skip leap jump crouch box run swing sway dribble "
    "pickup pick_up use_item talk interact push squat lift".split()
)
_WALK_SOURCES = ("accad_female1", "accad_male1", "accad_male2", "cmu", "opencap", "quaternius")
_SIT_CLIPS = ("opencap_sts1", "opencap_stsasym1", "opencap_stsweaklegs1", "quaternius_sit_full")
_QUIET, _HANGING = 0.12, 0.2  # m/s of any joint in a quiet stand; metres between hips and hanging wrists, in height
ROOT_SMOOTHING = 0.12  # seconds: standard deviation of the Gaussian over root position and heading


def gaussian_smooth(values: Array, sigma_frames: float) -> Array:
    """Smooth (T, ...) along time with a Gaussian; ends are point-mirrored so that velocity is kept."""
    radius = int(np.ceil(3 * sigma_frames))
    if len(values) < 2 or radius == 0:
        return values.copy()
    n = min(radius, len(values) - 1)
    head, tail = 2 * values[:1] - values[n:0:-1], 2 * values[-1:] - values[-2 : -n - 2 : -1]
    pad = radius - n
    padded = np.concatenate((np.repeat(head[:1], pad, 0), head, values, tail, np.repeat(tail[-1:], pad, 0)))
    kernel = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma_frames) ** 2)
    kernel /= kernel.sum()
    flat = padded.reshape(len(padded), -1)
    smooth = np.stack([np.convolve(flat[:, c], kernel, mode="valid") for c in range(flat.shape[1])], axis=1)
    return smooth.reshape(values.shape).astype(values.dtype)


def smoothed_root(positions: Array) -> tuple[Array, Array]:
    """Root positions (T, 2) and unwrapped headings (T,) of world joints (T, J, 3), smoothed over ROOT_SMOOTHING.

    The root is only a frame of reference, so smoothing costs no precision: the pose is expressed in it.
    It keeps the sway of a walking pelvis out of the trajectory that the network has to predict.
    """
    position, heading = root_of(positions)
    sigma = ROOT_SMOOTHING * FPS
    return gaussian_smooth(position, sigma), gaussian_smooth(np.unwrap(heading), sigma)


@dataclass(frozen=True)
class Library:
    """N frames of clips back to back.

    ``hips`` (N, 3) and ``rotations`` (N, J, 4) as captured; ``root`` (N, 2) and ``heading`` (N,) smoothed;
    ``pose`` (N, J, 3) and ``velocity`` (N, J, 3) joints in the root frame, m and m/s; ``contacts`` (N, 2);
    ``start`` and ``end`` (N,): first and one-past-last frame of the clip a frame belongs to.
    """

    names: tuple[str, ...]
    clip_of: Array
    start: Array
    end: Array
    hips: Array
    rotations: Array
    root: Array
    heading: Array
    pose: Array
    velocity: Array
    contacts: Array

    def __len__(self) -> int:
        return len(self.hips)


def build(clips: list[Clip]) -> Library:
    """Stack clips into a Library; clips shorter than 20 frames are dropped."""
    clips = [c for c in clips if len(c) >= 20]
    if not clips:
        raise CaptureError("no usable clip was found; name a folder with the captures' BVH files.")
    parts: dict[str, list[Array]] = {
        k: [] for k in ("clip_of", "start", "end", "hips", "rotations", "root", "heading", "pose", "velocity", "contacts")
    }
    offset = 0
    for number, clip in enumerate(clips):
        positions, _ = clip.world()
        root, heading = smoothed_root(positions)
        local = positions.copy()
        local[..., :2] -= root[:, None]
        velocity = np.gradient(positions, axis=0) * FPS
        n = len(clip)
        parts["clip_of"].append(np.full(n, number))
        parts["start"].append(np.full(n, offset))
        parts["end"].append(np.full(n, offset + n))
        parts["hips"].append(clip.hips_position)
        parts["rotations"].append(clip.local_rotations)
        parts["root"].append(root)
        parts["heading"].append(heading)
        parts["pose"].append(rotate_planar(local, -heading[:, None]))
        parts["velocity"].append(rotate_planar(velocity, -heading[:, None]))
        parts["contacts"].append(detect_foot_contacts(positions))
        offset += n
    return Library(tuple(c.name for c in clips), **{k: np.concatenate(v) for k, v in parts.items()})


def _is_level_walk(clip: Clip) -> bool:
    if any(word in clip.name for word in _LEFT_OUT):
        return False
    hips = clip.hips_position
    speed = np.linalg.norm(np.diff(hips[:, :2], axis=0), axis=1).mean() * FPS
    return bool(hips[:, 2].min() > 0.8 and speed < 2.0)


def load_walks(folder: str | Path) -> list[Clip]:
    """Read the level idle and walking clips below the capture folder: by labels where there are sidecars, else by name and measure."""
    other = ("cmu_02_04", "cmu_02_05", "cmu_02_06", "cmu_02_07", "cmu_02_08", "cmu_02_09", "cmu_02_10", "cmu_06", "cmu_01_", "cmu_03_")
    paths = [p for p in unlabelled(folder, *_WALK_SOURCES) if not (p.parent.name == "cmu" and f"{name_in(p)}_".startswith(other))]
    named = [read_capture(p, folder) for p in paths]
    return [c for c in named if _is_level_walk(c)] + [c for piece in labelled(folder) for c in walks_and_runs(piece)[0]]


_RUN_LEFT_OUT = tuple("hop skip leap jump crouch box side hop2 jump2 quick".split())


def load_runs(folder: str | Path) -> list[Clip]:
    """Read the clips that run, start to run or stop running: by labels where there are sidecars, else by name and measure."""
    runs = ("run", "jog", "cmu_02_03", "cmu_09")
    paths = [p for p in unlabelled(folder, *_WALK_SOURCES) if any(r in p.stem for r in runs)]
    clips = [read_capture(p, folder) for p in paths if not any(word in p.stem for word in _RUN_LEFT_OUT)]
    clips = [c for c in clips if c.hips_position[:, 2].min() > 0.6]
    return clips + [c for piece in labelled(folder) for c in walks_and_runs(piece)[1]]


@dataclass(frozen=True)
class SitDown:
    """One captured sit-down and rise: stand at 0, seat reached at ``down``, left at ``up``, stand at the end."""

    clip: Clip
    down: int
    up: int


# Frame of a quiet stand whose arms the sitters get: the chair captures have no hand markers and hold the arms folded.
# A folder without it gives the longest quiet stand of its own.
_NEUTRAL_ARMS = ("accad_male1", "male1_a1_stand", 90)
_ARM_JOINTS = [INDEX[s + n] for s in ("Right", "Left") for n in ("Collar", "Shoulder", "Elbow", "Wrist")]


def stance(folder: str | Path) -> dict[str, object]:
    """The quiet stand that takes start from: hips height, metres, and local rotations (23 x 4), facing -Y."""
    clip = neutral(folder)
    _, heading = clip.root()
    hips, rotations = transform(clip.hips_position, clip.local_rotations, np.zeros(2), -heading)
    return {"hips_height": float(hips[0, 2]), "local_rotations": np.round(rotations[0], 5).tolist()}


def neutral(folder: str | Path) -> Clip:
    """One frame of a quiet stand with hanging arms; CaptureError where nobody stands still."""
    source, name, frame = _NEUTRAL_ARMS
    path = Path(folder) / "clips" / source / f"{name}.bvh"
    if path.exists():
        return read_capture(path, folder)[frame : frame + 1]
    best: tuple[int, Clip] | None = None
    for clip in load_walks(folder):
        positions, _ = clip.world()
        quiet = (np.linalg.norm(np.gradient(positions, axis=0), axis=-1) * FPS < _QUIET).all(axis=1)
        wrists = positions[:, [arm[2] for arm in ARMS]]
        quiet &= detect_foot_contacts(positions).all(axis=1) & (np.abs(wrists[..., 2] - positions[:, HIPS, None, 2]) < _HANGING).all(axis=1)
        for a, b in intervals(quiet):
            if best is None or b - a > best[0]:
                best = b - a, clip[(a + b) // 2 : (a + b) // 2 + 1]
    if best is None:
        raise CaptureError(
            f"nobody stands still with hanging arms in {folder}; add a capture of a quiet stand and run `python -m nsm_core annotate`."
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
        hip, knee, wrist = positions[:, INDEX[name + "Hip"]], positions[:, INDEX[name + "Knee"]], positions[:, arm[2]]
        thigh = hip + 0.55 * (knee - hip) + np.array((0, 0, 0.085))
        rotations = place_wrists(clip.hips_position, rotations, side, (wrist + w * (thigh - wrist)).astype(np.float32))
    smooth = gaussian_smooth(align_quaternions(rotations[:, _ARM_JOINTS]), 2.0)
    rotations[:, _ARM_JOINTS] = quat_normalize(smooth)
    return Clip(clip.name, clip.hips_position, rotations.astype(np.float32))


def align_quaternions(q: Array) -> Array:
    """Flip signs along time so that (T, ..., 4) quaternions never jump to the other half."""
    flips = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=-1) < 0, -1.0, 1.0), axis=0)
    return np.concatenate((q[:1], q[1:] * flips[..., None]))


def load_sits(folder: str | Path) -> list[SitDown]:
    """Cut out sit-downs that start and end standing: by labels where there are sidecars, else by name and height; may be empty."""
    sits: list[SitDown] = []
    labels = [cut for piece in labelled(folder) for cut in sit_downs(piece)]
    paths = [p for p in unlabelled(folder) if name_in(p) in _SIT_CLIPS]
    if not paths and not labels:
        return sits
    arms = neutral(folder).local_rotations[0, _ARM_JOINTS]
    for path in paths:
        clip = read_capture(path, folder)
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
            cut = Clip(f"{clip.name}@{start}", clip.hips_position[start : end + 1], clip.local_rotations[start : end + 1])
            sits.append(SitDown(rest_hands_on_thighs(cut, arms), int(down - start), int(up - start)))
    return sits + [SitDown(rest_hands_on_thighs(cut, arms), down, up) for cut, down, up in labels]
