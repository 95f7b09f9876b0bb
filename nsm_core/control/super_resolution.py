"""Motion kept as a context of ten frames and one target, pose and speed, a second, and made whole again by
filling from each to the next in series (papers/001 section 7.4).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nsm_core import npz
from nsm_core.body.clip import Clip
from nsm_core.conventions import FPS
from nsm_core.errors import CaptureError
from nsm_core.files import output
from nsm_core.model.inference.transition_model import TransitionModel
from nsm_core.model.transitions.layout import PAST, TARGET_FRAMES

from .inbetween import Gap, fill

_FORMAT = ("hips", "local")


@dataclass(frozen=True)
class Compressed:
    """``past`` of PAST frames, and N targets of TARGET_FRAMES frames each, FPS frames apart."""

    past: Clip
    targets: tuple[Clip, ...]

    def save(self, path: str | Path) -> Path:
        """Write it: places in single, rotations in half precision."""
        parts = (self.past, *self.targets)
        hips = np.concatenate([p.hips_position for p in parts]).astype(np.float32)
        local = np.concatenate([p.local_rotations for p in parts]).astype(np.float16)
        with output(path, "The motion") as temporary, open(temporary, "wb") as file:
            np.savez_compressed(file, hips=hips, local=local)
        return Path(path)

    @classmethod
    def load(cls, path: str | Path) -> Compressed:
        """Read what ``save`` wrote; CaptureError where it is something else."""
        path = Path(path)
        try:
            arrays = npz.read_arrays(path, dict.fromkeys(_FORMAT, "f"), 1 << 28)
            hips, local = (arrays[name].astype(np.float32) for name in _FORMAT)
            whole = Clip(path.stem, hips, local)
        except (OSError, KeyError, npz.DamagedArrays) as error:
            raise CaptureError(f"{path} holds no compressed motion ({error}); compress it again.") from error
        count = len(whole) - PAST
        if count < 0 or count % TARGET_FRAMES:
            raise CaptureError(f"{path} holds {len(whole)} frames, which are no targets; compress it again.")
        starts = range(PAST, len(whole), TARGET_FRAMES)
        return cls(whole[:PAST], tuple(whole[a : a + TARGET_FRAMES] for a in starts))


def compress(clip: Clip) -> Compressed:
    """Keep of a clip its first frames and one target a second; what is left behind the last one is lost.

    CaptureError where there is no second to keep.
    """
    last = len(clip) - TARGET_FRAMES
    starts = range(PAST - 1 + FPS, last + 1, FPS)
    if not starts:
        raise CaptureError(
            f"{clip.name} has {len(clip)} frames, and {PAST + FPS + 1} are the least that can be compressed; "
            "choose a longer one."
        )
    return Compressed(clip[:PAST], tuple(clip[a : a + TARGET_FRAMES] for a in starts))


def decompress(kept: Compressed, network: TransitionModel | None) -> Clip:
    """Make a motion whole: each gap goes on from what was made of the one before it."""
    whole = kept.past
    for target in kept.targets:
        made = fill(Gap(whole[-PAST:], target, FPS - 1), network).clip
        parts = (whole, made, target[:1])
        whole = Clip(
            kept.past.name,
            np.concatenate([p.hips_position for p in parts]),
            np.concatenate([p.local_rotations for p in parts]),
        )
    return whole


__all__ = ["Compressed", "compress", "decompress"]
