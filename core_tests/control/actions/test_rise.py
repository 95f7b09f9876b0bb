"""Leaving a seat from its side, and what comes after it."""

from __future__ import annotations

import numpy as np
from puppets import EMPTY, Puppet

from nsm_core.control.actions.approach import Command, Ground
from nsm_core.control.actions.rise import TurnBack
from nsm_core.control.actions.walk import Go
from nsm_core.control.goals import Goal


def test_who_has_risen_and_gave_way_looks_for_its_way_anew():
    goal = Goal("walk", "place", np.array((6.0, 0.0, 0.0)), 0.0, 0.1)
    puppet = Puppet([goal])
    director = puppet.director
    while director.index < 0:
        puppet.step()
    ground = Ground(EMPTY, np.random.default_rng(0))
    director.stage = TurnBack(goal, Command("sit", np.zeros(3), 0.0), lambda moment: Go(goal, ground))
    for _ in range(400):
        puppet.step()
        command = director.command
        if command is not None and command.course is not None:
            break
    assert command is not None and command.course is not None and puppet.root[0] < 4.0
    director.giving_way = Command("idle", np.append(puppet.root[:2], 0.0))
    puppet.step()
    assert director.command is director.giving_way and not director.resuming
    director.resume()
    assert director.resuming
    puppet.step()
    assert director.command is not None and director.command.course is not None
    assert director.command is not command and not director.resuming
