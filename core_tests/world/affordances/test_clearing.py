"""Where light things may rest, and which one is put aside for another that it blocks."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.errors import GoalError
from nsm_core.world.affordances.clearing import plan_clearing
from nsm_core.world.affordances.picking import Around, plan_picking
from nsm_core.world.affordances.resting import resting_places
from nsm_core.world.geometry.distance import Cuboids, Union
from nsm_core.world.scene.small_things import make_thing

BOARD = 1.0
PLACE = np.array((0.45, 0.15, BOARD))
REFUSED = GoalError("The jar cannot be taken.")


def niche():
    """A board with a niche on it that is open towards -Y, 26 cm wide and 20 cm high."""
    low = (-0.7, 0.0, 0.95), (-0.16, 0.0, 1.0), (0.13, 0.0, 1.0), (-0.16, 0.0, 1.2), (-0.7, 0.42, 0.0)
    high = (0.7, 0.42, 1.0), (-0.13, 0.42, 1.2), (0.16, 0.42, 1.2), (0.16, 0.42, 1.23), (0.7, 0.45, 1.5)
    return Cuboids([((0.0, 0.0, 0.0), 0.0, np.array(low), np.array(high))])


def things():
    rng = np.random.default_rng(3)
    jar = make_thing("spice jar", rng, (0.0, 0.3, BOARD, 0.0), "jar")
    tin = make_thing("tin", rng, (0.0, 0.12, BOARD, 0.0), "tin")
    far = make_thing("mug", rng, (0.6, 0.2, BOARD, 0.0), "mug")
    return jar, tin, far


def without(solids, every):
    def around(gone):
        names = {one.name for one in gone}
        standing = Union([solids, *(one for one in every if one.name not in names)])
        return Around(standing, standing, lambda places: np.full(len(places), np.inf))

    return around


def test_things_rest_where_the_foot_is_borne_and_nothing_is_beside_or_over_it():
    solids, (jar, _, far) = Union([niche(), things()[2]]), things()
    places = resting_places(jar, solids, np.array((0.3, 0.2, BOARD)), 0.6, 0.4)
    assert len(places) > 5
    heights = np.unique(places[:, 2].round(2))
    np.testing.assert_allclose(heights, (BOARD, 1.23), atol=4e-3)  # the board, and the niche's top
    half = float(np.linalg.norm(jar.size[:2])) / 2
    assert (places[:, 1] > half - 0.01).all() and (places[:, 0] < 0.7 - half + 0.01).all()  # not over an edge
    assert (np.linalg.norm(places[:, :2] - far.pose[:2], axis=1) > half + 0.05).all()
    assert len(resting_places(jar, solids, np.array((0.0, -2.0, BOARD)), 0.6, 0.4)) == 0


def test_what_blocks_a_thing_is_put_where_it_blocks_it_no_more():
    solids, every = niche(), things()
    jar, tin, far = every
    around = without(solids, every)
    with pytest.raises(GoalError):
        plan_picking(jar, PLACE, around([jar]))
    found = plan_clearing(jar, PLACE, [far, tin], around, REFUSED)
    ((moved, picking),) = found.aside
    assert moved is tin and np.linalg.norm(picking.pose[:2] - tin.pose[:2]) > 0.15
    put = tin.put(picking.pose)
    assert solids.signed_distance(put.middle[None].astype(np.float32), 0.5)[0] > 0.03
    then = without(solids, [jar, put, far])
    plan_picking(jar, PLACE, then([jar]))  # which raised before


def test_where_nothing_that_may_be_moved_helps_the_first_reason_is_told():
    jar, tin, far = things()
    with pytest.raises(GoalError) as told:
        plan_clearing(jar, PLACE, [far], without(niche(), (jar, tin, far)), REFUSED)
    assert told.value is REFUSED
