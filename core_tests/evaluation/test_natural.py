"""How natural motion is said to be: gait of a made walk, distances of windows, and takes beside captures."""

from __future__ import annotations

from dataclasses import replace

import captures
import numpy as np
import pytest

from nsm_core.body.skeleton import forward_kinematics
from nsm_core.commands.evaluate import main
from nsm_core.conventions import SIT, STYLES, WALK
from nsm_core.errors import CaptureError
from nsm_core.evaluation import natural
from nsm_core.evaluation.measures.naturalness import (
    Space,
    WatchedMotion,
    frechet,
    gait,
    shown,
    spread,
    windows,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return captures.write_captures(tmp_path_factory.mktemp("natural"))


@pytest.fixture(scope="module")
def seen(folder) -> list[WatchedMotion]:
    return natural.captured(folder)


def walker(distance: float = 6.0, seconds: float = 5.0, name: str = "a") -> WatchedMotion:
    positions = forward_kinematics(*captures.walk(distance, 0.0, seconds))[0]
    labels = np.zeros((len(positions), len(STYLES)))
    labels[:, WALK] = 1
    return WatchedMotion(name, "made", name, positions, labels)


def test_the_gait_of_a_made_walk_is_what_it_was_made_with():
    found = gait([walker()])
    assert found["cadence"] == pytest.approx(2 * 60 * 30 / captures.CYCLE, rel=0.05)
    assert 0.6 < found["stride_m"] < 2.0 and found["jerk_m_s3"] > 0
    assert np.isnan(gait([])["cadence"])


def test_windows_follow_neither_place_nor_heading():
    one = walker()
    turned = replace(one, positions=one.positions[..., [1, 0, 2]] * (1, -1, 1) + (3, 4, 0))
    a, b = windows(one, "walks", "0.5 s"), windows(turned, "walks", "0.5 s")
    assert len(a) > 10
    np.testing.assert_allclose(a, b, atol=1e-4)
    assert len(windows(one, "sits", "0.5 s")) == 0 and len(windows(one, "walks", "2 s")) > 3


def test_the_distance_is_none_of_the_same_and_grows_with_the_difference():
    rng = np.random.default_rng(0)
    first = rng.normal(size=(400, 30)) * np.linspace(3, 0.1, 30)
    space = Space.of(first)
    near, far = (first + shift * first.std(0) for shift in (0.2, 1.0))
    assert space.distance(first, first) == pytest.approx(0, abs=1e-6)
    assert 0 < space.distance(first, near) < space.distance(first, far)
    assert np.isnan(space.distance(first, far[:5]))
    # Of two normal distributions it is known.
    one, other = rng.normal(size=(60_000, 2)), rng.normal(size=(60_000, 2)) * 2 + (3, 0)
    assert frechet(one, other) == pytest.approx(9 + 2, rel=0.03)


def test_spread_is_that_of_poses_over_motions():
    still = forward_kinematics(*captures.stand(60))[0]
    labels = np.zeros((60, len(STYLES)))
    labels[:, SIT] = 1
    low, high = (WatchedMotion(n, "g", n, still * (1, 1, k), labels) for n, k in (("a", 1.0), ("b", 1.1)))
    assert spread([low, low], "sits") == pytest.approx(0, abs=1e-9)
    assert 1 < spread([low, high], "sits") < 10
    assert np.isnan(spread([low], "sits")) and np.isnan(spread([low, high], "climbs"))


def test_captures_are_told_apart_by_rule_and_figures_stand_beside_each_other(seen):
    assert any(shown(m, "sits").max() > 0.9 for m in seen) and any(shown(m, "walks").max() > 1 for m in seen)
    found = natural.figures([walker(name="t 0"), walker(5.0, name="t 0"), walker(name="t 1")], seen)
    assert found["takes"]["labels"]["walk"] == pytest.approx(1) and found["captures"]["labels"]["sit"] > 0
    assert found["distances"]["walks, 0.5 s"]["takes"] > 0
    assert found["distances"]["climbs, 2 s"] == {}
    assert found["spread_over_seeds_cm"]["walks"] >= 0
    told = natural.table(found)
    assert "cadence" in told and "walks, 0.5 s" in told and "nan" not in told


def test_a_folder_without_captures_is_told_before_anything_is_rolled_out(tmp_path):
    with pytest.raises(CaptureError, match="no BVH file that can be read"):
        main(["--natural", str(tmp_path), "--out", str(tmp_path / "n.json")])


@pytest.mark.slow
def test_takes_of_the_network_are_looked_at(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(natural, "_PARTS", ("climb",))
    monkeypatch.setattr(natural, "SEEDS", (0,))
    assert main(["--natural", str(folder), "--starts", "1", "--out", str(tmp_path / "n.json")]) == 0
    assert "share of time: climb" in capsys.readouterr().out and (tmp_path / "n.json").exists()
