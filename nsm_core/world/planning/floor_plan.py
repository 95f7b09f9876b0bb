"""Ways over the floor between pieces of furniture: clearance map, A*, and an elastic band that rounds the
corners.

Plain planning for a walking body, not a part of the paper; it leads locomotion around furniture and lays out
training takes.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from nsm_core.errors import GoalError
from nsm_core.rotations import Array

from .cheapest_way import cheapest
from .clearance_map import BODY_RADIUS, COMFORT, ClearanceMap, body_at

if TYPE_CHECKING:
    from nsm_core.world.geometry.distance import DistanceQuery

_ESCAPE = 1.2  # metres around a start or goal that is hemmed in, within which the way may squeeze through
BRUSH = 0.03  # metres of room that squeezing through needs
# Metres to get off a thing that one stands or sits on; further from deeper ones that a way starts on.
_LEAVE = 0.7
_BEYOND = (0.3, 1.0)  # metres past the nearest free floor, tried one after the other
_FARTHEST = 1000.0  # metres between the ends of a way
# Cells that are searched at once, and the times that they may be doubled in size for it; metres around the
# ends of a way that is looked for in a part of a large floor.
_MOST_CELLS, _COARSER, _AROUND = 400_000, 2, 8.0
# On ways that are too long for that: metres before and behind a thing in the way between which a way around
# it is looked for, metres aside, and points of the straight way of which one is kept.
_BEFORE, _WIDE, _SPARSE = 3.0, 50.0, 10
_SUSPECTS = 5  # things of which it is tried whether one would get through without them


class FloorPlan(ClearanceMap):
    """Free floor of a scene for a body of some radius, and ways over it; see ``ClearanceMap``."""

    def line_is_free(self, a: Array, b: Array, radius: float | None = None) -> bool:
        """Whether the body can go straight from ``a`` to ``b``, (2,) metres."""
        a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
        count = 2 + int(np.linalg.norm(b - a) / (self.cell / 2))
        return bool(
            (
                self.clearance(a + np.linspace(0, 1, count)[:, None] * (b - a))
                >= (self.radius if radius is None else radius)
            ).all()
        )

    def find(self, start: Array, goal: Array, step: float = 0.05) -> Array:
        """Find a smooth short way (N, 2), metres, its points ``step`` apart, from ``start`` to ``goal`` (2,),
        both included.

        A start or goal between furniture, such as one on a seat, is left or reached by squeezing out the
        cheapest way. Raises GoalError if there is no way or if an end lies off the plan.
        """
        cells = self.require_way(start, goal)
        if len(cells) == 2:
            return resample_path(cells, step)
        free = np.flatnonzero(self.clearance(cells) >= self.radius)
        first, last = (int(free[0]), int(free[-1])) if len(free) else (0, 0)
        pulled = np.concatenate((cells[:first], self._pull(cells[first : last + 1]), cells[last + 1 :]))
        return resample_path(self._relax(resample_path(pulled, step)), step)

    def require_way(self, start: Array, goal: Array) -> Array:
        """A rough way (N, 2) from ``start`` to ``goal`` (2,), its two ends alone where it is straight; raises
        as ``find``.
        """
        ends = [np.asarray(p, dtype=np.float64)[:2] for p in (start, goal)]
        for end, name in zip(ends, ("start", "goal"), strict=True):
            if not np.isfinite(end).all() or (end < self.bounds[0]).any() or (end > self.bounds[1]).any():
                raise GoalError(
                    f"The {name} at ({end[0]:.2f}, {end[1]:.2f}) m lies off the planned floor; move it or "
                    "plan a larger floor."
                )
        if np.linalg.norm(ends[1] - ends[0]) > _FARTHEST:
            raise GoalError(
                f"It is {np.linalg.norm(ends[1] - ends[0]):.0f} m to ({ends[1][0]:.0f}, {ends[1][1]:.0f}) "
                "m, and a way may be up to "
                f"{_FARTHEST:.0f} m long; choose a nearer goal, or one on the way there first."
            )
        cells = self._way(*ends)
        if cells is None:
            raise GoalError(
                f"There is no free way to ({ends[1][0]:.2f}, {ends[1][1]:.2f}) m for a body "
                f"{2 * self.radius:.2f} m wide; " + self._advice(*ends)
            )
        return cells

    def _way(self, start: Array, goal: Array) -> Array | None:
        """The same, or None where there is no way."""
        ends = [start, goal]
        if self.line_is_free(start, goal):
            return np.stack(ends)
        cells = self._search_near(start, goal)
        if cells is None and float(self.clearance(start[None])[0]) <= BRUSH:
            cells = self._leave_deep(start, goal)
        if cells is None:
            return None
        if len(cells) < 3:  # the ends lie in neighbouring cells
            cells = np.stack((start, (start + goal) / 2, goal))
        cells[0], cells[-1] = ends
        return cells

    def _advice(self, start: Array, goal: Array) -> str:
        """What to do where no way leads to ``goal`` (2,): name what stands in it, where there is one thing
        without which one would.
        """
        query = self.solids
        line = start + np.linspace(0, 1, 2 + int(np.linalg.norm(goal - start) / self.cell))[:, None] * (
            goal - start
        )
        blocked = line[self.clearance(line) < self.radius]
        if hasattr(query, "nearest") and hasattr(query, "without") and len(blocked):
            near = query.nearest(body_at(blocked[:: max(1, len(blocked) // 100)]), self.radius)
            for name, _ in Counter(n for n in near if n is not None).most_common(_SUSPECTS):
                if (
                    FloorPlan(query.without(name), self.bounds, self.radius, self.cell, self.stairs)._way(
                        start, goal
                    )
                    is not None
                ):
                    return (
                        f"'{name}' stands in it: move it, or set its custom property nsm_collider to False "
                        "where one may walk "
                        "through it, or choose another goal."
                    )
        return "move the furniture apart or choose another goal."

    def _search_near(self, start: Array, goal: Array, leave: float = _LEAVE) -> Array | None:
        """``_search`` on the whole floor; where that is large, near the ends first, and in larger cells."""
        whole = self.bounds
        ends = np.stack((start, goal))
        near = np.maximum(ends.min(0) - _AROUND, whole[0]), np.minimum(ends.max(0) + _AROUND, whole[1])
        small = np.prod((whole[1] - whole[0]) / self.cell) <= _MOST_CELLS
        fitted = False
        for low, high in [whole] if small else [near, whole]:
            coarser = next(
                (k for k in range(_COARSER + 1) if np.prod((high - low) / (self.cell * 2**k)) <= _MOST_CELLS),
                None,
            )
            if coarser is not None:
                fitted, way = True, self._search(start, goal, leave, low, high, self.cell * 2**coarser)
                if way is not None:
                    return way
        return None if fitted else self._detours(start, goal, leave)

    def _detours(self, start: Array, goal: Array, leave: float) -> Array | None:
        """A way too long for one search: straight on, and around each thing in the way by a search of its
        own.
        """
        line = start + np.linspace(0, 1, 2 + int(np.linalg.norm(goal - start) / self.cell))[:, None] * (
            goal - start
        )
        blocked = np.flatnonzero(self.clearance(line) < self.radius)
        before = round(_BEFORE / self.cell)
        runs = np.split(blocked, np.flatnonzero(np.diff(blocked) > 3 * before) + 1)
        way, here = [], 0
        for first, last in (
            (max(int(r[0]) - before, 0), min(int(r[-1]) + before, len(line) - 1)) for r in runs if len(r)
        ):
            ends = line[[first, last]]
            low, high = (
                np.maximum(ends.min(0) - _WIDE, self.bounds[0]),
                np.minimum(ends.max(0) + _WIDE, self.bounds[1]),
            )
            size = self.cell * 2**_COARSER
            if np.prod((high - low) / size) > 2 * _MOST_CELLS:
                return None
            around = self._search(ends[0], ends[1], leave, low, high, size)
            if around is None:
                return None
            way += [line[here:first:_SPARSE], around]
            here = last
        return np.concatenate((*way, line[here::_SPARSE], line[-1:]))

    def _cells(self, low: Array, high: Array, cell: float) -> Array:
        """Floor points (nx, ny, 2) of the cells between two corners (2,), metres."""
        shape = np.round((high - low) / cell).astype(int) + 1
        x, y = (low[k] + cell * np.arange(shape[k]) for k in (0, 1))
        return np.stack(np.meshgrid(x, y, indexing="ij"), -1)

    def _leave_deep(self, start: Array, goal: Array) -> Array | None:
        """As ``_search`` for a start so deep on a thing that free floor lies further away than usual."""
        low, high = np.maximum(start - _AROUND, self.bounds[0]), np.minimum(start + _AROUND, self.bounds[1])
        points = self._cells(low, high, self.cell)
        free = self.clearance(points) >= self.radius
        if not free.any():
            return None
        nearest = float(np.linalg.norm(points[free] - start, axis=-1).min())
        ways = (self._search_near(start, goal, nearest + more) for more in _BEYOND if nearest + more > _LEAVE)
        return next((way for way in ways if way is not None), None)

    def _search(
        self, start: Array, goal: Array, leave: float, low: Array, high: Array, size: float
    ) -> Array | None:
        """A* over cells of ``size`` metres between two corners (2,) with 8 neighbours; the way as points (N,
        2), or None.

        ``leave``: metres within which a start on top of a thing gets off it.
        """
        points = self._cells(low, high, size)
        room = self.clearance(points)
        price = 1 + 1.5 * np.clip((self.radius + COMFORT - room) / COMFORT, 0, 1)
        blocked = room < self.radius
        squeeze = np.zeros_like(blocked)
        for end, far in ((start, leave), (goal, _LEAVE)):
            own, away = float(self.clearance(end[None])[0]), np.linalg.norm(points - end, axis=-1)
            if own < self.radius:
                # Beside a thing one may brush it, never pass through it; only from on top of a thing the way
                # leads off it.
                squeeze |= blocked & (((room > BRUSH) & (away < _ESCAPE)) if own > BRUSH else (away < far))
            else:  # an end that is just free may lie between cells that are not
                squeeze |= blocked & (room > BRUSH) & (away < 2 * size)
        # Flesh gives way before wood does: inside a solid costs much more than close to one.
        price = np.where(
            squeeze, 6 + 60 * np.clip((0.15 - room) / 0.15, 0, 2), np.where(blocked, np.inf, price)
        )
        to_cell = [
            tuple(np.clip(np.round((p - low) / size).astype(int), 0, np.array(room.shape) - 1))
            for p in (start, goal)
        ]
        way = cheapest(price, *to_cell)
        return None if way is None else low + size * way

    def _pull(self, way: Array) -> Array:
        """Drop the points of ``way`` that a straight line with as much room, up to some comfort, can skip."""
        room = np.minimum(self.clearance(way), self.radius + 0.1)
        out, here = [way[0]], 0
        while here < len(way) - 1:
            there, far = here + 1, len(way) - 1
            # The farthest point in sight; sight is not monotone, so look from the far end in halves.
            while far > there:
                if self.line_is_free(way[here], way[far], float(room[here : far + 1].min()) - 1e-3):
                    there = far
                    break
                far = here + max(1, (far - here) * 3 // 4)
            out.append(way[there])
            here = there
        return np.array(out)

    def _relax(self, way: Array, rounds: int = 120) -> Array:
        """Tighten and round a way like an elastic band that solids push off; its ends stay."""
        if len(way) < 5:
            return way
        start = self.clearance(way)
        need = np.minimum(start, self.radius)  # where it squeezes out it may stay as close, not closer
        wish = np.minimum(np.maximum(start, self.radius) + 0.06, self.radius + COMFORT)
        held = start < self.radius
        held[[0, -1]] = True
        reach = max(1, min(6, (len(way) - 1) // 2))
        index = np.arange(len(way))
        near = np.minimum(reach, np.minimum(index, len(way) - 1 - index))
        band = way.copy()
        for _ in range(rounds):
            middle = 0.25 * (band[index - near] + band[index + near]) + 0.25 * (
                band[index - (near > 0)] + band[index + (near > 0)]
            )
            band = np.where(held[:, None], band, band + 0.5 * (middle - band))
            band = np.where(held[:, None], band, self._push(band, wish, 0.3))
        band = np.where(held[:, None], band, self._push(self._push(band, need, 1.0), need, 1.0))
        return band if (self.clearance(band) >= need - 0.02).all() else way

    def _push(self, points: Array, room: Array, share: float) -> Array:
        """Move points up the clearance by ``share`` of what they lack to ``room``."""
        here = self._at(points, slice(0, 3))
        size = np.linalg.norm(here[:, 1:], axis=-1)
        lack = np.maximum(0, room - here[:, 0]) * share / np.maximum(size, 1e-6) * (size > 1e-3)
        return points + lack[:, None] * here[:, 1:]


def line_is_free(query: FloorPlan | DistanceQuery, a: Array, b: Array, radius: float = BODY_RADIUS) -> bool:
    """Whether a body of ``radius`` can go straight from ``a`` to ``b``, (2,) metres; ``query`` may be a plan
    or solids.
    """
    if isinstance(query, FloorPlan):
        return query.line_is_free(a, b, radius)
    a, b = (np.asarray(p, dtype=np.float64)[:2] for p in (a, b))
    line = a + np.linspace(0, 1, 2 + int(np.linalg.norm(b - a) / 0.05))[:, None] * (b - a)
    return bool((query.signed_distance(body_at(line), radius + 0.01) >= radius).all())


def path_length(path: Array) -> float:
    """Length of a way (N, 2), metres."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=-1).sum())


def resample_path(path: Array, step: float) -> Array:
    """Points (N, 2) along a way at even distances of nearly ``step`` metres, its ends included."""
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=-1)
    keep = np.concatenate(((True,), lengths > 1e-9))
    path, along = path[keep], np.concatenate(((0.0,), np.cumsum(lengths[lengths > 1e-9])))
    if along[-1] < 1e-9:
        return path[:1]
    at = np.linspace(0, along[-1], max(2, 1 + round(along[-1] / step)))
    return np.stack([np.interp(at, along, path[:, k]) for k in (0, 1)], axis=-1)
