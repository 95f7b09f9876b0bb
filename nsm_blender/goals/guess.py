"""The action that an object asks for by its shape; its name decides between what its shape allows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import bpy

from nsm_core.errors import NsmError
from nsm_core.world.actions import require_action

from ..world.frame import WorldFrame
from .looks import Looks
from .loose_parts import is_group, touch
from .registry import FINDERS


def guess(target: bpy.types.Object, frame: WorldFrame) -> str:
    """Return the key of the action that an object looks made for: a seat is sat on, a door opened, a crate
    carried, a podium climbed; what looks like none of them is walked to.
    """
    if target.type == "EMPTY" and not is_group(target):
        return _otherwise()
    named = _words_of(target)
    by_name = [key for key, finder in FINDERS.items() if named.intersection(finder.words)]
    try:
        looks = Looks.of(target, frame)
    except NsmError:
        looks = None
    if looks is None:
        return by_name[0] if by_name else _otherwise()
    for key in by_name:
        if FINDERS[key].likely(looks) > 0:
            return key
    scores = {key: finder.likely(looks) for key, finder in FINDERS.items()}
    return max(scores, key=scores.__getitem__)


@dataclass
class Asked:
    """A goal that selected objects ask for."""

    target: bpy.types.Object
    action: str
    to: bpy.types.Object | None = None


def asked_of(
    targets: Sequence[bpy.types.Object], frame: WorldFrame, active: bpy.types.Object | None = None
) -> list[Asked]:
    """Goals for objects that are added at once.

    Parts are no goals beside their whole: neither children beside their parent, nor cushions, legs and backs
    that are objects of their own beside the seat that they touch.  What is carried goes onto the ``active``
    object, where that is one to walk up to.
    """
    chosen = [t for t in targets if not any(t in other.children_recursive for other in targets)]
    asked = [Asked(target, guess(target, frame)) for target in chosen]
    wholes = [a for a in asked if FINDERS[a.action].loose]
    parts = [a for a in asked if FINDERS[a.action].anything and a.target.type == "MESH"]
    for part in parts:
        if any(touch(whole.target, part.target, frame) for whole in wholes):
            asked.remove(part)
    onto = next((a for a in asked if a.target == active and FINDERS[a.action].anything), None)
    brought = [a for a in asked if require_action(a.action).needs_destination]
    if onto is not None and brought:
        asked.remove(onto)
        for each in brought:
            each.to = onto.target
    return asked


def _otherwise() -> str:
    """What anything is good for."""
    return next(key for key, finder in FINDERS.items() if finder.anything)


def _words_of(target: bpy.types.Object) -> set[str]:
    """The words of a name, in lower case, without the plural."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", target.name)
    return {word.removesuffix("s") for word in re.findall(r"[a-z]+", spaced.lower())}
