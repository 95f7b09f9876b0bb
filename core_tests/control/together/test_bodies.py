"""Other characters as solids: distances to their spheres, in worlds of other scales, and depths of pairs."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.capsules import BUNDLED, Body
from nsm_core.control.posing import stance_of
from nsm_core.control.together.bodies import OtherProp, depths_between, spheres_distance, track_of
from nsm_core.control.together.frames import Frame
from nsm_core.model.inference.model import load_model
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.props import Prop, sense


def test_distances_to_spheres_are_exact_and_end_where_asked():
    rng = np.random.default_rng(0)
    centres, radii = rng.uniform(-0.5, 0.5, (30, 3)), rng.uniform(0.02, 0.15, 30)
    points = rng.uniform(-1.5, 1.5, (400, 3)).astype(np.float32)
    exact = (np.linalg.norm(points[:, None] - centres, axis=-1) - radii).min(1)
    found = spheres_distance(points, centres.astype(np.float32), radii.astype(np.float32), 0.4)
    np.testing.assert_allclose(found, np.minimum(exact, 0.4), atol=2e-5)
    far = spheres_distance(points + 9, centres.astype(np.float32), radii.astype(np.float32), 0.4)
    assert (far == np.float32(0.4)).all()


@pytest.fixture(scope="module")
def stand():
    height, local = stance_of(load_model(backend="numpy"))
    hips = np.zeros((4, 3)) + (0, 0, height)
    return hips, np.repeat(local[None], 4, axis=0)


def test_a_track_knows_where_the_body_is_in_each_frame_and_stays_at_its_end(stand):
    hips, local = stand
    moving = hips + np.arange(4)[:, None] * (1.0, 0, 0)
    track = track_of(moving, local, BUNDLED, Frame(), Frame())
    centre = Body.of(moving, local).centres[2, 0]
    frames = np.array([0, 2, 3, 9])
    inside = track.distance(frames, np.repeat(centre[None], 4, axis=0), 0.5) < 0
    assert inside.tolist() == [False, True, False, False]
    later = track.during(slice(2, 4))
    assert later.distance(np.array([0]), centre[None], 0.5)[0] < 0
    end = Body.of(moving, local).centres[3, 0]
    assert track.distance(np.array([50]), end[None], 0.5)[0] < 0


def test_depth_of_a_pair_is_the_same_in_a_world_of_another_scale(stand):
    hips, local = stand
    one = track_of(hips, local, BUNDLED, Frame(), Frame())
    near, apart = (track_of(hips + (x, 0, 0), local, BUNDLED, Frame(), Frame()) for x in (0.3, 1.2))
    deep = depths_between(one, near)
    assert deep.shape == (4,) and 0.01 < deep.max() < 0.3
    assert depths_between(one, apart).max() == 0
    child = Frame(0.5, 0.2)
    seen = [track_of(hips + (x, 0, 0), local, BUNDLED, Frame(), child) for x in (0.0, 0.3)]
    np.testing.assert_allclose(depths_between(*seen) * 0.5, deep, atol=1e-4)


def test_a_thing_is_seen_in_its_size_where_it_was_put():
    cube = Cuboids([((0, 0, 0), 0.0, [(-0.2, -0.2, -0.2)], [(0.2, 0.2, 0.2)])])
    box = Prop("Box", cube, sense(cube, (-0.2,) * 3, (0.2,) * 3), np.array((1.0, 0.0, 0.2, 0.3)))
    thing = OtherProp(box, Frame(), Frame(0.5, 0.0))  # for one half as large it is twice as large
    np.testing.assert_allclose(thing.pose, (2.0, 0.0, 0.4, 0.3))
    points = np.array(((2.0, 0.0, 0.9), (2.0, 0.0, 0.4)), dtype=np.float32)
    np.testing.assert_allclose(thing.signed_distance(points, 1.0), (0.1, -0.4), atol=1e-5)
    assert thing.settled and not setattr(thing, "held", True) and not thing.settled
    box.pose = np.array((3.0, 1.0, 0.2, 0.0))
    np.testing.assert_allclose(thing.pose[:2], (6.0, 2.0))
