"""Bodies that go down for what a hand takes low: they reach, stay outside of the shelf, and never jump."""

from __future__ import annotations

from dataclasses import replace

import captures
import numpy as np
import pytest

from nsm_core.body.capsules import BUNDLED
from nsm_core.body.contacts import ANKLES
from nsm_core.body.ik.clearance import Obstacle
from nsm_core.body.ik.footsteps import Footsteps
from nsm_core.body.ik.solver import Pose
from nsm_core.body.skeleton import ARMS, FEET, INDEX
from nsm_core.control.crouching import Crouched, crouched
from nsm_core.conventions import DT
from nsm_core.rotations import quat_from_rotvec
from nsm_core.world.geometry.distance import Cuboids

FRAMES, WORKS, HAND = 120, slice(50, 70), 1
REACH = 0.5  # metres from a shoulder
EDGE = -0.42  # metres before who stands at the origin and faces -Y: where boards begin
BOARDS = (0.08, 0.45, 0.8, 1.15, 1.5)  # metres over the floor, of a shelf


@pytest.fixture
def standing() -> Pose:
    """A body that stands at the origin with its arms hanging."""
    hips, local = captures.stand(FRAMES)
    for arm, turn in zip(ARMS, (-1.5, 1.5), strict=True):
        local[:, arm[0]] = quat_from_rotvec(np.array((0.0, turn, 0.0)))
    return Pose(BUNDLED.tree, hips.astype(float), local.astype(float))


def asked(pose: Pose, height: float, within: float = REACH) -> Crouched:
    """A left hand that is wanted inside of the shelf, so high, for a while."""
    feet = Footsteps(pose.positions[:, ANKLES], pose.world[:, ANKLES], np.ones((FRAMES, 2), bool), ([], []))
    reach = np.full((FRAMES, 2), np.inf)
    reach[WORKS, HAND] = within
    return Crouched(np.zeros(FRAMES), feet, np.tile((0.1, EDGE - 0.08, height), (FRAMES, 2, 1)), reach)


def shelf() -> Obstacle:
    mins = np.array([(-0.5, EDGE - 0.3, z) for z in BOARDS])
    return Obstacle(Cuboids([((0, 0, 0), 0.0, mins, mins + (1.0, 0.3, 0.02))]))


def depth(pose: Pose, solid: Obstacle) -> np.ndarray:
    """How deep (T,) the body but its arms is in a solid, metres."""
    centres, radii = BUNDLED.spheres.of(pose.positions, pose.world)
    own = [k for k, n in enumerate(BUNDLED.spheres.names) if not any(a in n for a in ("Elbow", "Wrist"))]
    far = solid.distance(np.repeat(np.arange(FRAMES), len(own)), centres[:, own].reshape(-1, 3), 0.2)
    return (radii[:, own] - far.reshape(FRAMES, -1)).max(1)


@pytest.mark.parametrize("height", [0.55, 0.65])
def test_one_goes_down_before_a_shelf_and_not_into_it(standing, height):
    who, solid = asked(standing, height), shelf()
    assert who.lack(standing, np.arange(FRAMES))[WORKS].min() > 0.2
    down = crouched(standing, who, [solid], BUNDLED)
    lack = who.lack(down, np.arange(FRAMES))[WORKS]  # a hand that is wanted at once is waited for
    assert lack[6:-6].max() < 0.06  # the solver gives the rest
    assert depth(down, solid).max() < 0.01
    # Who would only bow comes into it.
    bowed = who.down(standing, np.arange(FRAMES), np.tile((0.0, 0.0, 1.4), (FRAMES, 1)))
    assert depth(bowed, solid).max() > 0.03
    pace = np.linalg.norm(np.diff(down.positions, axis=0), axis=-1) / DT
    assert pace[:, 0].max() < 1.5 and pace[:, INDEX["Head"]].max() < 3.0
    # Feet stand, one is not twisted, and stands upright before and after.
    assert down.positions[:, ANKLES] == pytest.approx(standing.positions[:, ANKLES], abs=1e-3)
    shoulders, hips = (
        down.positions[:, one[1]] - down.positions[:, one[0]]
        for one in ([arm[0] for arm in ARMS], [leg[0] for leg in FEET])
    )
    turned = np.arctan2(shoulders[:, 1], shoulders[:, 0]) - np.arctan2(hips[:, 1], hips[:, 0])
    assert np.ptp(turned) < np.radians(8)
    assert down.positions[[0, -1]] == pytest.approx(standing.positions[[0, -1]], abs=1e-3)


def test_who_reaches_as_he_stands_stays_as_he_is(standing):
    who = asked(standing, 1.35, 0.6)
    assert who.lack(standing, np.arange(FRAMES)).max() == 0.0
    assert crouched(standing, who, [shelf()], BUNDLED) is standing


def test_a_head_stays_up_and_arms_hang_as_one_pitches(standing):
    frames = np.arange(FRAMES)
    down = asked(standing, 0.5).down(standing, frames, np.tile((0.3, 0.1, 1.0), (FRAMES, 1)))
    up = {name: down.world[0, INDEX[name]] for name in ("Chest4", "Head", "RightShoulder")}
    was = {name: standing.world[0, INDEX[name]] for name in up}
    turned = {name: 2 * np.degrees(np.arccos(min(1.0, abs(up[name] @ was[name])))) for name in up}
    assert turned["Chest4"] == pytest.approx(np.degrees(1.0), abs=1.0)
    assert turned["Head"] == pytest.approx(np.degrees(0.5), abs=1.0)
    assert turned["RightShoulder"] < 10
    knees = down.positions[0, [leg[1] for leg in FEET], 0]
    assert np.ptp(knees) > np.ptp(standing.positions[0, [leg[1] for leg in FEET], 0]) + 0.1


def test_an_arm_that_hangs_swings_back_before_a_worktop(standing):
    frames = np.arange(FRAMES)
    who = replace(asked(standing, 0.95), targets=np.tile((0.1, -0.8, 0.95), (FRAMES, 2, 1)))
    worktop = Obstacle(Cuboids([((0, 0, 0), 0.0, [(-1.0, -0.9, 0.0)], [(1.0, -0.14, 0.86)])]))
    side, arm = BUNDLED.spheres, 1 - HAND

    def forearm(pose: Pose) -> float:
        centres, radii = side.of(pose.positions, pose.world)
        own = np.flatnonzero((side.forearm == arm) | (side.hand == arm))
        far = worktop.distance(np.repeat(frames, len(own)), centres[:, own].reshape(-1, 3), 0.2)
        return float((radii[:, own] - far.reshape(FRAMES, -1)).max())

    down = crouched(standing, who, [worktop], BUNDLED)
    assert forearm(down) < 0.01
    # As it hung it would be in there.
    pitch = np.tile((0.0, 0.1, 0.9), (FRAMES, 1))
    assert forearm(who.down(standing, frames, pitch)) > 0.02
    wrist = np.diff(down.positions[:, ARMS[arm][2]], axis=0)
    assert np.linalg.norm(wrist, axis=1).max() / DT < 3.0
