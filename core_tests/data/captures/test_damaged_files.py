"""Damaged captures, mappings, sidecars and pools: a sentence or a right result, nothing else, in bounded
memory.
"""

from __future__ import annotations

import re
import struct
from dataclasses import replace

import numpy as np
import pytest
from captures import sit, walk
from fuzzing import survives

from nsm_core.body.clip import Clip
from nsm_core.body.skeleton import JOINTS
from nsm_core.data.annotation.proposal import arrays_of, propose
from nsm_core.data.captures import bvh_writer, reader, sidecar, sidecar_writer
from nsm_core.data.captures.joint_map import load_mapping
from nsm_core.data.captures.joint_names import families
from nsm_core.data.captures.sheet import Use
from nsm_core.world.assets import glb
from nsm_core.world.assets.pool import Pool


@pytest.fixture(scope="module")
def motion():
    hips, local = walk(0.6, 0.3, 1.1, rest=0.2)
    return hips[::4], local[::4]


@pytest.mark.parametrize("names", ["own", "mixamo"])
def test_captures(tmp_path, motion, names):
    path = tmp_path / "a.bvh"
    bvh_writer.write_bvh(path, *motion)
    text = path.read_text()
    if names == "mixamo":  # retargeted instead of taken as it is
        limbs = {
            "Shoulder": "Arm",
            "Elbow": "ForeArm",
            "Wrist": "Hand",
            "Collar": "Shoulder",
            "Knee": "Leg",
            "Ankle": "Foot",
        }
        text = "".join(limbs.get(w, w) for w in re.split(f"({'|'.join(limbs)})", text)).replace(
            "tHip\n", "tUpLeg\n"
        )

    def read(data: bytes) -> None:
        path.write_bytes(data)
        clips = reader.read_clips(path)
        assert clips and all(
            isinstance(c, Clip) and len(c) and np.abs(c.hips_position).max() < 1e9 for c in clips
        )

    done, refused = survives(read, text.encode(), 200, seed=5)
    assert done > 20 and refused > 20


def test_mappings(tmp_path):
    path = tmp_path / "m.toml"
    body = 'units = "cm"\nup = "+Y"\nforward = "auto"\nrest = "frame 0"\nrate = 120\nspine = ["a", "b"]\n'
    body += '[joints]\nHips = "h"\nHead = [ "k" ]\n'
    body += "[sides]\n" + "".join(
        f'{n} = "{{side}} {n}"\n' for n in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle")
    )

    def read(data: bytes) -> None:
        path.write_bytes(data)
        found = load_mapping(path)
        assert found.rate is None or 2 <= found.rate <= 5000
        assert found.units is None or 0 < found.units < 1e7
        assert set(found.joints) <= set(JOINTS) and all(
            isinstance(n, str) for n in (*found.joints.values(), *found.spine)
        )

    done, refused = survives(read, body.encode(), 500, seed=6)
    assert done > 10 and refused > 100


@pytest.fixture(scope="module")
def sheet_text(tmp_path_factory):
    clip = Clip("walk", *(a.astype(np.float32) for a in sit()))
    path = tmp_path_factory.mktemp("sheets") / "walk.nsm.toml"
    sidecar_writer.write_sheet(path, *propose(clip))
    return path.read_bytes()


def test_sidecars(tmp_path, sheet_text):
    path = tmp_path / "walk.nsm.toml"

    def read(data: bytes) -> None:
        path.write_bytes(data)
        sheet = sidecar.read_sheet(path)
        sheet.edited()
        if sheet.frames > 10_000:  # who computes holds it against the clip first
            return
        a = arrays_of(sheet)
        for name in ("style", "contact", "phase", "phase_mirrored"):
            assert np.isfinite(getattr(a, name)).all(), name
        assert all(g.place is None or np.isfinite(g.place).all() for g in a.goals)
        again = tmp_path / "again.nsm.toml"
        sidecar_writer.write_sheet(again, sheet)
        assert [g.action for g in sidecar.read_sheet(again).goals] == [g.action for g in sheet.goals]

    done, refused = survives(read, sheet_text, 400, seed=7)
    assert done > 20 and refused > 100


