"""Captures in BVH: axes, units and rates are turned into the project's own; damage is named with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from captures import walk, write_captures

from nsm_core.body.skeleton import INDEX, JOINTS
from nsm_core.data.captures import bvh_writer, reader
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.matching.selection import load_sits, load_walks, stance
from nsm_core.errors import CaptureError, NsmError, SkeletonError
from nsm_core.rotations import quat_rotate, quat_to_matrix


@pytest.fixture
def capture(tmp_path) -> Path:
    hips, local = walk(0.6, 0.3, 1.1, rest=0.2)
    bvh_writer.write_bvh(tmp_path / "walk.bvh", hips[:40], local[:40])
    return tmp_path / "walk.bvh"


def edited(path: Path, change) -> Path:
    """A copy of a capture with its list of lines changed in place; returns the copy."""
    lines = path.read_text().splitlines()
    change(lines)
    other = path.with_name("edited.bvh")
    other.write_text("\n".join(lines) + "\n")
    return other


def motion(lines: list[str]) -> int:
    """Index of the first row of numbers."""
    return lines.index("MOTION") + 3


def by_hand(
    tmp_path: Path,
    channels: dict[str, str],
    row: dict[str, tuple[float, ...]],
    interval: float = 1 / 30,
    frames: int = 1,
) -> Path:
    """A flat BVH file with every joint, written without the project's own writer."""
    lines, numbers = ["HIERARCHY"], []
    for n, joint in enumerate(JOINTS):
        chosen = channels.get(joint, "Zrotation Yrotation Xrotation").split()
        lines += [
            f"{'JOINT' if n else 'ROOT'} {joint}",
            "{",
            "OFFSET 0 0 0",
            f"CHANNELS {len(chosen)} {' '.join(chosen)}",
        ]
        numbers += [*row.get(joint, (0.0,) * len(chosen))]
    lines += ["}"] * len(JOINTS)
    lines += [
        "MOTION",
        f"Frames: {frames}",
        f"Frame Time: {interval}",
        *[" ".join(map(str, numbers))] * frames,
    ]
    path = tmp_path / "hand.bvh"
    path.write_text("\n".join(lines))
    return path


def test_axes_and_units(tmp_path):
    """Y up, +Z ahead and centimetres become Z up, -Y ahead and metres."""
    six = "Xposition Yposition Zposition Zrotation Yrotation Xrotation"
    clip = reader.read_clip(by_hand(tmp_path, {"Hips": six}, {"Hips": (10, 90, 200, 0, 90, 0)}))
    np.testing.assert_allclose(clip.hips_position[0], (0.1, -2.0, 0.9), atol=1e-6)
    # A turn by 90 degrees about the file's up takes its +Z (our -Y) to its +X (our +X).
    np.testing.assert_allclose(
        quat_rotate(clip.local_rotations[0, 0], np.array((0, -1.0, 0))), (1, 0, 0), atol=1e-6
    )
    metres = reader.read_clip(tmp_path / "hand.bvh", centimetres=False)
    np.testing.assert_allclose(metres.hips_position[0], (10, -200, 90), atol=1e-4)


def test_channels_count_in_their_own_order(tmp_path):
    names = {"Chest": "Xrotation Yrotation Zrotation", "Neck": "Zrotation Xrotation Yrotation"}
    clip = reader.read_clip(by_hand(tmp_path, names, {"Chest": (30, 40, 50), "Neck": (50, 30, 40)}))
    turn = {k: np.radians(v) for k, v in (("X", 30), ("Y", 40), ("Z", 50))}
    c, s = {k: np.cos(v) for k, v in turn.items()}, {k: np.sin(v) for k, v in turn.items()}
    about = {
        "X": np.array(((1, 0, 0), (0, c["X"], -s["X"]), (0, s["X"], c["X"]))),
        "Y": np.array(((c["Y"], 0, s["Y"]), (0, 1, 0), (-s["Y"], 0, c["Y"]))),
        "Z": np.array(((c["Z"], -s["Z"], 0), (s["Z"], c["Z"], 0), (0, 0, 1))),
    }
    axes = np.array(((1.0, 0, 0), (0, 0, -1), (0, 1, 0)))  # the file's axes to ours
    for joint, order in (("Chest", "XYZ"), ("Neck", "ZXY")):
        matrix = about[order[0]] @ about[order[1]] @ about[order[2]]
        ours = quat_to_matrix(clip.local_rotations[0, INDEX[joint]].astype(float))
        np.testing.assert_allclose(ours, axes @ matrix @ axes.T, atol=1e-6)


def test_other_rates_are_resampled(tmp_path):
    hips, local = walk(2.0, 0.4, 3.2)
    bvh_writer.write_bvh(tmp_path / "slow.bvh", hips, local)
    at = np.arange(0, len(hips) - 1, 0.25)
    fine = np.stack([np.interp(at, np.arange(len(hips)), hips[:, k]) for k in range(3)], axis=1)
    bvh_writer.write_bvh(tmp_path / "fast.bvh", fine, np.repeat(local, 4, axis=0)[: len(at)], fps=120)
    slow, fast = reader.read_clip(tmp_path / "slow.bvh"), reader.read_clip(tmp_path / "fast.bvh")
    assert abs(len(slow) - len(fast)) <= 1
    np.testing.assert_allclose(slow.hips_position[: len(fast)], fast.hips_position[: len(slow)], atol=2e-3)


