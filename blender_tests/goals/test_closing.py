"""What is opened to get at a thing is shut again, once no later goal needs it open."""

from __future__ import annotations

import bpy
import pytest
from placings import found, place
from scenes import empty

from nsm_blender.demo_scene.kitchen import build_kitchen
from nsm_blender.rigs.character import add_character
from nsm_core.errors import GoalError

SECOND, DOOR = "Drawers drawer 2", "Wall cupboard door"


@pytest.fixture
def character(empty_scene):
    """Who is in a kitchen."""
    room, _ = build_kitchen(0)
    character = add_character((*room.start, 0.0))
    bpy.context.view_layer.update()
    return character


def told(goal):
    return [one.name if one.action == "place" else (one.name, one.opening) for one in goal.parts]


def test_a_drawer_is_shut_after_the_last_thing_that_is_taken_out_of_it(character):
    first, last = found(character, place("Bowl"), place("Cup 3"))
    assert told(first) == [(SECOND, 1.0), "Bowl"] and told(last) == ["Cup 3", (SECOND, 0.0)]
    assert last.then[0].prop is first.first[0].prop
    assert last.then[0].pulling.begin == pytest.approx(first.first[0].pulling.end)
    assert last.then[0].pulling.end == pytest.approx(0.0)
    _, last = found(character, place("Bowl"), place("Cup 3", close_after=False))
    assert told(last) == ["Cup 3"]


def test_what_cannot_be_shut_past_the_thing_itself_is_told(character):
    empty("There", (0.75, -0.5, 1.45))  # in the way of the door
    with pytest.raises(
        GoalError, match=f"{DOOR} cannot be shut again once Tin 2 is put down: .* Close After off"
    ):
        found(character, place("Tin 2", "There"))
    (goal,) = found(character, place("Tin 2", "There", close_after=False))
    assert goal.then == ()
