"""The pool of captured frames that performances are stitched from.

A library holds every usable clip and its mirror image back to back, with what stitching needs per frame:
the smoothed planar root, the pose in the root frame and the foot contacts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.clip import Clip, smoothed_root
from nsm_core.body.contacts import detect_foot_contacts
from nsm_core.conventions import FPS
from nsm_core.errors import CaptureError
from nsm_core.rotations import Array, rotate_planar


@dataclass(frozen=True)
class Library:
    """N frames of clips back to back.

    ``hips`` (N, 3) and ``rotations`` (N, J, 4) as captured; ``root`` (N, 2) and ``heading`` (N,) smoothed;
    ``pose`` (N, J, 3) and ``velocity`` (N, J, 3) joints in the root frame, m and m/s; ``contacts`` (N, 2);
    ``start`` and ``end`` (N,): first and one-past-last frame of the clip a frame belongs to; ``phase`` (N,),
    cycles, as its sidecar says it, NaN where it follows from the motion.
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
    phase: Array

    def __len__(self) -> int:
        return len(self.hips)


def build_library(clips: list[Clip]) -> Library:
    """Stack clips into a Library; clips shorter than 20 frames are dropped."""
    clips = [c for c in clips if len(c) >= 20]
    if not clips:
        raise CaptureError("no usable clip was found; name a folder with the captures' BVH files.")
    parts: dict[str, list[Array]] = {
        k: []
        for k in (
            "clip_of",
            "start",
            "end",
            "hips",
            "rotations",
            "root",
            "heading",
            "pose",
            "velocity",
            "contacts",
            "phase",
        )
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
        stands = detect_foot_contacts(positions)
        parts["contacts"].append(
            stands if clip.feet is None else np.where(np.isfinite(clip.feet), clip.feet > 0.5, stands)
        )
        parts["phase"].append(np.full(n, np.nan) if clip.phase is None else clip.phase[:, 0])
        offset += n
    return Library(tuple(c.name for c in clips), **{k: np.concatenate(v) for k, v in parts.items()})
