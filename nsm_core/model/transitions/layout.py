"""The one place that names every slice of what a transition network reads and tells.

All 23 joints are told where the paper has 22 bones: each of them carries a bone or ends one (wrists, head and
toe joints), so there is none to leave out.  Positions and velocities are metres and metres a frame in a world
that is turned as ``TransitionConfig.faced`` says.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import J
from nsm_core.model.features.layout import Layout
from nsm_core.rotations import Array

PAST = 10  # frames of context (section 3.1)
TARGET_FRAMES = 2  # the target, and the one behind it, which tells how fast it is
PATCH_CELLS, PATCH_SIZE = 13, 2.06  # points and metres along each side of the ground that is seen

# x: the hips' velocity, then the other joints seen from the hips (section 3.2).
POSE = Layout(root_velocity=(3,), joint_position=(J - 1, 3))
# t: that of the target frame, and how fast each of its numbers' joints is there.
TARGET = Layout(pose=(POSE.size,), velocity=(J, 3))
# o: from where each joint is to where the target has it, in the world.
OFFSET = Layout(joint_offset=(J, 3))
# p: heights of the ground over a grid around the hips, seen from the hips.
PATCH = Layout(height=(PATCH_CELLS, PATCH_CELLS))
# What a network that tells all frames at once is shown of each, beside its patch: where the hips are seen
# from the last past frame's, how fast all joints are, and the joints seen from the hips.
FRAME = Layout(root_offset=(3,), velocity=(J, 3), joint_position=(J - 1, 3))
VECTORS = {"pose": POSE, "target": TARGET, "offset": OFFSET, "patch": PATCH}


def layout_description() -> dict[str, dict[str, list[int]]]:
    """Names and shapes of all blocks, for the metadata of weights."""
    return {k: {n: list(s) for n, s in v.shapes.items()} for k, v in VECTORS.items()}


def patch_grid() -> Array:
    """Places (169, 2) of the points of a patch seen from under the hips, metres, x first."""
    line = np.linspace(-PATCH_SIZE / 2, PATCH_SIZE / 2, PATCH_CELLS)
    return np.stack(np.meshgrid(line, line, indexing="ij"), -1).reshape(-1, 2)


__all__ = [
    "FRAME",
    "OFFSET",
    "PAST",
    "PATCH",
    "PATCH_SIZE",
    "POSE",
    "TARGET",
    "TARGET_FRAMES",
    "VECTORS",
    "layout_description",
    "patch_grid",
]
