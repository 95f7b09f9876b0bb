"""What feeling the ground is worth: the same gaps with their own ground, level ground and another's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gaps_of_walks import SMALL, windows

pytest.importorskip("torch")

from nsm_core.evaluation.transitions import terrain
from nsm_core.evaluation.transitions.tables import Judge
from nsm_core.model.networks.gap_torch import gap_network
from nsm_core.model.networks.rtn_config import TransitionConfig


@pytest.fixture
def judge(monkeypatch):
    """All gaps over ground that counts as uneven."""
    monkeypatch.setattr(terrain, "UNEVEN", -1.0)
    return Judge(windows())


def test_who_feels_no_ground_fills_alike_whatever_it_is(judge):
    net = gap_network(replace(TransitionConfig(**SMALL), terrain=False)).eval()
    found = terrain.felt(judge, net)["30"]
    assert len({row.mse for row in found.values()}) == 1
    assert np.isclose(found[terrain.OWN].mse, judge.judged(net, 30).mse)


def test_who_feels_it_fills_its_own_as_in_the_tables_and_others_otherwise(judge):
    net = gap_network(TransitionConfig(**SMALL)).eval()
    found = terrain.felt(judge, net)["30"]
    assert np.isclose(found[terrain.OWN].mse, judge.judged(net, 30).mse)
    assert found[terrain.OWN].mse != found[terrain.LEVEL].mse
    assert "its own" in terrain.text({"30": found})


def test_other_ground_begins_as_high_as_the_own(judge):
    gaps = judge.gaps(30)
    begin = np.zeros((len(gaps.first), 1, 2))
    heights = {name: ground(begin) for name, ground in terrain._grounds(gaps).items()}
    assert np.allclose(heights[terrain.OWN], heights[terrain.LEVEL], atol=1e-3)
    assert np.allclose(heights[terrain.OWN], heights[terrain.OTHER], atol=1e-3)
