"""Neural State Machine core: everything of the product that needs no Blender.

What a script needs is named here and loaded when it is first asked for, so that importing the package costs
nothing; ``docs/script.py`` shows it at work.  Whatever else the rooms below hold may change from version to
version.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .earlier import keep_names

if TYPE_CHECKING:
    from .control.goals import Goal, GoalResult
    from .control.inbetween import Gap, fill
    from .control.take import TakeRequest, TakeResult, TakeRunner, roll
    from .data.captures.bvh_writer import write_bvh as write_bvh
    from .errors import NsmError
    from .evaluation.furniture_goals import climb_goal, sit_goal
    from .model.inference.model import Model, load_model
    from .model.inference.transition_model import load_transitions
    from .world.affordances.passage import passage
    from .world.geometry.distance import Cuboids
    from .world.scene.door import make_door
    from .world.scene.furniture import carried_box, cuboids
    from .world.scene.furniture import make as make_furniture

__version__ = "0.1.0"

# Where a public name is kept, and under which name there.
_KEPT = {
    "Cuboids": "world.geometry.distance:Cuboids",
    "Gap": "control.inbetween:Gap",
    "Goal": "control.goals:Goal",
    "GoalResult": "control.goals:GoalResult",
    "Model": "model.inference.model:Model",
    "NsmError": "errors:NsmError",
    "TakeRequest": "control.take:TakeRequest",
    "TakeResult": "control.take:TakeResult",
    "TakeRunner": "control.take:TakeRunner",
    "carried_box": "world.scene.furniture:carried_box",
    "climb_goal": "evaluation.furniture_goals:climb_goal",
    "cuboids": "world.scene.furniture:cuboids",
    "fill": "control.inbetween:fill",
    "load_model": "model.inference.model:load_model",
    "load_transitions": "model.inference.transition_model:load_transitions",
    "make_door": "world.scene.door:make_door",
    "make_furniture": "world.scene.furniture:make",
    "passage": "world.affordances.passage:passage",
    "roll": "control.take:roll",
    "sit_goal": "evaluation.furniture_goals:sit_goal",
    "write_bvh": "data.captures.bvh_writer:write_bvh",
}
__all__ = [
    "Cuboids",
    "Gap",
    "Goal",
    "GoalResult",
    "Model",
    "NsmError",
    "TakeRequest",
    "TakeResult",
    "TakeRunner",
    "carried_box",
    "climb_goal",
    "cuboids",
    "fill",
    "load_model",
    "load_transitions",
    "make_door",
    "make_furniture",
    "passage",
    "roll",
    "sit_goal",
    "write_bvh",
]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for."""
    if name not in _KEPT:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    module, _, inside = _KEPT[name].partition(":")
    value = globals()[name] = getattr(import_module(f"{__name__}.{module}"), inside)
    return value


def __dir__() -> list[str]:
    """The public names, loaded or not, for completion in a console."""
    return sorted({*globals(), *__all__})


keep_names()