@pytest.mark.parametrize(
    ("line", "wrong"),
    [
        (key, value)
        for key, values in {
            "place": (
                "[nan, 0, 0]",
                "[1e39, 0, 0]",
                "[true, 0, 0]",
                "[1, 2]",
                "[[1], 2, 3]",
                f"[{'9' * 400}, 0, 0]",
                "{x = 1}",
                "'a'",
            ),
            "facing": ("nan", "inf", "1e300", "true", "'north'", "9" * 400, "[0]", "-1e5"),
            "ahead": ("nan", "-1", "1e300", "true", "'soon'", "9" * 400),
            "frame": ("-1", "true", "1.5", "'1'", "9" * 30, "[1]", "nan"),
            "action": ("1", "['walk']", "''", "'walk+'", "'walk+walk'", "'walk+idle+sit'", "true", "'Walk'"),
            "kind": ("'dynamic'", "1", "true", "''", "['static']"),
            "places": ("[0, 0, 0]",),
            "Place": ("[0, 0, 0]",),
        }.items()
        for value in values
    ],
)
def test_no_edit_of_a_goal_passes_without_a_word(tmp_path, line, wrong):
    """A static goal whose place is damaged, misspelt or contradicted must not become a goal of nowhere."""
    lines = {"frame": "0", "action": '"sit"', "kind": '"static"', "place": "[0.1, 0.2, 0.5]", "facing": "90"}
    if line == "ahead":
        lines = {"frame": "0", "action": '"walk"', "kind": '"dynamic"', "ahead": "1"}
    if line in ("places", "Place"):
        del lines["place"], lines["kind"]
    path = tmp_path / "a.nsm.toml"
    for change, read in ((lines | {line: wrong}, False), (lines, line not in ("places", "Place"))):
        path.write_text(
            "clip = 'a'\nframes = 60\n[[goals]]\n" + "".join(f"{k} = {v}\n" for k, v in change.items())
        )
        if read:
            assert len(sidecar.read_sheet(path).goals) == 1
        elif change is not lines:
            with pytest.raises(sidecar.CaptureError, match=r"^a\.nsm\.toml.*\.$"):
                sidecar.read_sheet(path)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("frames = true", "`frames` must say"),
        (f"frames = {'9' * 40}", "`frames` must say"),
        ("frames = 60\nactions = []", r"\[actions\] is \[\]; it must be a table"),
        ("frames = 60\nactions = {walk = [1]}", r"\[actions.walk\]: expected lines"),
        ("frames = 60\nphase = 3", r"\[phase\]: expected lines"),
        ("frames = 60\nphase = {1 = 0.5, 01 = 0.5}", "frame 1 stands twice"),
        ("frames = 60\nphase = {'²' = 1}", "is no frame of this clip"),
        ("frames = 60\nphase = {1 = nan}", "has the value nan"),
        ("frames = 60\ngoals = {}", "it must be a list"),
        ("frames = 60\ngoals = [3]", "goal 1 is 3"),
        ("frames = 60\nproposal = []", r"\[proposal\] is \[\]"),
        ("frames = 60\nproposal = {goals = 3}", "'goals' is 3; it must be a text"),
        ("frames = 60\nclip = 3", "clip is 3; it must be a text"),
        ("frames = 60\nuse = {walk = 3}", r"\[use\]: walk is 3; it must be a list"),
        ("frames = 60\nuse = {hop = []}", "'hop' is not known; use walk, run, sit, bend, stand"),
        ("frames = 60\nuse = {run = [3]}", r"3 is no stretch; write it as \[first, last\]"),
        ("frames = 60\nuse = {run = [[0, 60]]}", "a frame is 60; it must be a whole number from 0 to 59"),
        ("frames = 60\nuse = {sit = [[30, 10]]}", r"\[30, 10\] is shorter than 20 frames"),
        (
            "frames = 60\nuse = {walk = [[0, 30], [30, 59]]}",
            r"\[30, 59\] begins before the stretch ahead of it",
        ),
        ("frames = 60\nuse = {stand = 1.5}", "stand is 1.5; it must be a whole number"),
        ("frames = 60\n[action.walk]\n1 = 1", "'action' is not known"),
        (
            "frames = 60\n[[goals]]\nframe = 1\naction = 'walk'\n[[goals]]\nframe = 1\naction = 'idle'",
            "two goals begin at frame 1",
        ),
    ],
)
def test_a_sidecar_that_says_what_it_cannot_is_refused_in_its_own_words(tmp_path, text, says):
    (tmp_path / "a.nsm.toml").write_text(text)
    with pytest.raises(sidecar.CaptureError, match=rf"^a\.nsm\.toml.*{says}.*\.$"):
        sidecar.read_sheet(tmp_path / "a.nsm.toml")


