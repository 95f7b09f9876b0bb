"""Boxes away from edges: where one stands, what is refused, the way over an edge and between boards."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.skeleton import J
from nsm_core.control.actions.box_grasp import Carrying
from nsm_core.control.actions.hold import SeenBody
from nsm_core.conventions import HAND_CONTACTS
from nsm_core.distances import BODY_TO_BOX
from nsm_core.errors import GoalError
from nsm_core.evaluation.measures.objects import box_in_solids
from nsm_core.evaluation.trials import carry_far
from nsm_core.evaluation.trials.together import alone
from nsm_core.model.inference.model import load_model
from nsm_core.rotations import rotate_planar
from nsm_core.world.affordances.standing import (
    BODY_TO_EDGE,
    TOES_CLEAR,
    choose_side,
    edge_before_box,
    further_off,
    require_room,
)
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.berth import Berth
from nsm_core.world.scene import furniture
from nsm_core.world.scene.props import Box, sense

SIZE = np.array((0.34, 0.3, 0.26))


def crate(pose, size=SIZE) -> Box:
    half = np.asarray(size) / 2
    query = Cuboids([((0, 0, 0), 0.0, -half[None], half[None])])
    return Box("Crate", query, sense(query, -half, half), np.asarray(pose), np.asarray(size, dtype=float))


def table(turn=0.0, width=1.4, depth=1.2, top=0.74, more=()) -> Cuboids:
    """A top whose edges lie half of ``width`` and ``depth`` from the origin, on legs; ``more`` boxes (mins,
    maxs) in its frame.
    """
    x, y = width / 2, depth / 2
    parts = [((-x, -y, top - 0.04), (x, y, top)), *more]
    parts += [
        ((sx * x - 0.03, sy * y - 0.03, 0), (sx * x + 0.03, sy * y + 0.03, top))
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    low, high = (np.array([p[k] for p in parts]) for k in (0, 1))
    return Cuboids([((0, 0), turn, low, high)])


def on_table(edge: float, turn=0.0, depth=1.2, top=0.74) -> Box:
    """A crate whose face towards +Y of the table is ``edge`` metres from the edge there; its carrier faces -Y
    of the table.
    """
    place = rotate_planar(np.array((0.0, depth / 2 - edge - SIZE[1] / 2, 0.0)), np.float64(turn))
    return crate((*place[:2], top + SIZE[2] / 2, turn))


@pytest.mark.parametrize("turn", [0.0, 0.7])
@pytest.mark.parametrize("edge", [0.02, 0.08, 0.2, 0.3])
def test_one_stands_outside_of_the_edge_and_not_further_than_needed(edge, turn):
    box, solids = on_table(edge, turn), table(turn)
    assert edge_before_box(box, 0.0, box.pose[:3], turn, solids) == pytest.approx(edge, abs=0.015)
    facing, stand, further = choose_side(
        box, None, rotate_planar(np.array((0.0, 3.0)), np.float64(turn)), solids=solids
    )
    assert facing == 0.0 and further == pytest.approx(max(0.0, edge + BODY_TO_EDGE - BODY_TO_BOX), abs=0.015)
    own = rotate_planar(stand, np.float64(-turn))
    assert own[1] - 0.6 > BODY_TO_EDGE - 0.02 and abs(own[0]) < 1e-6


def test_from_a_box_on_the_floor_toes_keep_off():
    floor = crate((0, 0, SIZE[2] / 2, 0.0))
    assert further_off(floor, 0.0, floor.pose[:3], 0.0, Cuboids()) == TOES_CLEAR
    assert further_off(floor, 0.0, (0, 0, 0.9), 0.0, Cuboids()) == 0


def test_what_no_body_leans_to_is_refused_with_its_distance():
    box = on_table(0.45)
    with pytest.raises(
        GoalError, match=r"^Crate lies 0\.4[56] m behind the edge before it; a body leans 0\.\d\d m .*\.$"
    ):
        choose_side(box, None, np.array((0.0, 3.0)), solids=table())
    with pytest.raises(GoalError, match=r"^Crate lies 45\.\d\d m"):
        choose_side(box, None, np.array((0.0, 3.0)), solids=table(), scale=100.0)


def test_places_between_things_are_refused_or_right():
    shelf = carry_far.inner_shelf(np.random.default_rng(0), 0.8, 0.8, 0.4, 0.4)
    solids, box = furniture.cuboids([(shelf, np.zeros(2), np.pi)]), crate((5, 5, 0.13, 0.0))
    place = np.array((0.0, 0.2 - 0.05 - SIZE[1] / 2, 0.8 + SIZE[2] / 2, 0.0))  # its open front looks to +Y
    require_room(box, place, solids, "The place")
    assert further_off(box, 0.0, place[:3], 0.0, solids) < 0.05
    with pytest.raises(GoalError, match="^The place is shut off by something"):  # through its back
        further_off(box, 0.0, place[:3], np.pi, solids, "The place")
    assert choose_side(box, None, np.array((0.0, 3.0)), place, solids)[0] == 0.0  # and it is taken from there
    with pytest.raises(GoalError, match="room over Crate, too little to lift it out"):
        choose_side(box, None, np.array((0.0, 3.0)), place + (0, 0, 0.11, 0), solids)
    wide = crate((5, 5, 0.13, 0.0), (0.7, 0.3, 0.26))
    with pytest.raises(GoalError, match="^The place has no room beside it for the hands"):
        further_off(wide, 0.0, place[:3], 0.0, solids, "The place")
    with pytest.raises(GoalError, match="^The place is taken by something"):
        require_room(box, place + (0.3, 0, 0, 0), solids, "The place")
    low = place - (0, 0, 0.37, 0)
    with pytest.raises(GoalError, match="nobody bends into"):
        further_off(box, 0.0, low[:3], 0.0, solids)
    with pytest.raises(GoalError, match="too little room above"):
        require_room(crate(place, (0.3, 0.3, 0.37)), place + (0, 0, 0.055, 0), solids, "The place")


def carried_to(
    goal: np.ndarray, solids: Cuboids, start: np.ndarray, further: float
) -> tuple[Box, np.ndarray]:
    """Poses (T, 4) of a box that hands at the height of ``start`` bring straight before ``goal`` and hold
    there.
    """
    box = crate(start)
    carrying = Carrying(box, 0.0, goal, solids)
    carrying.send(goal, further)
    wrists, local, poses = carrying.grasps(), np.zeros((J, 4)), []
    local[:, 0] = 1
    contacts = np.zeros(5, np.float32)
    contacts[HAND_CONTACTS] = 1
    for _ in range(150):
        if carrying.state == "held":
            over = np.array((goal[0], goal[1] + further, max(start[2], goal[2] - 0.1), 0.0))
            way = box.to_world(box.grasps(0.0), over) - wrists
            wrists = wrists + way * min(1.0, 0.03 / max(float(np.linalg.norm(way[0])), 1e-9))
        root = np.append(wrists.mean(0)[:2] + (0, 0.4), 0.0)
        carrying.apply(SeenBody(np.append(root[:2], 0.9), local.copy(), wrists), root, contacts)
        poses.append(box.pose.copy())
    return box, np.array(poses)


@pytest.mark.parametrize(("top", "held", "further"), [(1.1, 0.75, 0.1), (0.74, 0.6, 0.25), (0.95, 1.1, 0.0)])
def test_a_box_goes_over_the_edge_and_comes_down_from_above(top, held, further):
    solids, goal = table(top=top), np.append(on_table(0.05 + further, top=top).pose[:3], 0.0)
    box, poses = carried_to(goal, solids, np.array((0.0, 2.6, held, 0.0)), further)
    np.testing.assert_allclose(poses[-1], goal, atol=0.01)
    assert box_in_solids(box, poses, solids) < 0.01
    assert np.abs(np.diff(poses[:, :3], axis=0)).max() < 0.06


def test_a_box_goes_between_boards_from_the_front():
    shelf = carry_far.inner_shelf(np.random.default_rng(0), 0.8, 0.8, 0.4, 0.36)
    solids = furniture.cuboids([(shelf, np.zeros(2), np.pi)])
    goal = np.array((0.0, 0.2 - 0.05 - SIZE[1] / 2, 0.8 + SIZE[2] / 2, 0.0))
    assert Berth(crate(goal), goal, solids).roofed
    for held in (0.7, 1.15):
        box, poses = carried_to(goal, solids, np.array((0.0, 2.0, held, 0.0)), 0.0)
        np.testing.assert_allclose(poses[-1], goal, atol=0.01)
        assert box_in_solids(box, poses, solids) < 0.01


@pytest.mark.slow
def test_a_far_box_is_carried_without_standing_in_the_table_or_going_through_a_top():
    model = load_model(None, backend="numpy")
    for trial in carry_far.trials(1, [0]):
        _, report = alone(carry_far.run_trial(model, trial))
        assert report["placed"] and report["box_in_solids_cm"] <= 1, trial.name
        assert report["penetration_share"] <= 0.03, trial.name
