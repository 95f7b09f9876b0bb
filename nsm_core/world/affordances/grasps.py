"""Grasps: poses of one wrist around a light thing, from the side, from above, by its rim or its handle.

A grasp is found on the thing's distances alone, so that a mesh, boxes and solids of revolution are one: the
hand is a palm, fingers and a thumb of capsules, which must be clear of the thing while the thing lies between
them.  Frames of wrists are those of ``scene.wrist``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.errors import GoalError
from nsm_core.rotations import Array, cross, matrix_from_forward_up, rotate_planar
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.small_things import HEAVIEST, LARGEST
from nsm_core.world.scene.wrist import TO_HELD, WIDEST_GRIP, WristPose

# The hand: fingers and thumb this thick, so far beyond what is held; palm and forearm as thick spheres at
# metres before and behind the wrist.
_FINGER, _TIPS = 0.008, (-0.035, -0.012, 0.008)
_DEEP = 0.045  # metres from the near side of something to where the hand is closed about it, at most
_BEHIND = ((0.03, 0.032), (0.0, 0.034), (-0.08, 0.04), (-0.16, 0.045), (-0.24, 0.05))
_WIDTHS = np.arange(0.012, WIDEST_GRIP + 1e-9, 0.008)
_AROUND, _ACROSS, _LEVELS = 16, 8, (0.35, 0.55, 0.75)
_PITCHES = (0.0, -0.5, 0.35)  # radians by which a hand from the side points up
AMPLE = 0.1  # metres of room beyond which more is no better
_LEVER, _TWIST = 0.25, 0.02  # what a metre off the middle costs, and a hand that is not thumb up, metres
# What a hand from above costs, which is raised and bent, and what a handle is worth, metres.
_FROM_ABOVE, _MADE_FOR_IT = 0.02, 0.015
SIDE, TOP, HANDLE = "side", "top", "handle"


@dataclass(frozen=True)
class OneHandGrasp:
    """A pose that holds a thing, in its frame: ``wrist``, ``kind`` ("side", "top" or "handle"), ``width``
    metres between fingers and thumb, ``room`` metres that hand and forearm have around them, ``score`` in
    metres, the more the better.
    """

    wrist: WristPose
    kind: str
    width: float
    room: float
    score: float

    def at(self, pose: Array) -> WristPose:
        """The wrist in the world where the thing has ``pose`` (4,)."""
        turn = np.float64(pose[3])
        ways = np.stack([rotate_planar(column, turn) for column in self.wrist.rotation.T], -1)
        return WristPose(rotate_planar(self.wrist.place, turn) + np.asarray(pose)[:3], ways)


def find_grasps(
    name: str,
    query: DistanceQuery,
    low: Array,
    high: Array,
    pose: Array,
    around: DistanceQuery,
    mass: float = 0.0,
    handle: Array | None = None,
    least_room: float = 0.0,
) -> list[OneHandGrasp]:
    """Find grasps of a thing where it is, the best first; those with less room than ``least_room`` are left
    out.

    ``query`` the thing's solids in its own frame, whose bounding box is ``low``, ``high`` (3,), metres;
    ``pose`` (4,) its place; ``around`` everything else in the world; ``mass`` kilograms; ``handle`` (2, 3)
    corners of its handle.  Raises GoalError on what is too large or too heavy for one hand.
    """
    low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    if (high - low).max() > LARGEST + 1e-6:
        largest = (high - low).max() * 100
        raise GoalError(
            f"{name} is {largest:.0f} cm long, too large for one hand; choose something up to "
            f"{LARGEST * 100:.0f} cm, or carry it in both arms."
        )
    if mass > HEAVIEST:
        raise GoalError(f"{name} weighs {mass:.1f} kg, too much for one hand; {HEAVIEST:.0f} kg is the most.")
    kinds, held, towards, thumb = _candidates(query, low, high, handle)
    rotation = matrix_from_forward_up(towards, thumb)
    width = _widths(query, held, rotation)
    fits = np.isfinite(width)
    kinds, held, rotation, width = kinds[fits], held[fits], rotation[fits], width[fits]
    own, free = _room(query, around, held, rotation, width, np.asarray(pose, dtype=np.float64))
    middle = (low + high) / 2
    off = np.linalg.norm(held - middle, axis=-1) * np.where(kinds == HANDLE, 0.5, 1.0)
    twist = np.where(kinds == SIDE, 1 - np.abs(rotation[:, 2, 2]), 0.0)
    score = np.minimum(free, AMPLE) - _LEVER * off - _TWIST * twist - _FROM_ABOVE * (kinds == TOP)
    score += _MADE_FOR_IT * (kinds == HANDLE)
    place = held + TO_HELD * rotation[:, :, 1]
    good = np.flatnonzero((free >= least_room) & (own >= 0))
    return [
        OneHandGrasp(
            WristPose(place[k], rotation[k]), str(kinds[k]), float(width[k]), float(free[k]), float(score[k])
        )
        for k in good[np.argsort(-score[good], kind="stable")]
    ]


def _candidates(
    query: DistanceQuery, low: Array, high: Array, handle: Array | None
) -> tuple[Array, Array, Array, Array]:
    """Kinds (N,), middles of what is held (N, 3), ways of the hand (N, 3) and of the thumb (N, 3)."""
    middle, up = (low + high) / 2, np.array((0.0, 0.0, 1.0))
    angle = np.arange(_AROUND) * 2 * np.pi / _AROUND
    level = np.stack((np.cos(angle), np.sin(angle), 0 * angle), -1)
    found: list[tuple[str, Array, Array, Array]] = []
    for share in _LEVELS:
        at = np.array((*_solid_middle(query, low, high, share), low[2] + share * (high - low)[2]))
        near = _near_side(query, at, -level)
        pitches = _PITCHES if share == _LEVELS[1] else _PITCHES[:1]
        for way, far in zip(level, near, strict=True):
            where = at - way * max(far - _DEEP, 0.0)
            found += [(SIDE, where, _pitched(way, pitch), up) for pitch in pitches]
    rim = _rim(query, low, high, level)
    for way, place in zip(level, rim, strict=True):
        if np.isfinite(place).all():
            aside = np.array((-way[1], way[0], 0.0))
            # The wall between the fingers, from above; a flat edge between them, from the side.
            found.append((TOP, place, -up, aside))
            found.append((SIDE, _edge(query, place, way, low[2], high[2]), -way, aside))
    for k in range(_ACROSS):
        turn = np.pi * k / _ACROSS
        for depth in (0.02, 0.04):
            at = np.array((*middle[:2], high[2] - min(depth, (high - low)[2] / 2)))
            found.append((TOP, at, -up, np.array((np.cos(turn), np.sin(turn), 0.0))))
    if handle is not None:
        found += _by_handle(np.asarray(handle, dtype=np.float64), middle, up)
    kinds, held, ways, thumbs = zip(*found, strict=True)
    return np.array(kinds), np.array(held), np.array(ways), np.array(thumbs)


def _by_handle(handle: Array, middle: Array, up: Array) -> list[tuple[str, Array, Array, Array]]:
    """Hands at the outer bar of a handle beside the thing, along one that sticks out, or over one on top."""
    low, high = handle
    at, size = (low + high) / 2, high - low
    outwards = (at - middle) * (1, 1, 0)
    reach = float(np.linalg.norm(outwards))
    if reach < 0.01:  # a bow over it, which lies along its longer side
        top = np.array((at[0], at[1], high[2] - 0.007))
        along = np.eye(3)[int(size[:2].argmax())]
        return [(HANDLE, top, -up, sign * along) for sign in (-1.0, 1.0)] + [
            (HANDLE, top, sign * cross(up, along), sign * along) for sign in (-1.0, 1.0)
        ]
    out = outwards / reach
    far = at + out * (float(np.abs(size @ np.abs(out))) / 2)
    found = []
    if size[2] > 0.03:  # an ear: held at its bar, from outside and from either side
        bar = far - out * 0.006
        for tilt in (-1.0, -0.5, 0.0, 0.5, 1.0):
            way = rotate_planar(-out, np.float64(tilt * np.pi / 2))
            found += [(HANDLE, bar, _pitched(way, pitch), up) for pitch in _PITCHES]
        return found
    for share in (0.35, 0.6):  # a stick: held along it and across it, level and from above
        point = far - out * share * (float(np.abs(size @ np.abs(out))))
        aside = cross(up, out)
        found += [(HANDLE, point, sign * aside, out * turn) for sign in (-1.0, 1.0) for turn in (-1.0, 1.0)]
        found += [(HANDLE, point, -up, out), (HANDLE, point, -up, -out), (HANDLE, point, -out, aside)]
    return found


def _pitched(way: Array, pitch: float) -> Array:
    """A level way (3,) that points up by ``pitch`` radians."""
    return np.cos(pitch) * way + np.array((0.0, 0.0, np.sin(pitch)))


def _solid_middle(query: DistanceQuery, low: Array, high: Array, share: float) -> Array:
    """The middle (2,) of the body at a share of the height: handles and spouts left aside, as its thickest
    part is.
    """
    x, y = np.linspace(low[0], high[0], 25), np.linspace(low[1], high[1], 25)
    z = low[2] + share * (high - low)[2]
    points = np.stack(np.meshgrid(x, y, (z,), indexing="ij"), -1)[:, :, 0]
    inside = query.signed_distance(points.reshape(-1, 3).astype(np.float32), 1.0).reshape(25, 25) < 0
    if not inside.any():
        return (low + high)[:2] / 2
    wide = inside.sum(1) >= 0.45 * inside.sum(1).max(), inside.sum(0) >= 0.45 * inside.sum(0).max()
    return np.array([(a[w].min() + a[w].max()) / 2 for a, w in zip((x, y), wide, strict=True)])


def _rim(query: DistanceQuery, low: Array, high: Array, level: Array) -> Array:
    """The middle (N, 3) of the outermost wall just under the top, seen from the middle along level ways; not
    finite where there is none.
    """
    top = high[2] - min(0.012, (high - low)[2] / 2)
    centre = np.array((*_solid_middle(query, low, high, 0.5), top))
    along = np.arange(0.0, np.linalg.norm((high - low)[:2]), 0.002)
    points = centre + along[:, None] * level[:, None]
    solid = (
        query.signed_distance(points.reshape(-1, 3).astype(np.float32), 0.05).reshape(len(level), -1) < 0.001
    )
    out = np.full((len(level), 3), np.nan)
    for k, row in enumerate(solid):
        runs = np.flatnonzero(np.diff(np.concatenate(([0], row.astype(int), [0]))))
        if len(runs):
            first, last = along[runs[0]], along[min(runs[1], len(along) - 1)]
            out[k] = centre + level[k] * max((first + last) / 2, last - 0.03)
    return out


def _near_side(query: DistanceQuery, at: Array, ways: Array) -> Array:
    """Metres (N,) from a point (3,) to where the thing ends along unit ways (N, 3)."""
    along = np.arange(0.0, LARGEST, 0.004)
    line = at + along[:, None] * ways[:, None]
    solid = _distances(query, line) < 0.002
    return np.where(solid, along, 0.0).max(1)


def _edge(query: DistanceQuery, rim: Array, way: Array, low: float, high: float) -> Array:
    """The middle (3,) of the outermost edge beyond a rim's middle, between its upper and its lower side."""
    out = float(_near_side(query, rim, way[None])[0])
    place = rim + way * max(out - 0.004, 0.0)
    heights = np.arange(low, high, 0.002)
    column = np.concatenate((np.tile(place[:2], (len(heights), 1)), heights[:, None]), 1)
    solid = heights[_distances(query, column[None])[0] < 0.001]
    return np.array((*place[:2], (solid.min() + solid.max()) / 2 if len(solid) else rim[2]))


