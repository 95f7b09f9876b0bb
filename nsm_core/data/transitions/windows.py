"""Windows of captures, with ground fitted under each: what transitions are learnt from and judged by."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from nsm_core import npz
from nsm_core.body.clip import Clip
from nsm_core.body.skeleton import J, forward_kinematics
from nsm_core.conventions import FPS
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.errors import CaptureError
from nsm_core.files import output
from nsm_core.model.transitions.layout import PAST
from nsm_core.rotations import Array

from .actors import actor_of, held_out
from .fitting import KEPT, fitted
from .ground import Grounds
from .heightmaps import heightmaps
from .samples import Samples

AFTER = 10  # frames kept behind a transition, the first two of them its target
EVERY = 20  # frames from the start of a window to that of the next (papers/001 table 6)
SHORTEST = PAST + 15 + AFTER  # frames of a clip that one window is still cut from
LEFT_OUT = ("smartbody",)  # folders that nothing shipped may learn from, see the credits
_FORMAT = "nsm-transitions-1"


@dataclass
class Windows:
    """N windows into F frames of captures, and KEPT grounds under each.

    ``hips`` (F, 3) metres and ``local`` rotations (F, 23, 4); windows' first frames ``start`` (N,), their
    ``length`` (N,), and whether they are of actors who are ``held`` out (N,).  ``maps`` are those that
    ``grounds`` (N, KEPT) are made of; ``about`` says what all came from.
    """

    hips: Array
    local: Array
    start: Array
    length: Array
    held: Array
    grounds: Grounds
    maps: Array
    about: dict[str, object]
    # Ground of windows as sampled when it was first asked for: runs one after the other share it.
    _samples: dict[tuple[int, int], Samples] = field(default_factory=dict, init=False, repr=False)

    def chosen(self, held: bool, frames: int) -> Array:
        """Windows with ``frames`` frames at least, of actors held out or of the others."""
        return np.flatnonzero((self.held == held) & (self.length >= frames))

    def joints(self) -> Array:
        """World joints (F, 23, 3) of all frames, float32."""
        parts = np.array_split(np.arange(len(self.hips)), max(1, len(self.hips) // 4096))
        return np.concatenate([forward_kinematics(self.hips[p], self.local[p])[0] for p in parts])

    def speeds(self) -> Array:
        """How fast the hips go over the floor on average (N,), m/s."""
        gone = np.linalg.norm(np.diff(self.hips[:, :2], axis=0, append=self.hips[-1:, :2]), axis=1)
        spans = zip(self.start, self.length, strict=True)
        return np.array([FPS * gone[first : first + length - 1].mean() for first, length in spans])

    def sampled(self, window: int, ground: int) -> Samples:
        """The ``ground`` of a window around the captured way."""
        if (window, ground) not in self._samples:
            start = self.start[window]
            way = self.hips[start : start + self.length[window], :2]
            under = self.grounds[window, ground]
            self._samples[window, ground] = Samples.around(way, lambda at: under.height(self.maps, at))
        return self._samples[window, ground]

    def save(self, path: Path) -> None:
        """Write all but the maps, which are made again."""
        arrays = {n: getattr(self, n) for n in ("hips", "local", "start", "length", "held")}
        arrays |= {f"ground_{f.name}": getattr(self.grounds, f.name) for f in fields(Grounds)}
        arrays["about"] = np.frombuffer(json.dumps(self.about).encode(), np.uint8)
        with output(path, "The windows") as temporary, open(temporary, "wb") as file:
            np.savez(file, **arrays)

    @classmethod
    def load(cls, path: Path) -> Windows:
        """Read what ``save`` wrote; CaptureError where it is something else."""
        kinds = {"hips": "f", "local": "f", "start": "i", "length": "i", "held": "b", "about": "u"}
        kinds |= {f"ground_{f.name}": "i" if f.name == "map" else "f" for f in fields(Grounds)}
        try:
            arrays = npz.read_arrays(path, kinds, 1 << 31)
            about = json.loads(arrays.pop("about").tobytes().decode())
            if about.get("format") != _FORMAT or set(arrays) != set(kinds) - {"about"}:
                raise ValueError("another format")
        except (OSError, ValueError, KeyError, npz.DamagedArrays) as error:
            raise CaptureError(
                f"{path} holds no windows of captures ({error}); delete it to have them cut again."
            ) from error
        grounds = Grounds(*(arrays.pop(f"ground_{f.name}") for f in fields(Grounds)))
        return cls(**arrays, grounds=grounds, maps=heightmaps(), about=about)


def cut(
    clips: Sequence[Clip],
    transition: int,
    seed: int = 0,
    every: int = EVERY,
    progress: Callable[[float], None] | None = None,
) -> Windows:
    """Cut clips, named "folder/clip", into windows of PAST + ``transition`` + AFTER frames, shorter clips
    into one; CaptureError where there is nothing to cut.
    """
    whole = PAST + transition + AFTER
    clips = [clip for clip in clips if len(clip) >= min(SHORTEST, whole)]
    if not clips:
        raise CaptureError(
            f"No clip is {min(SHORTEST, whole)} frames long, and transitions are cut from longer ones; "
            "choose another folder."
        )
    frames: Counter[str] = Counter()
    for clip in clips:
        frames[actor_of(clip.name)] += len(clip)
    out, maps = held_out(frames), heightmaps()
    rng = np.random.default_rng(seed)
    spans, held, grounds, first = [], [], [], 0
    for n, clip in enumerate(clips):
        positions = clip.world()[0]
        for start in range(0, max(1, len(clip) - whole + 1), every):
            length = min(whole, len(clip))
            spans.append((first + start, length))
            held.append(actor_of(clip.name) in out)
            grounds.append(fitted(positions[start : start + length], maps, rng))
        first += len(clip)
        if progress is not None:
            progress((n + 1) / len(clips))
    about = {
        "format": _FORMAT,
        "transition": transition,
        "frames": dict(frames),
        "held_out": list(out),
        "held_out_share": sum(frames[a] for a in out) / sum(frames.values()),
    }
    start, length = np.array(spans, np.int64).T
    stacked = [np.stack([getattr(g, f.name) for g in grounds]) for f in fields(Grounds)]
    stacked = [a.astype(np.int32 if a.dtype.kind == "i" else np.float32) for a in stacked]
    return Windows(
        np.concatenate([c.hips_position for c in clips]).astype(np.float32),
        np.concatenate([c.local_rotations for c in clips]).astype(np.float32).reshape(-1, J, 4),
        start,
        length,
        np.array(held),
        Grounds(*stacked),
        maps,
        about,
    )


def clips_of(folder: str | Path, leave_out: Sequence[str] = LEFT_OUT) -> list[Clip]:
    """All clips of a capture folder, named "folder/clip", but those in folders to ``leave_out``."""
    captures = CaptureFolder(folder)
    found = []
    for capture in captures.captures:
        name = capture.path.relative_to(captures.folder).with_suffix("").as_posix()
        if not set(Path(name).parts[:-1]) & set(leave_out):
            clip = captures.read(capture)
            found.append(Clip(name, clip.hips_position, clip.local_rotations))
    return found


__all__ = ["AFTER", "EVERY", "KEPT", "LEFT_OUT", "Windows", "clips_of", "cut"]
