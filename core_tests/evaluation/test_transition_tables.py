"""Tables of transition networks: what is measured, and what is set beside the paper's values."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from gaps_of_walks import SMALL, windows

pytest.importorskip("torch")

from nsm_core.commands import evaluate as command
from nsm_core.data.transitions.gaps import GapSource
from nsm_core.evaluation.transitions.measures import errors, interpolation
from nsm_core.evaluation.transitions.sheets import notable
from nsm_core.evaluation.transitions.tables import Judge, read
from nsm_core.model.networks.rtn_config import TransitionConfig
from nsm_core.model.networks.rtn_rows import ROWS, TABLES, TransitionSettings
from nsm_core.model.transitions.layout import PAST
from nsm_core.training.transitions import TransitionTrainer


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("transitions")
    windows().save(path / "windows.npz")
    settings = TransitionSettings(shortest=8, longest=8, batch=4)
    for name in ("rtn-0", "rtn-1"):
        config = replace(TransitionConfig(**SMALL), faced=name == "rtn-1")
        (path / name).mkdir()
        TransitionTrainer(windows(), config, settings).export(path / name / "fill.npz")
    return path


def test_what_was_captured_has_no_error_and_slides_as_it_does():
    gaps = GapSource(windows(), True, False).fixed(20, 3)
    true = gaps.joints[:, PAST:-1]
    found = errors(gaps, true, np.zeros(69), np.ones(69))
    assert found.mse == found.aco == found.gap == 0 and found.slide == found.true_slide
    off = errors(gaps, true + 0.01, np.zeros(69), np.ones(69))
    assert np.isclose(off.aco, 1) and np.isclose(off.gap, np.sqrt(3)) and np.allclose(off.profile, 1)


def test_interpolation_is_seen_in_the_gaps_own_place_and_heading():
    gaps = GapSource(windows(), True, False).fixed(20, 3)
    joints = interpolation(windows(), gaps)
    assert joints.shape == (len(gaps.first), 21, 23, 3)
    assert np.abs(joints[:, -1] - gaps.joints[:, -2]).max() < 1e-3
    found = errors(gaps, joints, np.zeros(69), np.ones(69))
    assert found.gap < 0.1 and found.profile[0] < found.profile[10] > found.profile[-1]


def test_a_network_is_judged_alike_whichever_way_it_sees_gaps(folder):
    """A network that only goes straight home does so in any heading: same error faced or not."""
    judge, nets = Judge(windows()), [read(folder / f"rtn-{n}" / "fill.npz") for n in (0, 1)]
    for net in nets:
        net.decode[-1].weight.data.zero_()
        net.decode[-1].bias.data.zero_()
    one, two = (judge.judged(net, 20) for net in nets)
    assert np.isclose(one.mse, two.mse, rtol=1e-3) and np.isclose(one.aco, two.aco, rtol=1e-3)


def test_tables_name_what_was_trained_and_what_was_not(folder, tmp_path, capsys):
    out = tmp_path / "tables.json"
    asked = ["--only", "transitions", "--transitions", str(folder), "--out", str(out)]
    assert command.main([*asked, "--weights", str(folder / "rtn-1" / "fill.npz")]) == 0
    told = capsys.readouterr().out
    assert out.exists() and "Table 4" in told and "cm off by frames missing" in told
    made = json.loads(out.read_text())["finished"]
    assert made["captures"]["off"] == made["network"]["differs"] == 0 < made["interpolation"]["off"]
    lines = {line.split()[0]: line for line in reversed(told.splitlines()) if line.strip()}
    assert lines["f_erd"].endswith("not trained") and "0.092" in lines["f_erd"]
    assert "0.210" in lines["int"] and "0.087" in lines["rtn"] and "not trained" not in lines["rtn"]
    assert {name for names in TABLES.values() for name in names} == set(ROWS)


def test_sheets_show_what_is_notable(folder, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    assert set(notable(windows(), 30)) == {"furthest", "turn", "rise", "sink", "half"}
    asked = ["--only", "transitions", "--transitions", str(folder), "--sheets", str(tmp_path)]
    assert command.main([*asked, "--weights", str(folder / "rtn-1" / "fill.npz")]) == 0
    assert len(list(tmp_path.glob("fill_*.png"))) == 5 == len(capsys.readouterr().out.split())
