"""Low ground: rugs and kerbs raise the walker's floor, and feet stand on top of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nsm_core.body.capsules import penetration_depths
from nsm_core.body.contacts import TOES
from nsm_core.body.skeleton import HIPS, TOE_HEIGHT, forward_kinematics
from nsm_core.control.goals import Goal
from nsm_core.control.relief import Relief
from nsm_core.control.take import TakeRequest, TakeRunner
from nsm_core.conventions import FPS
from nsm_core.evaluation.measures.motion import jumps, travel_report
from nsm_core.evaluation.trials.sit import sit_goal
from nsm_core.model.inference.model import load_model
from nsm_core.rotations import rotate_planar
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.clearance_map import HEIGHTS
from nsm_core.world.scene import furniture
from nsm_core.world.scene.terrain import FLOOR_TOP, HeightMap, Terrain

_FACES = np.array(((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)))


def slab(low, high, turn: float = 0.0) -> tuple[HeightMap, Cuboids]:
    """A box as a map of its mesh, and as a solid."""
    corners = np.array(
        [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    turned = rotate_planar(corners, turn)
    triangles = turned[np.concatenate((_FACES[:, :3], _FACES[:, (0, 2, 3)]))]
    return HeightMap.over(triangles), Cuboids([(np.zeros(3), turn, np.array([low]), np.array([high]))])


def roll(request: TakeRequest):
    runner = TakeRunner(load_model(backend="numpy"), request)
    while runner.step():
        pass
    return runner.result()


@pytest.mark.parametrize("turn", [0.0, 0.6])
def test_a_map_of_a_mesh_has_its_heights_and_its_edges(turn):
    found, _ = slab((-1.0, -0.5, 0.0), (1.0, 0.5, 0.04), turn)
    points = np.random.default_rng(0).uniform(-1.3, 1.3, (2000, 2))
    inside = (np.abs(points) <= (1.0, 0.5)).all(1)
    sure = np.abs(np.abs(points) - (1.0, 0.5)).min(1) > 0.03
    heights = found.at(rotate_planar(points, turn))
    np.testing.assert_allclose(heights[sure & inside], 0.04, atol=1e-6)
    assert not heights[sure & ~inside].any()


def test_a_map_keeps_slopes_and_small_faces_and_leaves_out_paint():
    x, y = np.meshgrid(np.arange(0, 1, 0.005), np.arange(0, 0.3, 0.005), indexing="ij")
    a, b, c = (
        np.stack((x + dx, y + dy, 0.1 * (x + dx)), -1).reshape(-1, 3)
        for dx, dy in ((0, 0), (0.005, 0), (0, 0.005))
    )
    fine = HeightMap.over(np.stack((a, b, c), 1))
    whole = HeightMap.over(
        np.array((((0, 0, 0), (1, 0, 0.1), (1, 0.3, 0.1)), ((0, 0, 0), (1, 0.3, 0.1), (0, 0.3, 0))))
    )
    points = np.random.default_rng(1).uniform((0.05, 0.05), (0.95, 0.25), (300, 2))
    for found in (fine, whole):
        np.testing.assert_allclose(found.at(points), 0.1 * points[:, 0], atol=0.003)
    assert HeightMap.over(np.array((((0, 0, 0.001), (1, 0, 0.001), (1, 1, 0.001)),))) is None
    assert HeightMap.over(np.zeros((0, 3, 3))) is None


def test_the_largest_floor_stays_a_small_map():
    found, _ = slab((-300.0, -300.0, 0.0), (300.0, 300.0, 0.05))
    assert found.heights.size < 500_000
    np.testing.assert_allclose(found.at(np.array(((299.0, 0.0), (-250.0, 250.0)))), 0.05)


def test_ground_tells_distances_as_its_solid_does():
    found, solid = slab((-0.5, -0.3, -1.0), (0.5, 0.3, 0.1))
    points = (
        np.random.default_rng(2).uniform((-0.7, -0.5, 0.0), (0.7, 0.5, 0.25), (800, 3)).astype(np.float32)
    )
    want, have = (q.signed_distance(points, 0.08) for q in (solid, Terrain([found])))
    np.testing.assert_allclose(have, want, atol=0.021)  # a cell


def test_no_body_is_looked_for_below_what_is_walked_over():
    assert min(HEIGHTS) > FLOOR_TOP


def test_the_walkers_floor_follows_the_ground_without_a_jolt():
    found, _ = slab((-1.0, 1.0, 0.0), (1.0, 4.0, 0.12))
    relief, levels = Relief(Terrain([found]), np.zeros(2)), []
    for y in np.arange(0.0, 2.5, 0.04):
        levels.append(relief.follow(np.array((0.0, y))))
    assert levels[0] == 0 and levels[-1] == pytest.approx(0.12, abs=0.002)
    assert (np.diff(levels) > -1e-6).all() and np.abs(
        np.diff(levels, 2)
    ).max() * 900 < 5  # m/s2; hips of a walker know 16
    assert Relief(Terrain([found]), np.array((0.0, 2.5))).level == pytest.approx(0.12)


def test_goals_on_the_ground_stay_on_it_and_others_are_told_from_it():
    found, _ = slab((-1.0, -1.0, 0.0), (1.0, 1.0, 0.1))
    relief = Relief(Terrain([found]), np.zeros(2))
    seen = relief.goals(np.array(((0, 0, 0), (0, 0, 0.1), (3, 0, 0), (0, 0, 0.55)), np.float32))
    np.testing.assert_allclose(seen[:, 2], (0, 0, 0, 0.45), atol=1e-6)


GROUNDS = {
    "rug": [((-1.5, -3.0, 0.0), (1.5, -1.0, 0.04))],
    "kerb, then podium": [((-3.0, -1.35, 0.0), (3.0, -1.2, 0.1)), ((-3.0, -9.0, 0.0), (3.0, -2.5, 0.12))],
}


@pytest.mark.parametrize("name", list(GROUNDS))
def test_one_walks_over_low_ground_with_the_feet_on_top(name):
    maps, solids = zip(*(slab(*corners) for corners in GROUNDS[name]), strict=True)
    ground = Terrain(maps)
    goal = Goal("walk", "place", np.array((0.0, -4.0, 0.0)), 0.0, 0.3)
    take = roll(TakeRequest(np.zeros(2), 0.0, [goal], Cuboids(), ground=ground))
    assert take.goals[0].reached and take.goals[0].position_error_cm < 5
    for solid in solids:
        assert (
            penetration_depths(take.hips_position, take.local_rotations, solid).max() < 0.04
        )  # a heel over the kerb's edge
    report = travel_report(take.hips_position, take.local_rotations, ground=ground.height)
    assert report["below_floor_share"] < 0.03
    assert jumps(take.hips_position, take.local_rotations)["jolt_cm"] < 9  # 7 on a flat floor
    rise = float(ground.height(take.root[-1:, :2])[0])
    flat = roll(TakeRequest(np.zeros(2), 0.0, [goal], Cuboids()))
    level = travel_report(flat.hips_position, flat.local_rotations)
    assert report["slide_moving_weighted_cm_s"] < 1.3 * level["slide_moving_weighted_cm_s"]
    toes = forward_kinematics(take.hips_position, take.local_rotations)[0][:, TOES]
    over = toes[..., 2] - ground.height(toes[..., :2].reshape(-1, 2)).reshape(-1, 2) - TOE_HEIGHT
    speed = np.linalg.norm(np.diff(toes[..., :2], axis=0), axis=-1) * FPS
    stands = (np.abs(over[1:]) < 0.001) & (np.abs(over[:-1]) < 0.001)
    assert stands.mean() > 0.4 and np.median(speed[stands]) < 0.005 and speed[stands].mean() < 0.02
    assert take.hips_position[-1, 2] - flat.hips_position[-1, 2] == pytest.approx(rise, abs=0.01)


def test_one_sits_on_what_stands_on_a_podium_as_on_the_floor():
    piece, up = furniture.make("chair", np.random.default_rng(3)), np.array((0, 0, 0.1), np.float32)
    found, solid = slab((-1.5, -4.0, 0.0), (1.5, -1.6, 0.1))
    chair = furniture.cuboids([(piece, np.array((0.0, -3.0)), np.pi)])
    chair.groups = [replace(g, position=g.position + up) for g in chair.groups]
    goal = sit_goal(piece, np.array((0.0, -3.0)), np.pi)
    sensed = replace(goal.interaction, centre=goal.interaction.centre + up)
    goal = replace(goal, position=goal.position + up, interaction=sensed, hold=0.3)
    take = roll(TakeRequest(np.zeros(2), 0.0, [goal], chair, ground=Terrain([found])))
    assert (
        take.goals[0].reached
        and take.goals[0].position_error_cm < 3
        and take.goals[0].network_position_error_cm < 10
    )
    assert penetration_depths(take.hips_position, take.local_rotations, solid).max() < 0.03
    assert forward_kinematics(take.hips_position, take.local_rotations)[0][-1, HIPS, 2] == pytest.approx(
        goal.position[2], abs=0.02
    )
