"""The network that tells fields around things: as torch and as numpy, its slopes, its codes, its training."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from nsm_core.data.reaches.library import load_library, make_library
from nsm_core.errors import CaptureError, WeightsError
from nsm_core.model.inference.field_model import FieldModel, KnownFields, load_fields
from nsm_core.model.networks.field_config import CONDITION, TASK, FieldConfig
from nsm_core.model.networks.field_decoder import FieldDecoder
from nsm_core.model.networks.field_numpy import NumpyFields, cells_of, seen_of
from nsm_core.model.networks.protocol import Weights
from nsm_core.training.hand_fields import FieldSettings, FieldTrainer
from nsm_core.training.timed_run import run
from nsm_core.world.planning.hand_fields import SOONEST, grid_around

SMALL = FieldConfig(width=32, layers=4, again=2, latent=16, encoder=24, block=5)


def both(seed: int = 0):
    torch.manual_seed(seed)
    net = FieldDecoder(SMALL)
    net.query_scale.copy_(torch.tensor((1, 1, 1, 1, 0.4, 0.4, 0.4)))
    values = {n.replace("/", "."): v.detach().numpy() for n, v in net.values.items()}
    assert {n: v.shape for n, v in values.items()} == SMALL.parameter_shapes()
    scales = {"field_scale": net.field_scale.numpy(), "query_scale": net.query_scale.numpy()}
    return net, Weights(values, scales)


def test_numpy_tells_what_torch_tells_and_its_slopes():
    net, weights = both()
    rng = np.random.default_rng(0)
    query, code = rng.normal(0, 0.3, (9, 7)).astype(np.float32), rng.normal(0, 1, 16).astype(np.float32)
    place, latent = torch.tensor(query, requires_grad=True), torch.tensor(code, requires_grad=True)
    told = net(place[None], latent[None])[0]
    told[:, 2].sum().backward()
    ours = NumpyFields(SMALL, weights)
    values, slope = ours.by_place(query, code)
    assert np.allclose(values, told.detach().numpy(), atol=1e-5)
    assert np.allclose(slope, place.grad[:, 4:].numpy(), atol=1e-4)
    ahead = np.zeros((9, 3), np.float32)
    ahead[:, 2] = 1
    assert np.allclose(
        ours.by_code(query, code, ahead, ours.told(query, code)[1]), latent.grad.numpy(), atol=1e-4
    )
    seen = rng.normal(0, 1, 8205).astype(np.float32)
    guessed = net.guessed(torch.tensor(seen)[None])[0].detach().numpy()
    assert np.allclose(ours.guessed(seen), guessed, atol=1e-4)


def test_the_slope_of_arrival_is_that_of_differences():
    _, weights = both(3)
    ours, rng = NumpyFields(SMALL, weights), np.random.default_rng(4)
    query, code = rng.normal(0, 0.3, (5, 7)).astype(np.float32), rng.normal(0, 1, 16).astype(np.float32)
    slope = ours.by_place(query, code)[1]
    for axis in range(3):
        step = np.zeros(7, np.float32)
        step[4 + axis] = 1e-3
        told = [ours.values(query + sign * step, code)[:, 2] for sign in (1, -1)]
        assert np.allclose((told[0] - told[1]) / 2e-3, slope[:, axis], atol=2e-2)


def test_half_precision_tells_nearly_the_same_while_learning():
    net, _ = both(5)
    query, code = torch.randn(3, 50, 7) * 0.3, torch.randn(3, 16)
    exact = net(query, code)
    net.half = True
    assert (net.train()(query, code) - exact).abs().mean() < 0.02 * exact.abs().mean() + 1e-3
    assert torch.equal(net.eval()(query, code), exact)


def test_the_encoder_sees_blocks_of_neighbouring_cells():
    field = np.zeros((32, 32, 32), np.float32)
    field[8:16, :8, 24:] = 2.0  # block (1, 0, 3) of (4, 4, 4), whole
    cells = cells_of(field, 3 * field, np.array((2.0, 6.0))).reshape(64, 2, 64)
    full = np.flatnonzero(cells.any((1, 2)))
    assert list(full) == [1 * 16 + 0 * 4 + 3] and np.allclose(cells[full], 1)
    seen = seen_of(cells.ravel(), np.arange(4), np.arange(9), np.array((2.0, 1, 1, 1)))
    assert list(seen[-13:]) == [0, 1, 2, 3, *range(9)] and seen.dtype == np.float32
    halves = seen_of(cells.ravel(), np.full(CONDITION.size, 3.0), np.zeros(TASK.size), np.full(4, 2.0))
    assert np.allclose(halves[8192:8196], 1.5)


def test_a_code_is_found_for_fields_that_the_network_can_tell():
    _, weights = both(1)
    model = FieldModel(SMALL, weights)
    rng = np.random.default_rng(2)
    true, condition = rng.normal(0, 0.5, 16).astype(np.float32), np.array((0.9, 0, 0, 0), np.float32)
    points = grid_around(np.zeros(3))[::4, ::4, ::4]
    flat = points.reshape(-1, 3)
    fields = model.fields(flat, condition, true).reshape(*points.shape[:3], 3)
    arrival = model.arrival(flat[:64], condition, true)[0]
    known = KnownFields(points, fields[..., 0], fields[..., 1], flat[:64], arrival)
    found = model.find_code(known, condition, np.zeros(9), steps=300, points=256, guess=False)
    assert min(found.errors) < 0.25 * found.errors[0]
    close = model.fields(flat, condition, found.code) - model.fields(flat, condition, true)
    far = model.fields(flat, condition, 0 * true) - model.fields(flat, condition, true)
    assert np.abs(close).mean() < 0.35 * np.abs(far).mean()


@pytest.fixture(scope="module")
def ways(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ways")
    make_library(folder, 2, 1, print)
    return folder


def test_ways_are_made_once_and_end_at_the_thing(ways):
    library = load_library(ways)
    assert set(library.kitchen) <= {0, 1} and len(library.laden) >= 2
    ends = library.path[:, -1]
    assert (np.linalg.norm(ends, axis=1) < 0.35).all() and (
        library.arrival.max((1, 2, 3)) > 0.9 / SOONEST
    ).all()
    rows, no = np.arange(len(ends)), np.zeros(len(ends), bool)
    there, asked = library.asked(rows, no, no)
    back, same = library.asked(rows, ~no, no)
    assert np.allclose(there[:, :2], back[:, :2]) and (there[:, 2:] + back[:, 2:] == 1).all()
    assert np.array_equal(asked, same) and np.allclose(asked[:, :3], ends, atol=1e-6)
    assert np.allclose(np.linalg.norm(asked[:, 3:6], axis=1), 1, atol=1e-5)
    other, turned = library.asked(rows, no, ~no)
    assert (there[:, 1] + other[:, 1] == 1).all() and np.array_equal(turned[:, ::3], -asked[:, ::3])
    assert np.array_equal(turned[:, 1::3], asked[:, 1::3])
    before = (ways / "kitchen_0000.npz").stat().st_mtime_ns
    make_library(ways, 2, 1, print)
    assert (ways / "kitchen_0000.npz").stat().st_mtime_ns == before


def test_a_damaged_file_of_ways_is_named(tmp_path):
    (tmp_path / "kitchen_0000.npz").write_bytes(b"PK no")
    with pytest.raises(CaptureError, match=r"kitchen_0000\.npz holds no ways"):
        load_library(tmp_path)
    with pytest.raises(CaptureError, match="make some first"):
        load_library(tmp_path / "none")


def test_a_training_goes_on_and_its_weights_are_read(ways, tmp_path):
    library = load_library(ways)
    settings = FieldSettings(minutes=0.05, scenes=4, points=64, held_out=0.0)
    trainer = FieldTrainer(library, SMALL, settings)
    first = np.mean([trainer.learn()[0] for _ in range(5)])
    trainer.save(tmp_path / "checkpoint.pt")
    other = FieldTrainer(library, SMALL, settings)
    run(other, tmp_path, 1.0, print)
    assert other.step > 5 and np.mean([other.learn()[0] for _ in range(5)]) < first
    model = load_fields(other.export(tmp_path / "planner.npz"))
    places = grid_around(np.zeros(3)).reshape(-1, 3)[::3000]
    condition = library.condition[0]
    code = other.codes.weight[0].detach().numpy()
    scale = other.net.field_scale.numpy()
    query = np.concatenate((np.tile(condition, (len(places), 1)), places), 1).astype(np.float32)
    told = (
        other.net.eval()(torch.from_numpy(query)[None], torch.from_numpy(code)[None])[0].detach().numpy()
        * scale
    )
    assert np.allclose(model.fields(places, condition, code), told, atol=0.2)
    torch.save({"net": {}}, tmp_path / "checkpoint.pt")
    with pytest.raises(WeightsError, match="choose another folder"):
        other.load(tmp_path / "checkpoint.pt")
