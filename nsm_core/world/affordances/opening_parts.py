"""What of a piece of furniture opens, told from its parts: axis, handle and range are proposals to be edited.

Frame of the furniture: Z up, front -Y, metres.  The body is the part that is as large as the whole; what lies
before it as a board is a door, what reaches into it a drawer, and words in names decide where shapes do not.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import Cuboids, DistanceQuery
from nsm_core.world.geometry.voxels import merge, voxelise
from nsm_core.world.scene.containers import MovingPart, moving_part

Named = tuple[str, Array, Array]  # name, vertices (V, 3), triangles (F, 3)

_WORDS = {
    "drawer": re.compile("drawer", re.IGNORECASE),
    "flap": re.compile("flap|oven|dishwasher", re.IGNORECASE),
    "lid": re.compile("lid(?!e)|cover|hatch", re.IGNORECASE),
    "sliding": re.compile("slid", re.IGNORECASE),
    "door": re.compile("door", re.IGNORECASE),
}
_HANDLE = re.compile("handle|knob|pull|grip", re.IGNORECASE)
_FIXED = re.compile("frame|body|carcass|wall|back|side|top$|worktop|counter|leg|foot|plinth", re.IGNORECASE)
_LEFT, _RIGHT = re.compile("left", re.IGNORECASE), re.compile("right", re.IGNORECASE)
_BODY = (0.8, 0.5, 0.6)  # shares of the whole along every axis from which on a part is the body
_BOARD, _LEAST = 0.14, 0.1  # a front is no thicker and no smaller, metres
_DEEP = 0.35  # share of the body's depth by which a drawer reaches in
_OUT = 0.012  # metres by which a handle stands out of its front
_SMALL = 0.3  # metres that a handle of its own measures at most but along one way
_TOUCHES = 0.05  # metres between a handle of its own and its front
_OVERLAP = (0.005, 0.4)  # share of its width by which a front that slides overlaps the next one
_KEPT, _SHALLOW = 0.25, 0.6  # shares: of a drawer that stays in; of the body's depth that a bare front goes
_TURNS, _LIDS = (float(np.radians(a)) for a in (100.0, 80.0))
_STEPS, _GIVE = 10, 0.015  # openings that are tried; metres by which it may run into something more
_VOXEL = 0.02
_EDGE = 0.05  # metres from the free edge to where a hand takes a front without a handle


@dataclass
class _Front:
    name: str
    word: str
    low: Array
    high: Array
    vertices: Array
    triangles: Array
    names: list[str]
    handle: tuple[Array, Array] | None = None  # corners (3,), (3,) of its handle

    @property
    def size(self) -> Array:
        return self.high - self.low

    @property
    def middle(self) -> Array:
        return (self.high + self.low) / 2

    def take_in(self, other: _Front) -> None:
        """Make a pane, a panel or a handle in it part of it."""
        self.triangles = np.concatenate((self.triangles, other.triangles + len(self.vertices)))
        self.vertices = np.concatenate((self.vertices, other.vertices))
        self.low, self.high = np.minimum(self.low, other.low), np.maximum(self.high, other.high)
        self.names += other.names


@dataclass(frozen=True)
class OpeningProposal:
    """A moving part, shut, at the origin of its furniture's frame, and the ``names`` of the parts that it
    consists of: the front, what lies in it, and its handle.
    """

    part: MovingPart
    names: list[str]


def opening_parts(parts: list[Named], around: DistanceQuery | None = None) -> list[OpeningProposal]:
    """Propose what opens of a piece of furniture.

    ``parts`` names, vertices (V, 3) and triangles (F, 3) of its meshes; handles may be parts of their own, or
    belong to their front.  Every proposal goes as far as it meets nothing of what stands, of the furniture
    and ``around`` it, in its frame.  Raises GeometryError where nothing of it looks as if it opened.
    """
    bounds = [(n, v.min(0).astype(np.float64), v.max(0).astype(np.float64), v, f) for n, v, f in parts]
    low, high = np.min([b[1] for b in bounds], axis=0), np.max([b[2] for b in bounds], axis=0)
    found: list[_Front] = []
    handles: dict[str, tuple[Array, Array]] = {}
    for name, a, b, v, f in bounds:
        if _is_handle(name, a, b):
            handles[name] = a, b
        elif (word := _word(name, a, b, low, high)) is not None:
            found.append(_Front(name, word, a, b, np.asarray(v, dtype=np.float64), f, [name]))
    fronts: list[_Front] = []
    for front in sorted(found, key=lambda x: -float(x.size[[0, 2]].prod())):
        outer = next((x for x in fronts if _within(front, x)), None)
        if outer is None:
            fronts.append(front)
        else:
            outer.take_in(front)
    if not fronts:
        raise GeometryError(
            "Nothing of it looks as if it opened; separate its doors, drawers and lids from the body, "
            "or name them so."
        )
    for front in fronts:
        front.handle = _handle_of(front, handles)
    moving = {name for front in fronts for name in front.names}
    still: list[DistanceQuery] = [_solid(v, f) for n, v, f in parts if n not in moving and n not in handles]
    still += [around] if around is not None else []
    proposals = []
    for front in sorted(fronts, key=lambda x: [p[0] for p in parts].index(x.name)):
        query = _solid(front.vertices, front.triangles)
        made = _proposal(front, fronts, query, float(high[1] - low[1]))
        _shorten(made, front, still)
        proposals.append(OpeningProposal(made, front.names))
    return proposals


def _is_handle(name: str, low: Array, high: Array) -> bool:
    size = np.sort(high - low)
    return bool(_HANDLE.search(name) and size[1] < _SMALL)


def _word(name: str, low: Array, high: Array, all_low: Array, all_high: Array) -> str | None:
    """What a part is: a key of ``_WORDS``, None for what stands."""
    size, whole = high - low, np.maximum(all_high - all_low, 1e-6)
    # A body is as large as the whole, but for how far its fronts stand out.
    if (size > np.array(_BODY) * whole).all():
        return None
    said = next((word for word, pattern in _WORDS.items() if pattern.search(name)), None)
    if said == "lid":
        return said if size[2] < _BOARD + 0.06 else None
    ahead = low[1] < all_low[1] + 0.3 * whole[1]
    if not ahead or min(size[0], size[2]) < 0.05:
        return None
    if said is not None:
        return said
    if _FIXED.search(name) or min(size[0], size[2]) < _LEAST:
        return None
    if size[1] > _DEEP * whole[1]:
        return "drawer" if low[1] < all_low[1] + 0.1 * whole[1] and size[2] < 0.5 * whole[2] else None
    return "door" if size[1] < max(_BOARD, 0.3 * float(min(size[0], size[2]))) else None


def _within(inner: _Front, outer: _Front) -> bool:
    """Whether a pane or a panel lies within another front."""
    slack = 0.01
    return bool(
        (outer.low <= inner.low + slack)[[0, 2]].all()
        and (outer.high >= inner.high - slack)[[0, 2]].all()
        and abs(outer.low[1] - inner.low[1]) < 0.08
    )


def _handle_of(front: _Front, handles: dict[str, tuple[Array, Array]]) -> tuple[Array, Array] | None:
    """Corners of the handle: a part of its own that touches the front, or what of it stands out."""
    own = [
        name
        for name, (a, b) in handles.items()
        if (a > front.low - _TOUCHES)[[0, 2]].all()
        and (b < front.high + _TOUCHES)[[0, 2]].all()
        and b[1] > front.low[1] - _TOUCHES
        and a[1] < front.high[1] + _TOUCHES
    ]
    if own:
        front.names += own
        return np.min([handles[n][0] for n in own], axis=0), np.max([handles[n][1] for n in own], axis=0)
    plane = _plane(front)
    out = front.vertices[front.vertices[:, 1] < plane - _OUT]
    if front.word == "lid" or not len(out):
        return None
    low, high = out.min(0), out.max(0)
    ends = (high - low)[[0, 2]] / front.size[[0, 2]]
    return (low, high) if ends.min() < 0.5 else None


def _plane(front: _Front) -> float:
    """Y of the face that makes up most of a front, as seen from before it."""
    corners = front.vertices[front.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.abs(normal[:, 1]) * (np.abs(normal[:, 1]) > 0.8 * np.linalg.norm(normal, axis=1))
    if area.sum() <= 0:
        return float(front.low[1])
    place = np.round(corners[:, :, 1].mean(1) / 0.006).astype(int)
    share = np.bincount(place - place.min(), area)
    return float((int(np.flatnonzero(share > 0.35 * share.max())[0]) + place.min()) * 0.006)


def _proposal(front: _Front, fronts: list[_Front], query: Cuboids, depth: float) -> MovingPart:
    low, high, middle, size = front.low, front.high, front.middle, front.size
    plane = _plane(front)
    bounds, held = (low, high), front.handle
    at = (held[0] + held[1]) / 2 if held else np.array((middle[0], plane, middle[2]))
    bar = np.eye(3)[2]
    if held and (held[1] - held[0])[0] > (held[1] - held[0])[2]:
        bar = np.eye(3)[0]
    if front.word == "drawer":
        travel = size[1] * (1 - _KEPT) if size[1] > _DEEP * depth else depth * _SHALLOW
        at = at if held else np.array((middle[0], plane, high[2] - min(_EDGE, size[2] / 2)))
        return moving_part(front.name, "drawer", query, bounds, (0, -1, 0), middle, travel, at, bar=bar)
    if front.word == "lid":
        edge = np.array((middle[0], low[1], middle[2]))
        pivot = (middle[0], high[1], high[2])
        return moving_part(front.name, "lid", query, bounds, (-1, 0, 0), pivot, _LIDS, edge, bar=np.eye(3)[0])
    if front.word == "flap" or (
        held and bar[0] and at[2] > middle[2] + 0.25 * size[2] and (held[1] - held[0])[0] > 0.5 * size[0]
    ):
        at = at if held else np.array((middle[0], plane, high[2] - _EDGE))
        pivot = (middle[0], plane, low[2])
        return moving_part(
            front.name, "lid", query, bounds, (1, 0, 0), pivot, np.pi / 2, at, bar=np.eye(3)[0]
        )
    beside = _behind_or_before(front, fronts)
    if front.word == "sliding" or beside is not None:
        towards = float(np.sign(beside.middle[0] - middle[0])) if beside else 1.0
        edge = np.array(((low if towards > 0 else high)[0] + towards * _EDGE, plane, middle[2]))
        return moving_part(
            front.name, "sliding", query, bounds, (towards, 0, 0), middle, 0.8 * size[0],
            at if held else edge,
        )  # fmt: skip
    hinge = _hinge(front, fronts)
    x = low[0] if hinge < 0 else high[0]
    if not held:
        free = high[0] if hinge < 0 else low[0]
        at = np.array((free + hinge * _EDGE, plane, middle[2]))
    return moving_part(front.name, "hinged", query, bounds, (0, 0, hinge), (x, plane, 0), _TURNS, at, bar=bar)


def _hinge(front: _Front, fronts: list[_Front]) -> int:
    """-1 where a door hangs at its edge of lower x, 1 at that of greater x: away from its handle, else by its
    name, else away from the door beside it.
    """
    if front.handle is not None:
        off = float((front.handle[0] + front.handle[1])[0] / 2 - front.middle[0])
        if abs(off) > 0.1 * front.size[0]:
            return -1 if off > 0 else 1
    if bool(_LEFT.search(front.name)) != bool(_RIGHT.search(front.name)):
        return -1 if _LEFT.search(front.name) else 1
    for other in fronts:
        level = abs(other.middle[2] - front.middle[2]) < 0.1 * front.size[2]
        if other is not front and other.word == "door" and level:
            if abs(other.low[0] - front.high[0]) < 0.05:
                return -1
            if abs(front.low[0] - other.high[0]) < 0.05:
                return 1
    return -1


def _behind_or_before(front: _Front, fronts: list[_Front]) -> _Front | None:
    """The front on the next track, which this one overlaps in part; None where it hangs alone."""
    for other in fronts:
        over = min(front.high[0], other.high[0]) - max(front.low[0], other.low[0])
        alike = abs(other.size[2] - front.size[2]) < 0.1 * front.size[2]
        level = abs(other.middle[2] - front.middle[2]) < 0.1 * front.size[2]
        apart = abs(other.high[1] - front.high[1]) > 0.25 * min(front.size[1], other.size[1])
        if other is not front and other.word in ("door", "sliding") and alike and level and apart:
            if _OVERLAP[0] * front.size[0] < over < _OVERLAP[1] * front.size[0]:
                return other
    return None


def _solid(vertices: Array, triangles: Array) -> Cuboids:
    grid = voxelise(vertices, triangles, _VOXEL)
    mins, maxs = merge(grid)
    return Cuboids([((0, 0, 0), 0.0, grid.origin + mins * grid.cell, grid.origin + maxs * grid.cell)])


def _shorten(part: MovingPart, front: _Front, others: list[DistanceQuery]) -> None:
    """Let a part go no farther than it comes without running into the others deeper than it lies in them when
    shut.
    """
    v = front.vertices
    some = v[np.linspace(0, len(v) - 1, min(len(v), 400)).astype(int)]
    # Corners alone would miss what comes between them.
    grid = np.linspace(0.05, 0.95, 7)
    inner = (
        front.low + np.stack(np.meshgrid(grid, (0.5,), grid, indexing="ij"), -1).reshape(-1, 3) * front.size
    )
    points = np.concatenate((some, inner))
    shut = _deepest(points, others)
    for k in range(1, _STEPS + 1):
        moved = part.to_world(points, opening=k / _STEPS)
        if (_deepest(moved, others) < np.minimum(shut, 0.0) - _GIVE).any():
            part.travel *= max(k - 1, 1) / _STEPS
            return


def _deepest(points: Array, others: list[DistanceQuery]) -> Array:
    far = np.full(len(points), 0.1)
    for other in others:
        far = np.minimum(far, other.signed_distance(points.astype(np.float32), 0.1))
    return far
