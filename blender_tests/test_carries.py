"""Whole carries with meshes: from far off a table's edge onto another table and a shelf."""

from __future__ import annotations

import math
from typing import NamedTuple

import bpy
import numpy as np
import pytest
from scenes import empty, mesh_of_boxes

from nsm_blender.goals.spec import GoalSpec
from nsm_blender.keys.keying import read_back
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import Take, TakeSpec, finish, generate
from nsm_core.body.capsules import Body
from nsm_core.evaluation.measures.objects import wrists
from nsm_core.world.geometry.distance import Cuboids

SIZE = (0.34, 0.3, 0.26)
DEEP = 0.03  # metres in something from which a frame counts as deep


class Carried(NamedTuple):
    """What is seen of a take: the box's corner-to-corner matrices, the body, and what stands there."""

    take: Take
    boxes: np.ndarray  # (T, 4, 4) world matrices of the box, whose origin is in the middle of its base
    body: Body
    hands: np.ndarray  # (T, 2, 3)
    still: Cuboids


def boards(name, parts, location, turn):
    """Put boxes (low, high) into the scene as one mesh; returns them as ``Cuboids`` have them."""
    mesh_of_boxes(name, parts, (*location, 0.0), turn)
    return (location, turn, np.array([p[0] for p in parts]), np.array([p[1] for p in parts]))


def table(name, location, turn=0.0, width=1.2, depth=0.9, top=0.74):
    x, y = width / 2, depth / 2
    legs = [
        (
            (sx * (x - 0.03) - 0.03, sy * (y - 0.03) - 0.03, 0),
            (sx * (x - 0.03) + 0.03, sy * (y - 0.03) + 0.03, top - 0.04),
        )
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    return boards(name, [*legs, ((-x, -y, top - 0.04), (x, y, top))], location, turn)


def shelf(name, location, turn=0.0, width=0.9, depth=0.36, levels=(0.06, 0.42), top=1.0):
    """Open towards -Y of its own frame."""
    x, y, t = width / 2, depth / 2, 0.025
    sides = [
        ((-x, -y, 0), (-x + t, y, top)),
        ((x - t, -y, 0), (x, y, top)),
        ((-x + t, y - t, 0), (x - t, y, top - t)),
    ]
    return boards(
        name,
        [
            *sides,
            *[((-x + t, -y, z - t), (x - t, y - t, z)) for z in levels],
            ((-x + t, -y, top - t), (x - t, y, top)),
        ],
        location,
        turn,
    )


@pytest.fixture(scope="module")
def carried() -> Carried:
    """One character takes one box from 15 cm behind a table's edge to 18 cm behind another's and onto a
    shelf.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.fps = 30
    pieces = [
        table("Table", (0.0, 0.0)),
        table("Desk", (2.2, -1.6), -math.pi / 2),
        shelf("Shelf", (0.2, -3.6), math.pi),
    ]
    half = np.array(SIZE) * (0.5, 0.5, 1.0)
    box = mesh_of_boxes("Box", [((-half[0], -half[1], 0), tuple(half))], (0.0, -0.45 + 0.15 + half[1], 0.74))
    desk = empty("On the desk", (2.2 - 0.45 + 0.18 + half[1], -1.6, 0.74), math.pi / 2)
    goals = [GoalSpec("carry", box, 0.2, to=to) for to in (desk, bpy.data.objects["Shelf"])]
    character = add_character((0.2, -1.5, 0.0))
    take = finish(generate(TakeSpec(character, goals), scene))
    frames = range(take.keyed.frame_start, take.keyed.frame_end + 1)
    matrices = []
    for frame in frames:
        scene.frame_set(frame)
        matrices.append(np.array(box.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world))
    hips, local = read_back(character, frames, scene)
    return Carried(take, np.array(matrices), Body.of(hips, local), wrists(hips, local), Cuboids(pieces))


def test_every_carry_is_reached(carried):
    assert [(g["reached"], g["reason"]) for g in carried.take.report["goals"]] == [(True, "")] * 2
    assert all(g["position_error_cm"] < 2 for g in carried.take.report["goals"])
    lowest = carried.boxes[:, 2, 3]
    assert lowest[0] == pytest.approx(0.74, abs=1e-4) and lowest[-1] == pytest.approx(1.0, abs=0.01)
    away = np.linalg.norm(carried.boxes[:, :2, 3] - (2.2, -1.6), axis=1)
    assert ((np.abs(lowest - 0.74) < 0.01) & (away < 0.5)).sum() > 5  # on the desk


def test_the_box_is_never_inside_anything(carried):
    half = np.array(SIZE) / 2
    axes = [np.linspace(-h, h, 8) for h in half]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3) + (0, 0, half[2])
    world = points @ np.swapaxes(carried.boxes[::2, :3, :3], 1, 2) + carried.boxes[::2, None, :3, 3]
    assert carried.still.signed_distance(world.reshape(-1, 3).astype(np.float32), 0.1).min() > -0.012
    assert world[..., 2].min() > -0.01


def test_the_box_moves_in_hands_alone(carried):
    step = np.linalg.norm(np.diff(carried.boxes[:, :3, 3], axis=0), axis=1)
    middle = carried.boxes[1:, :3, 3] + (0, 0, SIZE[2] / 2)
    away = np.linalg.norm(carried.hands[1:] - middle[:, None], axis=-1).max(1)
    assert away[step > 0.003].max() < 0.36
    assert np.linalg.norm(np.diff(carried.boxes[:, :3, 3], n=2, axis=0), axis=1).max() < 0.035


def test_thighs_stay_out_of_tables_and_the_body_out_of_everything(carried):
    body = carried.body
    distance = carried.still.signed_distance(body.centres.reshape(-1, 3).astype(np.float32), 0.2).reshape(
        body.radii.shape
    )
    depth = body.radii - distance
    thighs = [k for k, name in enumerate(body.names) if name in ("LeftHip-LeftKnee", "RightHip-RightKnee")]
    assert depth[:, thighs].max() < 0.02
    assert (depth.max(1) > DEEP).mean() < 0.02 and depth.max() < 0.06