def test_a_value_that_is_no_number_is_named_by_its_line(capture):
    line = motion(capture.read_text().splitlines()) + 7

    def change(lines):
        lines[line] = lines[line].replace(lines[line].split()[4], "nan", 1)

    with pytest.raises(CaptureError, match=rf"edited\.bvh, line {line + 1}: a value is not a number; .+\.$"):
        reader.read_clip(edited(capture, change))


@pytest.mark.parametrize(
    "spoil",
    [lambda row: " ".join(row.split()[:-5]), lambda row: row + " 1.0", lambda row: row.replace(".", "x", 1)],
)
def test_a_broken_row_is_named_by_its_line(capture, spoil):
    line = motion(capture.read_text().splitlines()) + 3

    def change(lines):
        lines[line] = spoil(lines[line])

    with pytest.raises(CaptureError, match=rf"edited\.bvh, line {line + 1}: expected 72 numbers"):
        reader.read_clip(edited(capture, change))


def test_a_truncated_file_is_named_by_the_line_it_ends_at(capture):
    def cut(lines):
        del lines[motion(lines) + 12 :]

    other = edited(capture, cut)
    last = len(other.read_text().splitlines())
    with pytest.raises(CaptureError, match=rf"line {last}: 40 frames are announced, 12 are there"):
        reader.read_clip(other)


def test_a_file_that_ends_in_its_skeleton(capture):
    def cut(lines):
        del lines[40:]

    with pytest.raises(CaptureError, match="no MOTION section"):
        reader.read_clip(edited(capture, cut))


def test_damage_between_the_brackets_and_in_the_head(capture):
    def bracket(lines):
        lines.insert(lines.index("MOTION"), "}")
        lines.insert(lines.index("MOTION"), "}")

    with pytest.raises(CaptureError, match=r"line \d+: a bracket closes"):
        reader.read_clip(edited(capture, bracket))

    def frames(lines):
        lines[lines.index("MOTION") + 1] = "Frames: many"

    with pytest.raises(CaptureError, match=r"line \d+: expected 'Frames:'"):
        reader.read_clip(edited(capture, frames))


def test_missing_joints_are_listed(capture):
    def rename(lines):
        for k, text in enumerate(lines):
            lines[k] = text.replace("JOINT LeftAnkle", "JOINT bone7").replace(
                "JOINT RightKnee", "JOINT bone12"
            )

    with pytest.raises(
        SkeletonError,
        match=r"edited\.bvh lacks the bones RightKnee, LeftAnkle, .* mapping file .*--mapping\.$",
    ):
        reader.read_clip(edited(capture, rename))


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(CaptureError, match=r"gone\.bvh cannot be read .*check the path"):
        reader.read_clip(tmp_path / "gone.bvh")


def spoilt(change) -> object:
    return lambda path: edited(path, change)


def _binary(path: Path) -> Path:
    path.write_bytes(b"\x93NUMPY\xff\xfe\x00\x80")
    return path


def _at(offset: int, text: str):
    def change(lines):
        lines[lines.index("MOTION") + offset] = text

    return change


def _first(lines: list[str]) -> None:
    lines.insert(1, "CHANNELS 3 Zrotation Yrotation Xrotation")


def _nameless(lines: list[str]) -> None:
    lines[1] = "ROOT"


@pytest.mark.parametrize(
    "spoil",
    [
        pytest.param(_binary, id="not text"),
        pytest.param(spoilt(_at(2, "Frame Time: -0.03")), id="time runs backwards"),
        pytest.param(spoilt(_at(2, "Frame Time: nan")), id="time is not a number"),
        pytest.param(spoilt(_at(1, "Frames: -3")), id="negative count"),
        pytest.param(spoilt(_first), id="channels of nothing"),
        pytest.param(spoilt(_nameless), id="joint without a name"),
    ],
)
def test_every_other_damage_is_a_sentence(capture, spoil):
    with pytest.raises(NsmError, match=r"\.$"):
        reader.read_clip(spoil(capture))


def test_loaders_pass_damage_on_and_name_the_file(tmp_path):
    folder = write_captures(tmp_path)
    damaged = folder / "tuesday" / "walk_01.bvh"
    text = damaged.read_text()
    damaged.write_text(text[: len(text) // 2])
    with pytest.raises(CaptureError, match=r"walk_01\.bvh"):
        load_walks(CaptureFolder(folder))
    (folder / "monday" / "stand.bvh").unlink()
    for loader in (stance, load_sits):  # without a stand that is named the longest of the walks is looked for
        with pytest.raises(CaptureError, match=r"walk_01\.bvh"):
            loader(CaptureFolder(folder))
