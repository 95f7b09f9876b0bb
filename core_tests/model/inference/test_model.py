"""The numpy network against the formulas of papers/000 section 3, written out slowly, and against torch."""

from __future__ import annotations

import importlib.util
import math

import numpy as np
import pytest

from nsm_core.errors import WeightsError
from nsm_core.model.features.layout import Inputs
from nsm_core.model.inference.model import BUNDLED, load_model, model_of
from nsm_core.model.inference.weights_file import load_weights
from nsm_core.model.networks.nsm_numpy import NEGLIGIBLE

# A sum of n products in single precision rounds by about sqrt(n) units in the last place, in an order that
# processor and library choose: 1e-5 of the largest value for the 4,018 inputs (four times what was met, and
# more).  What the gating network adds up goes through an exponential, which makes of the rounding of its sums
# a share of the coefficients; the sums grow as the gating features do, and the bound with them.
ROUNDING = 1e-5


def assert_same(one, other, gating_scale=1.0):
    """Outputs (B, N) or coefficients (B, K) that differ by rounding alone, measured by the largest of
    them.
    """
    assert np.abs(one - other).max() < ROUNDING * gating_scale * np.abs(other).max()


def elu(v: float) -> float:
    return v if v > 0 else math.exp(v) - 1


def affine(weight, bias, v):
    """Row by row, in double precision."""
    v = [float(x) for x in v]
    return [
        sum(w * x for w, x in zip(row, v, strict=True)) + b
        for row, b in zip(weight.tolist(), bias.tolist(), strict=True)
    ]


def reference(weights, x, gating):
    """One character, one scalar at a time: blend the experts' weights first, then apply them, as the paper
    writes it.
    """
    p, s, c = weights.parameters, weights.statistics, weights.config
    x = [(a - m) / d for a, m, d in zip(x, s["input_mean"], s["input_std"], strict=True)]
    h = [(a - m) / d for a, m, d in zip(gating, s["gating_mean"], s["gating_std"], strict=True)]
    for i in range(3):
        h = affine(p[f"gating.{i}.weight"], p[f"gating.{i}.bias"], h)
        h = [elu(v) for v in h] if i < 2 else h
    exponentials = [math.exp(v - max(h)) for v in h]
    coefficients = [v / sum(exponentials) for v in exponentials]
    encoded, start = [], 0
    for e, part in enumerate(("frame", "goal", "environment", "interaction")):
        h, start = x[start : start + c[part]], start + c[part]
        for i in range(2):
            h = [
                elu(v)
                for v in affine(p[f"encoders.{e}.layers.{i}.weight"], p[f"encoders.{e}.layers.{i}.bias"], h)
            ]
        encoded += h
    h = encoded
    for i in range(3):
        weight, bias = p[f"experts.{i}.weight"].astype(np.float64), p[f"experts.{i}.bias"].astype(np.float64)
        blended_weight, blended_bias = np.zeros(weight.shape[1:]), np.zeros(bias.shape[1:])
        for k, a in enumerate(coefficients):
            blended_weight, blended_bias = blended_weight + a * weight[k], blended_bias + a * bias[k]
        h = affine(blended_weight, blended_bias, h)
        h = [elu(v) for v in h] if i < 2 else h
    return np.array(h) * s["output_std"] + s["output_mean"], np.array(coefficients)


def predict(model, x, gating):
    """Outputs and coefficients of a first step."""
    y, memory, info = model.step(Inputs(x, gating), model.start(len(x)))
    assert memory == {}
    return y, info["experts"]


def features(config, count, seed=1, gating_scale=1.0):
    rng = np.random.default_rng(seed)
    gating = rng.normal(size=(count, config.gating)) * gating_scale
    return rng.normal(size=(count, config.inputs)).astype(np.float32), gating.astype(np.float32)


@pytest.mark.parametrize("backend", ["numpy", "torch"])
def test_equals_the_written_out_formulas_at_full_size(full_weights, backend):
    if backend == "torch":
        pytest.importorskip("torch")
    weights = load_weights(full_weights)
    model = model_of(weights, backend)
    x, gating = features(model.config, 2)
    y, coefficients = predict(model, x, gating)
    for row in range(2):
        expected, expected_coefficients = reference(weights, x[row], gating[row])
        assert_same(y[row], expected)
        assert_same(coefficients[row], expected_coefficients)
    assert y.std() > 0.5  # the comparison is about signals, not about zeros


@pytest.mark.parametrize("count", [1, 2, 7, 64])
@pytest.mark.parametrize("gating_scale", [1.0, 30.0])  # 30: some experts fall to nothing and are not read
def test_back_ends_agree(full_weights, count, gating_scale):
    pytest.importorskip("torch")
    ours, theirs = load_model(full_weights, "numpy"), load_model(full_weights, "torch")
    x, gating = features(ours.config, count, gating_scale=gating_scale)
    (y, c), (y_torch, c_torch) = predict(ours, x, gating), predict(theirs, x, gating)
    assert y.dtype == c.dtype == y_torch.dtype == np.float32
    assert_same(y, y_torch, gating_scale)
    assert_same(c, c_torch, gating_scale)
    if gating_scale > 1:
        assert c.min() < NEGLIGIBLE


def test_one_by_one_equals_the_batch(full_weights):
    model = load_model(full_weights, "numpy")
    x, gating = features(model.config, 5, gating_scale=10)
    batch, _ = predict(model, x, gating)
    single = np.concatenate([predict(model, x[i : i + 1], gating[i : i + 1])[0] for i in range(5)])
    assert_same(batch, single, 10)


def test_coefficients_are_a_mixture(full_weights):
    model = load_model(full_weights, "numpy")
    _, c = predict(model, *features(model.config, 9))
    assert c.shape == (9, 8) and np.all(c >= 0)
    np.testing.assert_allclose(c.sum(axis=1), 1, atol=1e-5)


def test_predict_keeps_its_inputs(full_weights):
    model = load_model(full_weights, "numpy")
    x, gating = features(model.config, 1)
    before = x.copy(), gating.copy()
    predict(model, x, gating)
    assert np.array_equal(x, before[0]) and np.array_equal(gating, before[1])


def test_other_widths_are_refused(full_weights):
    model = load_model(full_weights, "numpy")
    x, gating = features(model.config, 1)
    with pytest.raises(ValueError, match="4018"):
        predict(model, x[:, :-1], gating)
    with pytest.raises(ValueError, match="650"):
        predict(model, x, gating[:, :-1])
    with pytest.raises(ValueError, match="step needs"):
        predict(model, x[0], gating[0])


def test_auto_steps_in_numpy(full_weights):
    assert load_model(full_weights).backend == "numpy"


def test_unknown_back_end(full_weights):
    with pytest.raises(WeightsError, match="auto, numpy, torch"):
        load_model(full_weights, "jax")


@pytest.mark.skipif(importlib.util.find_spec("torch") is not None, reason="torch is installed")
def test_torch_asked_for_and_missing(full_weights):
    with pytest.raises(WeightsError, match="PyTorch"):
        load_model(full_weights, "torch")


@pytest.mark.skipif(not BUNDLED.exists(), reason="no weights are bundled yet")
def test_bundled_weights_load_and_name_their_data():
    model = load_model(backend="numpy")
    assert BUNDLED.stat().st_size < 40e6
    assert any("mocap.cs.cmu.edu" in line for line in model.metadata["credits"])
    x, gating = features(model.config, 1)
    assert np.all(np.isfinite(predict(model, x, gating)[0]))