def _fingers(held: Array, rotation: Array, width: Array) -> Array:
    """Points (N, 2 * 3, 3) on the middles of fingers and thumb around what is held."""
    x, y = rotation[:, :, 0], rotation[:, :, 1]
    aside = (width / 2 + _FINGER + 0.001)[:, None, None] * x[:, None]
    tips = -np.array(_TIPS)[:, None] * y[:, None]
    return np.concatenate((held[:, None] + tips + aside, held[:, None] + tips - aside), 1)


def _widths(query: DistanceQuery, held: Array, rotation: Array) -> Array:
    """The least width (N,) at which fingers are clear of the thing and it lies between them; infinite where
    there is none.
    """
    out = np.full(len(held), np.inf)
    for width in _WIDTHS[::-1]:
        fingers = _fingers(held, rotation, np.full(len(held), width))
        far = _distances(query, fingers).min(1)
        line = np.linspace(-width / 2, width / 2, 9)[:, None] * rotation[:, None, :, 0]
        between = (_distances(query, held[:, None] + line) < 0.002).any(1)
        out = np.where((far >= _FINGER - 0.001) & between, width, out)
    return out


def _room(
    query: DistanceQuery, around: DistanceQuery, held: Array, rotation: Array, width: Array, pose: Array
) -> tuple[Array, Array]:
    """Room (N,) between the palm and forearm and the thing itself, and (N,) between the whole hand and what
    is around, metres; negative where they touch.
    """
    ahead = np.array([b for b, _ in _BEHIND])
    thick = np.array([t for _, t in _BEHIND])
    wrist = held + TO_HELD * rotation[:, :, 1]
    arm = wrist[:, None] - ahead[:, None] * rotation[:, None, :, 1]
    own = (_distances(query, arm) - thick).min(1)
    fingers = _fingers(held, rotation, width)
    points = np.concatenate((arm, fingers), 1)
    radii = np.concatenate((thick, np.full(fingers.shape[1], _FINGER)))
    world = rotate_planar(points, np.float64(pose[3])) + pose[:3]
    return own, (_distances(around, world) - radii).min(1)


def _distances(query: DistanceQuery, points: Array) -> Array:
    """Distances (N, K) of points (N, K, 3)."""
    if not len(points):
        return np.zeros(points.shape[:2])
    flat = query.signed_distance(points.reshape(-1, 3).astype(np.float32), AMPLE + 0.06)
    return flat.reshape(points.shape[:2]).astype(np.float64)
