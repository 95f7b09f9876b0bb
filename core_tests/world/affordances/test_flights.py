"""Flights of stairs are found in the faces of a scene, and only where there are some."""

import numpy as np
import pytest

from nsm_core.rotations import rotate_planar, wrap_angle
from nsm_core.world.affordances.flights import find_stairs
from nsm_core.world.scene import furniture
from nsm_core.world.scene.furniture.flight import flight_piece
from nsm_core.world.scene.stairs import Flight

FLIGHT = Flight(np.array((0.5, -1.0)), 0.4, 1.1, 0.28, 0.17, 6)


def corners(piece, place, turn):
    return (rotate_planar(piece.vertices.astype(float), np.float64(turn)) + np.asarray(place))[
        piece.triangles
    ]


def built(flight, landing=(1.5, 0.5), plate=None):
    place = np.append(flight.foot, flight.base)
    return corners(flight_piece(flight, landing, plate), place, flight.heading + np.pi)


def box(low, high, flight=FLIGHT):
    """A box in the frame of a flight: across and along it, and up."""
    piece = furniture.build("box", [(low[0], high[0], low[1], high[1], low[2], high[2])], centred=False)
    return corners(piece, np.append(flight.foot, 0), flight.heading + np.pi)


def is_same(found, flight):
    np.testing.assert_allclose(found.foot, flight.foot, atol=0.01)
    assert found.steps == flight.steps and abs(wrap_angle(found.heading - flight.heading)) < 0.01
    for name in ("width", "tread", "riser", "base"):
        assert getattr(found, name) == pytest.approx(getattr(flight, name), abs=0.01), name


@pytest.mark.parametrize("plate", [None, 0.05])
def test_a_flight_is_found_among_furniture(plate):
    rng = np.random.default_rng(3)
    kinds = ("table", "chair", "shelf", "sofa", "step", "cabinet", "stool", "desk")
    pieces = [
        corners(furniture.make(k, rng), (*rng.uniform(2, 5, 2), 0.0), rng.uniform(-3, 3)) for k in kinds
    ]
    assert not find_stairs(np.concatenate(pieces)) and not find_stairs(np.zeros((0, 3, 3)))
    stairs = find_stairs(np.concatenate((built(FLIGHT, plate=plate), *pieces)))
    assert len(stairs.flights) == 1
    is_same(stairs.flights[0], FLIGHT)
    places = np.stack([FLIGHT.at(FLIGHT.length + s) for s in (0.5, 1.4, 1.6)])
    np.testing.assert_allclose(stairs.heights(places), (FLIGHT.rise, FLIGHT.rise, 0), atol=1e-6)


def test_a_flight_to_an_upper_floor_around_its_opening_ends_on_that_floor():
    # Five treads, and a floor on all sides of the opening over them.
    treads = built(Flight(FLIGHT.foot, FLIGHT.heading, 1.1, 0.28, 0.17, 5), (0.28, 0.0))
    top, x, end = FLIGHT.rise, 0.55, 5 * 0.28
    parts = [((-3, end), (3, 4)), ((-3, -3), (-x, end)), ((x, -3), (3, end)), ((-x, -3), (x, -1))]
    slab = [box((*low, top - 0.2), (*high, top)) for low, high in parts]
    stairs = find_stairs(np.concatenate((treads, *slab)))
    assert len(stairs.flights) == 1
    is_same(stairs.flights[0], FLIGHT)
    # Beside and before the flight the lower floor is what is walked on.
    places = np.stack((FLIGHT.at(FLIGHT.length + 1), FLIGHT.at(0.5, 2.0), FLIGHT.at(-2.0)))
    np.testing.assert_allclose(stairs.heights(places), (top, 0, 0), atol=1e-6)
    up, under = np.append(places[0], top), np.append(places[0], 0.0)
    floor = np.append(places[2], 0.0)
    assert stairs.lead_to(up) and not stairs.lead_to(under)
    assert stairs.asked_for(floor, [up]) is stairs and stairs.asked_for(up, [floor]) is stairs
    assert not stairs.asked_for(floor, [floor]) and not stairs.asked_for(under, [floor])


def test_a_second_flight_begins_on_the_landing_of_the_first():
    second = Flight(
        FLIGHT.at(FLIGHT.length + 1.0, 1.2), FLIGHT.heading + np.pi, 1.0, 0.27, 0.16, 4, FLIGHT.rise
    )
    floating = Flight(np.array((6.0, 6.0)), 0.0, 1.0, 0.27, 0.16, 4, 0.9)
    landing = box((-2.0, FLIGHT.length, FLIGHT.rise - 0.1), (0.6, FLIGHT.length + 2.5, FLIGHT.rise))
    parts = [built(FLIGHT, (0.1, 0.0), 0.05), landing, built(second, plate=0.05), built(floating, plate=0.05)]
    stairs = find_stairs(np.concatenate(parts[1:2] + parts[:1] + parts[2:]))
    assert sorted(f.steps for f in stairs.flights) == [4, 6]
    is_same(next(f for f in stairs.flights if f.steps == 4), second)
