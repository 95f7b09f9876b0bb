"""The ways of feet past what stands on the floor: legs of tables and chairs, walls, doors in motion."""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np

from nsm_core.body.capsules import SPHERES, Spheres
from nsm_core.body.contacts import ANKLES, TOES
from nsm_core.body.near_spheres import near_spheres
from nsm_core.rotations import Array, quat_mul, quat_rotate
from nsm_core.signals import gaussian_smooth, smooth_step

from .clearance import Obstacle
from .footsteps import Footsteps
from .solver import Pose

PAD = 0.005  # metres between a foot and solids
ROUNDS, MOST = 8, 0.12  # metres at most by which a stand is moved
SMOOTH = 2.0  # frames over which a swinging foot gives way
_LEVEL = 0.3  # of a way off a solid, over the floor, that counts
_NEAR = 0.15  # metres off feet within which solids are looked at

FOOT_SPHERES = SPHERES.foot


def keep_clear(
    feet: Footsteps, pose: Pose, solids: Sequence[Obstacle], body: Spheres = SPHERES
) -> Generator[None, None, None]:
    """Move stands, each as a whole, and the ways between them off ``solids``, in place; ``pose`` tells how
    toes are bent, ``body`` how large feet are.  Yields now and then.
    """
    count = len(pose.hips)
    moved = np.zeros((count, 2, 2))
    own = body.only(np.flatnonzero(body.foot))
    near = _near(feet, pose, solids, moved, own)
    if not any(len(frames) for frames, _ in near):
        return
    for _ in range(ROUNDS):
        yield
        push = _pushes(feet, pose, solids, near, moved, own)
        if not push.any():
            break
        for side in (0, 1):
            moved[:, side] += _smooth(push[:, side], feet.runs[side])
        size = np.linalg.norm(moved, axis=-1, keepdims=True)
        moved *= np.minimum(1, MOST / np.maximum(size, 1e-9))
    feet.ankles[..., :2] += moved


def _centres(feet: Footsteps, pose: Pose, moved: Array, own: Spheres) -> tuple[Array, Array]:
    """Spheres of the feet (T, S, 3), where they are to be, and their radii."""
    positions, world = pose.positions.copy(), pose.world.copy()
    positions[:, ANKLES] = feet.ankles
    positions[:, ANKLES, :2] += moved
    world[:, ANKLES] = feet.rotations
    positions[:, TOES] = positions[:, ANKLES] + quat_rotate(
        feet.rotations, np.broadcast_to(pose.tree.offsets[TOES], feet.ankles.shape)
    )
    world[:, TOES] = quat_mul(feet.rotations, pose.local[:, TOES])
    return own.of(positions, world)


def _near(
    feet: Footsteps, pose: Pose, solids: Sequence[Obstacle], moved: Array, own: Spheres
) -> list[tuple[Array, Array]]:
    centres, radii = _centres(feet, pose, moved, own)
    return [near_spheres(solid.distance, centres, radii, own, _NEAR) for solid in solids]


def _pushes(
    feet: Footsteps,
    pose: Pose,
    solids: Sequence[Obstacle],
    near: Sequence[tuple[Array, Array]],
    moved: Array,
    own: Spheres,
) -> Array:
    """How far (T, 2, 2) over the floor the deepest sphere of each foot has to go."""
    centres, radii = _centres(feet, pose, moved, own)
    sides = np.array([int(name.startswith("Left")) for name in own.names])
    push, most = np.zeros((len(moved), 2, 2)), np.zeros((len(moved), 2))
    for solid, (frames, spheres) in zip(solids, near, strict=True):
        distance = solid.distance(frames, centres[frames, spheres], float(radii.max()))
        lack = radii[frames, spheres] + PAD - distance
        deep = np.flatnonzero(lack > 0)
        deep = deep[np.argsort(lack[deep])]  # the deepest is written last
        frames, spheres, lack = frames[deep], spheres[deep], lack[deep]
        ways = solid.normals(frames, centres[frames, spheres], distance[deep])
        # What a foot stands on is no obstacle to it, though its heel hangs over the edge.
        below = feet.planted[frames, sides[spheres]] & (ways[:, 2] > _LEVEL)
        ways = ways[:, :2]
        size = np.linalg.norm(ways, axis=1)
        ok = (size > _LEVEL) & ~below
        frames, side = frames[ok], sides[spheres[ok]]
        ways, lack = ways[ok] / size[ok, None], lack[ok]
        deeper = lack > most[frames, side]
        push[frames[deeper], side[deeper]] = (ways * lack[:, None])[deeper]
        most[frames[deeper], side[deeper]] = lack[deeper]
    return push


def _smooth(push: Array, runs: Sequence[tuple[int, int]]) -> Array:
    """One step (T, 2) of a foot out of (T, 2) pushes: the same over each of its stands, smooth in between."""
    count = len(push)
    out = np.zeros_like(push)
    ends = [(0, 0, np.zeros(2))]
    for a, b in runs:
        worst = push[a + int(np.linalg.norm(push[a:b], axis=1).argmax())]
        out[a:b] = worst
        ends.append((a, b, worst))
    ends.append((count, count, np.zeros(2)))
    for (_, end, before), (start, _, after) in zip(ends[:-1], ends[1:], strict=True):
        gap = start - end
        if gap <= 0:
            continue
        k = np.arange(1, gap + 1)
        share = smooth_step(k / (gap + 1))[:, None]
        own = gaussian_smooth(push[end:start], SMOOTH) if gap > 2 else push[end:start]
        inside = smooth_step(np.minimum(k, gap + 1 - k) / 3.0)[:, None]
        out[end:start] = (1 - share) * before + share * after + inside * own
    return out


__all__ = ["FOOT_SPHERES", "keep_clear"]
