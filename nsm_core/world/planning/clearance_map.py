"""How much room a body has over the floor, looked at in tiles where something is asked, once."""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from nsm_core.errors import GoalError
from nsm_core.rotations import Array
from nsm_core.world.scene.stairs import Stairs

from .on_stairs import room_on_stairs

if TYPE_CHECKING:
    from nsm_core.world.geometry.distance import DistanceQuery

_Map = TypeVar("_Map", bound="ClearanceMap")

BODY_RADIUS = 0.28
# Heights at which a body would touch something, metres; closer together than the body is wide, so no board
# slips between.
HEIGHTS = (0.15, 0.45, 0.75, 1.05, 1.35, 1.65)
COMFORT = 0.17  # metres of room beyond the radius that a walker likes to keep
_TILE = 32  # nodes along the sides of a tile
_ROWS = 1 << 30  # tiles along either axis of the world
# What was looked at of each set of solids that says that it stands ``still``, by radius and cell, as long as
# it is there: the next take needs the same.
_seen: WeakKeyDictionary[DistanceQuery, dict[tuple[float, float], dict[int, Array]]] = WeakKeyDictionary()


class ClearanceMap:
    """Room of a body over a floor, however large: what is large costs nothing by itself.

    Args:
        query: solids of the scene, without the floor.
        bounds: minimum and maximum corner ((x, y), (x, y)) of the floor, metres.
        radius: of the body, metres.
        cell: half the way between the nodes at which it is looked, metres.
        stairs: flights that are walked up and down.
    """

    def __init__(
        self,
        query: DistanceQuery,
        bounds: tuple[Array, Array] | Array,
        radius: float = BODY_RADIUS,
        cell: float = 0.05,
        stairs: Stairs | None = None,
    ) -> None:
        low, high = (np.asarray(b, dtype=np.float64)[:2] for b in bounds)
        if not (np.isfinite(low).all() and np.isfinite(high).all() and (high > low).all()):
            raise GoalError(
                "The floor to plan on has no size; give its lower left and upper right corner in metres."
            )
        self.radius, self.cell, self._query = float(radius), float(cell), query
        self._far = max(BODY_RADIUS, radius) + COMFORT + 0.25  # clearance beyond which more does not matter
        # Distances change by at most a metre a metre, so every second cell is enough and the rest is
        # interpolated.
        self._spacing = 2 * self.cell
        # Nodes lie on one grid for all maps, so that they share what was looked at.
        self._first = np.floor(low / self._spacing + 1e-9).astype(np.int64)
        self._last = np.maximum(np.ceil(high / self._spacing - 1e-9).astype(np.int64), self._first + 1)
        self.bounds = (self._first * self._spacing, self._last * self._spacing)
        self._base: ClearanceMap | None = None
        self._places = np.zeros((0, 2))
        self._reach = 0.0
        self.stairs = stairs or Stairs()
        still = getattr(query, "still", False) and not self.stairs
        self._forget(_seen.setdefault(query, {}).setdefault((self.radius, self.cell), {}) if still else {})

    def _forget(self, rooms: dict[int, Array]) -> None:
        self._rooms = rooms  # clearance (n + 3, n + 3) of the nodes of a tile and of those around it
        self._slots: dict[int, int] = {}
        self._nodes = np.zeros((0, _TILE + 1, _TILE + 1, 3))  # clearance and the way it grows, by slot

    @property
    def solids(self) -> DistanceQuery:
        """What stands on the floor."""
        return self._query if self._base is None else self._base.solids

    def clearance(self, points: Array) -> Array:
        """Distance (N,) in metres from floor points (N, 2) to the nearest solid at body height, capped near
        0.7 m, negative inside.
        """
        return self._at(np.asarray(points, dtype=np.float64), slice(0, 1))[..., 0]

    def off_solids(self, place: Array) -> Array:
        """The direction (2,) from a floor point (2,) with more room; zero where nothing is near."""
        slope = self._at(np.asarray(place, dtype=np.float64)[None], slice(1, 3))[0]
        return slope / max(float(np.linalg.norm(slope)), 1e-6) * (np.linalg.norm(slope) > 1e-3)

    def besides(self: _Map, query: DistanceQuery, places: Array, reach: float) -> _Map:
        """This map with more solids in it: ``query``, which lies within ``reach`` metres of ``places`` (N,
        2).
        """
        other = copy(self)
        other._base, other._query, other._places, other._reach = (
            self,
            query,
            np.asarray(places, dtype=np.float64),
            reach,
        )
        other._forget({})
        return other

    def _tiles(self, numbers: Array) -> Array:
        """Clearance (K, n + 3, n + 3) at the nodes of tiles and around them, looked at where that has not
        been done.
        """
        missing = [int(k) for k in numbers if int(k) not in self._rooms]
        if missing:
            corner = (np.stack(np.divmod(np.array(missing), _ROWS), -1) - _ROWS // 2) * _TILE - 1
            node = np.stack(np.meshgrid(*[np.arange(_TILE + 3)] * 2, indexing="ij"), -1)
            nodes = self._spacing * (corner[:, None, None] + node)
            if self._base is None:
                rooms = self._sample(nodes)
            else:
                rooms = self._base._tiles(np.array(missing)).copy()
                near = (np.abs(nodes[..., None, :] - self._places).max(-1) < self._reach + self._far).any(-1)
                if near.any():
                    rooms[near] = np.minimum(rooms[near], look(self._query, nodes[near], self._far))
            self._rooms.update(zip(missing, rooms, strict=True))
        return np.stack([self._rooms[int(k)] for k in numbers])

    def _sample(self, nodes: Array) -> Array:
        """Clearance (K, m, m) at nodes (K, m, m, 2): a coarse look first, then every node that could be near
        something.
        """
        every = 4
        half_diagonal = every * self._spacing * np.sqrt(0.5)
        coarse = nodes[:, ::every, ::every] + every * self._spacing / 2
        reach = self._far + half_diagonal + self._spacing
        found = np.asarray(self._query.signed_distance(body_at(coarse.reshape(-1, 2)), reach + 1e-3))
        near = (found < reach).reshape(len(HEIGHTS), *coarse.shape[:3])
        near = near.repeat(every, 2).repeat(every, 3)[:, :, : nodes.shape[1], : nodes.shape[2]]
        out = np.full(near.shape, self._far)
        height, *at = np.nonzero(near)
        if len(height):
            points = np.column_stack((nodes[tuple(at)], np.array(HEIGHTS)[height])).astype(np.float32)
            out[near] = self._query.signed_distance(points, self._far)
        rooms = out.min(0)
        if self.stairs:
            own = room_on_stairs(self.stairs, self._query, nodes.reshape(-1, 2), self._far)
            rooms = np.where(np.isnan(own), rooms.reshape(-1), own).reshape(rooms.shape)
        return rooms

    def _at(self, points: Array, what: slice) -> Array:
        """Interpolate ``what`` of the nodes (clearance, its two slopes) at floor points (..., 2)."""
        grid = np.clip(points / self._spacing, self._first, self._last - 1e-6)
        cell = np.floor(grid).astype(np.int64)
        tile, within = np.divmod(cell, _TILE)
        tile += _ROWS // 2
        slot = self._slot(tile[..., 0] * _ROWS + tile[..., 1])
        i, j = within[..., 0], within[..., 1]
        u, v = np.moveaxis(grid - cell, -1, 0)[..., None]
        nodes = self._nodes[..., what]
        near, far = ((1 - v) * nodes[slot, i + k, j] + v * nodes[slot, i + k, j + 1] for k in (0, 1))
        return (1 - u) * near + u * far

    def _slot(self, tiles: Array) -> Array:
        """Where the nodes of tiles (...) are kept, after looking at those that are new."""
        if tiles.size and (first := int(tiles.flat[0])) in self._slots and (tiles == first).all():
            return np.full(tiles.shape, self._slots[first])
        numbers, back = np.unique(tiles, return_inverse=True)
        new = np.array([k for k in numbers.tolist() if k not in self._slots], dtype=np.int64)
        if len(new):
            rooms = self._tiles(new)
            slopes = np.gradient(rooms, self._spacing, axis=(1, 2))
            made = np.stack((rooms, *slopes), axis=-1)[:, 1:-1, 1:-1]
            self._slots.update(
                zip(new.tolist(), range(len(self._nodes), len(self._nodes) + len(new)), strict=True)
            )
            self._nodes = np.concatenate((self._nodes, made))
        return np.array([self._slots[k] for k in numbers.tolist()], dtype=np.int64)[back].reshape(tiles.shape)


def body_at(points: Array) -> Array:
    """Places (6 N, 3) float32 at which a body at floor points (N, 2) would touch something."""
    return np.concatenate([np.insert(points, 2, z, axis=1) for z in HEIGHTS]).astype(np.float32)


def look(query: DistanceQuery, points: Array, reach: float) -> Array:
    """Clearance (N,) of a body at floor points (N, 2), metres, at most ``reach``."""
    return (
        np.asarray(query.signed_distance(body_at(points), reach), dtype=np.float64)
        .reshape(len(HEIGHTS), -1)
        .min(0)
    )
