"""Clips: checked when made, moved and turned as one, reflected, resampled; and the library that is cut from
them.
"""

from __future__ import annotations

import numpy as np
import pytest
from captures import capture_folder, source, stand, walk

from nsm_core.body.clip import Clip, resample, smoothed_root, transform
from nsm_core.body.skeleton import HIPS, MIRROR
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.matching.database import build_library
from nsm_core.data.matching.selection import load_walks
from nsm_core.errors import CaptureError
from nsm_core.rotations import rotate_planar, wrap_angle
from nsm_core.signals import gaussian_smooth


@pytest.fixture
def clip() -> Clip:
    hips, local = walk(2.4, 1.0, 3.2)
    return Clip("walk", hips.astype(np.float32), local.astype(np.float32))


def test_shapes_and_numbers_are_checked(clip):
    with pytest.raises(CaptureError, match=r"walk: expected hips \(T, 3\)"):
        Clip("walk", clip.hips_position[:, :2], clip.local_rotations)
    with pytest.raises(CaptureError, match="expected"):
        Clip("walk", clip.hips_position[:10], clip.local_rotations)
    rotations = clip.local_rotations.copy()
    rotations[17, 4, 2] = np.nan
    with pytest.raises(CaptureError, match=r"walk: frame 17 holds values that are not numbers; .*\.$"):
        Clip("walk", clip.hips_position, rotations)
    hips = clip.hips_position.copy()
    hips[3, 0] = np.inf
    with pytest.raises(CaptureError, match="frame 3"):
        Clip("walk", hips, clip.local_rotations)


def test_transform_moves_every_joint_as_one_body(clip):
    hips, local = transform(
        clip.hips_position, clip.local_rotations, np.array((2.0, -3.0), np.float32), np.float32(1.3)
    )
    moved, _ = Clip("moved", hips, local).world()
    positions, _ = clip.world()
    expected = rotate_planar(positions, np.float32(1.3))
    expected[..., :2] += (2.0, -3.0)
    np.testing.assert_allclose(moved, expected, atol=1e-5)
    position, heading = Clip("moved", hips, local).root()
    np.testing.assert_allclose(position, expected[:, HIPS, :2], atol=1e-5)
    assert np.abs(wrap_angle(heading - clip.root()[1] - 1.3)).max() < 1e-5


def test_mirror_exchanges_the_sides(clip):
    positions, _ = clip.world()
    reflected, _ = clip.mirrored().world()
    np.testing.assert_allclose(reflected, positions[:, MIRROR] * (-1, 1, 1), atol=1e-5)
    np.testing.assert_allclose(clip.mirrored().mirrored().local_rotations, clip.local_rotations, atol=1e-7)
    np.testing.assert_allclose(clip.mirrored().root()[1], -clip.root()[1], atol=1e-5)


def test_slices_are_clips(clip):
    cut = clip[20:50]
    assert len(cut) == 30 and cut.name == "walk"
    np.testing.assert_array_equal(cut.hips_position, clip.hips_position[20:50])


def test_resampling_meets_its_frames_and_stays_between_them(clip):
    hips, local = resample(clip.hips_position, clip.local_rotations, np.arange(len(clip)) / 30)
    np.testing.assert_allclose(hips, clip.hips_position, atol=1e-5)
    np.testing.assert_allclose(np.abs((local * clip.local_rotations).sum(-1)), 1, atol=1e-5)
    hips, local = resample(clip.hips_position, clip.local_rotations, np.array((50.5 / 30, -1.0, 99.0)))
    np.testing.assert_allclose(hips[0], (clip.hips_position[50] + clip.hips_position[51]) / 2, atol=1e-5)
    np.testing.assert_allclose(hips[1:], clip.hips_position[[0, -1]], atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(local, axis=-1), 1, atol=1e-6)


def test_smoothing_keeps_straight_lines_and_ends():
    line = np.linspace(0, 5, 40)[:, None] * np.array((1.0, -2.0))
    np.testing.assert_allclose(gaussian_smooth(line, 4.0), line, atol=1e-9)
    noisy = line + np.random.default_rng(0).normal(0, 0.1, line.shape)
    smooth = gaussian_smooth(noisy, 4.0)
    assert smooth.shape == noisy.shape and np.abs(smooth - line).mean() < 0.5 * np.abs(noisy - line).mean()
    np.testing.assert_array_equal(gaussian_smooth(line[:1], 4.0), line[:1])


def test_smoothed_root_follows_the_body_without_turning_over(clip):
    hips, local = transform(
        clip.hips_position, clip.local_rotations, np.zeros(2, np.float32), np.float32(np.pi - 0.4)
    )
    positions, _ = Clip("over", hips, local).world()
    root, heading = smoothed_root(positions)
    assert np.abs(np.diff(heading)).max() < 0.1 and abs(heading[-1] - heading[0] - 1.0) < 0.02
    assert np.linalg.norm(root - positions[:, HIPS, :2], axis=1).max() < 0.03


def test_library_frames_are_seen_from_their_roots(clip):
    other = Clip("stand", *(a.astype(np.float32) for a in stand(60)))
    library = build_library([clip, other, clip[:10]])  # too short a clip is left out
    assert library.names == ("walk", "stand") and len(library) == len(clip) + 60
    assert set(library.start) == {0, len(clip)} and set(library.end) == {len(clip), len(clip) + 60}
    positions, _ = clip.world()
    back = rotate_planar(library.pose[: len(clip)], library.heading[: len(clip), None])
    back[..., :2] += library.root[: len(clip), None]
    np.testing.assert_allclose(back, positions, atol=1e-5)
    walked = np.linalg.norm(library.velocity[50:80, HIPS, :2], axis=1)
    np.testing.assert_allclose(
        walked, np.linalg.norm(np.diff(clip.hips_position[49:80, :2], axis=0), axis=1) * 30, atol=0.05
    )
    assert (library.velocity[60:70, HIPS, 1] < -0.5).all(), "a walker goes to the front, -Y of its root"
    assert library.contacts[len(clip) :].all() and not library.contacts[40:100].all()
    with pytest.raises(CaptureError, match="no usable clip"):
        build_library([clip[:5]])


def test_loaders_choose_what_sidecars_say(tmp_path_factory):
    folder = capture_folder(tmp_path_factory)
    names = [c.name for c in load_walks(CaptureFolder(folder))]
    assert "monday/stand" in names and "tuesday/walk_03" in names
    assert not {"thursday/hop_in_place", "wednesday/sit_0", "wednesday/sit_1"} & set(names)
    loaded = source(folder)
    sits = loaded.segments["sit"]
    assert len(sits) == 4  # two and their mirror images
    for s in sits:
        height, down, up = loaded.library.hips[:, 2], s.marks["down"], s.marks["up"]
        assert (
            s.first < down < up < s.last and height[down:up].max() < height[[s.first, s.last - 1]].min() - 0.3
        )
