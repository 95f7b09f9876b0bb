"""What people really hand to the readers: pipes and folders for files, odd letters, numbers as texts, things
said twice.
"""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from captures import walk

from nsm_core.body.skeleton import JOINTS
from nsm_core.data.annotation.proposal import propose
from nsm_core.data.captures import bvh_writer, reader, sidecar, sidecar_writer
from nsm_core.data.captures.joint_map import load_mapping
from nsm_core.errors import CaptureError, NsmError
from nsm_core.model.inference import model
from nsm_core.model.inference.weights_file import load_weights

MAPPING = 'units = "cm"\nup = "+Y"\nforward = "auto"\nrest = "frame 0"\nrate = 120\n[joints]\n' + "".join(
    f'{j} = "{j}"\n' for j in JOINTS
)
READERS = {
    "bvh": reader.read_clips,
    "nsm.toml": sidecar.read_sheet,
    "toml": load_mapping,
    "npz": load_weights,
}


def sentence(read, path) -> str:
    with pytest.raises(NsmError) as raised:
        read(path)
    text = str(raised.value)
    assert text.endswith(".") and text.isprintable() and len(text) < 1500, text
    return text


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A sound file of every kind, by its ending."""
    folder = tmp_path_factory.mktemp("good")
    hips, local = walk(0.6, 0.3, 1.1, rest=0.2)
    bvh_writer.write_bvh(folder / "a.bvh", hips, local)
    clip = reader.read_clip(folder / "a.bvh")
    sidecar_writer.write_sheet(folder / "a.nsm.toml", *propose(clip))
    npz = model.BUNDLED
    return {
        "bvh": (folder / "a.bvh").read_bytes(),
        "nsm.toml": (folder / "a.nsm.toml").read_bytes(),
        "toml": MAPPING.encode(),
        "npz": npz.read_bytes(),
    }


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.skipif(sys.platform == "win32", reason="pipes and rings of links are made otherwise there")
def test_what_is_no_file_is_told_at_once(tmp_path, kind, good):
    read = READERS[kind]
    (tmp_path / f"folder.{kind}").mkdir()
    os.mkfifo(tmp_path / f"pipe.{kind}")
    for a, b in (("one", "two"), ("two", "one")):
        (tmp_path / f"{a}.{kind}").symlink_to(tmp_path / f"{b}.{kind}")
    (tmp_path / f"gone.{kind}").symlink_to(tmp_path / "nothing")
    (tmp_path / f"good.{kind}").write_bytes(good[kind])
    names = ("folder", "pipe", "one", "gone", "missing", "no/such", "a\0b", "n" * 300)
    for path in (
        *(tmp_path / f"{name}.{kind}" for name in names),
        tmp_path / f"good.{kind}" / "x",
        Path("/proc/self/mem"),
    ):
        sentence(read, path)


@pytest.mark.parametrize("kind", READERS)
def test_what_is_of_another_kind_is_told(tmp_path, kind, good):
    path = tmp_path / f"x.{kind}"
    pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"
    others = [
        data for other, data in good.items() if other != kind and not (kind == "toml" and other == "nsm.toml")
    ]
    heads = (b"<!DOCTYPE html><html>404</html>", b"\x89PNG\r\n\x1a\n" + bytes(100), b"\x1f\x8b\x08\0\0")
    for data in (b"\0" * 5000, pointer, *heads, *others):
        path.write_bytes(data)
        sentence(READERS[kind], path)


@pytest.mark.skipif(sys.platform == "win32", reason="no such names there")
@pytest.mark.parametrize("name", ['a"b', "a'b", "a\nb", "a\\", "a\x1b[31m", "größe", "a b", "𓀀", "a\udcff"])
def test_whatever_a_file_is_called_its_sentence_is_one_line(tmp_path, name, good):
    for kind, read in READERS.items():
        path = tmp_path / f"{name}.{kind}"
        path.write_bytes(good[kind])
        read(path)
        path.write_bytes(good[kind][:300])
        sentence(read, path)


MARKS = {
    "mark": lambda t: b"\xef\xbb\xbf" + t.encode(),
    "mark twice, Windows line ends": lambda t: b"\xef\xbb\xbf" * 2 + t.replace("\n", "\r\n").encode(),
    "mark, Latin-1 letters": lambda t: b"\xef\xbb\xbf" + t.replace("\n", "\r\n").encode() + b"# \xe9\xff",
    "UTF-16": lambda t: t.replace("\n", "\r\n").encode("utf-16"),
    "old Mac line ends": lambda t: t.replace("\n", "\r").encode(),
    "letters without width": lambda t: ("\u200b" + t).encode(),
    "end of a DOS text": lambda t: t.encode() + b"\x1a",
    "tabs": lambda t: t.replace(" = ", "\t=\t").encode(),
}


@pytest.mark.parametrize("mark", MARKS)
def test_texts_as_editors_leave_them(tmp_path, mark, good):
    for kind in ("bvh", "nsm.toml", "toml"):
        plain, path = tmp_path / f"plain.{kind}", tmp_path / f"x.{kind}"
        plain.write_bytes(good[kind])
        path.write_bytes(MARKS[mark](good[kind].decode()))
        before, after = (READERS[kind](p) for p in (plain, path))
        if kind == "bvh":
            assert np.array_equal(before[0].hips_position, after[0].hips_position)
        else:
            assert after == before


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('Hips = "Hips"', "Hips = 5", "Hips must name one joint of the file, in quotes, not 5"),
        ('Hips = "Hips"', 'Hips = ""', "Hips must name one joint"),
        ('Hips = "Hips"', 'Hips = ["a", "b"]', "Hips must name one joint"),
        ('Head = "Head"', 'Head = "Hips"', "Hips and Head both name 'Hips'"),
        ("[joints]\n", '[sides]\nKnee = "knee"\n[joints]\n', None),
        ('LeftKnee = "LeftKnee"\n', "", "names no joint for LeftKnee"),
        ('forward = "auto"', 'forward = "-Y"', "up and forward are along one axis, Y"),
        ("rate = 120", 'rate = "120"', "rate must be"),
        ("rate = 120", "rate = true", "rate must be"),
        ("rate = 120", "rate = 120\nrate = 1", "not valid TOML"),
        ('units = "cm"', 'units = "0.01"', "units must be"),
        ('units = "cm"', "units = nan", "units must be"),
        ('rest = "frame 0"', 'rest = "frame -1"', "rest must be"),
        ("rate = 120", "rate = 120\nspine = [1]", "spine must be"),
        ("[joints]\n", "[[joints]]\n", "it must be a table"),
    ],
)
def test_mappings(tmp_path, old, new, says):
    path = tmp_path / "mapping.toml"
    path.write_text(MAPPING.replace(old, new, 1))
    if says is None:
        assert load_mapping(path).joints["LeftKnee"] == "LeftKnee"  # [joints] is the last word
    else:
        assert says in sentence(load_mapping, path)


def test_sides_without_a_side_are_one_joint_twice(tmp_path):
    path = tmp_path / "mapping.toml"
    path.write_text(re.sub(r"(Left|Right)Knee = .*\n", "", MAPPING) + '[sides]\nKnee = "knee"\n')
    assert "RightKnee and LeftKnee both name 'knee'" in sentence(load_mapping, path)


@pytest.mark.parametrize(
    ("old", "new", "note"),
    [
        (r"Frames: \d+", "Frames: 0", "0 frames are announced"),
        (r"Frame Time: .*\n", "", "no Frame Time is said"),
        (r"OFFSET .*\n", "", "27 joints, such as Chest, have no OFFSET"),
        (r"\Z", "MOTION\nFrames: 1\n", "what stands behind the last frame"),
        (r"Frame Time: .*", "Frame Time: 33", CaptureError),
        (r"Frames: (\d+)", r"Frames: 1\1", CaptureError),
        (r"JOINT Chest\n", "JOINT \n", CaptureError),
        (r"JOINT LeftKnee\n", "JOINT RightKnee\n", NsmError),
        (r"LeftKnee", "L" * 100_000, NsmError),
        (r"Xrotation", "Wrotation", CaptureError),
        (r"MOTION[\s\S]*", "", CaptureError),
    ],
)
def test_captures_that_are_odd_are_read_with_a_note_or_refused(tmp_path, good, old, new, note):
    path = tmp_path / "a.bvh"
    path.write_text(re.sub(old, new, good["bvh"].decode()))
    if isinstance(note, str):
        clip = reader.read_clip(path)
        assert len(clip) > 20 and any(note in said for said in clip.notes), clip.notes
    else:
        sentence(reader.read_clip, path)
