"""The object pool: meshes become few boxes with seats, the same pieces are held back everywhere, scales keep
seats sane.
"""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.distances import CRATE_SIDE, SEATS_DRAWN
from nsm_core.errors import GeometryError
from nsm_core.rotations import rotate_planar
from nsm_core.world.assets.door_from_mesh import door_measures
from nsm_core.world.assets.from_mesh import boxes_of, opening_of, piece_of
from nsm_core.world.assets.pool import Pool, hold_back, scaled
from nsm_core.world.assets.pool_cache import Entry
from nsm_core.world.scene.door import make_door
from nsm_core.world.scene.furniture import box_mesh, cuboids, make, top_of

trimesh = pytest.importorskip(
    "trimesh", reason="trimesh reads the pool's meshes; it comes with the train and test groups"
)


def write_glb(path, vertices, triangles):
    """Write a mesh of our axes (Z up, front -Y) as a GLB (Y up, front +Z)."""
    path.parent.mkdir(parents=True, exist_ok=True)
    v = np.stack((vertices[:, 0], vertices[:, 2], -vertices[:, 1]), axis=1)
    trimesh.Trimesh(v, triangles, process=False).export(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Hold a small pool: six chairs, three tables, two boxes, a lid, a wall with a hole, a leaf and a broken
    file.
    """
    root, rows, rng = tmp_path_factory.mktemp("assets"), ["file,class,front,scale"], np.random.default_rng(0)
    for kind, count in (("chair", 6), ("table", 3), ("box", 2), ("hole_wall", 1)):
        for k in range(count):
            piece = make(kind, rng, seat_height=0.45) if kind == "chair" else make(kind, rng)
            write_glb(root / kind / f"{k}.glb", piece.vertices + (3, 4, 0), piece.triangles)
            rows.append(f"{kind}/{k}.glb,{'wall' if kind == 'hole_wall' else kind},+Z,1.0")
    write_glb(root / "box/lid.glb", *box_mesh([(0, 0, 0)], [(0.5, 0.5, 0.05)]))
    (root / "chair/broken.glb").write_bytes(b"not a mesh")
    rows += ["box/lid.glb,box,n/a,1.0", "chair/broken.glb,chair,+Z,1.0", "rig/a.glb,rig,,1.0"]
    (root / "index.csv").write_text("\n".join(rows))
    return root


def test_meshes_become_standing_pieces_with_a_seat_and_the_rest_says_why(folder):
    pool = Pool.load(folder, cache=folder / "kept.npz")
    assert len(pool.entries) == 12
    assert sorted(name for name, _, _ in pool.rejected) == ["box/lid.glb", "chair/broken.glb"]
    for e in pool.entries:
        f = e.piece
        np.testing.assert_allclose((f.mins.min(0)[:2] + f.maxs.max(0)[:2]) / 2, 0, atol=1e-5)
        assert abs(f.mins[:, 2].min()) < 1e-6 and len(f.mins) <= 44 and (f.maxs > f.mins).all()
    for e in pool.of_kind("chair"):
        assert e.piece.seat.height == pytest.approx(0.45, abs=0.01) and e.piece.seat.heading == 0
        query = cuboids([(e.piece, (0, 0), 0.0)])
        over, under = (e.piece.seat.point + (0, 0, dz) for dz in (0.01, -0.01))
        assert query.signed_distance(over[None], 1.0)[0] > 0 > query.signed_distance(under[None], 1.0)[0]
    assert [e.piece.kind for e in pool.entries if e.group == "wall"] == ["hole_wall"]
    assert all(0.6 < top_of(e.piece)[0] < 0.85 for e in pool.of_kind("table"))
    text = pool.table()
    assert "chair     chair" in text and "left out: box/lid.glb (It is only 0.05 m thick" in text


def test_boxes_cover_the_mesh_and_little_else():
    chair = make("chair", np.random.default_rng(5), legs="posts", back_style="ladder")
    mins, maxs = boxes_of(chair.vertices, chair.triangles)
    query = cuboids([(chair, (0, 0), 0.0)])
    assert len(mins) <= 40
    volume = np.prod(maxs - mins, axis=1).sum()
    true = np.prod(chair.maxs - chair.mins, axis=1).sum()
    assert true < volume < 2.5 * true  # bars of 2.5 cm touch two fine voxels
    middles = (mins + maxs) / 2
    assert query.signed_distance(middles.astype(np.float32), 1.0).max() < 0.05
    np.testing.assert_allclose((mins.min(0), maxs.max(0)), (chair.mins.min(0), chair.maxs.max(0)), atol=1e-4)


def test_a_turned_seat_is_brought_to_the_front_only_where_the_front_is_unknown():
    chair = make("chair", np.random.default_rng(1))
    turned = rotate_planar(chair.vertices.astype(float), np.pi / 2)
    with pytest.raises(GeometryError, match="away from the front"):
        piece_of(turned, chair.triangles, "chair", sits=True)
    piece = piece_of(turned, chair.triangles, "chair", sits=True, front_known=False)
    np.testing.assert_allclose(piece.size, chair.size, atol=1e-3)
    np.testing.assert_allclose(piece.seat.point, chair.seat.point, atol=0.04)


def test_a_fifth_of_every_class_is_held_back_the_same_ones_every_time(folder):
    pool = Pool.load(folder, cache=folder / "kept.npz")
    held = {e.name for e in pool.held_back().entries}
    assert held == {e.name for e in Pool.load(folder).held_back().entries}  # read anew
    for kind, least in (("chair", 2), ("table", 1), ("box", 1)):
        of = pool.of_kind(kind)
        assert sum(e.held for e in of) == least < len(of)
    assert not held & {e.name for e in pool.training().entries}
    twins = [Entry(f"{k}.glb", "box", pool.of_kind("box")[0].piece) for k in range(6)]
    assert (
        len({e.held for e in hold_back(twins, 0.2)}) == 1
    )  # the same shape under another name would be no test
    assert len(Pool.load(folder, held_back=0.5).held_back().entries) > len(held)


def test_the_cache_serves_until_the_index_changes(folder, tmp_path):
    first = Pool.load(folder, cache=tmp_path / "deep" / "pool.npz")
    missing = tmp_path / "elsewhere"
    missing.mkdir()
    (missing / "index.csv").write_bytes((folder / "index.csv").read_bytes())
    again = Pool.load(missing, cache=tmp_path / "deep" / "pool.npz")  # there are no meshes beside this index
    assert [(e.name, e.held) for e in again.entries] == [(e.name, e.held) for e in first.entries]
    for a, b in zip(first.entries, again.entries, strict=True):
        np.testing.assert_array_equal(a.piece.mins, b.piece.mins)
        assert a.piece.kind == b.piece.kind and a.piece.opening == pytest.approx(b.piece.opening)
        assert (a.piece.seat is None) == (b.piece.seat is None)
        if a.piece.seat:
            np.testing.assert_allclose(a.piece.seat.point, b.piece.seat.point)
    (missing / "index.csv").write_text((folder / "index.csv").read_text() + "\nchair/other.glb,chair,+Z,1.0")
    assert len(Pool.load(missing, cache=tmp_path / "deep" / "pool.npz").entries) == 0


def test_draws_mix_meshes_and_parametric_pieces_and_repeat_by_seed(folder):
    pool = Pool.load(folder, cache=folder / "kept.npz").training()
    a, b = (pool.draw("chair", np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(a.mins, b.mins)
    rng = np.random.default_rng(0)
    seats = [pool.draw("chair", rng).seat.height for _ in range(40)]
    assert SEATS_DRAWN[0] - 1e-6 <= min(seats) < 0.42 and 0.5 < max(seats) <= SEATS_DRAWN[1] + 1e-6
    for _ in range(10):
        crate = pool.draw("crate", rng)
        assert (
            crate.kind == "crate"
            and (crate.size >= CRATE_SIDE[0] - 1e-5).all()
            and (crate.size <= CRATE_SIDE[1] + 1e-5).all()
        )
    assert pool.draw("step", rng).kind == "step"
    assert Pool().draw("sofa", rng).kind == "sofa"
    meshes = Pool.load(folder, cache=folder / "kept.npz").held_back()
    heights = {round(float(meshes.draw("chair", rng, augment=False).size[2]), 4) for _ in range(12)}
    assert heights == {round(float(e.piece.size[2]), 4) for e in meshes.of_kind("chair")}


def test_scaling_takes_the_seat_and_the_opening_along():
    chair = make("chair", np.random.default_rng(0), seat_height=0.4)
    taller = scaled(chair, (1.0, 1.0, 1.25))
    assert taller.seat.height == pytest.approx(0.5) and taller.size[2] == pytest.approx(1.25 * chair.size[2])
    np.testing.assert_allclose(taller.seat.point[:2], chair.seat.point[:2])
    wall = scaled(make("hole_wall", np.random.default_rng(0)), (1.2, 1.0, 1.0))
    np.testing.assert_allclose(opening_of(wall), wall.opening, atol=2e-3)


def door_parts(shift=0.0, height=2.05):
    """A leaf of 0.8 m whose handle is on the right, with a pane, in a frame; (name, vertices, triangles)."""
    boxes = {
        "frame": ([(-0.5, -0.06, 0), (0.42, -0.06, 0)], [(-0.41, 0.06, 2.1), (0.5, 0.06, 2.1)]),
        "door": ([(-0.4, -0.02, 0)], [(0.4, 0.02, height)]),
        "door_pane": ([(-0.35, -0.01, 0.1)], [(0.35, 0.01, 1.9)]),
        "knob": ([(0.3, -0.07, 1.0)], [(0.36, 0.07, 1.04)]),
    }
    return [
        (name, *box_mesh(np.array(a) + (shift, 0, 0), np.array(b) + (shift, 0, 0)))
        for name, (a, b) in boxes.items()
    ]


def test_doors_are_measured_by_their_parts():
    found = door_measures(door_parts(0.3))
    expected = {
        "width": 0.8,
        "height": 2.05,
        "panel": 0.04,
        "grips": 0.14,
        "handle_height": 1.02,
        "handle_edge": 0.07,
        "lever": 0.03,
    }
    assert {k: pytest.approx(v, abs=1e-5) for k, v in expected.items()} | {
        "depth": pytest.approx(0.12, abs=1e-5)
    } == found
    door = make_door(np.random.default_rng(0), **found)
    assert door.width == pytest.approx(0.8, abs=1e-5) and door.handle[2] == pytest.approx(1.02, abs=1e-5)
    with pytest.raises(GeometryError, match="handle"):
        door_measures(door_parts()[:3])
    with pytest.raises(GeometryError, match="0 parts that could be the leaf"):
        door_measures(door_parts()[:1])


def test_doors_of_the_pool_are_split_kept_and_drawn(folder, tmp_path):
    (tmp_path / "index.csv").write_text("file,class\n" + "".join(f"d{k}.glb,door\n" for k in range(4)))
    for k in range(4):
        scene = trimesh.Scene()
        for name, v, f in door_parts(height=1.9 + 0.05 * k):
            scene.add_geometry(
                trimesh.Trimesh(np.stack((v[:, 0], v[:, 2], -v[:, 1]), 1), f, process=False), node_name=name
            )
        scene.export(tmp_path / f"d{k}.glb")
    pool = Pool.load(tmp_path, cache=tmp_path / "pool.npz")
    assert sum(d.held for d in pool.doors) == 1 and len(pool.training().doors) == 3
    assert Pool.load(tmp_path, cache=tmp_path / "pool.npz").doors == pool.doors
    a, b = (pool.training().draw_door(np.random.default_rng(2)) for _ in range(2))
    np.testing.assert_array_equal(a.piece.mins, b.piece.mins)
    door = pool.held_back().draw_door(np.random.default_rng(0))
    assert door.thickness == pytest.approx(0.14, abs=1e-5) and 0.72 <= door.width <= 0.87
    assert 0.7 < Pool().draw_door(np.random.default_rng(0)).width < 1.05


def test_a_folder_without_an_index_is_refused(tmp_path):
    with pytest.raises(GeometryError, match="no index.csv"):
        Pool.load(tmp_path)
    (tmp_path / "index.csv").write_text("name\nchair")
    with pytest.raises(GeometryError, match="lacks the columns"):
        Pool.load(tmp_path)
