"""The actions, a record each: what every floor of the house has a part for, under the same key.

``control.actions.registry`` performs them, ``data.scenarios.registry`` composes them from captures,
``evaluation.trials.suite`` judges them, and the add-on's ``goals.registry`` finds them in a scene.  An action
is added by its record here, its files on those floors and one line in the registry of each.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

from nsm_core.errors import GoalError

if TYPE_CHECKING:
    from .scene.props import Prop


class Aim(Enum):
    """What an action is aimed at."""

    HERE = "here"  # nothing: it is done where one is
    PLACE = "place"  # an object, or a place where there is none
    OBJECT = "object"  # an object


@dataclass(frozen=True)
class Action:
    """An action that a goal can ask for.

    ``key`` names it in job files, goals and reports; ``label`` and ``description`` show it in a list,
    ``done`` is what a report says of one that is reached.  ``moved`` names the prop that its hands move, and
    ``handles`` what that is called in a sentence; with ``needs_destination`` it is brought somewhere.
    ``raises``: feet come to stand on the object, ``seats``: hips come to rest on it; ``hands``: reports tell
    how far its hands are from where they should be.  ``labels`` are those that a network must
    have learned (by default the action's own); standing is never asked for.
    """

    key: str
    label: str
    description: str
    done: str
    aim: Aim = Aim.OBJECT
    needs_destination: bool = False
    moved: str = ""
    handles: str = ""
    raises: bool = False
    seats: bool = False
    hands: bool = False
    labels: tuple[str, ...] = ()

    @property
    def needs_object(self) -> bool:
        """Whether there is nothing to do without an object."""
        return self.aim is Aim.OBJECT

    @property
    def stays(self) -> bool:
        """Whether one usually stays once it is done; else it is a stretch of the way to what follows."""
        return self.aim is not Aim.PLACE and not self.moved

    @property
    def moves(self) -> bool:
        """Whether its object is moved and keyed with the character."""
        return bool(self.moved)

    @property
    def pairs(self) -> bool:
        """Whether two of it can be done at once, one with either hand."""
        return self.moved == "LightThing"

    @property
    def prop(self) -> type[Prop] | None:
        """What its hands move; loaded when it is asked for, since menus are made of actions alone."""
        if not self.moved:
            return None
        from .scene import props

        kind: type[Prop] = getattr(props, self.moved)
        return kind


# Files keep the place of an action in this tuple: a new one goes to its end.
ACTIONS = (
    Action("sit", "Sit", "Walk to the object and sit down on it", "sat down", seats=True),
    Action("walk", "Walk", "Walk to the object or to the place", "arrived", Aim.PLACE),
    Action("idle", "Stand", "Stand still where the character is; a sitter rises first", "stands", Aim.HERE),
    Action("run", "Run", "Run to the object or to the place", "arrived", Aim.PLACE),
    Action(
        "carry",
        "Carry",
        "Lift the object with both hands and set it down on top of another one, or where an empty is",
        "set down",
        needs_destination=True,
        moved="Box",
        handles="a box to carry",
        hands=True,
    ),
    Action(
        "open",
        "Open",
        "Open the door whose leaf the object is, and go through; of furniture, open its door or drawer, or "
        "shut it where it stands open",
        "opened",
        moved="Openable",
        handles="the leaf of a door, or a door or drawer of furniture, to open",
        hands=True,
    ),
    Action(
        "climb", "Climb", "Step up onto the object, or over it where it is a low wall", "climbed", raises=True
    ),
    Action(
        "touch",
        "Touch",
        "Walk to the object and put a hand on it, as on a button",
        "touched",
        hands=True,
        labels=("idle", "walk"),
    ),
    Action(
        "place",
        "Pick and Place",
        "Take the object, which is light, with one hand, out of what it stands in, and put it on another "
        "one, or where an empty is",
        "put down",
        needs_destination=True,
        moved="LightThing",
        handles="a light thing to pick up",
        hands=True,
        labels=("idle", "walk"),
    ),
)
BY_KEY = {a.key: a for a in ACTIONS}


def require_action(action: str) -> Action:
    """Return the action of that name; GoalError lists what there is."""
    if action not in BY_KEY:
        raise GoalError(f"The action '{action}' is not one of {', '.join(BY_KEY)}; choose one of these.")
    return BY_KEY[action]


def require_learned(actions: Iterable[str], metadata: Mapping[str, Any]) -> None:
    """Raise GoalError on an action that the weights with this ``metadata`` have not learned."""
    learned = {"idle", *metadata.get("actions", BY_KEY)}  # everyone stands
    can = [a.key for a in ACTIONS if learned.issuperset(a.labels or (a.key,))]
    for action in actions:
        if action not in can:
            told = ", ".join(can)
            raise GoalError(
                f"The installed network has not learned to {action}; it can do: {told}. Choose one of "
                "these, or train it."
            )
