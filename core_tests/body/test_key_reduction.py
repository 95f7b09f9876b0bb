"""Fewer keys, and no joint or bone further off than was allowed: measured by other code than finds them."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.body.key_reduction import Bound, KeyedBody, KeyedChannels, reduce_keys
from nsm_core.body.skeleton import FEET, HIPS, PARENTS, J, forward_kinematics
from nsm_core.rotations import quat_from_rotvec, quat_mul

FRAMES = 200


@pytest.fixture(scope="module")
def motion():
    """A body that sways on feet which stand still for a second now and then: hips (T, 3), rotations (T, 23,
    4).
    """
    rng = np.random.default_rng(5)
    t = np.arange(FRAMES)[:, None, None] / 30
    vectors = rng.normal(0, 0.3, (1, J, 3)) * np.sin(rng.uniform(1, 5, (1, J, 3)) * t)
    still = (np.arange(FRAMES) // 30 % 2 == 0)[:, None]
    for foot in FEET:
        vectors[:, foot] = np.where(still[..., None], vectors[60, foot], vectors[:, foot])
    vectors[:, HIPS] = 0
    hips = np.column_stack((np.zeros(FRAMES), np.zeros(FRAMES), 0.9 + 0 * t[:, 0, 0]))
    return hips, quat_from_rotvec(vectors)


def body_of(hips, local):
    positions, rotations = forward_kinematics(hips, local)
    channels = {j: KeyedChannels(local[:, j]) for j in range(J)}
    channels[HIPS] = KeyedChannels(local[:, HIPS], places=hips, axes=np.eye(3)[None])
    return KeyedBody(PARENTS, positions, rotations, channels)


def played(values, rows, slopes):
    """What a curve of Bézier keys with these slopes shows in every frame."""
    curve = np.empty(FRAMES)
    for a, b, va, vb, sa, sb in zip(
        rows[:-1], rows[1:], values[:-1], values[1:], slopes[:-1], slopes[1:], strict=True
    ):
        u = np.arange(b - a + 1) / (b - a)
        third = (b - a) / 3
        points = (va, va + sa * third, vb - sb * third, vb)
        curve[a : b + 1] = sum(
            k * (1 - u) ** (3 - i) * u**i * p
            for i, (k, p) in enumerate(zip((1, 3, 3, 1), points, strict=True))
        )
    return curve


def with_fewer(hips, local, reduced):
    """The motion that the keys which stay make."""
    hips, local = hips.copy(), local.copy()
    for j, rows in reduced.rows.items():
        slopes = reduced.slopes[j]
        for c in range(4):
            local[:, j, c] = played(local[rows, j, c], rows, slopes[:, c])
        if j == HIPS:
            for c in range(3):
                hips[:, c] = played(hips[rows, c], rows, slopes[:, 4 + c])
    return hips, local / np.linalg.norm(local, axis=-1, keepdims=True)


@pytest.mark.parametrize("bound", [Bound(1.0, 0.3), Bound(5.0, 1.0), Bound(20.0, 90.0), Bound(1000.0, 0.5)])
def test_no_joint_and_no_bone_is_further_off_than_allowed(motion, bound):
    reduced = reduce_keys(body_of(*motion), bound)
    (positions, rotations), (near, turned) = (
        forward_kinematics(*m) for m in (motion, with_fewer(*motion, reduced))
    )
    off = np.linalg.norm(positions - near, axis=-1)
    chord = np.minimum(*(np.linalg.norm(rotations + s * turned, axis=-1) for s in (1, -1)))
    angle = np.degrees(4 * np.arcsin(np.minimum(chord / 2, 1)))
    assert off.max() * 1000 <= bound.mm + 1e-6 and angle.max() <= bound.degrees + 1e-6
    assert reduced.mm == pytest.approx(1000 * off.max()) and reduced.degrees == pytest.approx(angle.max())
    assert off[reduced.worst[0]].max() == off.max()
    assert reduced.after == sum(len(rows) for rows in reduced.rows.values()) < 0.7 * reduced.before
    feet = [foot[k] for foot in FEET for k in (2, 3)]
    still = np.zeros(FRAMES, bool)
    still[5:25] = still[65:85] = True
    assert 1000 * off[still][:, feet].max() <= max(0.4 * bound.mm, 1e-6) + 1e-6


def test_wider_bounds_leave_fewer_keys_and_the_ends_keep_theirs(motion):
    counts = []
    for mm in (1, 4, 16):
        reduced = reduce_keys(body_of(*motion), Bound(mm, mm / 4))
        counts.append(reduced.after)
        assert all(rows[0] == 0 and rows[-1] == FRAMES - 1 for rows in reduced.rows.values())
    assert counts[0] > 1.3 * counts[1] > 1.3**2 * counts[2]


def test_what_stands_still_needs_its_ends_alone():
    hips, local = np.tile((0.0, 0.0, 1.0), (30, 1)), np.tile((1.0, 0, 0, 0), (30, J, 1))
    reduced = reduce_keys(body_of(hips, local), Bound())
    assert reduced.after == 2 * J and reduced.mm < 1e-9
    single = reduce_keys(body_of(hips[:1], local[:1]), Bound())
    assert single.after == J


@pytest.mark.parametrize("mode", ["XYZ", "ZXY", "AXIS_ANGLE"])
def test_other_rotation_modes_are_judged_as_they_are_played(motion, mode):
    t = np.arange(FRAMES) / 30
    angles = np.column_stack((0.5 * np.sin(2 * t), 0.8 * np.sin(3 * t), 0.3 * np.sin(5 * t)))
    turns = (
        angles
        if mode != "AXIS_ANGLE"
        else np.column_stack((np.sin(3 * t), np.tile((0.6, 0.8, 0), (FRAMES, 1))))
    )

    def quats(values):
        if mode == "AXIS_ANGLE":
            axis = values[:, 1:] / np.linalg.norm(values[:, 1:], axis=1, keepdims=True)
            return quat_from_rotvec(values[:, :1] * axis)
        total = np.tile((1.0, 0, 0, 0), (FRAMES, 1))
        for letter in mode:
            k = "XYZ".index(letter)
            total = quat_mul(quat_from_rotvec(values[:, k : k + 1] * np.eye(3)[k]), total)
        return total

    arm = np.zeros((FRAMES, 2, 3))
    rotations = np.repeat(quats(turns)[:, None], 2, axis=1)
    reduced = reduce_keys(
        KeyedBody((-1, 0), arm, rotations, {0: KeyedChannels(turns, mode)}, feet=()), Bound(5, 2)
    )
    rows, slopes = reduced.rows[0], reduced.slopes[0]
    near = quats(np.column_stack([played(turns[rows, c], rows, slopes[:, c]) for c in range(turns.shape[1])]))
    angle = np.degrees(2 * np.arccos(np.clip(np.abs((near * rotations[:, 0]).sum(-1)), -1, 1)))
    assert angle.max() <= 2.001 and reduced.degrees == pytest.approx(angle.max(), abs=1e-3)
    assert len(rows) < 60
