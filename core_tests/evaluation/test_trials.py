"""Trials are the same at every call and fair: starts are free, boxes rest, doors and steps are what their
names say.
"""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.errors import GoalError
from nsm_core.evaluation.measures.objects import box_in_solids
from nsm_core.evaluation.trials import carry, climb, rollout, rooms, sit
from nsm_core.evaluation.trials import open as doors
from nsm_core.evaluation.trials.suite import PARTS
from nsm_core.rotations import heading_to_direction, rotate_planar, wrap_angle
from nsm_core.world.affordances.passage import passage
from nsm_core.world.assets.pool import Pool, scaled
from nsm_core.world.assets.pool_cache import Entry
from nsm_core.world.scene import furniture


def pool_of(*kinds: str) -> Pool:
    """A held-back pool of one piece of each kind."""
    rng = np.random.default_rng(5)
    return Pool([Entry(f"{k}.glb", k, furniture.make(k, rng), True) for k in kinds], mesh_share=1.0)


@pytest.mark.parametrize("name", PARTS)
def test_trials_are_the_same_at_every_call(name):
    first, second = (PARTS[name].trials(2, None) for _ in range(2))
    assert len(first) == len(second) > 1
    for a, b in zip(first, second, strict=True):
        assert a.name == b.name and a.setting == b.setting
        if hasattr(a, "start"):
            assert np.array_equal(a.start, b.start) and a.heading == b.heading


def test_starts_lie_about_the_object_and_are_free():
    for part in (carry, doors, climb):
        made = part.trials(4)
        for trial in made:
            asked = part.request(trial)
            middle = asked.goals[0].position[:2] if part is doors else np.zeros(2)
            assert 0.9 <= np.linalg.norm(trial.start - middle) <= 3.0
            assert rollout.clear_of(asked.environment, list(rollout.props_of(asked).values()), 0.34)(
                trial.start
            )
        facing = [wrap_angle(t.heading) for t in made]
        assert min(facing) < -1 and max(facing) > 1


def test_boxes_rest_on_what_is_under_them_at_both_ends():
    heights = set()
    for trial in carry.trials(1):
        asked = carry.request(trial)
        box = asked.goals[0].prop
        assert np.allclose(box.pose, trial.box, atol=1e-6) and np.allclose(
            asked.goals[0].position, trial.goal[:3]
        )
        for pose in (trial.box, trial.goal):
            assert box_in_solids(box, pose[None], asked.environment) < 2e-3
            under = np.append(pose[:2], pose[2] - box.size[2] / 2 - 0.01)
            supported = (
                under[2] < 0 or asked.environment.signed_distance(under[None].astype(np.float32), 1.0)[0] < 0
            )
            assert supported, trial.name
            heights.add(round(float(under[2]), 1))
        assert np.linalg.norm(trial.goal[:2] - trial.box[:2]) > 2
    assert min(heights) <= 0 and max(heights) > 0.6 and any(0.2 < h < 0.6 for h in heights)


def test_doors_are_what_their_names_say():
    sizes = set()
    for trial in doors.trials(3):
        leaf = doors.request(trial).goals[0].prop
        way = passage(leaf, trial.start)
        hinge = rotate_planar(leaf.pose[:2] - way.middle, np.float64(-way.heading))
        assert way.push == trial.name.startswith("push")
        assert (hinge[0] < 0) == trial.name.endswith("right"), "facing -Y, the right hand is towards -X"
        sizes.add(round(leaf.width, 3))
    assert len(sizes) == 4


def test_steps_are_climbed_from_the_near_side_and_walls_across():
    for trial in climb.trials(3):
        goal = climb.request(trial).goals[0]
        ahead = heading_to_direction(np.array(goal.heading))
        if trial.piece.kind == "low_wall":
            assert goal.position[2] == 0
            # The place lies beyond the wall for one who comes from the start.
            assert (goal.position[:2] @ ahead) > 0.5 > 0 > trial.start @ ahead
        else:
            assert goal.position[2] == pytest.approx(trial.piece.size[2]) and trial.start @ ahead < 0
        assert abs(wrap_angle(goal.interaction.heading - goal.heading - np.pi)) < 1e-6
        assert goal.interaction.occupancy.max() == 1


def test_held_back_pieces_serve_where_there_are_some():
    pool = pool_of("chair", "table", "box")
    chair = next(e.piece for e in pool.entries if e.piece.kind == "chair")
    seats = sit.trials(1, pool=pool)
    assert seats[0].known and not seats[1].known
    assert len(seats[0].piece.mins) == len(chair.mins) and seats[0].piece.seat.heading == 0
    hips = sit.request(seats[0]).goals[0].position
    assert np.allclose(hips[:2], seats[0].piece.seat.point[:2])
    for trial in carry.trials(1, pool=pool):
        assert max(trial.crate.size[:2]) <= 0.45
        assert (
            box_in_solids(
                carry.request(trial).goals[0].prop, trial.box[None], carry.request(trial).environment
            )
            < 2e-3
        )
    assert scaled(chair, np.ones(3)).seat.height == pytest.approx(chair.seat.height)


def test_seats_at_tables_stand_partly_under_them():
    for trial in sit.trials_at_tables(1):
        table, place, _ = trial.others[0]
        front = place[1] + table.maxs[:, 1].max()
        assert 0.2 < trial.piece.seat.point[1] - front < 0.4
        assert len(sit.request(trial).environment.groups) == 2


def test_rooms_offer_every_action_and_the_box_goes_somewhere_else():
    room = rooms.make_room(np.random.default_rng(1))
    rng = np.random.default_rng(2)
    before = room.box.pose[:3]
    for _ in range(4):
        goal = rooms.goal_of(room, "carry", rng)
        assert np.linalg.norm(goal.position - before) > 0.5
        assert box_in_solids(room.box, np.append(goal.position, goal.heading)[None], room.query) < 0.02
        before = goal.position
    goals = rooms.random_goals(room, rng, 30)
    assert len({g.action for g in goals}) == 7
    with pytest.raises(GoalError, match="free place"):
        rollout.start_about(rng, np.zeros(2), lambda place: False)
