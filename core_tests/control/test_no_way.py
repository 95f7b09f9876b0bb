"""A goal to which no way leads: an error before a take has begun, passed over and reported in the middle of
one.
"""

from __future__ import annotations

import numpy as np
import pytest
from puppets import ROOM, Puppet

from nsm_core.control.goals import Goal
from nsm_core.errors import GoalError
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.floor_plan import FloorPlan


class WalledIn(FloorPlan):
    """A floor on which from some moment on no way leads to one place."""

    shut: np.ndarray | None = None

    def find(self, start, goal, step=0.05):
        if self.shut is not None and np.linalg.norm(np.asarray(goal) - self.shut) < 0.1:
            raise GoalError("There is no free way to it; move the furniture apart.")
        return super().find(start, goal, step)


@pytest.mark.parametrize("later", [[Goal("walk", "home", (0, 1.0, 0), 0.0, 0.1)], []])
def test_goal_without_a_way_in_the_middle_of_a_take_is_passed_over(later):
    plan = WalledIn(Cuboids(), ROOM)
    p = Puppet(
        [Goal("walk", "near", (0, -5, 0), 0.0, 0.1), Goal("walk", "far", (8.0, -5, 0), 0.0, 0.1), *later],
        plan=plan,
    )
    p.director.update(p.moment())
    plan.shut = np.array((8.0, -5.0))
    p.run()
    near, far, *rest = p.director.results
    assert p.director.done and near.reached and not far.reached and "no free way" in far.reason
    assert all(r.reached and not r.reason for r in rest) and not near.reason and len(p.roots) > 100
    assert far.end_frame == far.start_frame > 0


def test_first_goal_without_a_way_is_an_error():
    plan = WalledIn(Cuboids(), ROOM)
    plan.shut = np.array((0.0, -8.0))
    with pytest.raises(GoalError, match="move the furniture"):
        Puppet([Goal("walk", "far", (0, -8, 0), 0.0)], plan=plan).run()
