"""Other characters, and what they move, as solids that move: now, for sensors and ways, and over a take."""

from __future__ import annotations

import numpy as np

from nsm_core.body.capsules import Body, Figure
from nsm_core.body.ik.body_track import SENSED, BodyTrack, spheres_distance
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.props import Prop

from .frames import Frame, Scaled


class OtherBody:
    """A character's newest pose in another one's world: the spheres that fill it.

    ``pose`` (4,) of its root, ``settled`` where it stands or sits.
    """

    def __init__(self, centres: Array, radii: Array, pose: Array, settled: bool) -> None:
        self.show(centres, radii, pose, settled)

    def show(self, centres: Array, radii: Array, pose: Array, settled: bool) -> None:
        """Go on to another pose: ``centres`` (S, 3) and ``radii`` (S,), metres."""
        self.centres, self.radii = centres.astype(np.float32), radii.astype(np.float32)
        self.pose, self.settled = pose, settled
        self.reach = float((np.linalg.norm(centres[:, :2] - pose[:2], axis=1) + radii).max())

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32 of ``points`` (N, 3), at most ``max_distance``; see ``DistanceQuery``."""
        return spheres_distance(np.asarray(points, dtype=np.float32), self.centres, self.radii, max_distance)


def spheres_of(hips: Array, local: Array, figure: Figure) -> tuple[Array, Array]:
    """Spheres (S, 3), (S,) that stand for a body in one pose, own world: every second that fills it."""
    body = Body.of(np.asarray(hips)[None], np.asarray(local)[None], figure)
    return body.centres[0, SENSED], body.radii[0, SENSED]


class OtherProp:
    """A thing that another character moves, in one's own world."""

    def __init__(self, prop: Prop, frame: Frame, own: Frame) -> None:
        """``prop`` as it is in the world ``frame`` of who moves it; ``own`` the world that it is seen in."""
        self.prop, self._frame, self._own = prop, frame, own
        self._query = in_world(prop.query, frame, own)
        self.held = False  # by someone, so that ways do not lead around it

    @property
    def pose(self) -> Array:
        """Where it is now (4,)."""
        return self._own.pose_from(self._frame, self.prop.pose)

    @property
    def reach(self) -> float:
        """Metres on the floor from its place within which all of it lies."""
        return self.prop.reach * self._frame.scale / self._own.scale

    @property
    def settled(self) -> bool:
        """Whether ways lead around it: nobody moves it now.  A door that is shut keeps everybody else out."""
        return not self.held

    def signed_distance(self, points: Array, max_distance: float) -> Array:
        """Distances (N,) float32 of ``points`` (N, 3) to where it is now; see ``DistanceQuery``."""
        local = self.prop.to_local(points, self.pose)
        return self._query.signed_distance(local.astype(np.float32), max_distance)


def in_world(query: DistanceQuery, frame: Frame, own: Frame) -> DistanceQuery:
    """Solids of the world ``frame``, about their own origin, in the sizes of ``own``."""
    return query if frame.scale == own.scale else Scaled(query, frame.scale / own.scale)


def track_of(hips: Array, local: Array, figure: Figure, frame: Frame, own: Frame) -> BodyTrack:
    """A body's whole motion, hips (T, 3) and rotations (T, 23, 4) of the world ``frame``, in the world
    ``own``.
    """
    body = Body.of(hips, local, figure)
    centres, radii = body.centres, body.radii
    ratio = frame.scale / own.scale
    seen = own.to_own(frame.to_common(centres)) if frame != own else centres
    nobody: DistanceQuery = OtherBody(seen[0], radii[0], np.zeros(4), True)
    return BodyTrack(nobody, None, None, seen.astype(np.float32), (radii * ratio).astype(np.float32))


def depths_between(one: BodyTrack, other: BodyTrack) -> Array:
    """How deep (T,), metres, two bodies are in each other in each frame of the longer one, 0 where they do
    not touch; both of one world.
    """
    count = max(len(one.centres), len(other.centres))
    out = np.zeros(count)
    rows = [np.minimum(np.arange(count), len(track.centres) - 1) for track in (one, other)]
    (low_a, high_a), (low_b, high_b) = (
        (box[0][at], box[1][at]) for box, at in zip(map(_boxes, (one, other)), rows, strict=True)
    )
    for t in np.flatnonzero(((low_a < high_b) & (low_b < high_a)).all(1)):
        a, b = (int(at[t]) for at in rows)
        radii = one.radii[a]
        most = float(radii.max()) + 0.01
        free = spheres_distance(one.centres[a], other.centres[b], other.radii[b], most)
        out[t] = max(0.0, float((radii - free).max()))
    return out


def _boxes(track: BodyTrack) -> tuple[Array, Array]:
    """The least and largest coordinates (T, 3) of a body in each frame."""
    size = track.radii[..., None]
    return (track.centres - size).min(1), (track.centres + size).max(1)
