"""Golden takes and golden composed data are made today as they were made before; see ``goldens`` for when
they may be written anew.
"""

from __future__ import annotations

import goldens
import numpy as np
import pytest


@pytest.mark.parametrize("kind, name", goldens.ALL, ids=lambda part: str(part))
def test_what_is_made_is_what_was_made(kind, name):
    problems = goldens.differences(kind, goldens.read(kind, name), goldens.made(kind, name))
    assert not problems, f"{kind} {name}: " + " ".join(problems)


def test_every_golden_is_of_something_that_is_made():
    assert sorted(path.name for path in goldens.FOLDER.iterdir()) == sorted(
        goldens.path_of(*each).name for each in goldens.ALL
    )


@pytest.mark.parametrize("kind, name", goldens.ALL, ids=lambda part: str(part))
def test_a_centimetre_in_any_joint_or_prop_shows_and_is_named(kind, name):
    golden = goldens.read(kind, name)
    assert not goldens.differences(kind, golden, golden)
    rng = np.random.default_rng(0)
    places = [
        n for n in golden if n in goldens.POINTS or n.startswith("prop_") or n in ("root", "thing_pose")
    ]
    assert {"joints", "root"} < set(places)
    for where in places:
        moved = {k: v.copy() for k, v in golden.items()}
        row = int(rng.integers(len(golden[where])))
        if where in goldens.POINTS:
            joint, way = int(rng.integers(len(goldens.JOINTS))), rng.normal(size=3)
            moved[where][row, joint] += 0.01 * way / np.linalg.norm(way)
            told = f"frame {goldens.EVERY[kind] * row} {goldens.JOINTS[joint]} by 0.0100"
        else:
            moved[where][row, 0] -= 0.01
            told = f"frame {goldens.EVERY[kind] * row} value 0 by 0.0100"
        (problem,) = goldens.differences(kind, golden, moved)
        assert problem.startswith(f"{where} is off in 1 of") and told in problem


def test_what_is_lost_added_cut_short_or_no_number_shows():
    golden = goldens.read("take", "carry")
    lost = {k: v for k, v in golden.items() if k != "prop_Box"}
    assert goldens.differences("take", golden, lost) == ["prop_Box is not made any more."]
    assert goldens.differences("take", lost, golden) == ["prop_Box is new; write the goldens anew."]
    assert goldens.differences("take", golden, golden | {"joints": golden["joints"][:-3]})
    spoilt = golden["root"].copy()
    spoilt[4, 1] = np.nan
    assert goldens.differences("take", golden, golden | {"root": spoilt})
    unreached = golden["goals"].copy()
    unreached[0, 0] = 0
    (problem,) = goldens.differences("take", golden, golden | {"goals": unreached})
    assert "in row 0, reached by 1" in problem


def test_every_action_is_carried_out():
    for name in goldens.SCENES:
        assert goldens.read("take", name)["goals"][:, 0].all(), name
