"""Ground to walk over, made by code: slopes, steps, stairs, blocks and rough ground, which repeat without end
on every side (the heightmaps that papers/001 section 3.3 fits to motion).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nsm_core.rotations import Array

CELL = 1.3 / 32  # metres: 33 points span the 1.3 m of the filter of equation 1
SIDE = 256  # cells of a map along each side, 10.4 m
_LINE = np.arange(SIDE) * CELL
_SPAN = SIDE * CELL


def heightmaps(each: int = 4, seed: int = 0) -> Array:
    """Heights (M, SIDE, SIDE) float32, metres: level ground, and ``each`` maps of every kind."""
    rng = np.random.default_rng(seed)
    maps = [np.zeros((SIDE, SIDE))]
    for make in KINDS.values():
        maps += [make(rng) for _ in range(each)]
    return np.stack(maps).astype(np.float32)


def _across(profile: Array) -> Array:
    """A map that is the same along y."""
    return np.repeat(profile[:, None], SIDE, axis=1)


def _slope(rng: np.random.Generator) -> Array:
    """Up one half of the map and down the other, at 4 to 25 degrees."""
    steep = np.tan(np.radians(rng.uniform(4, 25)))
    return _across(steep * np.minimum(_LINE, _SPAN - _LINE))


def _stairs(rng: np.random.Generator) -> Array:
    """A flight up, a landing, the flight down, a floor: risers of 12 to 20 cm, treads of 24 to 40 cm."""
    rise, tread = rng.uniform(0.12, 0.2), rng.uniform(0.24, 0.4)
    flat = rng.uniform(0.8, 1.6)
    steps = int((_SPAN / 2 - flat) / tread)
    up = np.minimum(np.floor(np.maximum(_LINE - flat / 2, 0) / tread), steps)
    down = np.minimum(np.floor(np.maximum(_SPAN - _LINE - flat / 2, 0) / tread), steps)
    return _across(rise * np.minimum(up, down))


def _steps(rng: np.random.Generator) -> Array:
    """Strips of ground 0.4 to 1.5 m wide, each up to 35 cm higher or lower than the last."""
    out, at, level = np.zeros(SIDE), 0.0, 0.0
    while at < _SPAN:
        wide = rng.uniform(0.4, 1.5)
        out[(_LINE >= at) & (_LINE < at + wide)] = level
        at, level = at + wide, float(np.clip(level + rng.uniform(-0.35, 0.35), 0, 0.8))
    return _across(out)


def _blocks(rng: np.random.Generator) -> Array:
    """Level ground with 40 boxes on it, 30 cm to 1.5 m wide and up to 60 cm high."""
    out = np.zeros((SIDE, SIDE))
    for _ in range(40):
        size, high = (rng.uniform(0.3, 1.5, 2) / CELL).astype(int), rng.uniform(0.08, 0.6)
        rows, columns = (np.arange(rng.integers(SIDE), SIDE * 2)[:n] % SIDE for n in size)
        part = np.ix_(rows, columns)
        out[part] = np.maximum(out[part], high)
    return out


def _rough(rng: np.random.Generator) -> Array:
    """Hills 2 to 5 m long and stones on them, up to some 40 cm high."""
    waves = np.fft.fftfreq(SIDE, CELL)
    far = np.hypot(waves[:, None], waves[None])
    out = np.zeros((SIDE, SIDE))
    for long, high in ((rng.uniform(2, 5), rng.uniform(0.05, 0.15)), (0.7, rng.uniform(0.01, 0.05))):
        noise = np.fft.fft2(rng.normal(size=(SIDE, SIDE)))
        hills = np.real(np.fft.ifft2(noise * np.exp(-((far * long) ** 2))))
        out += high * hills / hills.std()
    return out - out.min()


KINDS: dict[str, Callable[[np.random.Generator], Array]] = {
    "slope": _slope,
    "stairs": _stairs,
    "steps": _steps,
    "blocks": _blocks,
    "rough": _rough,
}

__all__ = ["CELL", "KINDS", "SIDE", "heightmaps"]
