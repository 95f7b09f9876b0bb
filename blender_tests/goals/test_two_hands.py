"""A job of two things to bring: both are carried at once, keyed with their hands."""

from __future__ import annotations

import bpy
import numpy as np
from placings import performed, shelf_and_table, small_thing

from nsm_blender.rigs.character import add_character

STANDS = {"Jar": (0.05, 0.1, 0.98), "Tin": (-0.2, 0.1, 0.98)}


def furnish():
    """A shelf with a jar and a tin, a table, and a character."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    shelf_and_table()
    for name, foot in STANDS.items():
        small_thing(name, foot)
    character = add_character((0.0, -1.6, 0.0))
    bpy.context.view_layer.update()
    return character.name


def seen(character, frames):
    """Places (T, 3) of both things, and of both wrists, as Blender evaluates them."""
    scene, rig = bpy.context.scene, bpy.data.objects[character]
    things, hands = {name: [] for name in STANDS}, {"RightWrist": [], "LeftWrist": []}
    for frame in range(1, frames + 1):
        scene.frame_set(frame)
        for name, places in things.items():
            places.append(np.array(bpy.data.objects[name].matrix_world.translation))
        for name, places in hands.items():
            places.append(np.array(rig.matrix_world @ rig.pose.bones[name].head))
    return [{name: np.stack(places) for name, places in kind.items()} for kind in (things, hands)]


def test_two_things_are_carried_at_once_and_each_is_told(tmp_path):
    character = furnish()
    report = performed(tmp_path, character, *STANDS)
    assert [goal["object"] for goal in report["goals"]] == ["Jar", "Tin"]
    for goal in report["goals"]:
        assert goal["reached"] and goal["position_error_cm"] < 1.0 and goal["hand_error_cm"] < 1.0
        assert any("were carried at once" in remark for remark in goal["remarks"])
    assert report["penetration_cm"] < 2.0
    things, hands = seen(character, report["frames"])
    moves = [np.linalg.norm(np.diff(places, axis=0), axis=1) > 1e-4 for places in things.values()]
    both = np.flatnonzero(moves[0] & moves[1])
    assert len(both) > 60
    holders = []
    for places in things.values():
        spread = {name: np.ptp(np.linalg.norm(wrist - places, axis=1)[both]) for name, wrist in hands.items()}
        holders.append(min(spread, key=spread.get))
        assert spread[holders[-1]] < 0.02 < max(spread.values())
    assert sorted(holders) == ["LeftWrist", "RightWrist"]
    for name, places in things.items():
        np.testing.assert_allclose(places[0], STANDS[name], atol=1e-4)
        assert 1.0 < places[-1, 0] < 2.0 and abs(places[-1, 2] - 0.75) < 0.005
