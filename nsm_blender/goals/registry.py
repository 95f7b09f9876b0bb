"""How each action's goal is found in a scene, by the action's key (see ``nsm_core.world.actions``)."""

from __future__ import annotations

from . import carry, climb, idle, open, place, sit, touch, walk
from .finder import Finder

FINDERS: dict[str, Finder] = {
    "idle": idle.FINDER,
    "walk": walk.WALK,
    "run": walk.RUN,
    "sit": sit.FINDER,
    "carry": carry.FINDER,
    "open": open.FINDER,
    "climb": climb.FINDER,
    "touch": touch.FINDER,
    "place": place.FINDER,
}
