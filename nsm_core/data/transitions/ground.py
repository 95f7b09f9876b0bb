"""Ground under windows of motion: a heightmap, placed, and what is added to it where feet touch it.

Kept as what it is made of, so that a window's five take a kilobyte and not a picture each; its height is
worked out where it is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from nsm_core.rotations import Array, rotate_planar

from .heightmaps import CELL, SIDE

KERNEL = 0.25  # metres: scale of the logistic kernel
DEVIATION = 5 * CELL  # of the Gaussian filter, 20 cm
HALF = 16 * CELL  # of its side


@dataclass
class Grounds:
    """Grounds (...) of windows; places are those of a window's motion, metres.

    ``map`` which heightmap; ``turn`` radians and ``shift`` (..., 2) metres by which a place is turned and
    then moved to be looked up in it; ``lift`` metres on top of it; ``contacts`` (..., C, 2) places,
    ``radial`` and ``filtered`` (..., C) metres that the radial basis functions and the filter of equation 1
    add there.
    """

    map: Array
    turn: Array
    shift: Array
    lift: Array
    contacts: Array
    radial: Array
    filtered: Array

    def __getitem__(self, index: object) -> Grounds:
        return Grounds(*(getattr(self, f.name)[index] for f in fields(self)))

    def height(self, maps: Array, places: Array) -> Array:
        """Heights (..., N) at places (..., N, 2)."""
        out = looked_up(maps, self.map, self.turn, self.shift, places) + self.lift[..., None]
        if self.contacts.shape[-2]:
            x, y = (places[..., :, None, k] - self.contacts[..., None, :, k] for k in (0, 1))
            out = out + (logistic(x, y) @ self.radial[..., None])[..., 0]
            out = out + (gaussian(x, y) @ self.filtered[..., None])[..., 0]
        return np.asarray(out)


def looked_up(maps: Array, which: Array, turn: Array, shift: Array, places: Array) -> Array:
    """Heights (..., N) of ``maps`` (M, SIDE, SIDE), which repeat, at places (..., N, 2), between cells
    bilinear.
    """
    at = (rotate_planar(places, turn[..., None]) + shift[..., None, :]) / CELL
    low = np.floor(at)
    part = (at - low).astype(np.float32)
    first = low.astype(np.int32) % SIDE
    i, j = first[..., 0], first[..., 1]
    k, m = (i + 1) % SIDE, (j + 1) % SIDE
    flat, base = maps.reshape(-1), np.asarray(which)[..., None].astype(np.int32) * (SIDE * SIDE)
    u, v = part[..., 0], part[..., 1]
    near = flat[base + i * SIDE + j] * (1 - v) + flat[base + i * SIDE + m] * v
    far = flat[base + k * SIDE + j] * (1 - v) + flat[base + k * SIDE + m] * v
    return np.asarray(near * (1 - u) + far * u)


def logistic(x: Array, y: Array) -> Array:
    """Logistic kernel (...) of places ``x`` and ``y`` (...) apart: 1 at none, the density of a logistic
    distribution.
    """
    e = np.exp(np.sqrt(x * x + y * y) * (-1 / KERNEL))
    return np.asarray(4 * e / (1 + e) ** 2)


def gaussian(x: Array, y: Array) -> Array:
    """The filter F of equation 1 (...) at ``x`` and ``y`` (...) from its middle, 0 off its 33 x 33 points."""
    inside = (np.abs(x) <= HALF) & (np.abs(y) <= HALF)
    return np.asarray(np.exp((x * x + y * y) * (-0.5 / DEVIATION**2)) * inside)


__all__ = ["Grounds", "gaussian", "logistic", "looked_up"]
