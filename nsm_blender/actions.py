"""The one list of what the shipped weights can do; sidebar, job files and messages all read it."""

from __future__ import annotations

from dataclasses import dataclass

from nsm_core.errors import GoalError


@dataclass(frozen=True)
class Action:
    """An action that a goal can ask for, as the sidebar shows it."""

    key: str
    label: str
    description: str
    icon: str
    needs_object: bool


ACTIONS = (
    Action("sit", "Sit", "Walk to the object and sit down on it", "TRIA_DOWN_BAR", True),
    Action("walk", "Walk", "Walk to the object or to the place", "TRIA_RIGHT_BAR", False),
    Action("idle", "Stand", "Stand still where the character is; a sitter rises first", "PAUSE", False),
)
BY_KEY = {a.key: a for a in ACTIONS}


def require_action(action: str) -> Action:
    """Return the action of that name; GoalError lists what there is."""
    if action not in BY_KEY:
        raise GoalError(f"The action '{action}' is not one of {', '.join(BY_KEY)}; choose one of these.")
    return BY_KEY[action]
