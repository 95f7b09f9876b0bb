"""A BVH file in memory, as it is written, and its bodies where it holds several."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from nsm_core.body.clip import resample
from nsm_core.conventions import FPS
from nsm_core.errors import CaptureError
from nsm_core.rotations import Array, quat_mul, quat_rotate

# Frames times joints that are held at once: half an hour at 120 Hz of a body without fingers, 3 GB at most.
MOST_CELLS = 6_000_000


@dataclass(frozen=True)
class Bvh:
    """A BVH file as it is written: its own names, axes, units and rate.

    ``offsets`` (N, 3) and ``places`` (T, N, 3) are relative to the parent, in the file's units; ``rotations``
    (T, N, 4) are relative to the parent; ``interval`` is the time between frames, seconds.  End sites are
    joints named after their parent with "_End" behind it.  ``notes`` are sentences on what was read other
    than it is written.
    """

    name: str
    joints: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Array
    places: Array
    rotations: Array
    interval: float
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.rotations)

    def __getitem__(self, frames: slice) -> Bvh:
        return replace(self, places=self.places[frames], rotations=self.rotations[frames])

    def world(self) -> tuple[Array, Array]:
        """World positions (T, N, 3) and rotations (T, N, 4) of all joints, in the file's axes and units."""
        return world_of(self.parents, self.places, self.rotations)

    def rest(self) -> tuple[Array, Array]:
        """World positions (N, 3) and rotations (N, 4) with every channel at zero."""
        identity = np.tile(np.array((1.0, 0, 0, 0)), (len(self.joints), 1))
        return world_of(self.parents, self.offsets, identity)

    def at_rate(self, fps: float = FPS) -> Bvh:
        """Return the motion at ``fps``, unchanged where the file is at that rate already; CaptureError where
        that is too much.
        """
        rate = 1 / self.interval
        if abs(rate - fps) <= 0.1:
            return self
        count = int((len(self) - 1) * self.interval * fps) + 1
        check_size(self.name, count, len(self.joints))
        times = np.arange(count) / fps
        flat, rotations = resample(self.places.reshape(len(self), -1), self.rotations, times, rate)
        return replace(self, places=flat.reshape(len(times), -1, 3), rotations=rotations, interval=1 / fps)

    def only(self, joints: list[int]) -> Bvh:
        """Return the file with some of its joints alone, in their order; each joint's parent must be among
        them or be none.
        """
        at = {j: k for k, j in enumerate(joints)}
        return replace(
            self,
            joints=tuple(self.joints[j] for j in joints),
            parents=tuple(at.get(self.parents[j], -1) for j in joints),
            offsets=self.offsets[joints],
            places=self.places[:, joints],
            rotations=self.rotations[:, joints],
        )


def world_of(parents: tuple[int, ...], places: Array, rotations: Array) -> tuple[Array, Array]:
    """Chain (..., N, 3) places and (..., N, 4) rotations relative to parents into world ones of the same
    shapes.
    """
    positions, turned = np.empty_like(places), np.empty_like(rotations)
    for j, p in enumerate(parents):
        if p < 0:
            positions[..., j, :], turned[..., j, :] = places[..., j, :], rotations[..., j, :]
            continue
        turned[..., j, :] = quat_mul(turned[..., p, :], rotations[..., j, :])
        positions[..., j, :] = positions[..., p, :] + quat_rotate(turned[..., p, :], places[..., j, :])
    return positions, turned


def check_size(name: str, frames: int, joints: int) -> None:
    """Raise CaptureError where a motion is more than can be held at once."""
    if frames * joints > MOST_CELLS:
        raise CaptureError(
            f"{name}.bvh would be {frames} frames of {joints} joints, too much to read at once; "
            f"cut it into files of at most {MOST_CELLS // joints} frames, or correct its Frame Time."
        )
