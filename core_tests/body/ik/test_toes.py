"""Toes that bend up where a foot that rolls off would have them in the floor."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.capsules import BUNDLED
from nsm_core.body.contacts import ANKLES, TOES
from nsm_core.body.ik.footsteps import FootGround
from nsm_core.body.ik.toes import bent_up
from nsm_core.body.skeleton import OFFSETS, J
from nsm_core.rotations import quat_from_rotvec, quat_rotate
from nsm_core.world.scene.terrain import Terrain

FRAMES = 9


def rolling(raised: float = 0.0):
    """Feet that roll over their toes by up to 60 degrees, the toe joints as high as when they stand."""
    turns = np.zeros((FRAMES, J, 3))
    turns[:, ANKLES, 0] = np.linspace(0, np.radians(60), FRAMES)[:, None]
    local = quat_from_rotvec(turns)
    hips = np.tile(OFFSETS[0].astype(float), (FRAMES, 1))
    low = BUNDLED.tree.forward(hips, local)[0][:, TOES[0], 2]
    hips[:, 2] += BUNDLED.sole.toe_height - low + raised
    return hips, local


def lowest(hips, local) -> np.ndarray:
    """Of the foremost spheres of the toes, metres over the floor (T,)."""
    positions, world = BUNDLED.tree.forward(hips, local)
    centre, radius = BUNDLED.tip
    ways = quat_rotate(world[:, TOES], np.broadcast_to(centre, (FRAMES, 2, 3)))
    return (positions[:, TOES] + ways)[..., 2].min(1) - radius


def test_toes_stay_on_the_floor_and_only_they_turn():
    flat = FootGround(Terrain(), Terrain(), np.zeros(FRAMES))
    hips, local = rolling()
    assert lowest(hips, local)[-1] < -0.02
    out = bent_up(BUNDLED, hips, local, flat)
    assert lowest(hips, out).min() > -1e-3
    others = [j for j in range(J) if j not in TOES]
    assert out[:, others] == pytest.approx(local[:, others])
    steps = np.degrees(2 * np.arccos(np.clip(np.abs((out[1:, TOES[0]] * out[:-1, TOES[0]]).sum(-1)), 0, 1)))
    assert 0 < steps.max() < 15  # as the foot rolls, no pop


def test_toes_in_the_air_stay_as_they_are():
    flat = FootGround(Terrain(), Terrain(), np.zeros(FRAMES))
    hips, local = rolling(0.1)
    assert bent_up(BUNDLED, hips, local, flat) == pytest.approx(local)
