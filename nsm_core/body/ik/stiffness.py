"""How a person's joints give way: what turns easily, what hardly, and about which axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nsm_core.body.skeleton import JOINTS

from .solver import Stiffness

# Joints by what their names hold, and the radians by which they give way.
_GIVES = (("Hips", 0.08), ("Chest", 0.12), ("Neck", 0.2), ("Head", 0.2), ("Collar", 0.08),
          ("Shoulder", 0.5),
          ("Elbow", 0.6), ("Wrist", 0.3), ("Hip", 0.4), ("Knee", 0.6), ("Ankle", 0.5),
          ("Toe", 0.05))  # fmt: skip
_HIPS_GIVE = np.array((0.05, 0.05, 0.06))
_HINGES = {"Knee": (1.0, 0.0, 0.0), "RightElbow": (0.0, 0.0, 1.0), "LeftElbow": (0.0, 0.0, -1.0)}
_ACROSS = 0.05  # radians by which hinges turn about other axes


def stiffness(names: Sequence[str] = JOINTS) -> Stiffness:
    """How a person's joints of these names give way."""
    turns = np.array(
        [next(g for key, g in _GIVES if name.endswith(key) or name.startswith(key)) for name in names]
    )
    hinges = {
        j: (np.array(axis), _ACROSS)
        for j, name in enumerate(names)
        for key, axis in _HINGES.items()
        if name.endswith(key)
    }
    return Stiffness(_HIPS_GIVE, turns, hinges)


__all__ = ["stiffness"]
