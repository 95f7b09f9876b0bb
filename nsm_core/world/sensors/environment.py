"""The environment sensor: spheres in a cylinder around the root, each telling how near the next solid is.

The paper states radius, height and a rounding rule that does not give its own 1408 spheres; the layout of the
released system does: 8 layers of 7 rings with round(2 pi k) spheres on ring k, spaced 2 m / 7 apart.
"""

from __future__ import annotations

import numpy as np

from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.geometry.distance import BoxGroup, Cuboids, DistanceQuery, Union

DIAMETER = 4.0
RINGS = tuple(round(2 * np.pi * k) for k in range(1, 8))
LAYERS = 8
SPACING = DIAMETER / 2 / len(RINGS)
# Neighbouring spheres overlap: the radius is half the diagonal of the spacing.
SPHERE_RADIUS = float(np.sqrt(0.5)) * SPACING
HEIGHTS = (SPACING * np.arange(LAYERS)).astype(np.float32)


def _plane() -> Array:
    rings = []
    for k, count in enumerate(RINGS, start=1):
        # The first sphere of a ring lies straight ahead, so that mirroring left and right maps spheres on
        # spheres.
        angle = 2 * np.pi * np.arange(count) / count
        rings.append(k * SPACING * np.stack((np.sin(angle), -np.cos(angle)), axis=-1))
    return np.concatenate(rings).astype(np.float32)


PLANE = _plane()  # (176, 2) metres, root frame
ENVIRONMENT_POINTS = np.concatenate(  # (1408, 3) metres, root frame: layer by layer, ring by ring
    (np.tile(PLANE, (LAYERS, 1)), np.repeat(HEIGHTS, len(PLANE))[:, None]), axis=1
)

_FRAMES_AT_ONCE = 512


def environment_points_world(root_position: Array, root_heading: float) -> Array:
    """Centres (1408, 3) of the spheres in the world, metres, for a root at (2,) metres and a heading in
    radians.
    """
    points = rotate_planar(ENVIRONMENT_POINTS, np.float32(root_heading))
    points[:, :2] += np.asarray(root_position, dtype=np.float32)[:2]
    return points


def environment_sensor(query: DistanceQuery, root_position: Array, root_heading: float) -> Array:
    """Read the environment sensor once: (1408,) float32 in 0..1 (section 4.3).

    1 where the centre of a sphere is inside a solid, 0 where the sphere touches none, else 1 - distance /
    radius.
    ``root_position`` (2,) world metres, ``root_heading`` radians; the floor is no part of ``query``.
    """
    distance = query.signed_distance(environment_points_world(root_position, root_heading), SPHERE_RADIUS)
    return np.clip(1 - distance / np.float32(SPHERE_RADIUS), 0, 1)


def environment_sensor_many(
    query: DistanceQuery, positions: Array, headings: Array, out: Array | None = None
) -> Array:
    """Read the environment sensor in many frames: (T, 1408) in 0..1, as ``environment_sensor`` would one by
    one.

    ``positions`` (T, 2) world metres, ``headings`` (T,) radians.  ``out`` (T, 1408) of any float type, a
    memory map for instance, is filled and returned; without it a float32 array is made.  Upright cuboids take
    a fast path.
    """
    positions = np.asarray(positions, dtype=np.float64)
    headings = np.asarray(headings, dtype=np.float64)
    out = np.empty((len(positions), len(ENVIRONMENT_POINTS)), np.float32) if out is None else out
    boxes, others = _split(query)
    for start in range(0, len(positions), _FRAMES_AT_ONCE):
        rows = slice(start, min(start + _FRAMES_AT_ONCE, len(positions)))
        values = _read_upright(boxes, positions[rows], headings[rows])
        for i, t in enumerate(range(rows.start, rows.stop)):
            for other in others:
                np.maximum(values[i], environment_sensor(other, positions[t], headings[t]), out=values[i])
        out[rows] = values
    return out


def _split(query: DistanceQuery) -> tuple[list[BoxGroup], list[DistanceQuery]]:
    """Part a query into upright boxes and the rest."""
    if isinstance(query, Union):
        parts = [_split(part) for part in query.parts]
        return [g for boxes, _ in parts for g in boxes], [q for _, rest in parts for q in rest]
    if not isinstance(query, Cuboids):
        return [], [query]
    tilted = Cuboids()
    tilted.groups = [g for g in query.groups if g.heading is None]
    return [g for g in query.groups if g.heading is not None], [tilted] if tilted.groups else []


def _read_upright(groups: list[BoxGroup], positions: Array, headings: Array) -> Array:
    """Values (T, 1408) of boxes whose objects are only turned about Z.

    There the squared distance is a planar part, the same in all layers, plus a part in height, the same in
    all frames; and a box concerns only the few spheres next to it.
    """
    limit = np.float32(SPHERE_RADIUS**2)
    square = np.full(len(positions) * LAYERS * len(PLANE), limit, dtype=np.float32)
    reach = DIAMETER / 2 + SPHERE_RADIUS
    for group in groups:
        root = rotate_planar(positions - group.position[:2], -np.full(len(positions), group.heading)).astype(
            np.float32
        )
        lo, hi = (b[:2] for b in group.bounds)
        frames = np.flatnonzero(_outside(root, (lo + hi) / 2, (hi - lo) / 2) < reach**2)
        if not len(frames):
            continue
        root = root[frames]
        turn = (headings[frames] - group.heading).astype(np.float32)[:, None]
        c, s = np.cos(turn), np.sin(turn)
        x = root[:, :1] + c * PLANE[:, 0] - s * PLANE[:, 1]
        y = root[:, 1:] + s * PLANE[:, 0] + c * PLANE[:, 1]
        for centre, half in zip(group.centres, group.halves, strict=True):
            dz = np.maximum(np.abs(HEIGHTS - centre[2] - np.float32(group.position[2])) - half[2], 0) ** 2
            layers = np.flatnonzero(dz < limit)
            close = np.flatnonzero(_outside(root, centre[:2], half[:2]) < reach**2)
            if not len(layers) or not len(close):
                continue
            whole = len(close) == len(root)
            d = _square_outside(x if whole else x[close], centre[0], half[0])
            d += _square_outside(y if whole else y[close], centre[1], half[1])
            hit = np.flatnonzero(d < limit - dz[layers].min())
            d = d.reshape(-1)[hit]
            row, sphere = np.divmod(hit, len(PLANE))
            first = frames[close[row]] * (LAYERS * len(PLANE)) + sphere
            for layer in layers:
                cell = first + layer * len(PLANE)
                square[cell] = np.minimum(square[cell], d + dz[layer])
    np.sqrt(square, out=square)
    square *= np.float32(-1 / SPHERE_RADIUS)
    square += 1
    return np.maximum(square, 0, out=square).reshape(len(positions), -1)


def _square_outside(x: Array, centre: float, half: float) -> Array:
    """Square of how far ``x`` lies outside an interval."""
    d = x - centre
    np.abs(d, out=d)
    d -= half
    np.maximum(d, 0, out=d)
    d *= d
    return d


def _outside(points: Array, centre: Array, half: Array) -> Array:
    """Squared distance (N,) of planar points (N, 2) to a rectangle."""
    return (np.maximum(np.abs(points - centre) - half, 0) ** 2).sum(1)
