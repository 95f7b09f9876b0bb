"""Job files ask for ways along curves, for speeds, and for the weight of what is carried."""

from __future__ import annotations

import pytest

from nsm_blender.jobs.read import read_job


def goal_of(tmp_path, text: str):
    path = tmp_path / "job.toml"
    (tmp_path / "room.blend").touch()
    path.write_text(f'scene = "room.blend"\n[[take]]\nname = "along"\ngoals = [ {{ {text} }} ]\n')
    (take,) = read_job(path).takes
    return take.error or take.goals[0]


def test_a_curve_rounds_and_a_speed(tmp_path):
    goal = goal_of(tmp_path, 'curve = "Path", action = "run", rounds = 2, speed = 2.5')
    assert (goal.curve, goal.object, goal.rounds, goal.speed) == ("Path", None, 2, 2.5)
    assert goal_of(tmp_path, 'object = "Chair", action = "walk", speed = 0.8').speed == 0.8


def test_a_box_may_be_given_its_weight(tmp_path):
    goal = 'object = "Box", action = "carry", to = "There"'
    assert goal_of(tmp_path, goal).mass is None and goal_of(tmp_path, goal + ", mass = 8").mass == 8


def test_what_is_opened_for_a_thing_is_shut_again_unless_it_is_to_stay_open(tmp_path):
    goal = 'object = "Mug", action = "place", to = "There"'
    assert goal_of(tmp_path, goal).close_after
    assert not goal_of(tmp_path, goal + ", close_after = false").close_after


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('curve = "Path", action = "sit", object = "Chair"', "'curve' is for walk and run"),
        ('curve = "Path", action = "walk", object = "Chair"', "remove 'object'"),
        ('location = [0, 0, 0], action = "walk", rounds = 2', "'rounds' counts those of a closed 'curve'"),
        ('curve = "Path", action = "walk", speed = 3.0', "asks for 3 m/s"),
        ('curve = "Path", action = "walk", rounds = 0', "'rounds'"),
        ('curve = 3, action = "walk"', "'curve'"),
        ('object = "Chair", action = "sit", mass = 3', "'mass' is that of what is brought somewhere"),
        ('object = "Box", action = "carry", to = "There", mass = -1', "'mass'"),
        ('object = "Box", action = "carry", to = "There", close_after = true', "take the action 'place'"),
        ('object = "Mug", action = "place", to = "There", close_after = 1', "it must be true or false"),
    ],
)
def test_what_is_wrong_is_told(tmp_path, text, told):
    assert told in goal_of(tmp_path, text)
