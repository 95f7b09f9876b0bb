"""A take written as BVH reads back as it was, in channels that do not jump, whole or not at all."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.skeleton import INDEX, JOINTS
from nsm_core.data.captures import bvh_writer, reader
from nsm_core.errors import OutputError
from nsm_core.rotations import heading_quat, quat_from_rotvec, quat_mul, quat_normalize


def test_round_trip(tmp_path):
    rng = np.random.default_rng(0)
    rotations = quat_normalize(rng.normal(size=(40, 23, 4)).astype(np.float32))
    half = np.sqrt(0.5)
    # Rest and two poles.
    rotations[0], rotations[1], rotations[2] = ((1, 0, 0, 0), (half, 0, half, 0), (half, 0, 0, -half))
    hips = rng.normal(size=(40, 3)).astype(np.float32)
    bvh_writer.write_bvh(tmp_path / "take.bvh", hips, rotations)
    clip = reader.read_clip(tmp_path / "take.bvh")
    np.testing.assert_allclose(clip.hips_position, hips, atol=1e-6)
    np.testing.assert_allclose(np.abs((clip.local_rotations * rotations).sum(-1)), 1, atol=1e-5)


def test_a_folder_that_cannot_be_written_to(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        bvh_writer.write_bvh(
            tmp_path / "file" / "take.bvh", np.zeros((1, 3)), np.tile(np.array((1.0, 0, 0, 0)), (1, 23, 1))
        )


def channels_of(path) -> dict[str, np.ndarray]:
    """Rotation channels (T, 3) of every joint of a written file, degrees, as they stand there."""
    text = path.read_text()
    rows = np.array([line.split() for line in text.split("Frame Time")[1].splitlines()[1:]], dtype=float)
    return {name: rows[:, 3 + 3 * k : 6 + 3 * k] for k, name in enumerate(JOINTS)}


def steps(path, joint: str) -> np.ndarray:
    """Largest change of each rotation channel of a joint from frame to frame, degrees."""
    return np.abs(np.diff(channels_of(path)[joint], axis=0)).max(0)


def turned(joint: str, rotations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A standing motion in which one joint turns by ``rotations`` (T, 4)."""
    local = np.zeros((len(rotations), 23, 4))
    local[..., 0] = 1
    local[:, INDEX[joint]] = rotations
    return np.tile((0, 0, 0.97), (len(rotations), 1)), local


@pytest.mark.parametrize(
    ("joint", "axis", "degrees"),
    [
        ("Hips", (0, 0, 1), 760),  # more than two turns on the spot
        ("Hips", (1, 0, 0), 400),  # somersaults forwards
        ("Hips", (0, 1, 0), -400),  # cartwheels
        ("RightKnee", (1, 0, 0), 150),
        ("LeftElbow", (0, 0, 1), 150),
        ("LeftShoulder", (0, 1, 0), 170),
        ("LeftShoulder", (0, 0, -1), 120),
        ("Head", (0, 0, 1), 120),
    ],
)
def test_even_turns_are_even_channels(tmp_path, joint, axis, degrees):
    """No channel runs faster than the joint turns, whatever it passes; and the turn reads back."""
    angles = np.radians(np.linspace(-10, degrees, 120))
    motion = turned(joint, quat_from_rotvec(angles[:, None] * np.array(axis, float)))
    bvh_writer.write_bvh(tmp_path / "a.bvh", *motion)
    assert steps(tmp_path / "a.bvh", joint).max() < abs(degrees + 10) / 119 + 0.01
    clip = reader.read_clip(tmp_path / "a.bvh")
    np.testing.assert_allclose(np.abs((clip.local_rotations * motion[1]).sum(-1)), 1, atol=1e-5)


def test_headings_do_not_leak_into_pitch_and_roll(tmp_path):
    """Who leans while turning: the heading is the first channel alone, the lean does not swap channels."""
    heading = heading_quat(np.linspace(-0.2, 2 * np.pi + 0.2, 60))
    lean = quat_from_rotvec(np.array((0.3, 0.1, 0.0)))
    bvh_writer.write_bvh(
        tmp_path / "a.bvh", *turned("Hips", quat_mul(heading, np.broadcast_to(lean, heading.shape)))
    )
    text = (tmp_path / "a.bvh").read_text()
    assert "CHANNELS 6 Xposition Yposition Zposition Yrotation Xrotation Zrotation" in text
    assert (
        steps(tmp_path / "a.bvh", "Hips").max() < 6.6 and steps(tmp_path / "a.bvh", "Hips")[1:].max() < 0.01
    )


def test_a_write_that_fails_leaves_the_old_file(tmp_path):
    hips, local = turned("Hips", heading_quat(np.zeros(3)))
    bvh_writer.write_bvh(tmp_path / "a.bvh", hips, local)
    before = (tmp_path / "a.bvh").read_bytes()
    hips[1, 2] = np.nan
    for motion, says in (
        ((hips, local), "values that are not numbers"),
        ((hips[:0], local[:0]), "no frames"),
    ):
        with pytest.raises(OutputError, match=rf"^a\.bvh is not written: its motion has {says}\.$"):
            bvh_writer.write_bvh(tmp_path / "a.bvh", *motion)
    with pytest.raises(OutputError, match=r"cannot be written .*\.$"):
        bvh_writer.write_bvh(f"{tmp_path}/a\0.bvh", np.zeros((3, 3)), local)
    assert (tmp_path / "a.bvh").read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["a.bvh"]
