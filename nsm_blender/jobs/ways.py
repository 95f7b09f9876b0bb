"""What goals of a job file say of the way they are gone: a curve, rounds of it, a speed."""

from __future__ import annotations

from typing import Any

from nsm_core import validate
from nsm_core.control.goals import SPEEDS, require_speed
from nsm_core.errors import GoalError, JobError

from .paths import require_words

WAY_KEYS = ("curve", "rounds", "speed")
_MOST_ROUNDS = 100


def read_way(entry: dict[str, Any], action: str, where: str) -> tuple[str | None, int, float | None]:
    """The name of the curve that a goal goes along, how often, and its speed in m/s (None: as drawn).

    Raises JobError with one sentence where that does not go with its ``action``, or with its other keys.
    """
    curve, speed = None, None
    for key in WAY_KEYS:
        if key in entry and action not in SPEEDS:
            raise JobError(f"In {where}, '{key}' is for {' and '.join(SPEEDS)}; remove it.")
    if "curve" in entry:
        curve = require_words(entry["curve"], f"'curve' in {where}")
        for key in ("object", "location"):
            if key in entry:
                raise JobError(f"In {where}, 'curve' is the way itself; remove '{key}'.")
    elif "rounds" in entry:
        raise JobError(f"In {where}, 'rounds' counts those of a closed 'curve'; add it, or remove 'rounds'.")
    rounds = validate.whole(entry.get("rounds", 1), f"'rounds' in {where}", JobError, 1, _MOST_ROUNDS)
    if "speed" in entry:
        speed = validate.number(entry["speed"], f"'speed' in {where}", JobError, 0, 100)
        try:
            require_speed(action, speed)
        except GoalError as error:
            raise JobError(f"In {where}: {error}") from error
    return curve, rounds, speed
