"""Hands that are led: how firmly and whereto, how they are given back, and what arms lack."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.skeleton import ARM_LENGTH, J
from nsm_core.control.actions.hold import (
    GONE,
    LEAN,
    LEAN_FURTHER,
    LET_GO_TIME,
    NEAR,
    SHIFT,
    TAKE_TIME,
    WAIT,
    Hold,
    SeenBody,
)
from nsm_core.conventions import FPS

TAKES, RETURNS = round(TAKE_TIME * FPS), round(LET_GO_TIME * FPS)


def seen(wrists, hips=(0.0, 0.0, 0.9)) -> SeenBody:
    """A body in the rest pose; what leads hands looks at its shoulders alone."""
    local = np.zeros((J, 4))
    local[:, 0] = 1
    return SeenBody(np.array(hips), local, np.asarray(wrists, dtype=np.float64))


WRISTS = seen(np.zeros((2, 3))).shoulders + np.array((0.0, -0.4, -0.2))
PLACES = WRISTS + (0.0, -0.06, 0.05)


def drawn(hold: Hold, label: float = 0.0) -> int:
    """Frames until its hands are at their places in full."""
    for frame in range(1, 200):
        hold.approach(np.linalg.norm(PLACES - WRISTS, axis=1)[hold.hands], np.full(len(hold.hands), label))
        hold.apply(seen(WRISTS), PLACES[hold.hands])
        if hold.weight >= 1:
            return frame
    raise AssertionError("never drawn")


def test_a_hand_that_is_not_held_is_not_led():
    hold = Hold([0, 1])
    hold.apply(seen(WRISTS), PLACES)
    assert not hold.busy and not hold.leads and np.isinf(hold.lacking)


def test_hands_are_drawn_onto_their_places_in_time_and_smoothly():
    hold, led = Hold([1]), []
    for _ in range(3 * TAKES):
        hold.approach(np.array((0.05,)), np.zeros(1))
        hold.apply(seen(WRISTS), PLACES[1:])
        (lead,) = hold.leads
        assert lead.hand == 1
        led.append((lead.share, *lead.target))
    shares, targets = np.array(led)[:, 0], np.array(led)[:, 1:]
    assert (np.diff(shares) >= 0).all() and shares[0] < 0.1 and np.diff(shares).max() < 0.2
    assert shares[TAKES + 1] == 1 and shares[TAKES - 3] < 1
    # As firmly as it is led, it is on the straight way from where the network has it.
    np.testing.assert_allclose(targets, WRISTS[1] + shares[:, None] * (PLACES[1] - WRISTS[1]), atol=1e-12)


def test_what_is_far_off_is_not_drawn_and_what_stays_near_or_touches_is():
    far, near = Hold([0]), Hold([0])
    for frame in range(12):
        far.approach(np.array((NEAR + 0.05,)), np.zeros(1))
        near.approach(np.array((NEAR - 0.05,)), np.zeros(1))
        if frame < 8:
            assert near.weight == 0, "it may only be passing"
    assert far.weight == 0 and near.weight > 0
    far.approach(np.array((NEAR + 0.05,)), np.ones(1))
    assert far.weight > 0, "a hand that says it holds is taken at its word"
    before = near.weight
    near.approach(np.array((GONE - 0.05,)), np.zeros(1))
    assert near.weight > before
    near.approach(np.array((GONE + 0.05,)), np.zeros(1))
    assert near.weight < before + 0.2
    for _ in range(RETURNS + 1):
        near.approach(np.array((GONE + 0.05,)), np.zeros(1))
    assert near.weight == 0


def test_a_hand_that_says_it_holds_is_quick_and_one_led_far_is_slow():
    assert drawn(Hold([0, 1]), label=1.0) < drawn(Hold([0, 1])) < drawn(Hold([0, 1], further=0.3))


def test_all_hands_have_to_be_near():
    hold = Hold([0, 1])
    for _ in range(20):
        hold.approach(np.array((0.02, NEAR + 0.02)), np.array((1.0, 0.0)))
    assert hold.weight == 0


def test_the_offset_fades_after_release_so_that_hands_go_on_with_the_body():
    hold = Hold([0, 1])
    drawn(hold)
    hold.release()
    assert hold.busy and hold.weight == 0
    offsets, rise = [], np.zeros(3)
    for _ in range(RETURNS + 2):
        rise = rise + (0.0, 0.0, 0.04)
        hold.apply(seen(WRISTS + rise), PLACES)  # the places stay behind
        offsets.append([lead.target - w for lead, w in zip(hold.leads, WRISTS + rise, strict=True)])
        if not hold.busy:
            break
    assert RETURNS - 2 <= len(offsets) <= RETURNS + 1
    left = np.array(offsets[:-1])
    share = left @ (PLACES - WRISTS)[0] / float((PLACES - WRISTS)[0] @ (PLACES - WRISTS)[0])
    assert share[0].min() > 0.9 and (np.diff(share, axis=0) < 0).all() and share[-1].max() < 0.1
    np.testing.assert_allclose(left, share[..., None] * (PLACES - WRISTS)[0], atol=1e-12)
    assert np.abs(np.diff(share, axis=0)).max() < 0.2


def test_hands_that_take_hold_anew_do_not_jump():
    hold, led = Hold([0, 1]), []
    for frame in range(40):
        if frame == 15:
            hold.release()
        if frame < 15 or frame > 18:
            hold.approach(np.full(2, 0.05), np.zeros(2))
        hold.apply(seen(WRISTS), PLACES if frame < 15 else PLACES + (0.05, 0.0, 0.0))
        led.append([lead.target for lead in hold.leads])
    step = np.linalg.norm(np.diff(np.array(led), axis=0), axis=2)
    assert step.max() < 0.03
    np.testing.assert_allclose(led[-1], PLACES + (0.05, 0.0, 0.0), atol=1e-12)


@pytest.mark.parametrize(("further", "give"), [(0.0, SHIFT + LEAN), (0.2, SHIFT + LEAN + 0.2 * LEAN_FURTHER)])
def test_what_arms_lack_is_told_once_they_are_held(further, give):
    """A place 5 cm further than arm, trunk and hips reach, straight ahead of each shoulder."""
    hold, shoulders = Hold([0, 1], further), seen(WRISTS).shoulders
    ahead = np.array((0.0, -(ARM_LENGTH + give + 0.05), 0.0))
    hold.weight = 0.9
    hold.apply(seen(WRISTS), shoulders + ahead)
    assert np.isinf(hold.lacking), "on its way a hand tells nothing"
    hold.weight = 1.0
    hold.apply(seen(WRISTS), shoulders + ahead)
    assert hold.lacking == pytest.approx(0.05)
    hold.lean_share = 0.0  # no room to lean
    hold.apply(seen(WRISTS), shoulders + ahead)
    assert hold.lacking == pytest.approx(0.05 + LEAN)


def test_hands_hold_once_they_are_there_and_what_they_lack_is_waited_for_not_for_long():
    reaching, short = Hold([0, 1]), Hold([0, 1])
    drawn(reaching)
    assert reaching.complete(True)
    drawn(short)
    far = seen(WRISTS).shoulders + (0.0, -2.0, 0.0)
    short.apply(seen(WRISTS), far)
    waited = 0
    while not short.complete(True):
        waited += 1
    assert waited == WAIT
    without = Hold([0, 1])
    drawn(without)
    without.apply(seen(WRISTS), far)
    assert without.complete(False), "a body that is left alone leans to nothing"
