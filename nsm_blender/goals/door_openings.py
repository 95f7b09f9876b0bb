"""How a leaf is shut: by the opening in the wall that it closes, so that one that stands open or ajar is
known as such.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Quaternion, Vector

from nsm_core.rotations import Array, rotate_planar, wrap_angle
from nsm_core.world.geometry.distance import DistanceQuery

from ..animation.channels import channels_of
from ..keys.layers import rotation_channel
from ..keys.objects import delta_turn, own_turn

AJAR = np.radians(3)  # a leaf that is open by less counts as shut
_STEP = np.radians(4)  # between the turns that are tried
# What surrounds a shut leaf: metres beyond its edges at which it is looked for, how near counts as solid, and
# how deep a leaf may reach into solids where it shuts.
_BESIDE, _SOLID, _INTO = (0.012, 0.04, 0.08), 0.008, 0.02
_SURE = 2.0  # of the three sides (hinge, free edge, top): so many show that a leaf is shut there
_BETTER = 0.5  # by which another turn must fit better than the present one
_ALONG = np.radians(12)  # by which the wall may deviate from where a leaf fits


@dataclass(frozen=True)
class WallOpening:
    """A leaf about its hinge among solids: ``pivot`` (2,) core frame; ``edge``, ``width`` x of both edges and
    ``middle`` y, ``top`` z of the board, along its own +X from the pivot.
    """

    query: DistanceQuery
    pivot: Array
    edge: float
    width: float
    middle: float
    top: float

    def shut(self, heading: float, keyed: float | None = None, cleared: float | None = None) -> float:
        """The heading at which the leaf that stands at ``heading`` is shut: where it fills an opening.

        ``keyed`` is where its keys begin and ``cleared`` where it stands without rotation.  Where no opening
        is found, one of these that fits better; where there is nothing about it, ``keyed``; else it is shut
        where it stands.
        """
        hints = [h for h in (keyed, cleared) if h is not None]
        now = float(self._fit(np.array((heading,)))[0])
        if now >= _SURE:
            return self._straight(heading, [heading, *hints])
        tried = wrap_angle(heading + np.arange(-np.pi + _STEP, np.pi, _STEP))
        turns = np.concatenate(((heading,), hints, tried))
        fits = self._fit(turns)
        best = float(fits.max())
        if best < max(_SURE - 0.5, now + _BETTER):
            better = [h for h, fit in zip(hints, fits[1:], strict=False) if fit >= max(now + _BETTER, 0.9)]
            return better[0] if better else keyed if keyed is not None and best < _BETTER else heading
        good = turns[fits > best - 0.25]
        away = wrap_angle(good - heading)
        known = [h for h in hints if np.abs(wrap_angle(good - h)).min() < 1e-6]
        nearest = wrap_angle(known[0] - heading) if known else away[np.abs(away).argmin()]
        cluster = away[np.abs(wrap_angle(away - nearest)) < 3 * _STEP]
        return self._straight(float(wrap_angle(heading + cluster.mean())), hints)

    def _fit(self, headings: Array) -> Array:
        """How many sides (N,), 0 to 3, of the leaf at ``headings`` (N,) are beside something solid; -1 where
        it stands in a solid.
        """
        z = np.linspace(0.2, 0.92, 5) * self.top
        near = np.array(_BESIDE)
        x, high = np.meshgrid(np.concatenate((self.edge - near, self.width + near)), z, indexing="ij")
        along, over = np.meshgrid(
            np.array((0.3, 0.55, 0.8)) * self.width, self.top + np.array((0.015, 0.04, 0.1)), indexing="ij"
        )
        u, v = np.meshgrid(
            np.array((0.3, 0.6, 0.9)) * self.width, np.array((0.25, 0.5, 0.8)) * self.top, indexing="ij"
        )
        places = ((x, high), (along, over), (u, v))
        points = np.concatenate(
            [np.column_stack((a.ravel(), np.full(a.size, self.middle), b.ravel())) for a, b in places]
        )
        distance = self._distance(points, headings, _INTO + 0.01)
        beside, above, inside = np.split(distance, (x.size, x.size + along.size), axis=1)
        solid = (beside < _SOLID).reshape(-1, 2, len(near), len(z)).any(2).mean(2).sum(1)
        solid += (above < _SOLID).reshape(-1, 3, 3).any(2).mean(1)
        return np.where((inside < -_INTO + 1e-6).mean(1) > 0.2, -1.0, solid)

    def _straight(self, heading: float, known: list[float]) -> float:
        """A heading near ``heading`` along the wall: one of those ``known`` where it is as good."""
        for _ in range(2):
            tilt = self._tilt(heading)
            if tilt is None:
                break
            heading = float(wrap_angle(heading + tilt))
        near = [h for h in known if abs(wrap_angle(h - heading)) < AJAR / 2]
        return near[0] if near else heading

    def _tilt(self, heading: float) -> float | None:
        """Radians by which the wall beside the opening is turned from ``heading``; None where that cannot be
        told.
        """
        beside, off, z = 0.25, 0.35, 0.93 * self.top
        ends = (self.edge - beside, self.width + beside)
        points = np.array([(x, self.middle + side * off, z) for side in (-1, 1) for x in ends])
        reach = off + 0.1
        d = self._distance(points, np.array((heading,)), reach)[0].reshape(2, 2)
        tilts = []
        for side, (a, b) in zip((-1, 1), d, strict=True):
            turn = side * float(np.arctan((a - b) / (ends[1] - ends[0])))
            if max(a, b) < reach - 1e-3 and min(a, b) > 0.02 and abs(turn) < _ALONG:
                tilts.append(turn)
        if not tilts or max(tilts) - min(tilts) > AJAR:
            return None
        return float(np.mean(tilts))

    def _distance(self, points: Array, headings: Array, reach: float) -> Array:
        """Distances (N, P) of ``points`` (P, 3), leaf's frame, to what is solid when the leaf stands at
        ``headings`` (N,).
        """
        world = rotate_planar(
            np.repeat(points[None], len(headings), axis=0), np.repeat(headings[:, None], len(points), axis=1)
        )
        world[..., :2] += self.pivot
        return np.asarray(self.query.signed_distance(world.reshape(-1, 3).astype(np.float32), reach)).reshape(
            len(headings), -1
        )


def earlier_headings(target: bpy.types.Object, heading: float) -> tuple[float | None, float | None]:
    """Headings of a leaf that stands at ``heading`` now: at the first key of its action, and with its
    rotation cleared; None for none.
    """
    first, delta = _first_turn(target), delta_turn(target)
    now = (delta @ own_turn(target)).to_matrix()
    space = (target.matrix_world @ target.matrix_basis.inverted_safe()).to_3x3()

    def at(turn: Quaternion | None) -> float | None:
        if turn is None:
            return None
        move = space @ turn.to_matrix() @ now.inverted() @ space.inverted_safe()
        along = move @ Vector((np.cos(heading), np.sin(heading), 0.0))
        upright = (move @ Vector((0, 0, 1))).normalized().z > 0.999 and along.length > 1e-6
        return float(np.arctan2(along.y, along.x)) if upright else None

    return at(None if first is None else delta @ first), at(delta)


def _first_turn(target: bpy.types.Object) -> Quaternion | None:
    """The rotation of an object at the first key of its action, as a quaternion; None where it has no keys of
    it.
    """
    channels, path = channels_of(target), rotation_channel(target.rotation_mode)
    curves = (
        [c for c in channels.bag.fcurves if c.data_path == path and len(c.keyframe_points)]
        if channels
        else []
    )
    if not curves:
        return None
    frame = min(c.keyframe_points[0].co.x for c in curves)
    values = list(getattr(target, path))
    for curve in curves:
        values[curve.array_index] = curve.evaluate(frame)
    return own_turn(target, values)
