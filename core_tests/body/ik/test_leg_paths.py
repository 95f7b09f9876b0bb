"""High thin walls: legs of whole takes go over them, feet land behind them, and one foot bears until the
other has landed.
"""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.capsules import penetration_depths
from nsm_core.body.contacts import ANKLES, TOES
from nsm_core.body.ik.leg_paths import LegPaths
from nsm_core.body.skeleton import ANKLE_HEIGHT, TOE_HEIGHT, forward_kinematics
from nsm_core.control.take import TakeRunner
from nsm_core.evaluation.measures.motion import jumps
from nsm_core.evaluation.trials import climb
from nsm_core.model.inference.model import load_model
from nsm_core.rotations import heading_to_direction
from nsm_core.signals import intervals
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene import furniture
from nsm_core.world.scene.terrain import Terrain


def over_wall(height: float, depth: float, start: tuple[float, float], heading: float):
    """A take over a wall at the origin, and the steps that it needed."""
    piece = furniture.make("low_wall", np.random.default_rng(1), width=1.4, height=height, depth=depth)
    asked = climb.request(climb.ClimbTrial(0, "wall", np.array(start), heading, piece, 0.0), hold=0.3)
    runner, steps = TakeRunner(load_model(backend="numpy"), asked), 0
    while runner.step():
        steps += 1
    assert steps >= runner.frames - 1 and not runner.step()
    return asked, runner.result()


@pytest.mark.parametrize(
    ("height", "depth", "start", "heading"), [(0.45, 0.05, (0.4, 1.8), 0.4), (0.6, 0.1, (-0.3, -1.9), 2.6)]
)
def test_a_high_thin_wall_is_stepped_over(height, depth, start, heading):
    asked, take = over_wall(height, depth, start, heading)
    goal = asked.goals[0]
    assert take.goals[0].reached
    depths = penetration_depths(take.hips_position, take.local_rotations, asked.environment)
    assert depths.max() < 0.03 and (depths > 0.02).mean() < 0.03
    positions = forward_kinematics(take.hips_position, take.local_rotations)[0].astype(np.float64)
    ahead = heading_to_direction(np.array(goal.heading))
    # Whoever hovers has both soles off what is under them; a push-off is no more than a third of a second.
    ground = Terrain.probe(asked.environment, goal.interaction).height
    soles = np.minimum(positions[:, TOES, 2] - TOE_HEIGHT, positions[:, ANKLES, 2] - ANKLE_HEIGHT)
    under = np.maximum(
        *(ground(positions[:, joints, :2].reshape(-1, 2)).reshape(-1, 2) for joints in (TOES, ANKLES))
    )
    runs = intervals((soles - under).min(1) > 0.05)
    assert max((b - a for a, b in runs), default=0) <= 10
    # The first foot that stands beyond the wall has its heel beyond it too.
    along = positions[:, ANKLES, :2] @ ahead
    stands = (soles < 0.03) & (along > 0)
    assert stands.any() and along[stands].min() - 0.05 > depth / 2 - 0.02
    assert jumps(take.hips_position, take.local_rotations)["jolt_cm"] < 16


def test_legs_that_are_clear_are_left_alone():
    piece = furniture.make("low_wall", np.random.default_rng(1), width=1.4, height=0.4, depth=0.1)
    wall = furniture.cuboids([(piece, np.array((0.0, 3.0)), 0.0)])
    hips, local = np.tile((0.0, 0.0, 0.97), (40, 1)), np.tile((1.0, 0, 0, 0), (40, 23, 1))
    before = hips.copy(), local.copy()
    for query in (wall, Cuboids()):
        list(LegPaths(query).clear(hips, local, np.ones((40, 2), bool), np.ones(40)))
        assert (hips == before[0]).all() and (local == before[1]).all()
