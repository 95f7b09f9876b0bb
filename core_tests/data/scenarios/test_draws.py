"""What composing draws at random stands in ``draws`` alone, its own or an action's: no range, spread or share
is written where it is drawn, and all of them are told by the data.
"""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import nsm_core.data.matching as matching
import nsm_core.data.scenarios as scenarios
from nsm_core.data.scenarios.registry import SCENARIOS, drawn
from nsm_core.data.scenarios.sit.draws import SITS

FILES = sorted(
    path
    for room in (scenarios, matching)
    for path in Path(room.__path__[0]).rglob("*.py")
    if path.name != "draws.py"
)


def numbers_in(tree: ast.AST):
    """Line and numbers of every draw of ``rng`` that is written with numbers: ends, spreads, and shares it is
    compared with.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare) and "random()" in ast.unparse(node.left):
            numbers = [n for n in node.comparators if isinstance(n, ast.Constant)]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(
            ("rng.uniform", "rng.integers", "rng.exponential")
        ):
            numbers = (
                [n for n in node.args if isinstance(n, ast.Constant)]
                if len(node.args) > 1 or "exp" in ast.unparse(node.func)
                else []
            )
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("rng.normal"):
            numbers = [n for n in node.args[1:2] if isinstance(n, ast.Constant)]
        else:
            continue
        if numbers:
            yield node.lineno, [n.value for n in numbers]


def test_numbers_in_draws_are_found():
    code = (
        "a = rng.uniform(0.2, b)\nif session.rng.random() < 0.5: rng.normal(0, 0.1)\n"
        "rng.integers(4)\nmotion.rng.exponential(0.1)"
    )
    assert sorted(numbers_in(ast.parse(code))) == [(1, [0.2]), (2, [0.1]), (2, [0.5]), (4, [0.1])]
    assert {p.parent.name for p in FILES} >= {"matching", "scenarios", *SCENARIOS} - {"run"}


@pytest.mark.parametrize("path", FILES, ids=lambda p: f"{p.parent.name}/{p.name}")
def test_no_draw_is_written_with_numbers(path):
    assert not list(numbers_in(ast.parse(path.read_text(encoding="utf-8"))))


def test_data_tell_what_was_drawn(monkeypatch):
    told = drawn()
    assert told["sit.kinds"] == list(SITS.kinds) and told["sit.share"] == SCENARIOS["sit"].share
    assert {name.split(".")[0] for name in told} == {
        "performance",
        "way",
        "furnishing",
        "matching",
        *SCENARIOS,
    }
    monkeypatch.setitem(SITS.__dict__, "tries", 99)
    assert {name for name, value in drawn().items() if told[name] != value} == {"sit.tries"}
