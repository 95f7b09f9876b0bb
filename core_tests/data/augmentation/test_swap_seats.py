"""The augment command: sit-downs on other seats, written as clips that can be annotated and composed from in
turn.
"""

from __future__ import annotations

import captures
import numpy as np
import pytest

from nsm_core.__main__ import main
from nsm_core.body.skeleton import ARMS, FEET, HIP_OVER_SEAT, forward_kinematics
from nsm_core.conventions import HAND_CONTACTS
from nsm_core.data.augmentation.swap_seats import switch_all
from nsm_core.data.captures import reader
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.matching.selection import load_sits
from nsm_core.rotations import rotate_planar
from nsm_core.world.affordances.arm_rests import arm_rests
from nsm_core.world.assets.pool import Pool


def test_hips_come_to_the_seat_hands_to_its_arms_and_feet_stay(tmp_path_factory):
    folder = captures.capture_folder(tmp_path_factory)
    sits, found = load_sits(CaptureFolder(folder)), switch_all(folder, Pool(), 10, 3)
    assert len({round(s.piece.seat.height, 3) for s in found}) > 4 and {s.piece.kind for s in found} >= {
        "armchair",
        "chair",
        "stool",
    }
    with_arms = 0
    for n, s in enumerate(found):
        sit = sits[n % len(sits)]
        middle = (sit.down + sit.up) // 2
        before, after = sit.clip.world()[0], s.clip.world()[0]
        np.testing.assert_allclose(after[middle, 0, 2], s.piece.seat.height + HIP_OVER_SEAT, atol=0.02)
        seat = rotate_planar(s.piece.seat.point[:2].astype(float), np.float64(s.pose[3])) + s.pose[:2]
        assert np.linalg.norm(after[middle, 0, :2] - seat) < 0.12
        ankles = [leg[2] for leg in FEET]
        assert np.linalg.norm(after - before, axis=-1)[:, ankles].max() < 0.04
        if s.contacts[middle, HAND_CONTACTS[0]]:
            with_arms += 1
            rests = [
                rotate_planar(np.asarray(r, float), np.float64(s.pose[3])) + s.pose[:3]
                for r in arm_rests(s.piece)
            ]
            wrists = forward_kinematics(s.clip.hips_position, s.clip.local_rotations)[0][
                middle, [arm[2] for arm in ARMS]
            ]
            assert np.linalg.norm(wrists - rests, axis=1).max() < 0.05
    assert with_arms


def test_the_command_writes_clips_and_pictures_from_which_one_can_go_on(tmp_path_factory, tmp_path, capsys):
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    folder = captures.capture_folder(tmp_path_factory)
    assert main(["augment", str(folder), "--out", str(tmp_path / "out"), "--count", "2", "--seed", "1"]) == 0
    files = sorted((tmp_path / "out").glob("*.bvh"))
    assert len(files) == 2 and all(f.with_suffix(".png").stat().st_size > 5000 for f in files)
    said = capsys.readouterr().out
    assert all(f.name in said for f in files) and "seat 0." in said
    assert len(reader.read_clip(files[0])) > 60
    (tmp_path / "none").mkdir()
    assert main(["augment", str(tmp_path / "none"), "--out", str(tmp_path / "out")]) == 1
    assert "nobody sits down" in capsys.readouterr().err
