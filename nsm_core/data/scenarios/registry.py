"""How each action is composed, by its key (see ``nsm_core.world.actions``), in the order of the draws of a
seed.

Standing is part of every take, and so has none of its own; stairs are no action, but on the way of a walk.
"""

from __future__ import annotations

import json
from typing import Any

from nsm_core.data.matching.draws import MATCHING

from . import single_clips
from .carry import episode as carry
from .carry.draws import CARRIES
from .climb import episode as climb
from .climb.draws import CLIMBS
from .draws import FURNISHINGS, PERFORMANCES, WAYS
from .open import episode as open
from .open.draws import OPENS
from .scenario import Scenario, episode
from .sit import episode as sit
from .sit.draws import SITS
from .stairs import episode as stairs
from .stairs.draws import STAIRS
from .walk import ways
from .walk.draws import RUNS, WALKS

SCENARIOS: dict[str, Scenario] = {
    "sit": Scenario(0.8, episode(sit.lay), single_clips.sit, sit.segments, 1, SITS),
    "carry": Scenario(0.3, episode(carry.lay), single_clips.carry, carry.segments, 3, CARRIES),
    "open": Scenario(0.34, episode(open.lay), None, open.segments, 4, OPENS),
    "climb": Scenario(0.14, episode(climb.lay), None, climb.segments, 2, CLIMBS),
    "walk": Scenario(0.12, ways.walk, single_clips.walk_clip, draws=WALKS),
    "run": Scenario(0.25, ways.run, single_clips.run_clip, draws=RUNS),
    "stairs": Scenario(0.16, episode(stairs.lay), None, draws=STAIRS),
}


def drawn() -> dict[str, Any]:
    """What is drawn at random while data are composed, and how, as JSON keeps it: "sit.tries" -> 6.

    The share of an action is "sit.share".  It joins the meaning of the data, so that weights tell what they
    were trained on; other draws are another choice of data and no reason to refuse or warn.
    """
    general = {"performance": PERFORMANCES, "way": WAYS, "furnishing": FURNISHINGS, "matching": MATCHING}
    known = general | {name: s.draws for name, s in SCENARIOS.items() if s.draws is not None}
    found = {f"{name}.{k}": v for name, draws in known.items() for k, v in vars(draws).items()}
    found |= {f"{name}.share": scenario.share for name, scenario in SCENARIOS.items()}
    return json.loads(json.dumps(found))
