"""A few of the faults of the table, drawn with a fixed seed; ``fault_table.py`` beside runs them all."""

from __future__ import annotations

import random

import bpy
import pytest
from cases import Cases
from everything import difference, digest

import nsm_blender

DRAWN = {"escapes": 4, "events": 8, "raised": 5, "states": 5, "reviews": 2, "fills": 3, "disks": 2}


@pytest.fixture(scope="module")
def cases(tmp_path_factory) -> Cases:
    nsm_blender.register()
    yield Cases(tmp_path_factory.mktemp("rooms"), rooms=("walk",))
    nsm_blender.unregister()


@pytest.mark.parametrize("group", DRAWN)
def test_a_file_is_as_it_was_or_holds_the_whole_take(cases, group):
    every = list(getattr(cases, group)())
    for case in random.Random(7).sample(every, DRAWN[group]):
        state, wrong = case.go()
        assert state and not wrong, (case.name, state, wrong)


def test_the_comparison_sees_the_least_change(cases):
    cases.rooms.open("carry")
    before = digest()
    assert not difference(before, digest())
    for change in (
        lambda: setattr(bpy.data.objects["Hero"].pose.bones["Head"], "location", (0, 0, 1e-5)),
        lambda: setattr(bpy.data.actions["Old"], "use_fake_user", True),
        lambda: setattr(bpy.data.objects["Box"].animation_data.nla_tracks[0], "mute", True),
        lambda: bpy.data.objects["Hero"].__setitem__("age", 34),
        lambda: bpy.data.objects["Table"].select_set(True),
        lambda: bpy.context.scene.frame_set(7),
        lambda: bpy.data.actions.new("left over"),
    ):
        cases.rooms.open("carry")
        change()
        assert difference(before, digest())
