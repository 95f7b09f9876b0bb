"""Draws of measures, and the supports that several kinds of furniture share."""

from __future__ import annotations

from typing import Any

import numpy as np

from .piece import Part


def pick(
    rng: np.random.Generator, overrides: dict[str, Any], **ranges: tuple[float, float]
) -> dict[str, float]:
    """Draw every measure from its range, then let the caller's own values win."""
    drawn = {name: float(rng.uniform(*bounds)) for name, bounds in ranges.items()}
    for name in ranges:
        if overrides.get(name) is not None:
            drawn[name] = float(overrides.pop(name))
    return drawn


def choose(
    rng: np.random.Generator, overrides: dict[str, Any], name: str, options: tuple[Any, ...]
) -> object:
    drawn = options[int(rng.integers(len(options)))]
    return overrides.pop(name, drawn)


def supports(w: float, d: float, top: float, thick: float, style: str) -> list[Part]:
    """Whatever carries a plate of ``w`` x ``d`` at height ``top``."""
    x, y = w / 2, d / 2
    if style == "solid":
        return [(-x, x, -y, y, 0, top)]
    if style == "pedestal":
        return [
            (-0.03, 0.03, -0.03, 0.03, 0.05, top),
            (-x * 0.8, x * 0.8, -0.03, 0.03, 0, 0.05),
            (-0.03, 0.03, -y * 0.8, y * 0.8, 0, 0.05),
        ]
    if style == "sides":
        return [(-x, -x + thick, -y, y, 0, top), (x - thick, x, -y, y, 0, top)]
    return [
        (
            sx * x - (thick if sx > 0 else 0),
            sx * x + (thick if sx < 0 else 0),
            sy * y - (thick if sy > 0 else 0),
            sy * y + (thick if sy < 0 else 0),
            0,
            top,
        )
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
