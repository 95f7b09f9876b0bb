"""Every floor of the house has its part for every action, and asks for it by the action's key alone."""

from __future__ import annotations

import ast
from pathlib import Path

from nsm_core.control.actions.registry import PERFORMERS
from nsm_core.conventions import STYLES
from nsm_core.data.scenarios.registry import SCENARIOS
from nsm_core.evaluation.trials.rooms import OFFERS
from nsm_core.evaluation.trials.suite import PARTS, parts_named
from nsm_core.world.actions import ACTIONS, BY_KEY, Aim

ROOT = Path(__file__).resolve().parents[1]
# Labels and commands of the network, which bear the names of actions: what captures are annotated with, and
# what is trained on.
OF_LABELS = (
    "nsm_core/data/annotation/",
    "nsm_core/data/augmentation/",
    "nsm_core/evaluation/trials/locomotion.py",
)


def test_every_action_is_performed():
    assert set(PERFORMERS) == set(BY_KEY)


def test_every_action_is_composed_or_made_of_labels_that_others_teach():
    for action in ACTIONS:
        assert action.key in SCENARIOS or action.aim is Aim.HERE or action.labels, action.key
        assert set(action.labels or (action.key,)) <= set(STYLES), action.key
    assert set(SCENARIOS) <= set(BY_KEY) | {"stairs"}  # flights are on the way of a walk, or of a climb


def test_every_action_is_judged():
    assert {key for part in PARTS.values() for key in part.judges} == set(BY_KEY)
    assert set(OFFERS) <= set(BY_KEY)
    assert (
        parts_named("run") == ["travel", "response", "interrupt"]
        and parts_named("sit") == ["sit"]
        and parts_named("place") == ["place", "shut", "blocked", "both"]
        and not parts_named("fly")
    )


def dispatches(tree: ast.AST):
    """Lines at which an action is compared with the word of one."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            asked = any(
                isinstance(s, ast.Attribute | ast.Name) and ast.unparse(s).split(".")[-1] == "action"
                for s in sides
            )
            words = {c.value for s in sides for c in ast.walk(s) if isinstance(c, ast.Constant)}
            if asked and words & set(BY_KEY):
                yield node.lineno


def test_no_room_asks_which_action_it_is():
    assert list(dispatches(ast.parse('if goal.action == "sit" or action in ("walk", "run"):\n    pass'))) == [
        1,
        1,
    ]
    files = [*(ROOT / "nsm_core").rglob("*.py"), *(ROOT / "nsm_blender").rglob("*.py")]
    named = [(path, path.relative_to(ROOT).as_posix()) for path in files]
    found = [
        f"{name}:{line}"
        for path, name in named
        if not name.startswith(OF_LABELS)
        for line in dispatches(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert not found, found