def test_what_a_clip_is_used_for_comes_back(tmp_path, sheet_text):
    (tmp_path / "a.nsm.toml").write_bytes(sheet_text)
    sheet = sidecar.read_sheet(tmp_path / "a.nsm.toml")
    assert sheet.use == Use() and "\n[use]" not in sheet_text.decode()
    for use in (Use(walk=()), Use(((0, 20), (21, 60)), (), ((3, 40),), ((5, 29),), 7), Use(stand=0)):
        sidecar_writer.write_sheet(tmp_path / "b.nsm.toml", replace(sheet, use=use))
        assert sidecar.read_sheet(tmp_path / "b.nsm.toml") == replace(sheet, use=use)


@pytest.mark.parametrize(
    "name",
    [
        'a "quoted" one',
        "back\\slash",
        "line\nend",
        "bell\x07 tab\t",
        "größe 歩く",
        "lone \udc80",
        "#[x]",
        "'''",
    ],
    ids=ascii,
)
def test_clip_names_of_any_letters_come_back(tmp_path, sheet_text, name):
    (tmp_path / "a.nsm.toml").write_bytes(sheet_text)
    sheet = sidecar.read_sheet(tmp_path / "a.nsm.toml")
    sidecar_writer.write_sheet(tmp_path / "b.nsm.toml", replace(sheet, clip=name), {0: name})
    again = sidecar.read_sheet(tmp_path / "b.nsm.toml")
    assert again.clip == name.replace("\udc80", "?") and again.goals == sheet.goals and again.edited() == []


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_sidecars_as_windows_saves_them(tmp_path, sheet_text, encoding):
    (tmp_path / "a.nsm.toml").write_bytes(sheet_text)
    (tmp_path / "b.nsm.toml").write_bytes(sheet_text.decode().replace("\n", "\r\n").encode(encoding))
    assert sidecar.read_sheet(tmp_path / "b.nsm.toml") == sidecar.read_sheet(tmp_path / "a.nsm.toml")


def one_triangle() -> bytes:
    """A GLB of one triangle, written by hand."""
    corners = (
        np.array(((0, 0, 0), (0.5, 0, 0), (0, 0.5, 0.5)), np.float32).tobytes()
        + np.array((0, 1, 2, 0), np.uint16).tobytes()
    )
    said = (
        '{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], '
        '"nodes": [{"children": [1], "scale": [1, 1, 1]}, {"name": "leaf", "mesh": 0, "translation": [0, 1, '
        "0]}], "
        '"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}], "buffers": '
        '[{"byteLength": 44}], '
        '"bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": '
        "6}], "
        '"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, '
        '0], "max": [1, 1, 1]}, '
        '{"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}]}'
    )
    return packed(said.encode(), corners)


