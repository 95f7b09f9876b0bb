"""Where a person sits on a piece of furniture, found from its mesh alone.

The mesh is seen from above as a map of heights.  The seat is the level with the most area that is wide enough
for a person; the front is the side from which it can be reached, with the back rest opposite.
"""

from __future__ import annotations

import numpy as np

from nsm_core.distances import SEATS_FOUND
from nsm_core.errors import GeometryError
from nsm_core.rotations import Array, rotate_planar, wrap_angle
from nsm_core.world.geometry.triangles import check_mesh, cut_triangles
from nsm_core.world.scene.furniture.piece import Seat, hip_setback

LOWEST, HIGHEST = SEATS_FOUND
_USUAL = 0.45
_STEP = 0.02  # cells of the height map
_TOP = 1.15  # what lies higher does not matter to a sitter
_FLAT, _SOFT = 0.035, 0.055  # how uneven a level may be when looked for, and once found
_LEAST = 0.18  # narrower strips are arms and rails, not seats
_SLOT = 0.06  # gaps between slats and cushions
_REST = 0.10  # what stands this much over the seat is a back or an arm


def find_seat(vertices: Array, triangles: Array) -> Seat:
    """Find where to sit on a mesh: height, place of the hips, front, size, back and arm rests.

    ``vertices`` (V, 3) metres with Z up and the floor at z = 0, ``triangles`` (F, 3); the mesh may be open,
    broken or inside out.  The result is in the same frame.  Without a back rest the front is a long side;
    where all sides are alike it is -Y.  Raises GeometryError on an empty or broken mesh and when nothing on
    it can be sat on.
    """
    vertices, triangles = check_mesh(vertices, triangles)
    corners = vertices[triangles]
    z = corners[..., 2]
    # Seen from above, steep faces need few samples: cut them by a length that counts height less.
    squeeze = np.array((1, 1, 0.3))
    samples = (
        cut_triangles(corners[(z.max(1) > LOWEST / 2) & (z.min(1) < _TOP)] * squeeze, 0.85 * _STEP).reshape(
            -1, 3
        )
        / squeeze
    )
    samples = samples[samples[:, 2] > LOWEST / 2]
    samples[:, 2] = np.minimum(samples[:, 2], _TOP)
    if not len(samples):
        raise GeometryError(_NO_SEAT)
    turn = _main_direction(samples)
    tops, origin = _height_map(rotate_planar(samples, -turn))
    height = _seat_height(tops)
    best: tuple[float, Seat] | None = None
    for quarter in range(4):
        heading = turn + quarter * np.pi / 2
        # Where sides are alike, the documented front wins.
        score, seat = _sit_facing_front(tops, origin, height)
        score *= 1.3 if abs(wrap_angle(heading)) < 0.1 else 1.0
        if seat is not None and (best is None or score > best[0]):
            seat.point = rotate_planar(seat.point, np.float32(heading))
            seat.heading = float(wrap_angle(heading))
            best = score, seat
        # The same map seen a quarter further: (x, y) becomes (y, -x).
        tops, origin = tops.T[:, ::-1], np.array((origin[1], -origin[0] - len(tops) * _STEP))
    if best is None:
        raise GeometryError(_NO_SEAT)
    return best[1]


_NO_SEAT = (
    f"Nothing on this object can be sat on: it needs a level patch at least {_LEAST * 100:.0f} cm wide "
    "between "
    f"{LOWEST:.2f} and {HIGHEST:.2f} m over the floor; check its scale and that it stands on the floor, or "
    "move its goal empty by hand."
)


