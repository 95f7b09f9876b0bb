"""Motion kept as a pose a second, and made whole again."""

from __future__ import annotations

import numpy as np
import pytest
from gaps_of_walks import walk

from nsm_core.commands import decompress as command
from nsm_core.control.super_resolution import Compressed, compress, decompress
from nsm_core.data.captures.bvh_writer import write_bvh
from nsm_core.data.captures.reader import read_clip
from nsm_core.errors import CaptureError


def test_what_is_kept_is_met_and_small(tmp_path):
    clip = walk()
    kept = compress(clip)
    path = kept.save(tmp_path / "walk.npz")
    whole = clip.hips_position.nbytes + clip.local_rotations.nbytes // 2
    assert len(kept.targets) == 3 and path.stat().st_size < whole / 4
    made = decompress(Compressed.load(path), None)
    assert len(made) == 100
    for frame in (*range(10), 39, 69, 99):
        assert np.abs(made.world()[0][frame] - clip.world()[0][frame]).max() < 2e-3


def test_what_cannot_be_kept_or_read_is_told(tmp_path):
    with pytest.raises(CaptureError, match="walk has 40 frames, and 41 are the least"):
        compress(walk()[:40])
    assert len(compress(walk()[:41]).targets) == 1
    (tmp_path / "bad.npz").write_bytes(b"PK")
    with pytest.raises(CaptureError, match="holds no compressed motion"):
        Compressed.load(tmp_path / "bad.npz")
    odd = compress(walk())
    Compressed(odd.past, (odd.targets[0][:1],)).save(tmp_path / "odd.npz")
    with pytest.raises(CaptureError, match="11 frames, which are no targets"):
        Compressed.load(tmp_path / "odd.npz")


def test_the_command_says_what_it_costs(tmp_path, capsys):
    clip = walk()
    write_bvh(tmp_path / "walk.bvh", clip.hips_position, clip.local_rotations)
    out = tmp_path / "made.bvh"
    assert command.main([str(tmp_path / "walk.bvh"), "--out", str(out), "--interpolate"]) == 0
    assert "3.3 s kept in" in capsys.readouterr().out
    again = tmp_path / "again.bvh"
    assert command.main([str(tmp_path / "made.npz"), "--out", str(again), "--interpolate"]) == 0
    assert np.array_equal(read_clip(out).hips_position, read_clip(again).hips_position)
