"""To stand where one is."""

from __future__ import annotations

import bpy
import numpy as np

from nsm_core.control.goals import Goal

from ..world.surroundings import Surroundings
from .finder import Finder, Place
from .spec import GoalSpec


def _find(spec: GoalSpec, scene: bpy.types.Scene, around: Surroundings, before: Place) -> Goal:
    return Goal("idle", "here", np.append(before[0], 0.0), before[1], spec.hold)


FINDER = Finder(_find)