def packed(said: bytes, corners: bytes) -> bytes:
    said += b" " * (-len(said) % 4)
    parts = (
        struct.pack("<I4s", len(said), b"JSON") + said + struct.pack("<I4s", len(corners), b"BIN\0") + corners
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts


def test_meshes(tmp_path):
    pytest.importorskip(
        "trimesh", reason="trimesh reads the pool's meshes; it comes with the train and test groups"
    )
    path, whole = tmp_path / "a.glb", one_triangle()
    path.write_bytes(whole)
    assert [name for name, _, _ in glb.read_parts(path)] == ["leaf"]
    size = struct.unpack_from("<I", whole, 12)[0]
    said, corners = whole[20 : 20 + size], whole[28 + size :]

    def read(data: bytes) -> None:
        path.write_bytes(data)
        for _, v, f in glb.read_parts(path):
            assert np.isfinite(v).all() and f.max() < len(v)

    def described(data: bytes) -> None:
        read(packed(data, corners))

    assert min(survives(described, said, 300, seed=8)) > 10
    assert survives(read, whole, 150, seed=9)[1] > 50


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"count": 3', '"count": 1000000000000'),
        ('"count": 3', '"count": -3'),
        ('"bufferView": 0, ', ""),
        ('"children": [1]', '"children": [0]'),
        ('"children": [1]', '"children": [1, 1]'),
        ('"scale": [1, 1, 1]', '"scale": [1e300, 1, 1]'),
        ('"byteLength": 36', '"byteLength": 1e99'),
        ('"mesh": 0', '"mesh": 7'),
        ('"indices": 1', '"indices": 0.5'),
        ('"byteLength": 44', '"byteLength": 44, "uri": "/etc/passwd"'),
    ],
)
def test_a_mesh_that_declares_what_it_does_not_hold(tmp_path, old, new):
    whole = one_triangle()
    size = struct.unpack_from("<I", whole, 12)[0]
    said = whole[20 : 20 + size].decode()
    assert old in said
    (tmp_path / "a.glb").write_bytes(packed(said.replace(old, new).encode(), whole[28 + size :]))
    with pytest.raises(glb.GeometryError, match=r"^a\.glb.*\.$"):
        glb.check(tmp_path / "a.glb")


def test_indices(tmp_path):
    pytest.importorskip(
        "trimesh", reason="trimesh reads the pool's meshes; it comes with the train and test groups"
    )
    (tmp_path / "a.glb").write_bytes(one_triangle())
    path = tmp_path / "index.csv"

    def read(data: bytes) -> None:
        path.write_bytes(data)
        pool = Pool.load(tmp_path)
        assert all(len(r) == 3 for r in pool.rejected)

    index = "file,class,front,scale\na.glb , table , +Z , 1.0 \na.glb , box , +Z , 1.0 \nb.glb , rig , , \n"
    assert min(survives(read, index.encode(), 60, seed=10)) > 5


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_an_index_as_spreadsheets_save_it(tmp_path, encoding, mark):
    pytest.importorskip(
        "trimesh", reason="trimesh reads the pool's meshes; it comes with the train and test groups"
    )
    rows = [["File", " class", "scale", "note"], ["gone.glb", "chair", '"1,5"', "größe"]]
    rows += [["gone.glb", "chair", "much", ""], ["a.glb", "rig"]]
    (tmp_path / "index.csv").write_bytes("\r\n".join(mark.join(row) for row in rows).encode(encoding))
    (tmp_path / "kept.npz").write_bytes(b"PK\x03\x04 damaged")
    pool = Pool.load(tmp_path, cache=tmp_path / "kept.npz")
    assert [reason[:28] for _, _, reason in pool.rejected] == [
        "gone.glb cannot be read (No ",
        "Its scale is 'much'; write a",
    ]
    assert Pool.load(tmp_path, cache=tmp_path / "kept.npz").rejected == pool.rejected


def test_every_family_is_a_mapping_of_known_joints():
    assert len(families()) > 12
    for name, wanted in families().items():
        assert {"Hips", "Head", "LeftKnee", "RightWrist"} <= set(wanted), name