def _main_direction(samples: Array) -> float:
    """Turn, in -45..45 degrees, of the smallest rectangle around the footprint; 0 unless that is much
    smaller.
    """
    flat = samples[:: max(1, len(samples) // 20000), :2]
    angles = np.deg2rad(np.arange(-45, 45))
    # A row an angle: many times faster to go through.
    along = np.stack((np.cos(angles), np.sin(angles)), 1) @ flat.T
    across = np.stack((-np.sin(angles), np.cos(angles)), 1) @ flat.T
    area = np.ptp(along, axis=1) * np.ptp(across, axis=1)
    best = int(area.argmin())
    return float(angles[best]) if area[best] < 0.85 * area[45] else 0.0


def _height_map(samples: Array) -> tuple[Array, Array]:
    """Greatest height (X, Y) over each cell, -1 where there is nothing, and the corner (2,) of cell 0, 0."""
    origin = samples[:, :2].min(0) - 0.5 * _STEP
    cells = ((samples[:, :2] - origin) / _STEP).astype(np.int64)
    shape = cells.max(0) + 1
    tops = np.full(shape[0] * shape[1], -1.0)
    np.maximum.at(tops, cells[:, 0] * shape[1] + cells[:, 1], samples[:, 2])
    return tops.reshape(shape), origin


def _seat_height(tops: Array) -> float:
    """Height of the level on which most can be sat, usual heights first."""
    best, height = 0.0, None
    for level in np.arange(LOWEST, HIGHEST, 0.01):
        off = np.abs(tops - level)
        if (off < _FLAT).sum() * _STEP**2 < _LEAST**2 / 2:
            continue
        wide = _places(off < _FLAT)
        area = wide.sum() * _STEP**2
        even = (wide & (off < 0.015)).sum() * _STEP**2
        # The root: more than a place for one hardly makes a better seat.
        score = (np.sqrt(area) + 0.5 * np.sqrt(even)) * np.exp(-(((level - _USUAL) / 0.25) ** 2))
        if score > best:
            best, height = score, float(level)
    if height is None:
        raise GeometryError(_NO_SEAT)
    return height


def _places(level: Array) -> Array:
    """Keep what is wide enough to sit on: close the slots (X, Y), then drop what is narrower than a
    person.
    """
    slot, least = round(_SLOT / _STEP / 2), round(_LEAST / _STEP)
    padded = np.pad(level, least)
    size = 2 * slot + 1
    closed = ~_spread(~_spread(padded, size), size)
    opened = _spread(~_spread(~closed, least), least, back=True)
    return opened[least:-least, least:-least]


def _spread(mask: Array, size: int, back: bool = False) -> Array:
    """Set every cell that has a set cell in a window of ``size`` cells around it."""
    before = (size - 1) // 2 if not back else size // 2
    for axis in (0, 1):
        total = np.cumsum(
            np.pad(mask, [(before + 1, size - 1 - before) if a == axis else (0, 0) for a in (0, 1)]),
            axis=axis,
        )
        length = mask.shape[axis]
        mask = np.take(total, np.arange(size, size + length), axis) > np.take(total, np.arange(length), axis)
    return mask


def _sit_facing_front(tops: Array, origin: Array, height: float) -> tuple[float, Seat | None]:
    """How well one sits facing -Y, and the seat; each column of the map (X, Y) is followed from the front to
    the back.
    """
    seat = _places(np.abs(tops - height) < _SOFT)
    rest = tops > height + _REST
    columns = len(tops)
    front, depth, backed = np.zeros(columns, int), np.zeros(columns, int), np.zeros(columns, bool)
    for x in np.flatnonzero(seat.any(1)):
        first = int(seat[x].argmax())
        end = first + int(np.append(~seat[x, first:], True).argmax())
        if rest[x, :first].any():
            continue
        front[x], depth[x] = first, end - first
        backed[x] = rest[x, end : end + round(0.3 / _STEP)].any()
    length = depth * _STEP
    # Deep places without a near back are chaises seen from their end.
    quality = np.where(length >= _LEAST, (0.35 + backed) * np.clip(1.5 - length, 0.15, 0.7), 0)
    if not quality.any():
        return 0.0, None
    start, stop = _longest_run(quality > 0.5 * np.sort(quality)[-max(1, round(_LEAST / _STEP))])
    middle = (start + stop - 1) / 2
    place = np.arange(
        max(start, int(middle - _LEAST / 2 / _STEP)), min(stop, int(middle + _LEAST / 2 / _STEP) + 1)
    )
    seat_depth = float(np.median(depth[place])) * _STEP
    hip = np.array((middle + 0.5, np.median(front[place]) + hip_setback(seat_depth) / _STEP))
    around = tops[place, max(0, int(hip[1]) - 4) : int(hip[1]) + 5]
    level = (
        float(np.median(around[np.abs(around - height) < 2 * _SOFT]))
        if (np.abs(around - height) < 2 * _SOFT).any()
        else height
    )
    run = slice(start, stop)
    first, last = int(np.median(front[run])), int(np.median((front + depth)[run]))
    beside = round(0.2 / _STEP)
    sides = [
        rest[max(0, start - beside) : start + 2, first:last].any(0),
        rest[stop - 2 : stop + beside, first:last].any(0),
    ]
    arms = all(s.size and s.mean() > 0.35 for s in sides)
    point = np.append(hip * _STEP + origin, level).astype(np.float32)
    found = Seat(
        point, 0.0, level, (stop - start) * _STEP, seat_depth, bool(backed[run].mean() > 0.5), bool(arms)
    )
    return float(quality[run].sum() * _STEP), found


def _longest_run(flags: Array) -> tuple[int, int]:
    """First and last + 1 index of the longest run of set flags (N,)."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(int), [0]))))
    starts, stops = edges[::2], edges[1::2]
    k = int((stops - starts).argmax())
    return int(starts[k]), int(stops[k])
