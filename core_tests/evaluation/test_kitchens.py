"""The benchmark of kitchens: its table and its pictures."""

from __future__ import annotations

import pytest

from nsm_core.__main__ import main


def test_kitchens_are_looked_at_and_drawn(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    assert main(["kitchens", "--seeds", "5:6", "--things", "3", "--draw", "1", "--out", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "1 kitchens" in told and "grasp with room" in told and "Fields:" in told
    assert (tmp_path / "kitchen_5.png").stat().st_size > 20_000
