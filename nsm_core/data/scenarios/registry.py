"""How each action is composed, by its key (see ``nsm_core.world.actions``), in the order of the draws of a
seed.

Standing is part of every take, and so has none of its own.
"""

from __future__ import annotations

from . import single_clips
from .carry import episode as carry
from .climb import episode as climb
from .open import episode as open
from .scenario import Scenario, episode
from .sit import episode as sit
from .walk import ways

SCENARIOS: dict[str, Scenario] = {
    "sit": Scenario(0.38, episode(sit.lay), single_clips.sit, sit.segments, 1),
    "carry": Scenario(0.18, episode(carry.lay), single_clips.carry, carry.segments, 3),
    "open": Scenario(0.22, episode(open.lay), None, open.segments, 4),
    "climb": Scenario(0.14, episode(climb.lay), None, climb.segments, 2),
    "walk": Scenario(0.1, ways.walk, single_clips.walk),
    "run": Scenario(0.07, ways.run, single_clips.run),
}
