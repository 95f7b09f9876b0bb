"""A clip: one performance of the 23-joint skeleton at 30 frames a second."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from nsm_core.conventions import FPS
from nsm_core.errors import CaptureError
from nsm_core.rotations import Array, quat_mul, quat_normalize, quat_rotate, quat_slerp
from nsm_core.rotations import heading_quat as _heading_quat
from nsm_core.signals import gaussian_smooth

from .skeleton import J, forward_kinematics, mirror, root_of

MIRRORED = "~"  # ends the name of a mirror image


@dataclass(frozen=True)
class Clip:
    """Hips positions (T, 3), metres, world, and parent-relative rotations (T, J, 4) at 30 Hz.

    ``notes`` are sentences on what its file says other than it was read.  ``phase`` (T, 2): cycles of the
    clip and of its mirror image; ``feet`` (T, 2): 1 where the right and the left foot stand, 0 where not;
    both where somebody says them, NaN in columns that nobody does, None where all follows from the motion.
    """

    name: str
    hips_position: Array
    local_rotations: Array
    notes: tuple[str, ...] = field(default=(), compare=False)
    phase: Array | None = field(default=None, compare=False)
    feet: Array | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        """Check shapes and numbers; CaptureError says what is wrong."""
        if self.hips_position.shape != (len(self), 3) or self.local_rotations.shape != (len(self), J, 4):
            raise CaptureError(
                f"{self.name}: expected hips (T, 3) and rotations (T, {J}, 4); read the capture again."
            )
        bad = ~(
            np.isfinite(self.hips_position).all(axis=1) & np.isfinite(self.local_rotations).all(axis=(1, 2))
        )
        if bad.any():
            raise CaptureError(
                f"{self.name}: frame {int(np.argmax(bad))} holds values that are not numbers; repair or cut "
                "that frame and read it again."
            )

    def __len__(self) -> int:
        return len(self.hips_position)

    def world(self) -> tuple[Array, Array]:
        """World joint positions (T, J, 3) and rotations (T, J, 4)."""
        return forward_kinematics(self.hips_position, self.local_rotations)

    def root(self) -> tuple[Array, Array]:
        """Planar root: positions (T, 2), metres, and headings (T,), radians."""
        return root_of(self.world()[0])

    def mirrored(self) -> Clip:
        """Return the clip reflected left to right."""
        hips, rotations = mirror(self.hips_position, self.local_rotations)
        phase, feet = (None if told is None else told[:, ::-1] for told in (self.phase, self.feet))
        return Clip(self.name + MIRRORED, hips, rotations, phase=phase, feet=feet)

    def __getitem__(self, frames: slice) -> Clip:
        phase, feet = (None if told is None else told[frames] for told in (self.phase, self.feet))
        return replace(
            self,
            hips_position=self.hips_position[frames],
            local_rotations=self.local_rotations[frames],
            phase=phase,
            feet=feet,
        )


def transform(
    hips_position: Array, local_rotations: Array, position: Array, heading: Array
) -> tuple[Array, Array]:
    """Turn a motion about the world's Z by ``heading`` (...) and then move it by ``position`` (..., 2)."""
    q = _heading_quat(np.asarray(heading, hips_position.dtype)).astype(hips_position.dtype)
    hips = quat_rotate(np.broadcast_to(q, hips_position.shape[:-1] + (4,)), hips_position)
    hips[..., :2] += position
    rotations = local_rotations.copy()
    rotations[..., 0, :] = quat_mul(
        np.broadcast_to(q, rotations[..., 0, :].shape), local_rotations[..., 0, :]
    )
    return hips, rotations


def resample(
    hips_position: Array, local_rotations: Array, times: Array, fps: float = FPS
) -> tuple[Array, Array]:
    """Sample a motion (T, ...) recorded at ``fps`` at ``times`` (N,), seconds; ends are held."""
    x = np.clip(np.asarray(times) * fps, 0, len(hips_position) - 1)
    i = np.minimum(x.astype(int), max(len(hips_position) - 2, 0))
    k = np.minimum(i + 1, len(hips_position) - 1)
    f = (x - i).astype(hips_position.dtype)
    hips = hips_position[i] + f[:, None] * (hips_position[k] - hips_position[i])
    rotations = quat_slerp(
        local_rotations[i], local_rotations[k], np.repeat(f[:, None], local_rotations.shape[1], axis=1)
    )
    return hips, quat_normalize(rotations)


ROOT_SMOOTHING = 0.12  # seconds: standard deviation of the Gaussian over root position and heading


def smoothed_root(positions: Array) -> tuple[Array, Array]:
    """Root positions (T, 2) and unwrapped headings (T,) of world joints (T, J, 3), smoothed over
    ROOT_SMOOTHING.

    The root is only a frame of reference, so smoothing costs no precision: the pose is expressed in it.
    It keeps the sway of a walking pelvis out of the trajectory that the network has to predict.
    """
    position, heading = root_of(positions)
    sigma = ROOT_SMOOTHING * FPS
    return gaussian_smooth(position, sigma), gaussian_smooth(np.unwrap(heading), sigma)
