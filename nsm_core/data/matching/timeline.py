"""Captured frames laid end to end: the motion of a take before it is joined and fitted."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from nsm_core.body.skeleton import HIPS
from nsm_core.conventions import FPS
from nsm_core.rotations import Array, rotate_planar

from .database import Library
from .draws import MATCHING


class Tape:
    """Fractional library ``frames`` with the ``roots`` (2,) and ``headings`` each is put on, and where pieces
    meet (``seams``).
    """

    def __init__(self, library: Library, rng: np.random.Generator) -> None:
        self.lib, self.rng = library, rng
        self.frames: list[float] = []
        self.roots: list[Array] = []
        self.headings: list[float] = []
        self.seams: list[int] = []

    def __len__(self) -> int:
        return len(self.frames)

    def lay(
        self,
        frames: Iterable[float],
        roots: Iterable[Array],
        headings: Iterable[float],
        seams: tuple[int, ...] = (),
        seam: bool = True,
    ) -> None:
        """Lay library ``frames`` (n,) with their ``roots`` (n, 2) and ``headings`` (n,) on; ``seams`` count
        from the first of them.
        """
        start = len(self)
        if seam and start:
            self.seams.append(start)
        self.seams += [start + s for s in seams]
        self.frames += [float(f) for f in frames]
        self.roots += list(roots)
        self.headings += [float(h) for h in headings]

    def run_on(self, frames: Array, seam: bool) -> None:
        """Lay captured frames on from the tape's last root, moving it as it moved in the capture."""
        lib, f = self.lib, np.asarray(frames, dtype=float)
        i = np.minimum(f.astype(int), len(lib) - 2)
        w = (f - i)[:, None]
        root = lib.root[i] * (1 - w) + lib.root[i + 1] * w
        heading = lib.heading[i] * (1 - w[:, 0]) + lib.heading[i + 1] * w[:, 0]
        at, facing = self.roots[-1], self.headings[-1]
        turn = facing - heading[0]
        self.lay(f, at + rotate_planar(root - root[0], np.full(len(f), turn)), heading + turn, seam=seam)

    def hold(self, frame: int, count: int, reach: int, seam: bool) -> None:
        """Stay about one captured frame for ``count`` frames, swaying slowly over its neighbours."""
        lib = self.lib
        low, high = max(frame - reach, int(lib.start[frame])), min(frame + reach, int(lib.end[frame]) - 2)
        period = self.rng.uniform(*MATCHING.sway_period) * FPS
        where = np.clip(frame + (high - low) / 2 * np.sin(2 * np.pi * np.arange(count) / period), low, high)
        self.run_on(where, seam)

    def stand(self, seconds: float) -> None:
        """Go on standing: as the capture does, where it stands still for that long, else by holding its last
        frame.
        """
        last = int(self.frames[-1])
        end = int(self.lib.end[last])
        count = int(seconds * FPS)
        captured = np.arange(last + 1, min(last + 1 + count, end - 1))
        speeds = (
            np.linalg.norm(self.lib.velocity[captured, HIPS, :2], axis=1) if len(captured) else np.ones(1)
        )
        if len(captured) >= count and speeds.max() < 0.12:
            self.run_on(captured, seam=False)
        else:
            self.stay(seconds)

    def stay(self, seconds: float) -> None:
        """Hold the last frame, whatever the capture goes on to do: after a bend, which is captured once and
        played to and fro.
        """
        self.hold(int(self.frames[-1]), int(seconds * FPS), 1, seam=False)

    def stretch(self, first: int, rate: Array) -> Array:
        """Play frames from ``first`` on at ``rate`` (n,), shares of their pace; returns when (n,) each of
        them is shown now, frames counted from ``first``.
        """
        count = len(self) - first
        when = np.concatenate(([0.0], np.cumsum(1 / rate[:-1])))
        y = np.interp(np.arange(int(when[-1]) + 1), when, np.arange(count))
        i = np.minimum(y.astype(int), count - 1)
        w = y - i
        frames = np.array(self.frames[first:])
        roots, headings = np.array(self.roots[first:]), np.array(self.headings[first:])
        seams = np.array([s - first for s in self.seams if s >= first], dtype=int)
        j = np.minimum(i + 1, count - 1)
        step = np.where(np.isin(j, seams), 1.0, frames[j] - frames[i])
        step[frames[i] + 2 > self.lib.end[frames[i].astype(int)]] = 0.0
        self.trim(first)
        moved = tuple(int(np.searchsorted(y, s)) for s in seams)
        self.lay(
            frames[i] + w * step,
            roots[i] + w[:, None] * (roots[j] - roots[i]),
            headings[i] + w * (headings[j] - headings[i]),
            seams=moved,
            seam=False,
        )
        return when

    def trim(self, length: int) -> None:
        """Drop frames from ``length`` on; commands stay."""
        del self.frames[length:], self.roots[length:], self.headings[length:]
        self.seams = [s for s in self.seams if s < length]
