"""Feet on steps: probed ground, soles that neither float nor sink, edges that are cleared, and flat floors
left as they were.
"""

from __future__ import annotations

import numpy as np
import pytest
from walks import synthetic_walk

from nsm_core.body.contacts import ANKLES, TOES, sole_depth
from nsm_core.body.ik.foot_plant import ContactIK
from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import FEET, OFFSETS, TOE_HEIGHT, J, forward_kinematics
from nsm_core.rotations import heading_quat, quat_from_rotvec, quat_rotate, rotate_planar
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene import furniture
from nsm_core.world.scene.terrain import Terrain, edge_before, merged
from nsm_core.world.sensors.interaction import interaction_sensor

LEGS = (FEET[0][:3], FEET[1][:3])
TOE = OFFSETS[TOES[0]].astype(float)


def block(height: float, depth: float = 0.8, edge: float = -0.5) -> tuple[Cuboids, Terrain]:
    """A block one walks onto along -Y; its near edge at y = ``edge``."""
    query = Cuboids([((0, 0, 0), 0.0, np.array([(-0.8, edge - depth, 0)]), np.array([(0.8, edge, height)]))])
    volume = interaction_sensor(
        query, np.array((0, edge - depth / 2, height / 2)), np.array((1.6, depth, height)), 0.0
    )
    return query, Terrain.probe(query, volume)


