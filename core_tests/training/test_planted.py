"""The slip of standing feet is that of the very step that roll-outs and takes are moved on by."""

from __future__ import annotations

import captures
import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs PyTorch")

from nsm_core.body.skeleton import INDEX
from nsm_core.conventions import FOOT_CONTACTS
from nsm_core.model.features.codec import read_outputs
from nsm_core.model.features.layout import OUTPUT
from nsm_core.model.features.rollout_step import Blending, advance
from nsm_core.model.networks.precision import half_precision_pays
from nsm_core.training.batches import Batches, RolloutSettings
from nsm_core.training.planted import SLIP, planted_loss

JOINTS = [[INDEX[f"{side}{part}"] for part in ("Ankle", "Toe")] for side in ("Right", "Left")]


@pytest.fixture(scope="module")
def steps(tmp_path_factory):
    """States of twenty true frames with inputs, targets and outputs that are off."""
    data = captures.dataset(captures.data_folder(tmp_path_factory))
    rng = np.random.default_rng(3)
    batches = Batches(data, data.frames, rng, 1, RolloutSettings())
    frames = batches.draw(20)
    x, _, y = batches.from_data(frames)
    return data.state(frames), x, y, (y + 0.02 * rng.standard_normal(y.shape)).astype(np.float32)


def test_the_loss_is_the_slip_of_the_step_that_is_made(steps):
    state, x, y, off = steps
    ends = [advance(state, read_outputs(v, state), Blending()).joint_position for v in (off, y)]
    stands = y[:, OUTPUT.slices["contact"]][:, FOOT_CONTACTS] > 0.5
    assert stands.any() and not stands.all()
    expected = sum(
        stands[:, s] * ((ends[0] - ends[1])[:, j] ** 2).mean(axis=(1, 2)) / SLIP**2
        for s, j in enumerate(JOINTS)
    )
    found = planted_loss(*(torch.from_numpy(v) for v in (x, off, y))).numpy()
    np.testing.assert_allclose(found, expected / 2, rtol=0.02, atol=1e-3)


def test_true_steps_do_not_slip_and_gradients_reach_the_bones_above(steps):
    _, x, y, off = steps
    assert planted_loss(*(torch.from_numpy(v) for v in (x, y, y))).max() < 0.02
    predicted = torch.from_numpy(off).requires_grad_()
    planted_loss(torch.from_numpy(x), predicted, torch.from_numpy(y)).sum().backward()
    place = OUTPUT.slices["joint_position"].start
    for name in ("Hips", "LeftKnee", "LeftAnkle", "LeftToe"):
        at = place + 3 * INDEX[name]
        assert predicted.grad[:, at : at + 3].abs().sum() > 0, name
    at = place + 3 * INDEX["Head"]
    assert not predicted.grad[:, at : at + 3].any()


def test_graphics_cards_multiply_half_precision_unasked():
    assert half_precision_pays(torch.device("cuda"))  # and none is needed to know it
