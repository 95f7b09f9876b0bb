"""Flights of stairs: treads where they are, and a floor that rises evenly through their middles."""

import numpy as np
import pytest

from nsm_core.world.scene.furniture import cuboids
from nsm_core.world.scene.furniture.flight import flight_piece
from nsm_core.world.scene.stairs import Flight, Stairs

FLIGHT = Flight(np.array((1.0, -2.0)), 0.7, 1.2, 0.28, 0.17, 5, 0.3)


def test_a_flight_has_as_many_treads_as_risers_and_ends_on_its_landing():
    along = FLIGHT.tread * (np.arange(-1, 7) + 0.5)
    expected = 0.3 + 0.17 * np.array((0, 1, 2, 3, 4, 5, 5, 5))
    np.testing.assert_allclose(FLIGHT.heights(along), expected)
    assert FLIGHT.length == pytest.approx(4 * 0.28) and FLIGHT.rise == pytest.approx(0.85)
    np.testing.assert_allclose(FLIGHT.local(FLIGHT.at(0.4, -0.3)), (0.4, -0.3), atol=1e-9)
    np.testing.assert_allclose(FLIGHT.local(FLIGHT.top), (FLIGHT.length, 0), atol=1e-9)


def test_the_floor_rises_evenly_through_the_middles_of_the_treads():
    middles = FLIGHT.tread * (np.arange(1, 4) + 0.5)
    np.testing.assert_allclose(FLIGHT.level(middles), FLIGHT.heights(middles), atol=1e-9)
    along = np.linspace(-1.5, 3, 500)
    level = FLIGHT.level(along)
    assert level[0] == pytest.approx(0.3) and level[-1] == pytest.approx(0.3 + FLIGHT.rise)
    slope = np.diff(level) / np.diff(along)
    assert (slope >= -1e-9).all() and slope.max() == pytest.approx(0.17 / 0.28, abs=1e-6)
    assert np.abs(np.diff(slope)).max() < 0.02  # no edge


def test_the_map_of_its_treads_is_what_stands_there():
    piece = flight_piece(FLIGHT, (1.0, 0.3))
    query = cuboids([(piece, np.append(FLIGHT.foot, 0.3), FLIGHT.heading + np.pi)])
    stairs = Stairs([FLIGHT])
    for k in range(4):
        for aside in (-0.5, 0.0, 0.5):
            place = FLIGHT.at((k + 0.5) * FLIGHT.tread, aside)
            height = float(stairs.terrain.height(place[None])[0])
            assert height == pytest.approx(0.3 + 0.17 * (k + 1))
            over, under = (
                query.signed_distance(np.append(place, height + d)[None].astype(np.float32), 1.0)
                for d in (0.03, -0.03)
            )
            assert over[0] == pytest.approx(0.03, abs=1e-4) and under[0] < 0
    assert stairs.terrain.height(FLIGHT.at(-0.1)[None])[0] == 0
    plates = flight_piece(FLIGHT, plate=0.05)
    hollow = cuboids([(plates, np.append(FLIGHT.foot, 0.3), FLIGHT.heading + np.pi)])
    low = np.append(FLIGHT.at(3.5 * FLIGHT.tread), 0.5)[None].astype(np.float32)
    assert hollow.signed_distance(low, 1.0)[0] > 0 > query.signed_distance(low, 1.0)[0]


def test_one_who_walks_beside_a_flight_stays_on_the_floor():
    stairs = Stairs([FLIGHT])
    middle = FLIGHT.length / 2
    levels = stairs.level(np.stack([FLIGHT.at(middle, x) for x in (0.0, 0.55, 0.9)]))
    assert levels[0] == pytest.approx(levels[1]) and levels[0] > 0.6 and levels[2] == 0
    assert not Stairs() and not Stairs().level(np.zeros((2, 2))).any()
