"""Doors and drawers of a kitchen open by hand in a take, and what is shut away is taken out: judged on the
evaluated bones and objects.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

from nsm_blender.demo_scene.kitchen import build_kitchen
from nsm_blender.goals.container_points import show_what_opens
from nsm_blender.goals.fronts import along_with, is_front, shut_away
from nsm_blender.goals.furniture_parts import OPENS, SHUT
from nsm_blender.goals.resolve import resolve
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.keys.keying import read_back
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import TakeSpec, finish, generate
from nsm_blender.world.frame import WorldFrame
from nsm_core.errors import GoalError
from nsm_core.evaluation.measures.objects import wrists
from nsm_core.world.scene.wrist import TO_HELD

SEED = 0
DRAWER, DOOR = "Drawers drawer 1", "Wall cupboard 6 left door"


@dataclass
class Opened:
    take: object
    matrices: dict[str, np.ndarray]  # (T, 4, 4)
    hands: np.ndarray  # (T, 2, 3)
    handles: dict[str, np.ndarray]  # (3,) own frame
    ranges: dict[str, float]  # radians or metres


def evaluated(scene, frames, names):
    seen = {name: [] for name in names}
    for frame in frames:
        scene.frame_set(frame)
        graph = bpy.context.evaluated_depsgraph_get()
        for name in names:
            seen[name].append(np.array(bpy.data.objects[name].evaluated_get(graph).matrix_world))
    return {name: np.array(found) for name, found in seen.items()}


@pytest.fixture(scope="module")
def opened() -> Opened:
    """One character opens a drawer and a cupboard's door of a kitchen."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.fps = 30
    room, kitchen = build_kitchen(SEED)
    bpy.context.view_layer.update()
    handles = {}
    for name in (DRAWER, DOOR):
        parts = ((c, p) for c in kitchen.containers.values() for p in c.parts)
        part = next(p for c, p in parts if f"{c.name} {p.name}" == name.lower())
        own = bpy.data.objects[name].matrix_world.inverted() @ Vector(part.to_world(part.handle))
        handles[name] = np.array(own)
    character = add_character((*room.start, 0.0))
    goals = [GoalSpec("open", bpy.data.objects[name], 0.0) for name in (DRAWER, DOOR)]
    take = finish(generate(TakeSpec(character, goals), scene))
    frames = range(take.keyed.frame_start, take.keyed.frame_end + 1)
    matrices = evaluated(scene, frames, (DRAWER, DOOR))
    hips, local = read_back(character, frames, scene)
    ranges = {name: float(bpy.data.objects[name][OPENS]) for name in (DRAWER, DOOR)}
    return Opened(take, matrices, wrists(hips, local), handles, ranges)


def moved(matrices):
    """Radians and metres by which an object is turned and moved from where it was."""
    turns = [Matrix(m.tolist()).to_3x3() @ Matrix(matrices[0].tolist()).to_3x3().inverted() for m in matrices]
    return (
        np.array([t.to_quaternion().angle for t in turns]),
        np.linalg.norm(matrices[:, :3, 3] - matrices[0, :3, 3], axis=1),
    )


def test_both_are_opened_by_their_whole_range(opened):
    assert [(g["reached"], g["reason"]) for g in opened.take.report["goals"]] == [(True, "")] * 2
    turned, along = moved(opened.matrices[DRAWER])
    assert along[-1] == pytest.approx(opened.ranges[DRAWER], abs=0.01) and turned.max() < 1e-3
    turned, along = moved(opened.matrices[DOOR])
    assert turned[-1] == pytest.approx(opened.ranges[DOOR], abs=0.02) and along.max() < 1e-3


def test_the_hand_is_at_the_handle_while_it_moves(opened):
    for name, matrices in opened.matrices.items():
        handle = matrices[:, :3, :3] @ opened.handles[name] + matrices[:, :3, 3]
        moving = np.flatnonzero(np.abs(np.diff(matrices, axis=0)).max((1, 2)) > 1e-5) + 1
        off = np.linalg.norm(opened.hands[moving] - handle[moving, None], axis=-1) - TO_HELD
        assert len(moving) > 20 and np.abs(off).min(1).max() < 0.02


class TestFound:
    @pytest.fixture
    def kitchen(self, empty_scene):
        made = build_kitchen(SEED)[1]
        bpy.context.view_layer.update()
        return made

    def test_what_shuts_a_thing_away_is_what_the_kitchen_says(self, kitchen):
        for name, standing in list(kitchen.things.items())[:16]:
            title = kitchen.containers[standing.container].name
            truth = {f"{title} {n}".lower() for n in kitchen.shut_by(name)}
            truth = {n for n in truth if not n.endswith(("flap", "lid"))}
            found = shut_away(bpy.data.objects[name[0].upper() + name[1:]])
            assert {o.name.lower() for o in found} == truth

    def test_what_stands_in_a_drawer_goes_along(self, kitchen):
        for n, container in kitchen.containers.items():
            if container.kind != "drawers":
                continue
            for number, board in enumerate(container.boards):
                inside = {k for k, s in kitchen.things.items() if (s.container, s.board) == (n, number)}
                front = bpy.data.objects[f"{n[0].upper()}{n[1:]} {board.rides}"]
                assert is_front(front) and {o.name.lower() for o in along_with(front)} == inside

    def test_open_shuts_what_stands_open(self, kitchen, empty_scene):
        front = bpy.data.objects[DOOR]
        points, _ = show_what_opens(empty_scene, [front])
        axis = next(p for p in points if SHUT in p and p.name.startswith(front.name))
        here = (np.array((1.5, -1.6), np.float32), np.pi)
        goal = resolve(GoalSpec("open", front), empty_scene, WorldFrame(), here)
        assert goal.opening == 1.0 and goal.prop.opening == pytest.approx(0.0, abs=1e-6)
        front.matrix_basis = front.matrix_basis @ Matrix.Rotation(0.8 * axis[OPENS], 4, "Z")
        bpy.context.view_layer.update()
        goal = resolve(GoalSpec("open", front), empty_scene, WorldFrame(), here)
        assert goal.opening == 0.0 and goal.prop.opening == pytest.approx(0.8, abs=0.01)

    def test_what_no_hand_opens_is_told(self, kitchen, empty_scene):
        here = (np.array((1.5, -1.6), np.float32), np.pi)
        for name, sentence in (
            ("Oven flap", "opens upwards or downwards"),
            ("Drawers drawer 3", "The handle of Drawers drawer 3 is 0.38 m over the floor"),
        ):
            with pytest.raises(GoalError, match=sentence):
                resolve(GoalSpec("open", bpy.data.objects[name]), empty_scene, WorldFrame(), here)
