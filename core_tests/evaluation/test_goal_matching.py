"""The code of what is around a thing, and grasps in the order of what it is like."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")

from nsm_core.commands import planner as command
from nsm_core.data.reaches.library import load_library, make_library
from nsm_core.errors import WeightsError
from nsm_core.evaluation.goal_matching import GoalKeyframes, choices, tried
from nsm_core.model.networks.environment_code import CODE, EnvironmentCode
from nsm_core.training.environment_code import CodeTrainer, told


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    make_library(folder / "ways", 2, 3, print)
    return folder


@pytest.fixture(scope="module")
def library(folder):
    return load_library(folder / "ways")


@pytest.fixture(scope="module")
def things():
    return choices(2, reshaped=False)


def learnt(library, steps=12):
    trainer = CodeTrainer(library, np.arange(len(library.laden)), minutes=5.0)
    return trainer, [trainer.learn()[0] for _ in range(steps)]


def test_a_code_is_learnt_and_goes_on_where_it_was(library, tmp_path):
    trainer, errors = learnt(library)
    assert np.mean(errors[-3:]) < 0.8 * errors[0]
    codes = trainer.codes(library.obstacles)
    assert codes.shape == (len(library.laden), CODE) and codes.std(0).max() > 1e-3
    trainer.save(tmp_path / "checkpoint.pt")
    other = CodeTrainer(library, trainer.rows, minutes=5.0, seed=1)
    other.load(tmp_path / "checkpoint.pt")
    other.seed = trainer.seed
    assert other.step == trainer.step and np.allclose(other.codes(library.obstacles), codes, atol=1e-5)
    assert np.isclose(other.learn()[0], trainer.learn()[0], rtol=1e-4)
    torch.save({"net": {}, "step": 1, "seconds": 1.0}, tmp_path / "other.pt")
    with pytest.raises(WeightsError, match="other"):
        other.load(tmp_path / "other.pt")


def test_what_is_told_again_has_the_size_of_the_fields(library):
    fields = told(library.obstacles[:2])
    assert EnvironmentCode()(fields).shape == fields.shape
    assert 0.99 < float(fields.max()) <= 1.01


def test_what_is_known_is_matched_with_itself_and_mirrored_with_its_mirror_image(library, things):
    trainer, _ = learnt(library, 2)
    keyframes = GoalKeyframes(library, trainer.rows, trainer.codes)
    row = 0
    goal = library.task[row, :6]
    for mirror in (1, -1):
        fields = library.obstacles[row, ::mirror].astype(np.float32)
        space = replace(things[0].at.space, obstacles=fields)
        thing = SimpleNamespace(middle=np.array((0, 0, library.condition[row, 0])))
        known = replace(things[0].at, space=space, thing=thing)
        found = keyframes.alike(known, bool(library.condition[row, 3]), 1)
        wanted = goal * np.tile((mirror, 1, 1), 2)
        assert np.abs(found - wanted).max(1).min() < 1e-3


def test_grasps_are_tried_until_one_does(things):
    does = [[choice.does(k) for k in range(len(choice))] for choice in things]
    assert any(any(each) for each in does)
    best = tried(things, lambda choice: -np.array(does[things.index(choice)], float))
    assert best.first == np.mean([any(each) for each in does])
    assert best.tries == np.mean([1 if any(each) else len(each) for each in does])
    last = tried(things, lambda choice: np.array(does[things.index(choice)], float))
    assert last.tries == np.mean([min(len(each), 1 + each.count(False)) for each in does])


def test_every_order_is_told(folder, things, capsys, monkeypatch):
    monkeypatch.setattr("nsm_core.evaluation.goal_matching.choices", lambda many, reshaped: things)
    asked = ["--run", str(folder), "--codes", "0.01", "--kitchens", "2", "--things", "3", "--layouts", "2"]
    assert command.main(asked) == 0
    said = capsys.readouterr().out
    assert said.count("| by score, as takes do |") == 2 and "like the nearest 5" in said
