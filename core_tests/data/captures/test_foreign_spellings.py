"""Any spelling of the format is read: without a word, with a note of what was mended, or refused in a
sentence.
"""

from __future__ import annotations

import re

import pytest
from foreign_bvh import same

from nsm_core.data.captures import reader
from nsm_core.errors import CaptureError, NsmError, SkeletonError


def rows(text: str, change) -> str:
    """Change every row of numbers of a capture."""
    head, _, body = text.rpartition("Frame Time: 0.0333333\n")
    return head + "Frame Time: 0.0333333\n" + "".join(change(row) + "\n" for row in body.splitlines())


FORGIVEN = {
    "doubled carriage returns": lambda t: t.replace("\n", "\r\r\n"),
    "old carriage returns": lambda t: t.replace("\n", "\r"),
    "blank lines everywhere": lambda t: t.replace("\n", "\n \t\n"),
    "no colons": lambda t: t.replace("Frames:", "Frames").replace("Time:", "Time"),
    "colons apart": lambda t: t.replace("Frames:", "Frames :").replace("Time: ", "Time:\t"),
    "small letters": lambda t: re.sub(
        "[A-Z]{3,}|Frames|Frame Time|Site|[XYZ](?=rot|pos)", lambda m: m[0].lower(), t
    ),
    "large letters": lambda t: re.sub("Frames|Frame Time|Site|rotation|position", lambda m: m[0].upper(), t),
    "tabs": lambda t: t.replace(" ", "\t").replace("Frame\tTime", "Frame Time"),
    "wide spaces": lambda t: rows(t, lambda r: "   " + r.replace(" ", "    ") + "  "),
    "brackets behind names": lambda t: t.replace("\n{", " {"),
    "a remark on top": lambda t: "# exported by a program\n" + t,
    "no line end": lambda t: t.rstrip("\n"),
    "head the other way round": lambda t: re.sub(r"(Frames: \d+)\n(Frame Time: .*)\n", r"\2\n\1\n", t),
    "decimal commas": lambda t: t.replace(".", ","),
    "commas between numbers": lambda t: rows(t, lambda r: r.replace(" ", ", ")),
    "semicolons and decimal commas": lambda t: rows(t, lambda r: r.replace(".", ",").replace(" ", ";")),
    "powers of ten": lambda t: rows(t, lambda r: " ".join(f"{float(w):+.8E}" for w in r.split())),
    "rows over several lines": lambda t: rows(t, lambda r: "\n".join(r.rsplit(" ", 20))),
    "no count": lambda t: re.sub(r"Frames: \d+\n", "", t),
}


@pytest.mark.parametrize("name", FORGIVEN)
def test_what_other_readers_open_is_read_without_a_word(tmp_path, plain, name):
    text, clip = plain
    changed = FORGIVEN[name](text)
    assert changed != text
    (tmp_path / "a.bvh").write_bytes(changed.encode())
    found = reader.read_clip(tmp_path / "a.bvh")
    same(found, clip)
    assert len(found) == len(clip) and found.notes == ()


@pytest.mark.parametrize(
    "encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "cp1252", "utf-32"]
)
def test_encodings(tmp_path, plain, encoding):
    text, clip = plain
    (tmp_path / "a.bvh").write_bytes(text.replace("LeftToeBase", "LinkerFuß").encode(encoding))
    same(reader.read_clip(tmp_path / "a.bvh")[:1], clip, 1)


def count(text: str, more: int) -> str:
    return re.sub(r"Frames: (\d+)", lambda m: f"Frames: {int(m[1]) + more}", text)


NOTED = {
    "one frame too many announced": (lambda t: count(t, 1), 0, "are announced, .* are there"),
    "one frame too few announced": (lambda t: count(t, -1), 0, "are announced, .* are there"),
    "half of them announced": (lambda t: count(t, -12), 0, "are announced, .* are there"),
    "a count that was never filled in": (
        lambda t: re.sub(r"Frames: \d+", "Frames: 0", t),
        0,
        "0 frames are announced",
    ),
    "a last row that is cut off": (lambda t: t[:-100], 1, "the last row is cut off"),
    "a last number that is cut off": (lambda t: t.rsplit(" ", 1)[0] + " -", 1, "the last row is cut off"),
    "no frame time": (lambda t: re.sub("Frame Time.*\n", "", t), 0, "no Frame Time is said"),
    "a frame time of zero": (lambda t: t.replace("0.0333333", "0"), 0, "no Frame Time is said"),
    "a word behind the end": (lambda t: t + "END\n", 0, "behind the last frame"),
    "zeros behind the end": (lambda t: t + "\0\0", 0, "behind the last frame"),
    "more numbers than channels": (lambda t: rows(t, lambda r: r + " 0.0 1.0"), 0, "the last 2 are left out"),
}