def climb(
    height: float, low: float = 0.0, short: float = 0.0, over: float = 0.06, late: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Step onto a block with one foot and then the other, and stand: hips (T, 3), rotations (T, 23, 4),
    labels (T, 5).

    The feet land ``low`` metres under the top and ``short`` metres short, and swing ``over`` metres higher
    than they land;
    ``late`` is the share of the swing after which they begin to rise.
    """
    count, spans = 120, ((20, 50), (55, 85))
    t = np.arange(count)

    def ease(a, b):
        return (lambda x: x * x * (3 - 2 * x))(np.clip((t - a) / (b - a), 0, 1))

    toes, labels, pitch = np.zeros((count, 2, 3)), np.zeros((count, 5)), np.zeros((count, 2))
    for side, (a, b) in enumerate(spans):
        w, x = ease(a, b), np.clip((t - a) / (b - a), 0, 1)
        toes[:, side, 0] = 0.1 if side else -0.1
        toes[:, side, 1] = -0.25 + w * (-0.5 + short)
        up = (
            ease(a + late * (b - a), a + (late + 0.6) * (b - a)) * (height - low + over)
            - ease(b - 0.35 * (b - a), b) * over
        )
        toes[:, side, 2] = TOE_HEIGHT + up
        labels[:, 3 + side] = np.clip(np.minimum(1, np.where((t > a) & (t < b), 0, 1)), 0, 1)
        pitch[:, side] = 0.25 * np.sin(np.pi * x)
    hips = np.stack(
        (
            np.zeros(count),
            0.1 - 0.25 - 0.5 * ease(25, 85),
            0.87 + (height if low < height else 0.0) * ease(35, 80),
        ),
        axis=1,
    )
    hips[:, 1] += 0.05
    local = np.zeros((count, J, 4))
    local[..., 0] = 1
    feet = quat_from_rotvec(pitch[..., None] * np.array((1.0, 0, 0)))
    return (
        hips,
        place_limbs(hips, local, LEGS, toes - quat_rotate(feet, np.broadcast_to(TOE, toes.shape)), feet),
        labels,
    )


def run(hips, local, labels, terrain):
    ik = ContactIK(terrain=terrain)
    frames = [ik.apply(h, q, c) for h, q, c in zip(hips, local, labels, strict=True)]
    return forward_kinematics(np.array([f[0] for f in frames]), np.array([f[1] for f in frames]))


@pytest.mark.parametrize("height", [0.15, 0.3, 0.45])
@pytest.mark.parametrize("low", [-0.04, 0.0, 0.05])
def test_feet_stand_on_the_top(height, low):
    _, terrain = block(height)
    hips, local, labels = climb(height, low)
    positions, rotations = run(hips, local, labels, terrain)
    for side, start in ((0, 62), (1, 97)):
        toe = positions[start:, TOES[side]]
        assert np.abs(toe[:, 2] - height - TOE_HEIGHT).max() < 0.012, "neither floats nor sinks"
        assert np.ptp(toe[:, :2], axis=0).max() < 0.01
    first = positions[:18, TOES]
    assert np.abs(first[..., 2] - TOE_HEIGHT).max() < 0.012
    heights = terrain.height(positions[:, TOES].reshape(-1, 3)[:, :2]).reshape(-1, 2)
    depth = sole_depth(positions[:, TOES], rotations[:, ANKLES], heights, np.zeros_like(heights))
    deep = [np.ptp(heights[:, s]) and float(depth[60:, s].max()) for s in (0, 1)]
    assert max(deep) < 0.012


def test_swinging_feet_clear_the_edge_without_a_pop():
    query, terrain = block(0.3)
    hips, local, labels = climb(0.3, low=0.04, over=0.0, late=0.3)
    before, _ = forward_kinematics(hips, local)
    positions, _ = run(hips, local, labels, terrain)

    def inside(p):
        return -query.signed_distance(p[:, TOES].reshape(-1, 3).astype(np.float32), 0.1)

    assert inside(before).max() > 0.02 and inside(positions).max() < 0.02
    step = np.linalg.norm(np.diff(positions[:, TOES], axis=0), axis=2)
    was = np.linalg.norm(np.diff(before[:, TOES], axis=0), axis=2)
    assert step.max() < was.max() + 0.06


def test_foot_that_stands_against_a_riser_is_brought_back():
    _, terrain = block(0.3, edge=-0.31)
    hips, local, labels = climb(0.3)
    positions, _ = run(hips[:20], local[:20], labels[:20], terrain)
    assert positions[-1, TOES[0], 1] - 0.075 > -0.33 and abs(positions[-1, TOES[0], 2] - TOE_HEIGHT) < 0.01


@pytest.mark.parametrize("over", [0.02, 0.25])
def test_foot_that_would_land_in_a_riser_is_held_off_before_it_gets_there(over):
    _, terrain = block(0.3, edge=-0.7)
    hips, local, labels = climb(0.3, low=0.3, over=over)
    before, _ = forward_kinematics(hips, local)
    positions, _ = run(hips, local, labels, terrain)

    def deep(p):
        return ((-0.7 - (p[:, TOES, 1] - 0.075)) * (p[:, TOES, 2] < 0.29)).max()

    assert deep(before) > 0.12 and deep(positions) < 0.045 and deep(positions[-20:]) < 0.005
    assert np.abs(positions[-1, TOES, 2] - TOE_HEIGHT).max() < 0.01, "stands before it"

    def jolt(p):
        return np.linalg.norm(np.diff(p[:, TOES], n=2, axis=0), axis=2).max()

    assert jolt(positions) < jolt(before) + 0.05


def test_flat_floor_is_as_before():
    hips, local, contacts = synthetic_walk(80)
    labels = np.zeros((80, 5))
    labels[:, 3:] = contacts
    flat = run(hips, local, labels, None)
    far = run(hips, local, labels, block(0.3, edge=-30.0)[1])
    np.testing.assert_allclose(flat[0], far[0], atol=1e-9)


def test_the_ground_is_felt_from_above():
    rng = np.random.default_rng(2)
    piece = furniture.make("step", rng, width=1.0, depth=0.9, height=0.45, steps=3)
    place, turn = np.array((1.0, -2.0)), 0.7
    query = furniture.cuboids([(piece, place, turn)])
    centre = np.append(place, piece.centre[2])
    volume = interaction_sensor(query, centre, piece.size, turn)
    terrain = Terrain.probe(query, volume)
    own = np.array([(0, -0.35), (0, -0.05), (0.3, 0.05), (0, 0.35), (0.45, -0.4), (0, -0.6), (0.6, 0)])
    heights = terrain.height(rotate_planar(own, np.float64(turn)) + place)
    np.testing.assert_allclose(heights, (0.15, 0.3, 0.3, 0.45, 0.15, 0, 0), atol=0.003)
    assert not Terrain() and Terrain().height(own).max() == 0
    both = merged((terrain, None, block(0.2)[1]))
    np.testing.assert_allclose(both.height(np.array(((0.0, -0.9),))), 0.2, atol=0.003)


def test_a_table_over_a_step_is_no_ground():
    top = Cuboids([((0, 0, 0), 0.0, np.array([(-1, -1, 1.0)]), np.array([(1, 1, 1.1)]))])
    volume = interaction_sensor(top, np.array((0, 0, 0.55)), np.array((2, 2, 1.1)), 0.0)
    assert not Terrain.probe(top, volume)


def test_where_the_edge_is():
    query, _ = block(0.3)
    volume = interaction_sensor(query, np.array((0, -0.9, 0.15)), np.array((1.6, 0.8, 0.3)), 0.0)
    assert edge_before(volume, np.array((0.1, -0.9)), 0.0) == pytest.approx(0.4)
    assert edge_before(volume, np.array((0.1, -1.8)), 0.0) == pytest.approx(1.3)
    assert edge_before(volume, np.array((0.0, -0.9)), np.pi / 2) == pytest.approx(0.8)
    assert heading_quat(np.array(0.0))[0] == 1
