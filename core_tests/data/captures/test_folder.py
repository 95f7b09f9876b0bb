"""Capture folders as people have them: several bodies in a file, settings beside it, and what was mended is
told.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from captures import sit, stand, walk, write_clip, write_pick_up

from nsm_core.__main__ import main
from nsm_core.body.clip import Clip
from nsm_core.body.skeleton import JOINTS
from nsm_core.data.captures import bvh_writer, reader
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.captures.joint_map import load_mapping
from nsm_core.data.matching.selection import load_bends, load_runs, load_sits, load_walks, stance
from nsm_core.errors import CaptureError


def two_bodies(path, shared_root: bool = False):
    """Write two people walking, one twice as far as the other, under two roots or under one node."""
    heads, rows = [], []
    for k, distance in enumerate((3.0, 1.5)):
        one = path.with_name(f"one{k}.bvh")
        bvh_writer.write_bvh(one, *walk(distance, 0.0, 3.2))
        head, motion = one.read_text().split("MOTION\n")
        one.unlink()
        head = (
            head.removeprefix("HIERARCHY\n")
            .replace("JOINT ", f"JOINT Actor{k}:")
            .replace("ROOT ", f"ROOT Actor{k}:")
        )
        heads.append(head.replace("ROOT ", "JOINT ") if shared_root else head)
        lines = motion.splitlines()
        rows.append(lines[2:])
    motion = [
        *lines[:2],
        *(("0 0 0 " if shared_root else "") + " ".join(row) for row in zip(*rows, strict=True)),
    ]
    if shared_root:
        heads = ["ROOT Stage\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Yrotation Xrotation\n", *heads, "}\n"]
    path.write_text("HIERARCHY\n" + "".join(heads) + "MOTION\n" + "\n".join(motion) + "\n")


def distance(clip) -> float:
    return float(np.linalg.norm(np.diff(clip.hips_position[(0, -1), :2], axis=0)))


def only(path: Path) -> Clip:
    """The one clip of a capture folder."""
    folder = CaptureFolder(path)
    (capture,) = folder.captures
    return folder.read(capture)


@pytest.mark.parametrize("shared_root", [False, True])
def test_every_body_of_a_file_is_a_clip(tmp_path, capsys, shared_root):
    two_bodies(tmp_path / "pair.bvh", shared_root)
    first = reader.read_clip(tmp_path / "pair.bvh")
    assert distance(first) == pytest.approx(3.0, abs=0.02)
    assert "pair.bvh holds 2 bodies (Actor0:Hips, Actor1:Hips)" in first.notes[0]
    folder = CaptureFolder(tmp_path)
    assert [c.path.name for c in folder.captures] == ["pair.2.bvh", "pair.bvh"]
    assert [distance(folder.read(c)) for c in folder.captures] == pytest.approx([1.5, 3.0], abs=0.02)
    assert main(["annotate", str(tmp_path), "--no-pictures"]) == 0
    assert "holds 2 bodies" in capsys.readouterr().out
    assert sorted(piece.clip.name for piece in CaptureFolder(tmp_path).labelled) == ["pair", "pair.2"]


def test_a_prop_and_an_unknown_skeleton_beside_a_body(tmp_path):
    two_bodies(tmp_path / "pair.bvh")
    text = (tmp_path / "pair.bvh").read_text()
    for joint in ("Hips", "Head", "LeftKnee"):
        text = text.replace(f"Actor0:{joint}\n", f"Actor0:thing{joint[0]}\n")
    (tmp_path / "pair.bvh").write_text(text)
    clip = reader.read_clip(tmp_path / "pair.bvh")
    assert distance(clip) == pytest.approx(1.5, abs=0.02) and "also holds Actor0:thingH" in clip.notes[0]


def test_a_wrong_frame_time_is_remarked_and_mended_by_a_mapping_of_one_line(tmp_path, capsys):
    """Captured at 120, written as 30: four times too slow; the joints are still found by their names."""
    hips, local = walk(5.0, 0.0, 5.3, rest=0.4)
    at = np.arange(0, len(hips) - 1, 0.25)
    fine = np.stack([np.interp(at, np.arange(len(hips)), hips[:, k]) for k in range(3)], axis=1)
    bvh_writer.write_bvh(tmp_path / "walk.bvh", fine, np.repeat(local, 4, axis=0)[: len(at)], fps=30)
    slow = reader.read_clip(tmp_path / "walk.bvh")
    assert (
        len(slow) == len(at)
        and "walks too slowly" in slow.notes[0]
        and "`rate = 100` or 120" in slow.notes[0]
    )
    (tmp_path / "mapping.toml").write_bytes(b"\xef\xbb\xbf# Vicon\r\nrate = 120\r\n")
    right = only(tmp_path)
    assert len(right) == pytest.approx(len(hips), abs=1) and right.notes == ()
    for wrong in ("1e308", "33.333", "0", "nan", "unknown"):
        (tmp_path / "odd.bvh").write_text((tmp_path / "walk.bvh").read_text().replace("0.0333333", wrong))
        assert len(
            reader.read_clip(tmp_path / "odd.bvh", mapping=load_mapping(tmp_path / "mapping.toml"))
        ) == len(right)


def test_a_folder_named_like_a_capture_is_none(tmp_path):
    (tmp_path / "odd.bvh").mkdir()
    bvh_writer.write_bvh(tmp_path / "odd.bvh" / "walk.3.bvh", *walk(1.0, 0.0, 1.1))
    folder = CaptureFolder(tmp_path)
    assert [c.path.name for c in folder.captures] == ["walk.3.bvh"]
    assert len(folder.read(folder.captures[0])) > 30


def test_a_mapping_for_all_names_whom_it_reads(tmp_path, capsys):
    """Who names one of two bodies in --mapping gets that one."""
    (tmp_path / "clips").mkdir()
    two_bodies(tmp_path / "clips" / "pair.bvh")
    (tmp_path / "second.toml").write_text("[joints]\n" + "".join(f'{n} = "Actor1:{n}"\n' for n in JOINTS))
    assert (
        main(
            ["annotate", str(tmp_path / "clips"), "--no-pictures", "--mapping", str(tmp_path / "second.toml")]
        )
        == 0
    )
    said = capsys.readouterr().out
    assert "1 clips annotated" in said and "also holds Actor0:Hips" in said
    second = load_mapping(tmp_path / "second.toml")
    assert distance(reader.read_clip(tmp_path / "clips" / "pair.bvh", mapping=second)) == pytest.approx(
        1.5, abs=0.02
    )


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with names here")
def test_what_never_ends_is_no_capture(tmp_path):
    os.mkfifo(tmp_path / "pipe.bvh")
    with pytest.raises(CaptureError, match=r"pipe\.bvh cannot be read \(it is no file\); check the path\.$"):
        reader.read_clip(tmp_path / "pipe.bvh")


def test_every_body_has_its_own_sidecar_and_hidden_files_are_no_captures(tmp_path):
    for source, name in (("one", "jog"), ("two", "walk")):
        (tmp_path / source).mkdir()
        two_bodies(tmp_path / source / f"{name}.bvh")
    for left in (".2f00aa11bb22-new.bvh", "._walk.bvh"):  # of a killed program, of macOS
        (tmp_path / "one" / left).write_bytes(b"\x00\x05\x16\x07HIERARCHY\nROOT")
    folder = CaptureFolder(tmp_path)
    assert [c.path.name for c in folder.captures] == ["jog.2.bvh", "jog.bvh", "walk.2.bvh", "walk.bvh"]
    assert [c.file.stem for c in folder.captures] == ["jog", "jog", "walk", "walk"]
    assert folder.labelled == () and load_walks(folder) == []  # nobody has said what they show
    count = len(folder.read(folder.captures[0]))
    for name, use in (("one/jog", "run"), ("one/jog.2", "walk"), ("two/walk.2", "walk")):
        (tmp_path / f"{name}.nsm.toml").write_text(f"frames = {count}\n[use]\n{use} = [[0, {count - 1}]]\n")
    folder = CaptureFolder(tmp_path)
    assert [c.name for c in load_walks(folder)] == ["one/jog.2", "two/walk.2"]
    assert [round(distance(c), 1) for c in load_walks(folder)] == [1.5, 1.5]
    assert [(c.name, round(distance(c), 1)) for c in load_runs(folder)] == [("one/jog", 3.0)]


@pytest.mark.skipif(os.name == "nt", reason="links and pipes are made otherwise there")
def test_settings_that_cannot_be_read_are_told_not_passed_over(tmp_path, capsys):
    bvh_writer.write_bvh(tmp_path / "walk.bvh", *walk(2.0, 0.0, 2.2))
    there = tmp_path / "mapping.toml"
    makers = (
        there.mkdir,
        lambda: there.symlink_to(tmp_path / "gone.toml"),
        lambda: there.symlink_to(there),
        lambda: os.mkfifo(there),
    )
    for make in makers:
        make()
        with pytest.raises(CaptureError, match=r"^mapping\.toml cannot be read .*\.$"):
            only(tmp_path)
        assert main(["annotate", str(tmp_path), "--no-pictures"]) == 1
        assert "walk.bvh: mapping.toml cannot be read" in capsys.readouterr().err
        there.rmdir() if there.is_dir() else there.unlink()


def test_a_folder_is_read_once_for_all_who_choose_from_it(tmp_path):
    for name, motion in (("walk", walk(2.0, 0.3, 2.2)), ("stand", stand()), ("sit", sit())):
        write_clip(tmp_path / f"{name}.bvh", motion)
    assert main(["annotate", str(tmp_path), "--no-pictures"]) == 0
    write_pick_up(tmp_path)
    folder = CaptureFolder(tmp_path)
    first = [load(folder) for load in (load_walks, load_runs, load_sits, load_bends, stance)]
    assert [len(found) > 0 for found in first] == [True, False, True, True, True]
    shutil.rmtree(tmp_path)  # whoever looked again would find nothing
    again = [load(folder) for load in (load_walks, load_runs, load_sits, load_bends, stance)]
    assert [c.name for c in again[0]] == [c.name for c in first[0]] and again[4] == first[4]
    assert [s.clip.name for s in again[2]] == [s.clip.name for s in first[2]] and len(again[3]) == len(
        first[3]
    )
