"""The records of the actions: what files of earlier versions rely on."""

from __future__ import annotations

import pytest

from nsm_core.errors import GoalError
from nsm_core.world.actions import ACTIONS, BY_KEY, require_action, require_learned


def test_places_of_the_actions_in_files_stay():
    assert [a.key for a in ACTIONS][:7] == ["sit", "walk", "idle", "run", "carry", "open", "climb"]
    assert len(BY_KEY) == len(ACTIONS)


def test_an_unknown_action_is_told_what_there_is():
    with pytest.raises(GoalError, match="The action 'fly' is not one of sit, walk, idle"):
        require_action("fly")


def test_only_what_weights_have_learned_is_asked_for():
    require_learned(["walk", "idle", "sit"], {"actions": ["walk", "sit"]})  # to stand is never in the way
    require_learned(BY_KEY, {})  # weights that do not say
    with pytest.raises(GoalError, match="has not learned to climb; it can do: sit, walk, idle"):
        require_learned(["climb"], {"actions": ["walk", "sit"]})
