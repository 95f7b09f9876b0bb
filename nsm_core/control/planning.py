"""Ways over the floor between pieces of furniture: clearance map, A*, and an elastic band that rounds the corners.

Plain planning for a walking body, not a part of the paper; it leads locomotion around furniture and lays out training takes.
"""

from __future__ import annotations

import heapq
from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from ..errors import GoalError
from ..rotations import Array

if TYPE_CHECKING:
    from ..sensors.query import DistanceQuery

BODY_RADIUS = 0.28
# Heights at which a body would touch something, metres; closer together than the body is wide, so no board slips between.
HEIGHTS = (0.15, 0.45, 0.75, 1.05, 1.35, 1.65)
_COMFORT = 0.17  # metres of room beyond the radius that a walker likes to keep
_FAR = BODY_RADIUS + _COMFORT + 0.25  # clearance beyond which more does not matter
_ESCAPE = 1.2  # metres around a start or goal that is hemmed in, within which the way may squeeze through
_BRUSH = 0.03  # metres of room that squeezing through needs
_LEAVE = 0.7  # metres to get off a thing that one stands or sits on; further from deeper ones that a way starts on:
_BEYOND = (0.3, 1.0)  # metres past the nearest free floor, tried one after the other


class FloorPlan:
    """Free floor of a scene for a body of some radius, sampled once and asked many times.

    Args:
        query: solids of the scene, without the floor.
        bounds: minimum and maximum corner ((x, y), (x, y)) of the floor to look at, metres.
        radius: of the body, metres.
        cell: size of the cells that are searched, metres.
    """

    def __init__(self, query: DistanceQuery, bounds: tuple[Array, Array] | Array, radius: float = BODY_RADIUS, cell: float = 0.05) -> None:
        low, high = (np.asarray(b, dtype=np.float64)[:2] for b in bounds)
        if not (np.isfinite(low).all() and np.isfinite(high).all() and (high > low).all()):
            raise GoalError("The floor to plan on has no size; give its lower left and upper right corner in metres.")
        self.radius, self.cell, self._low = float(radius), float(cell), low
        self._far = max(_FAR, radius + _COMFORT + 0.25)
        # Distances change by at most a metre a metre, so every second cell is enough and the rest is interpolated.
        self._spacing = 2 * self.cell
        shape = np.maximum(2, np.ceil((high - low) / self._spacing).astype(int) + 1)
        room = self._sample(query, shape)
        self._nodes = np.stack((room, *np.gradient(room, self._spacing)), axis=-1)  # clearance and the way it grows
        self.bounds = (low, low + (shape - 1) * self._spacing)

    def clearance(self, points: Array) -> Array:
        """Distance (N,) in metres from floor points (N, 2) to the nearest solid at body height, capped near 0.7 m, negative inside."""
        return self._at(np.asarray(points, dtype=np.float64), slice(0, 1))[..., 0]

    def line_is_free(self, a: Array, b: Array, radius: float | None = None) -> bool:
        """Whether the body can go straight from ``a`` to ``b``, (2,) metres."""
        a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
        count = 2 + int(np.linalg.norm(b - a) / (self.cell / 2))
        return bool((self.clearance(a + np.linspace(0, 1, count)[:, None] * (b - a)) >= (self.radius if radius is None else radius)).all())

    def find(self, start: Array, goal: Array, step: float = 0.05) -> Array:
        """Find a smooth short way (N, 2), metres, its points ``step`` apart, from ``start`` to ``goal`` (2,), both included.

        A start or goal between furniture, such as one on a seat, is left or reached by squeezing out the cheapest way.
        Raises GoalError if there is no way or if an end lies off the plan.
        """
        ends = [np.asarray(p, dtype=np.float64)[:2] for p in (start, goal)]
        for end, name in zip(ends, ("start", "goal"), strict=True):
            if not np.isfinite(end).all() or (end < self.bounds[0]).any() or (end > self.bounds[1]).any():
                raise GoalError(f"The {name} at ({end[0]:.2f}, {end[1]:.2f}) m lies off the planned floor; move it or plan a larger floor.")
        if self.line_is_free(*ends):
            return resample(np.stack(ends), step)
        cells = self._search(*ends)
        if cells is None and float(self.clearance(ends[0][None])[0]) <= _BRUSH:
            cells = self._leave_deep(*ends)
        if cells is None:
            raise GoalError(
                f"There is no free way to ({ends[1][0]:.2f}, {ends[1][1]:.2f}) m for a body {2 * self.radius:.2f} m wide; "
                "move the furniture apart or choose another goal."
            )
        cells[0], cells[-1] = ends
        free = np.flatnonzero(self.clearance(cells) >= self.radius)
        first, last = (int(free[0]), int(free[-1])) if len(free) else (0, 0)
        pulled = np.concatenate((cells[:first], self._pull(cells[first : last + 1]), cells[last + 1 :]))
        return resample(self._relax(resample(pulled, step)), step)

    def _sample(self, query: DistanceQuery, shape: Array) -> Array:
        """Clearance (nx, ny) at the nodes: a coarse look first, then every node that could be near something."""
        x, y = (self._low[k] + self._spacing * np.arange(shape[k]) for k in (0, 1))

        every = 4
        coarse_x, coarse_y = x[::every], y[::every]
        half_diagonal = every * self._spacing * np.sqrt(0.5)
        centres = np.stack(np.meshgrid(coarse_x, coarse_y, indexing="ij"), -1).reshape(-1, 2) + every * self._spacing / 2
        reach = self._far + half_diagonal + self._spacing
        near = (_look(query, centres, reach + 1e-3) < reach).reshape(len(coarse_x), len(coarse_y))
        near = near.repeat(every, 0).repeat(every, 1)[: shape[0], : shape[1]]
        out = np.full(tuple(shape), self._far)
        nodes = np.stack(np.meshgrid(x, y, indexing="ij"), -1)[near]
        if len(nodes):
            out[near] = _look(query, nodes, self._far)
        return out

    def besides(self, query: DistanceQuery, places: Array, reach: float) -> FloorPlan:
        """This plan with more solids in it: ``query``, which lies within ``reach`` metres of ``places`` (N, 2)."""
        other = copy(self)
        room = self._nodes[..., 0].copy()
        x, y = (self._low[k] + self._spacing * np.arange(room.shape[k]) for k in (0, 1))
        nodes = np.stack(np.meshgrid(x, y, indexing="ij"), -1)
        near = (np.abs(nodes[:, :, None] - places).max(-1) < reach + self._far).any(-1)
        if near.any():
            room[near] = np.minimum(room[near], _look(query, nodes[near], self._far))
        other._nodes = np.stack((room, *np.gradient(room, self._spacing)), axis=-1)
        return other

    def _cells(self) -> Array:
        """Floor points (nx, ny, 2) of the cells that are searched, metres."""
        shape = np.round((self.bounds[1] - self._low) / self.cell).astype(int) + 1
        x, y = (self._low[k] + self.cell * np.arange(shape[k]) for k in (0, 1))
        return np.stack(np.meshgrid(x, y, indexing="ij"), -1)

    def _leave_deep(self, start: Array, goal: Array) -> Array | None:
        """As ``_search`` for a start so deep on a thing that free floor lies further away than usual."""
        points = self._cells()
        free = self.clearance(points) >= self.radius
        if not free.any():
            return None
        nearest = float(np.linalg.norm(points[free] - start, axis=-1).min())
        ways = (self._search(start, goal, nearest + more) for more in _BEYOND if nearest + more > _LEAVE)
        return next((way for way in ways if way is not None), None)

    def _search(self, start: Array, goal: Array, leave: float = _LEAVE) -> Array | None:
        """A* over the cells with 8 neighbours; the way as points (N, 2), or None.

        ``leave``: metres within which a start on top of a thing gets off it.
        """
        points = self._cells()
        room = self.clearance(points)
        price = 1 + 1.5 * np.clip((self.radius + _COMFORT - room) / _COMFORT, 0, 1)
        blocked = room < self.radius
        squeeze = np.zeros_like(blocked)
        for end, far in ((start, leave), (goal, _LEAVE)):
            own, away = float(self.clearance(end[None])[0]), np.linalg.norm(points - end, axis=-1)
            if own < self.radius:
                # Beside a thing one may brush it, never pass through it; only from on top of a thing the way leads off it.
                squeeze |= blocked & (((room > _BRUSH) & (away < _ESCAPE)) if own > _BRUSH else (away < far))
        # Flesh gives way before wood does: inside a solid costs much more than close to one.
        price = np.where(squeeze, 6 + 60 * np.clip((0.15 - room) / 0.15, 0, 2), np.where(blocked, np.inf, price))
        price = np.pad(price, 1, constant_values=np.inf)
        width = price.shape[1]
        to_cell = [tuple(np.round((p - self._low) / self.cell).astype(int)) for p in (start, goal)]
        first, last = ((i + 1) * width + j + 1 for i, j in to_cell)
        prices = price.ravel().tolist()
        if prices[first] == np.inf or prices[last] == np.inf:
            return None
        gi, gj = divmod(last, width)
        diagonal = 2**0.5
        steps = [(di * width + dj, diagonal if di and dj else 1.0) for di in (-1, 0, 1) for dj in (-1, 0, 1) if di or dj]
        cost, parent, done = {first: 0.0}, {first: first}, set()
        queue = [(0.0, first)]
        while queue:
            _, here = heapq.heappop(queue)
            if here in done:
                continue
            if here == last:
                break
            done.add(here)
            base, own = cost[here], prices[here]
            for offset, length in steps:
                there = here + offset
                p = prices[there]
                if p == np.inf or there in done:
                    continue
                new = base + length * 0.5 * (own + p)
                if new < cost.get(there, np.inf):
                    cost[there], parent[there] = new, here
                    i, j = divmod(there, width)
                    di, dj = abs(i - gi), abs(j - gj)
                    heapq.heappush(queue, (new + max(di, dj) + (diagonal - 1) * min(di, dj), there))
        else:
            return None
        way = [last]
        while way[-1] != first:
            way.append(parent[way[-1]])
        i, j = np.divmod(np.array(way[::-1]), width)
        return self._low + self.cell * np.stack((i - 1, j - 1), -1)

    def _pull(self, way: Array) -> Array:
        """Drop the points of ``way`` that a straight line with as much room, up to some comfort, can skip."""
        room = np.minimum(self.clearance(way), self.radius + 0.1)
        out, here = [way[0]], 0
        while here < len(way) - 1:
            there, far = here + 1, len(way) - 1
            while far > there:  # the farthest point in sight; sight is not monotone, so look from the far end in halves
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
        wish = np.minimum(np.maximum(start, self.radius) + 0.06, self.radius + _COMFORT)
        held = start < self.radius
        held[[0, -1]] = True
        reach = max(1, min(6, (len(way) - 1) // 2))
        index = np.arange(len(way))
        near = np.minimum(reach, np.minimum(index, len(way) - 1 - index))
        band = way.copy()
        for _ in range(rounds):
            middle = 0.25 * (band[index - near] + band[index + near]) + 0.25 * (band[index - (near > 0)] + band[index + (near > 0)])
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

    def _at(self, points: Array, what: slice) -> Array:
        """Interpolate ``what`` of the nodes (clearance, its two slopes) at floor points (..., 2)."""
        nodes = self._nodes[..., what]
        grid = np.clip((points - self._low) / self._spacing, 0, np.array(nodes.shape[:2]) - 1.000001)
        cell = grid.astype(int)
        i, j = cell[..., 0], cell[..., 1]
        u, v = np.moveaxis(grid - cell, -1, 0)[..., None]
        return (1 - u) * ((1 - v) * nodes[i, j] + v * nodes[i, j + 1]) + u * ((1 - v) * nodes[i + 1, j] + v * nodes[i + 1, j + 1])


def _look(query: DistanceQuery, points: Array, reach: float) -> Array:
    """Clearance (N,) of a body at floor points (N, 2), metres, at most ``reach``."""
    body = np.concatenate([np.insert(points, 2, z, axis=1) for z in HEIGHTS]).astype(np.float32)
    return np.asarray(query.signed_distance(body, reach), dtype=np.float64).reshape(len(HEIGHTS), -1).min(0)


def plan_path(
    query: DistanceQuery, start: Array, goal: Array, radius: float = BODY_RADIUS, margin: float = 2.0, step: float = 0.05
) -> Array:
    """Find a way (N, 2) on the floor ``margin`` metres around ``start`` and ``goal`` (2,); see ``FloorPlan.find``.

    Make a ``FloorPlan`` and ask it where more than one way is wanted.
    """
    ends = np.stack([np.asarray(p, dtype=np.float64)[:2] for p in (start, goal)])
    if not np.isfinite(ends).all():
        raise GoalError("The start or the goal has coordinates that are not numbers; place it again.")
    return FloorPlan(query, (ends.min(0) - margin, ends.max(0) + margin), radius).find(*ends, step=step)


def line_is_free(query: FloorPlan | DistanceQuery, a: Array, b: Array, radius: float = BODY_RADIUS) -> bool:
    """Whether a body of ``radius`` can go straight from ``a`` to ``b``, (2,) metres; ``query`` may be a plan or solids."""
    if isinstance(query, FloorPlan):
        return query.line_is_free(a, b, radius)
    a, b = (np.asarray(p, dtype=np.float64)[:2] for p in (a, b))
    line = a + np.linspace(0, 1, 2 + int(np.linalg.norm(b - a) / 0.05))[:, None] * (b - a)
    body = np.concatenate([np.insert(line, 2, z, axis=1) for z in HEIGHTS]).astype(np.float32)
    return bool((query.signed_distance(body, radius + 0.01) >= radius).all())


def path_length(path: Array) -> float:
    """Length of a way (N, 2), metres."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=-1).sum())


def resample(path: Array, step: float) -> Array:
    """Points (N, 2) along a way at even distances of nearly ``step`` metres, its ends included."""
    lengths = np.linalg.norm(np.diff(path, axis=0), axis=-1)
    keep = np.concatenate(((True,), lengths > 1e-9))
    path, along = path[keep], np.concatenate(((0.0,), np.cumsum(lengths[lengths > 1e-9])))
    if along[-1] < 1e-9:
        return path[:1]
    at = np.linspace(0, along[-1], max(2, 1 + round(along[-1] / step)))
    return np.stack([np.interp(at, along, path[:, k]) for k in (0, 1)], axis=-1)
