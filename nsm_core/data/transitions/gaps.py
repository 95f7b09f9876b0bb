"""Gaps in windows of captures, many at a time, as transition networks are trained on and judged by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from nsm_core.body.skeleton import HIPS, MIRROR, J
from nsm_core.model.transitions.layout import PAST, TARGET_FRAMES, patch_grid
from nsm_core.model.transitions.representation import facing, poses_of, targets_of, turned
from nsm_core.rotations import Array, rotate_planar

from .samples import sampled
from .windows import Windows


@dataclass(frozen=True)
class Gaps:
    """B gaps of ``frames`` missing frames.

    ``joints`` (B, PAST + frames + 2, 23, 3) world, metres: past, what is missing, target and the frame behind
    it, turned as the network sees them.  ``heights`` gives the ground (B, N) at such places (B, N, 2),
    ``sampled`` the same from samples of it, which patches are read from.  ``first`` (B,) are the frames of
    all captures that the gaps begin with, ``middle`` (B, 2) the place there that comes to the origin before
    all is turned by ``angle`` (B,).
    """

    frames: int
    joints: Array
    heights: Callable[[Array], Array]
    sampled: Callable[[Array], Array]
    first: Array
    middle: Array
    angle: Array

    @property
    def poses(self) -> Array:
        """Poses (B, PAST + frames + 1, 69), not standardised."""
        return poses_of(self.joints[:, :-1])

    @property
    def targets(self) -> Array:
        """Targets (B, 138), not standardised."""
        return targets_of(self.joints[:, -TARGET_FRAMES:])

    def patches(self, roots: Array) -> Array:
        """Heights of the ground (..., 169) around hips (B, T, 3), seen from them."""
        grid = patch_grid().astype(np.float32)
        count, frames = roots.shape[:2]
        places = roots[:, :, None, :2] + grid
        heights = self.sampled(places.reshape(count, -1, 2)).reshape(count, frames, len(grid))
        return (heights - roots[..., 2:]).astype(np.float32)


PACES = (0.3, 0.8, 1.6, 2.4)  # m/s of the hips: who stays, steps, walks, hurries and runs


class GapSource:
    """Draws gaps from windows: of the actors held out, or of all others."""

    def __init__(
        self, windows: Windows, held: bool, faced: bool, evened: float = 0.0, hasted: float = 0.0
    ) -> None:
        """``faced``: gaps are turned so that the last past frame has the heading 0; else by chance.
        ``evened``: by how much all paces are drawn alike, from 0, each window as often as any other, to 1,
        each of PACES as often as any other.  ``hasted``: share by which drawn windows are played faster or
        slower at most.
        """
        self.windows, self.held, self.faced, self.hasted = windows, held, faced, hasted
        pace = np.searchsorted(PACES, windows.speeds(), side="right")
        self.shares = np.bincount(pace)[pace].astype(float) ** -evened
        self.joints = windows.joints()

    def draw(self, frames: int, rows: int, rng: np.random.Generator) -> Gaps:
        """Gaps of ``frames`` frames by chance: the window, where in it, the ground, the heading, the side."""
        chosen = self.windows.chosen(self.held, PAST + frames + TARGET_FRAMES)
        shares = self.shares[chosen]
        index = rng.choice(chosen, rows, p=shares / shares.sum())
        whole, length = PAST + frames + TARGET_FRAMES, self.windows.length[index]
        room = length - whole
        into = (rng.random(rows) * (room + 1)).astype(int)
        ground = rng.integers(self.windows.grounds.map.shape[1], size=rows)
        angle = rng.uniform(-np.pi, np.pi, rows)
        mirrored = rng.random(rows) < 0.5
        rate = None
        if self.hasted:
            rate = (1 + self.hasted) ** rng.uniform(-1, 1, rows)
            rate = np.minimum(rate, (length - 1 - into) / (whole - 1))
        return self.gaps(frames, index, into, ground, angle, mirrored, rate)

    def fixed(self, frames: int, most: int, among: Array | None = None) -> Gaps:
        """The first gaps of windows spread over all of them, or over those ``among`` which they are to be, at
        most so many, the same at every call.
        """
        chosen = self.windows.chosen(self.held, PAST + frames + TARGET_FRAMES) if among is None else among
        index = chosen[np.unique(np.linspace(0, len(chosen) - 1, min(most, len(chosen))).astype(int))]
        rng, none = np.random.default_rng(frames), np.zeros(len(index), int)
        return self.gaps(frames, index, none, none, rng.uniform(-np.pi, np.pi, len(index)), none.astype(bool))

    def gaps(
        self,
        frames: int,
        index: Array,
        into: Array,
        ground: Array,
        angle: Array,
        mirrored: Array,
        rate: Array | None = None,
    ) -> Gaps:
        """Gaps of windows ``index`` (B,) from frame ``into`` (B,) of each, on its ``ground`` (B,), turned by
        ``angle`` (B,) radians where they are not faced, and seen in a mirror where ``mirrored`` (B,);
        played ``rate`` (B,) times as fast.
        """
        first, each = self.windows.start[index] + into, np.arange(PAST + frames + TARGET_FRAMES)
        if rate is None:
            joints = self.joints[first[:, None] + each]
        else:
            at = first[:, None] + rate[:, None] * each
            low = np.minimum(at.astype(int), len(self.joints) - 2)
            share = (at - low).astype(np.float32)[..., None, None]
            joints = (1 - share) * self.joints[low] + share * self.joints[low + 1]
        middle = joints[:, PAST - 1, HIPS, :2].copy()
        side = np.where(mirrored, -1.0, 1.0).astype(np.float32)
        joints = np.where(mirrored[:, None, None, None], joints[:, :, MIRROR], joints)
        joints = joints - np.concatenate((middle, np.zeros_like(middle[:, :1])), axis=-1)[:, None, None]
        joints[..., 0] *= side[:, None, None]
        if self.faced:
            angle = -facing(joints[:, PAST - 1])
        joints = turned(joints, np.zeros((len(index), 2)), angle).astype(np.float32)
        under, maps = self.windows.grounds[index, ground], self.windows.maps
        samples = sampled([self.windows.sampled(*pair) for pair in zip(index, ground, strict=True)])

        def captured(places: Array) -> Array:
            there = rotate_planar(places, -angle[:, None].astype(np.float32))
            there[..., 0] *= side[:, None]
            return np.asarray(there + middle[:, None])

        return Gaps(
            frames,
            joints,
            lambda places: under.height(maps, captured(places)),
            lambda places: samples(captured(places)),
            first,
            middle,
            angle,
        )


def statistics_of(source: GapSource, lengths: list[int], rng: np.random.Generator) -> dict[str, Array]:
    """Mean and deviation of every vector over gaps of these ``lengths``, 128 of each."""
    parts: dict[str, list[Array]] = {"pose": [], "velocity": [], "offset": [], "patch": []}
    for frames in lengths:
        gaps = source.draw(frames, 128, rng)
        parts["pose"].append(gaps.poses.reshape(-1, 3 * J))
        parts["velocity"].append(gaps.targets[:, -3 * J :])
        away = gaps.joints[:, -TARGET_FRAMES, None] - gaps.joints[:, : -TARGET_FRAMES + 1]
        parts["offset"].append(away.reshape(-1, 3 * J))
        patches = gaps.patches(gaps.joints[:, :-1:8, HIPS])
        parts["patch"].append(patches.reshape(-1, patches.shape[-1]))
    out = {}
    for name, values in parts.items():
        whole = np.concatenate(values).astype(np.float64)
        out[f"{name}_mean"] = whole.mean(0).astype(np.float32)
        out[f"{name}_std"] = np.maximum(whole.std(0), LEAST[name]).astype(np.float32)
    return out


# Deviations are raised to these: what hardly moves in training would else be blown up when it moves later.
LEAST = {"pose": 1e-3, "velocity": 1e-3, "offset": 0.01, "patch": 0.02}

__all__ = ["GapSource", "Gaps", "statistics_of"]
