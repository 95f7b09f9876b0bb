"""The one list of actions that a goal can ask for; sidebar, job files and messages all read it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from nsm_core.errors import GoalError


@dataclass(frozen=True)
class Action:
    """An action that a goal can ask for, as the sidebar shows it.

    ``moves`` tells whether its object is moved and keyed with the character.
    """

    key: str
    label: str
    description: str
    icon: str
    needs_object: bool
    needs_destination: bool = False
    moves: bool = False


ACTIONS = (
    Action("sit", "Sit", "Walk to the object and sit down on it", "TRIA_DOWN_BAR", True),
    Action("walk", "Walk", "Walk to the object or to the place", "TRIA_RIGHT_BAR", False),
    Action("idle", "Stand", "Stand still where the character is; a sitter rises first", "PAUSE", False),
    Action("run", "Run", "Run to the object or to the place", "FF", False),
    Action(
        "carry", "Carry", "Lift the object with both hands and set it down on top of another one, or where an empty is", "PACKAGE",
        True, needs_destination=True, moves=True,
    ),
    Action("open", "Open", "Open the door whose leaf the object is, and go through", "LOOP_FORWARDS", True, moves=True),
    Action("climb", "Climb", "Step up onto the object, or over it where it is a low wall", "TRIA_UP_BAR", True),
)  # fmt: skip
BY_KEY = {a.key: a for a in ACTIONS}


def require_action(action: str) -> Action:
    """Return the action of that name; GoalError lists what there is."""
    if action not in BY_KEY:
        raise GoalError(f"The action '{action}' is not one of {', '.join(BY_KEY)}; choose one of these.")
    return BY_KEY[action]


def require_learned(actions: Iterable[str], metadata: Mapping[str, Any]) -> None:
    """Raise GoalError on an action that the weights with this ``metadata`` have not learned."""
    learned = metadata.get("actions", BY_KEY)
    for action in actions:
        if action not in learned and action != "idle":
            can = ", ".join(a for a in BY_KEY if a in learned)
            raise GoalError(f"The installed network has not learned to {action}; it can do: {can}. Choose one of these, or train it.")
