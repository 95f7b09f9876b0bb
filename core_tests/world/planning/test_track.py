"""Lines that are kept to: slower in bends, around what cuts them, measured pass by pass."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.errors import GoalError
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.along import around_things
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.planning.track import Track, off_line

STRAIGHT = np.array(((0.0, 0.0), (4.0, 0.0)))


def ring(radius: float, rounds: int = 1) -> np.ndarray:
    a = np.linspace(0, 2 * np.pi * rounds, 200 * rounds + 1)
    return radius * np.stack((np.cos(a), np.sin(a)), -1)


def previewed(track: Track, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    places, _, pace = track.preview(track.speed, tuple(range(int(30 * seconds))))
    return places, pace


def test_bends_are_gone_slower_and_from_afar():
    straight, tight = previewed(Track(STRAIGHT, 0.0, 1.4), 1.0)[1], previewed(Track(ring(0.5), 0.0, 1.4), 3.0)
    assert straight.min() == pytest.approx(1.4)
    assert np.median(tight[1]) == pytest.approx(np.sqrt(0.9 * 0.5), rel=0.1)
    assert np.linalg.norm(tight[0], axis=1) == pytest.approx(0.5, abs=0.01)
    corner = Track(np.array(((0.0, 0), (3, 0), (3, 3))), 0.0, 1.4)
    places, pace = previewed(corner, 4.0)
    at = int(np.argmin(np.linalg.norm(places - (3, 0), axis=1)))
    assert pace[at] < 0.75 and (np.diff(pace[:at]) > -2 * 1.3 / 30 * 1.01).all(), "it slows down before"


def test_what_leads_moves_against_a_drift():
    track = Track(STRAIGHT, 0.0, 1.2)
    for x in np.linspace(0.1, 1.5, 40):
        track.advance(np.array((x, 0.05)))
    places = previewed(track, 1.5)[0]
    assert places[0, 1] < -0.01 and abs(previewed(track, 6.0)[0][-1, 1]) < 1e-6, "at its end the place counts"


def test_distances_belong_to_their_pass():
    line = ring(1.0, 2)
    track = np.concatenate((np.linspace((0.0, -2.0), (1.0, 0.0), 40), ring(1.1), ring(0.8)))
    away = off_line(line, track)
    assert away[20:180] == pytest.approx(0.1, abs=0.02) and away[220:380] == pytest.approx(0.2, abs=0.02)


def plan(*boxes) -> FloorPlan:
    return FloorPlan(Cuboids([((x, y), 0.0, [low], [high]) for x, y, low, high in boxes]), ((-3, -3), (7, 3)))


BOX = (2.0, 0.0, (-0.3, -0.3, 0), (0.3, 0.3, 1))


def test_a_line_leads_around_what_cuts_it():
    free = plan(BOX)
    way, detours = around_things("Path", STRAIGHT, free)
    assert free.clearance(way).min() > free.radius - 0.06 and len(detours) == 1
    assert np.linalg.norm(detours[0].middle - (2, 0)) < 0.1 and "(2.00, " in str(detours[0])
    assert (way[:8, 1] == 0).all() and (way[-8:, 1] == 0).all()
    same, none = around_things("Path", STRAIGHT + (0, 2), free)
    assert not none and same[[0, -1]] == pytest.approx(STRAIGHT + (0, 2))


@pytest.mark.parametrize(
    ("line", "boxes", "told"),
    [
        (STRAIGHT, [(2.0, 0.0, (-0.3, -9, 0), (0.3, 9, 1))], r"Path is cut at \(2\.00.*no way leads around"),
        (STRAIGHT + (2, 0), [BOX], r"The start of Path at \(2\.00"),
        (STRAIGHT[::-1] + (2, 0), [BOX], r"The end of Path at \(2\.00"),
    ],
)
def test_the_spot_is_named_where_it_cannot_be_gone(line, boxes, told):
    with pytest.raises(GoalError, match=told):
        around_things("Path", line, plan(*boxes))
