"""How far a leaf may turn for the body that stands beside it: what pushes it open, and what is in its way."""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import END_SITES, INDEX
from nsm_core.body.thin_capsules import THIN_CAPSULES
from nsm_core.rotations import Array, quat_rotate
from nsm_core.world.scene.props import Leaf

from .hold import SeenBody

TOUCH = 0.008  # metres between the body and a leaf at the nearest
NEARLY, SOON = (
    0.07,
    0.16,
)  # metres at which a leaf begins to give way, and from which on a trunk leans less towards it
_BOARD = (0.012, 0.05)  # metres: half the thickness of a board at least and at most
_SAMPLES = 5  # spheres that stand for a capsule
_TRUNK = ("Hips", "Chest2", "Neck", "Head", "RightShoulder")
_ARM = ("Shoulder", "Elbow", "Wrist")
_SIDES = ("Right", "Left")


Spheres = tuple[Array, Array]


def leaf_spheres(seen: SeenBody, without: int | None = None) -> tuple[Spheres, Spheres]:
    """Centres (S, 3) world and radii (S,), metres, of a body's capsules, but the arm ``without`` (0 right, 1
    left); of its trunk alone.
    """
    joints, turns = seen.joints
    first, last = joints[_ENDS] + quat_rotate(turns[_ENDS], _OFF)
    share = np.linspace(0, 1, _SAMPLES)[:, None]
    kept = np.ones(len(THIN_CAPSULES), dtype=bool) if without is None else ~_OF_ARM[without]
    centres = np.swapaxes(first + share[..., None] * (last - first), 0, 1)  # (C, _SAMPLES, 3)
    radii = (_RADII[:, 0] + share * (_RADII[:, 1] - _RADII[:, 0])).T
    whole, trunk = ((centres[k].reshape(-1, 3), radii[k].reshape(-1)) for k in (kept, kept & _OF_TRUNK))
    return whole, trunk


def _ends(which: int) -> tuple[list[int], Array]:
    """Joints (C,) of the first or last ends of the capsules and the ends' offsets (C, 3) from them,
    metres.
    """
    names = [(a, b)[which] for a, b, _, _ in THIN_CAPSULES]
    bones = [name.removesuffix(" end") for name in names]
    offsets = [
        np.zeros(3) if bone == name else END_SITES[bone] for bone, name in zip(bones, names, strict=True)
    ]
    return [INDEX[bone] for bone in bones], np.array(offsets, dtype=np.float64)


_FIRST, _LAST = _ends(0), _ends(1)
_ENDS, _OFF = np.stack((_FIRST[0], _LAST[0])), np.stack((_FIRST[1], _LAST[1]))
_RADII = np.array([capsule[2:] for capsule in THIN_CAPSULES])
_OF_TRUNK = np.array([a in _TRUNK and b not in ("RightElbow", "LeftElbow") for a, b, _, _ in THIN_CAPSULES])
_OF_ARM = (
    np.array([[a in [side + part for part in _ARM] for a, *_ in THIN_CAPSULES] for side in _SIDES])
    & ~_OF_TRUNK
)


class LeafRoom:
    """The angles between which a leaf is clear of a body; the leaf is a board of even thickness from hinge to
    free edge.
    """

    def __init__(self, leaf: Leaf) -> None:
        self.leaf = leaf
        middle = np.array(((0.5 * leaf.width, float(leaf.handle[1]), 0.75 * self._top),), dtype=np.float32)
        self._half = float(np.clip(-leaf.query.signed_distance(middle, 0.1)[0], *_BOARD))
        self._off = float(
            leaf.swing * leaf.handle[1]
        )  # of the board's middle from the hinge, towards where it opens

    @property
    def _top(self) -> float:
        volume = self.leaf.volume
        return float(volume.centre[2] + volume.size[2] / 2)

    def limits(self, centres: Array, radii: Array, margin: float = TOUCH) -> tuple[float, float]:
        """The angle at least, for what is on the leaf's closing side, and at most, for what is on the side to
        which it opens.

        ``centres`` (S, 3) world and ``radii`` (S,) of the body; -inf and inf where it is not within the
        leaf's reach.  What lies about the hinge, where no angle clears it, does not count.
        """
        leaf = self.leaf
        local = leaf.to_local(centres, leaf.pose_at(0.0))
        away = np.hypot(local[:, 0], local[:, 1])
        beside = leaf.swing * np.arctan2(local[:, 1], local[:, 0])
        over = np.maximum(
            away - leaf.width, 0.0
        )  # past the free edge a sphere is as wide as the edge cuts it
        size = radii + margin
        width = np.sqrt(np.maximum(size**2 - over**2, 0.0)) + self._half
        near = (over < size) & (local[:, 2] < self._top + radii)
        ahead = np.sin(beside - leaf.angle) * away > self._off
        behind_it, before_it = (
            near & ~ahead & (away > width - self._off),
            near & ahead & (away > width + self._off),
        )
        # Of what is behind the hinge line nothing is met by a leaf between shut and wide open.
        behind_it &= np.cos(beside - leaf.angle) > -0.2
        before_it &= np.cos(beside - leaf.angle) > -0.2
        least = (beside + np.arcsin(np.clip((width - self._off) / np.maximum(away, 1e-6), -1, 1)))[behind_it]
        most = (beside - np.arcsin(np.clip((width + self._off) / np.maximum(away, 1e-6), -1, 1)))[before_it]
        return float(least.max(initial=-np.inf)), float(most.min(initial=np.inf))

    def share_to_lean(self, trunk: Spheres) -> float:
        """0..1, how far a trunk may lean: less and less within ``SOON`` metres of the leaf, not at all where
        it touches.
        """
        (least, most), (least_soon, most_soon) = self.limits(*trunk), self.limits(*trunk, SOON)
        angle, share = self.leaf.angle, 1.0
        if np.isfinite(least_soon):
            share = (angle - least) / max(least_soon - least, 1e-3) if np.isfinite(least) else 1.0
        if np.isfinite(most_soon) and np.isfinite(most):
            share = min(share, (most - angle) / max(most - most_soon, 1e-3))
        return float(np.clip(share, 0.0, 1.0))