@pytest.mark.parametrize("name", NOTED)
def test_what_is_mended_is_told(tmp_path, plain, name):
    text, clip = plain
    change, lost, says = NOTED[name]
    (tmp_path / "a.bvh").write_text(change(text))
    found = reader.read_clip(tmp_path / "a.bvh")
    assert (
        len(found) == len(clip) - lost
        and len(found.notes) == 1
        and re.search(rf"^a\.bvh.*{says}.*\.$", found.notes[0])
    )
    same(found, clip, len(found))


REFUSED = {
    "milliseconds": (
        lambda t: t.replace("0.0333333", "33.333"),
        "33.333 seconds from one frame to the next; .*rate = 30",
    ),
    "a rate for a time": (lambda t: t.replace("0.0333333", "120"), "120 seconds from one frame to the next"),
    "an hour": (lambda t: t.replace("0.0333333", "3600"), "3600 seconds"),
    "a time beyond measure": (lambda t: t.replace("0.0333333", "1e308"), "1e.308 seconds"),
    "no time at all": (lambda t: t.replace("0.0333333", "1e-300"), "frames a second"),
    "time backwards": (lambda t: t.replace("0.0333333", "-0.03"), "no motion"),
    "time that is no number": (lambda t: t.replace("0.0333333", "nan"), "no motion"),
    "endless time": (lambda t: t.replace("0.0333333", "inf"), "no motion"),
    "a milliard frames": (
        lambda t: re.sub(r"Frames: \d+", "Frames: 1000000000", t),
        "1000000000 frames are announced, .* are there",
    ),
    "more frames than numbers": (lambda t: re.sub(r"Frames: \d+", "Frames: 1e300", t), "no motion"),
    "fewer than none": (lambda t: re.sub(r"Frames: \d+", "Frames: -3", t), "no motion"),
    "no rows": (lambda t: t.split("Frame Time")[0] + "Frame Time: 0.0333333\n", "are announced, 0 are there"),
    "values beyond measure": (lambda t: t.rsplit(" ", 1)[0] + " 1e300\n", "a value is beyond"),
    "a forest of joints": (
        lambda t: t.replace("End Site", "JOINT a\n{\n}\n" * 5000 + "End Site", 1),
        "more than 4000 joints",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_makes_no_motion_is_refused_before_it_is_computed(tmp_path, plain, name):
    change, says = REFUSED[name]
    (tmp_path / "a.bvh").write_text(change(plain[0]))
    with pytest.raises(CaptureError, match=rf"^a\.bvh.*{says}.*\.$"):
        reader.read_clip(tmp_path / "a.bvh")


def test_many_joints_times_many_frames_are_refused(tmp_path):
    """Frames of a body without channels cost no letters in the file: the whole is what counts."""
    joints = "JOINT a\n{\nOFFSET 0 1 0\n}\n" * 3900
    head = (
        "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 1 Yposition\n"
        + joints
        + "}\nMOTION\nFrames: 3000\nFrame Time: 0.01\n"
    )
    (tmp_path / "a.bvh").write_text(head + "0\n" * 3000)
    with pytest.raises(CaptureError, match=r"3000 frames of 3901 joints, too much to read at once; .*\.$"):
        reader.read_clip(tmp_path / "a.bvh")


def test_legs_without_length_are_refused(tmp_path, plain):
    (tmp_path / "a.bvh").write_text(re.sub("OFFSET.*", "OFFSET 0 0 0", plain[0]))
    with pytest.raises(SkeletonError, match=r"legs of the file have no length; .*\.$"):
        reader.read_clip(tmp_path / "a.bvh")


def test_every_refusal_is_one_sentence(tmp_path):
    for content in (b"", b"\0" * 100, b"HIERARCHY", b"MOTION\n", b"\x89PNG\r\n", "größe".encode("utf-16")):
        (tmp_path / "a.bvh").write_bytes(content)
        with pytest.raises(NsmError, match=r"^a\.bvh.*\.$"):
            reader.read_clip(tmp_path / "a.bvh")
