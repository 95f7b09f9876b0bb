"""Stairs in what is composed: feet on the treads, nothing of the body in the flight, and a floor that
rises.
"""

from functools import cache

import captures
import numpy as np
import pytest

from nsm_core.body.contacts import TOES
from nsm_core.body.skeleton import HIPS, TOE_HEIGHT, forward_kinematics
from nsm_core.body.thin_capsules import thin_depths
from nsm_core.conventions import CLIMB, FOOT_CONTACTS, FPS
from nsm_core.data.export import take_arrays
from nsm_core.data.scenarios.composer import Composer
from nsm_core.signals import intervals
from nsm_core.world.scene.furniture import cuboids

pytestmark = pytest.mark.slow


@cache
def _takes(folder):
    composer = Composer(captures.source(folder), {"stairs": 1.0})
    found = [take for take in map(composer.compose, range(4)) if take is not None and take.flights]
    assert len(found) >= 2
    return found


@pytest.fixture(scope="module")
def takes(tmp_path_factory):
    return _takes(captures.capture_folder(tmp_path_factory))


def _world(take):
    hips = take.hips + take.level[:, None] * (0, 0, 1)
    return hips, forward_kinematics(hips, take.rotations)[0]


def _solids(take):
    return cuboids([(f.furniture, f.position, f.heading) for f in take.flights])


def test_flights_are_gone_up_and_down_by_the_height_of_their_risers(takes):
    ways = set()
    for take in takes:
        rising = [r for r in intervals(np.abs(np.gradient(take.level)) > 1e-4) if r[1] - r[0] > FPS]
        assert len(rising) == len(take.flights)
        for (a, b), flight in zip(rising, take.flights, strict=True):
            change = take.level[min(b, len(take) - 1)] - take.level[a - 1]
            assert abs(change) == pytest.approx(float(flight.furniture.maxs[:, 2].max()), abs=0.01)
            ways.add(change > 0)
            assert take.labels[a + 10 : b - 10, CLIMB].mean() > 0.8
        assert np.abs(np.diff(take.level)).max() < 0.03  # no jump
    assert ways == {True, False}


def test_feet_stand_on_the_treads_and_in_place(takes):
    off, speeds = [], []
    for take in takes:
        _, joints = _world(take)
        solids, on = _solids(take), take.contacts[:, FOOT_CONTACTS] > 0.5
        climbing = take.labels[:, CLIMB] > 0.9
        for side in (0, 1):
            speed = np.linalg.norm(np.gradient(joints[:, TOES[side]], axis=0), axis=1) * FPS
            for a, b in intervals(on[:, side] & climbing):
                if b - a > 4:
                    toe = np.median(joints[a:b, TOES[side]], axis=0) - (0, 0, TOE_HEIGHT)
                    off.append(abs(float(solids.signed_distance(toe[None].astype(np.float32), 0.2)[0])))
                    speeds.append(speed[a + 1 : b - 1].mean())
    # Before the lowest riser one stands on the floor, which is no part of the flight.
    assert len(off) > 15 and np.mean(np.array(off) < 0.01) > 0.7
    assert np.median(speeds) < 0.02


def test_nothing_of_the_body_is_in_a_flight_and_hips_rise_without_a_jolt(takes):
    for take in takes:
        hips, joints = _world(take)
        assert thin_depths(hips, take.rotations, _solids(take)).max() < 0.06
        pace = np.gradient(joints[:, HIPS, 2]) * FPS
        assert np.abs(np.gradient(pace) * FPS)[take.labels[:, CLIMB] > 0.5].max() < 12  # m/s2


def test_what_is_written_is_told_over_the_floor_that_rises(takes):
    for take in takes[:1]:
        arrays = take_arrays(take)
        height = arrays["joint_position"][:, HIPS, 2]
        assert 0.6 < height.min() and height.max() < 1.1
        ahead = arrays["environment"].reshape(len(take), 8, -1)
        climbing, rises = take.labels[:, CLIMB] > 0.9, np.gradient(take.level)
        up, down = climbing & (rises > 1e-3), climbing & (rises < -1e-3)
        # Who goes up has treads before himself, who goes down none.
        seen = ahead[:, 1, 0]
        assert not up.any() or seen[up].mean() > 60
        assert not down.any() or seen[down].mean() < 20
