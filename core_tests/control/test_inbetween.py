"""Gaps between frames that stay: filled, reached exactly, with feet that stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from walks import synthetic_walk

from nsm_core.body.capsules import SPHERES
from nsm_core.body.clip import Clip
from nsm_core.body.contacts import TOES
from nsm_core.body.interpolation import interpolated, target_blend
from nsm_core.body.skeleton import INDEX
from nsm_core.control.inbetween import Gap, check, fill
from nsm_core.errors import GapError
from nsm_core.world.geometry.distance import Cuboids


@pytest.fixture(scope="module")
def walk() -> Clip:
    hips, local, _ = synthetic_walk(150)
    return Clip("walk", hips.astype(np.float32), local.astype(np.float32))


def gap(clip: Clip, at: int, frames: int, **other) -> Gap:
    return Gap(clip[at - 10 : at], clip[at + frames : at + frames + 2], frames, **other)


def whole(asked: Gap, filled) -> Clip:
    parts = (asked.past, filled.clip, asked.target)
    return Clip(
        "whole",
        np.concatenate([p.hips_position for p in parts]),
        np.concatenate([p.local_rotations for p in parts]),
    )


@pytest.mark.parametrize("frames", (3, 8, 30, 90))
def test_a_fill_leaves_its_past_and_reaches_its_target_without_a_jump(walk, frames):
    asked = gap(walk, 40, frames)
    filled = fill(asked, None)
    assert len(filled.clip) == frames and not filled.notes
    positions = whole(asked, filled).world()[0]
    jerk = np.linalg.norm(np.diff(positions, n=2, axis=0), axis=-1).max(1)
    # No frame jumps more than the walk's own feet do, several times over.
    assert jerk.max() < 4 * np.linalg.norm(np.diff(walk.world()[0], n=2, axis=0), axis=-1).max()


def test_a_foot_that_stands_on_both_sides_stands_in_between(walk):
    still = replace(
        walk,
        hips_position=np.repeat(walk.hips_position[64:65], 60, 0),
        local_rotations=np.repeat(walk.local_rotations[64:65], 60, 0),
    )
    leant = still[:]
    leant.hips_position[30:] += np.float32((0.03, 0.02, 0))  # the feet go along, and are brought back
    asked = Gap(still[:10], replace(leant[30:32]), 20)
    toes = fill(asked, None).clip.world()[0][:, TOES]
    moved = np.linalg.norm(np.diff(toes[..., :2], axis=0), axis=-1)
    assert (toes[..., 2].max(0) > toes[..., 2].min(0) + 0.02).all()  # both step to where they are to be
    low = toes[:-1, :, 2] < 0.026
    assert low.sum() > 8 and moved[low].max() < 0.004


def test_ground_is_walked_on_where_it_is(walk):
    up = replace(walk, hips_position=walk.hips_position + np.float32((0, 0, 0.4)))
    flat, raised = fill(gap(walk, 40, 20), None), fill(gap(up, 40, 20), None)
    asked = gap(up, 40, 20, ground=lambda places: np.full(len(places), 0.4))
    assert np.allclose(raised.clip.hips_position - flat.clip.hips_position, (0, 0, 0.4), atol=1e-4)
    toes = fill(asked, None).clip.world()[0][:, TOES, 2]
    assert toes.min() > 0.4 + 0.015


def test_what_is_missing_or_too_far_is_told_in_a_sentence(walk):
    asked = gap(walk, 40, 30)
    for bad in (0, 2, 91):
        with pytest.raises(GapError, match=f"^{bad} frames are missing"):
            check(replace(asked, frames=bad))
    with pytest.raises(GapError, match="no frame before"):
        check(replace(asked, past=walk[:0]))
    with pytest.raises(GapError, match="no key after"):
        check(replace(asked, target=walk[:0]))
    (short,) = check(replace(asked, past=walk[39:40]))
    assert short.startswith("1 frame is known before the gap and 10 are read")
    (alone,) = check(replace(asked, target=walk[70:71]))
    assert "comes to rest" in alone
    far = replace(
        asked.target, hips_position=asked.past.hips_position[-1:] + np.float32(((5, 0, 0), (5, 0, 0)))
    )
    (fast,) = check(replace(asked, target=far, frames=10))
    assert "5.0 m to go in 10 frames, 13.6 m/s" in fast
    told = check(replace(asked, past=walk[36:40], target=far, frames=10, told_fps=60))
    assert told[0].startswith("7 frames are known before the gap and 19 are read")
    assert "5.0 m to go in 21 frames, 13.6 m/s" in told[1]
    (none,) = fill(replace(asked, seed=3), None).notes
    assert none == "Interpolation has no variations."


def test_one_frame_on_either_side_is_enough(walk):
    filled = fill(Gap(walk[39:40], walk[45:46], 5), None)
    assert len(filled.clip) == 5 and len(filled.notes) == 2


def test_interpolation_ends_in_its_target(walk):
    poses = [(walk.hips_position[t], walk.local_rotations[t]) for t in (20, 40)]
    hips, local = interpolated(*zip(*poses, strict=True), 19)
    assert len(hips) == 20 and np.allclose(hips[-1], poses[1][0], atol=1e-6)
    assert np.abs((local[-1] * poses[1][1]).sum(-1)).min() > 1 - 1e-6
    assert np.allclose(hips[9], (poses[0][0] + poses[1][0]) / 2, atol=1e-6)


def test_target_blend_grows_evenly_over_its_duration():
    positions, target = np.zeros((9, 2, 3)), np.ones((2, 3))
    share = target_blend(positions, target, 4)[:, 0, 0]
    assert np.allclose(share, (0, 0, 0, 0, 0, 0.25, 0.5, 0.75, 1))


def test_solids_beside_the_way_are_kept_out_of(walk):
    """A post that the right hand would pass through: the arm gives way, both ends stay."""
    asked = gap(walk, 40, 30)
    wrist = fill(asked, None).clip.world()[0][15, INDEX["RightWrist"]]
    post = Cuboids([(tuple(wrist), 0.0, ((-0.04, -0.04, -1.0),), ((0.04, 0.04, 0.5),))])

    def depth(clip: Clip) -> float:
        centres, radii = SPHERES.of(*clip.world())
        off = post.signed_distance(centres.reshape(-1, 3).astype(np.float32), 0.5)
        return float((radii - off.reshape(radii.shape)).max())

    through, beside = (fill(replace(asked, solids=s), None) for s in ((), (post,)))
    assert depth(through.clip) > 0.06 and depth(beside.clip) < 0.025
    ends = [clip.world()[0][[0, -1]] for clip in (through.clip, beside.clip)]
    assert np.abs(ends[0] - ends[1]).max() < 0.02
