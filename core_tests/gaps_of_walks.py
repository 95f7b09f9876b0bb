"""Windows of synthetic walks by two actors, cut once for all tests of transitions."""

from __future__ import annotations

from functools import cache

import numpy as np
from walks import synthetic_walk

from nsm_core.body.clip import Clip
from nsm_core.data.transitions.windows import Windows, cut

SMALL = {"encoder": 24, "future": 8, "hidden": 20, "decoder": 16, "decoder_second": 12}
SMALL_DELTA = {"width": 32, "layers": 2, "heads": 4}


@cache
def walk(frames: int = 120, speed: float = 1.0, heading: float = 0.0) -> Clip:
    hips, local, _ = synthetic_walk(frames, speed, heading)
    return Clip("walk", hips.astype(np.float32), local.astype(np.float32))


@cache
def windows() -> Windows:
    """Three walks each of "one" and "two_01" .. "two_03" to be cut for gaps of 30 frames."""
    clips = []
    for n, name in enumerate(("one/a", "one/b", "one/c", "two/two_01_a", "two/two_02_a", "two/two_03_a")):
        clip = walk(90 + 5 * n, 0.8 + 0.1 * n, 0.5 * n)
        clips.append(Clip(name, clip.hips_position, clip.local_rotations))
    return cut(clips, 30)
