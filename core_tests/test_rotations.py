"""Rotations and forward kinematics against scipy's, an independent library."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core import rotations as R
from nsm_core.body import skeleton as S

scipy_rotation = pytest.importorskip("scipy.spatial.transform").Rotation
N = 200


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def quats(rng, *shape):
    return R.quat_normalize(rng.normal(size=(*shape, 4)))


def theirs(q):
    """scipy rotation of (w, x, y, z) quaternions."""
    return scipy_rotation.from_quat(np.roll(np.reshape(q, (-1, 4)), -1, axis=-1))


def same_rotation(q, other, tolerance=1e-6):
    """Quaternions equal up to sign, as angles between rotations."""
    return (theirs(q).inv() * other).magnitude().max() < tolerance


def test_product_and_inverse(rng):
    a, b = quats(rng, N), quats(rng, N)
    assert same_rotation(R.quat_mul(a, b), theirs(a) * theirs(b))
    assert same_rotation(R.quat_conjugate(a), theirs(a).inv())


def test_rotating_vectors(rng):
    q, v = quats(rng, N), rng.normal(size=(N, 3))
    np.testing.assert_allclose(R.quat_rotate(q, v), theirs(q).apply(v), atol=1e-12)


def test_matrices_both_ways(rng):
    q = np.concatenate((quats(rng, N), np.eye(4)))  # the rows of eye: identity and half turns
    np.testing.assert_allclose(R.quat_to_matrix(q), theirs(q).as_matrix(), atol=1e-12)
    assert same_rotation(R.quat_from_matrix(theirs(q).as_matrix()), theirs(q))


def test_rotation_vectors_both_ways(rng):
    q = quats(rng, N)
    np.testing.assert_allclose(R.quat_to_rotvec(q), theirs(q).as_rotvec(), atol=1e-9)
    v = np.concatenate((rng.normal(size=(N, 3)) * 2, np.zeros((1, 3)), np.full((1, 3), 1e-10)))
    assert same_rotation(R.quat_from_rotvec(v), scipy_rotation.from_rotvec(v))


def test_axis_angle(rng):
    axis = rng.normal(size=(N, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    angle = rng.uniform(-6, 6, N)
    assert same_rotation(
        R.quat_from_axis_angle(axis, angle), scipy_rotation.from_rotvec(axis * angle[:, None])
    )


@pytest.mark.parametrize("t", [0.0, 0.25, 0.5, 1.0])
def test_slerp(rng, t):
    slerp = pytest.importorskip("scipy.spatial.transform").Slerp
    for a, b in zip(quats(rng, 30), quats(rng, 30), strict=True):
        expected = slerp([0, 1], scipy_rotation.from_quat(np.roll(np.stack((a, b)), -1, axis=-1)))(t)
        assert same_rotation(R.quat_slerp(a, b, np.array(t)), expected)


def test_normalising_nothing_gives_the_identity():
    np.testing.assert_array_equal(R.quat_normalize(np.zeros((2, 4))), [[1, 0, 0, 0]] * 2)


def test_frames_from_forward_and_up(rng):
    forward, up = rng.normal(size=(N, 3)), rng.normal(size=(N, 3))
    m = R.matrix_from_forward_up(forward, up)
    np.testing.assert_allclose(m @ m.swapaxes(-1, -2), np.broadcast_to(np.eye(3), m.shape), atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(m), 1, atol=1e-9)
    np.testing.assert_allclose(
        -m[..., 1], forward / np.linalg.norm(forward, axis=1, keepdims=True), atol=1e-9
    )
    assert np.all((m[..., 2] * up).sum(-1) > 0)


def test_headings(rng):
    h = rng.uniform(-np.pi, np.pi, N)
    about_z = scipy_rotation.from_rotvec(h[:, None] * (0, 0, 1))
    turned = about_z.apply((0, -1, 0))
    np.testing.assert_allclose(R.heading_to_direction(h), turned[:, :2], atol=1e-12)
    np.testing.assert_allclose(R.direction_to_heading(turned), h, atol=1e-9)
    assert same_rotation(R.heading_quat(h), about_z)
    v = rng.normal(size=(N, 3))
    np.testing.assert_allclose(R.rotate_planar(v, h), about_z.apply(v), atol=1e-12)
    np.testing.assert_allclose(R.rotate_planar(v[:, :2], h), about_z.apply(v)[:, :2], atol=1e-12)
    np.testing.assert_allclose(R.wrap_angle(h + 4 * np.pi), h, atol=1e-9)


def test_single_precision_stays_single(rng):
    q, v = quats(rng, 5).astype(np.float32), rng.normal(size=(5, 3)).astype(np.float32)
    for value in (
        R.quat_mul(q, q),
        R.quat_conjugate(q),
        R.quat_rotate(q, v),
        R.quat_to_matrix(q),
        R.quat_from_matrix(R.quat_to_matrix(q)),
    ):
        assert value.dtype == np.float32


def homogeneous_fk(hips_position, local, offsets):
    """Forward kinematics by 4x4 matrices built with scipy, one joint after another, from the table of
    names.
    """
    world = {}
    for j, name in enumerate(S.JOINTS):
        m = np.eye(4)
        m[:3, :3] = theirs(local[j]).as_matrix()[0]
        m[:3, 3] = hips_position if j == 0 else offsets[j]
        world[name] = m if j == 0 else world[S.JOINTS[S.PARENTS[j]]] @ m
    return np.stack([world[name] for name in S.JOINTS])


def test_forward_kinematics(rng):
    local, hips = quats(rng, 6, S.J), rng.normal(size=(6, 3))
    positions, rotations = S.forward_kinematics(hips, local)
    for t in range(6):
        expected = homogeneous_fk(hips[t], local[t], S.OFFSETS.astype(np.float64))
        np.testing.assert_allclose(positions[t], expected[:, :3, 3], atol=1e-9)
        assert same_rotation(rotations[t], scipy_rotation.from_matrix(expected[:, :3, :3]))
    back = S.local_from_world(rotations)
    assert same_rotation(back, theirs(local))


def test_rest_pose_stands_on_the_floor_facing_minus_y():
    identity = np.tile(np.array((1.0, 0, 0, 0)), (S.J, 1))
    positions, _ = S.forward_kinematics(S.OFFSETS[0].astype(np.float64), identity)
    at = dict(zip(S.JOINTS, positions, strict=True))
    assert at["RightAnkle"][0] < 0 < at["LeftAnkle"][0]
    for side in ("Right", "Left"):
        assert at[f"{side}Ankle"][2] == pytest.approx(S.ANKLE_HEIGHT, abs=1e-6)
        assert at[f"{side}Toe"][2] == pytest.approx(S.TOE_HEIGHT, abs=1e-6)
        assert at[f"{side}Toe"][1] < at[f"{side}Ankle"][1]
    root, heading = S.root_of(positions)
    np.testing.assert_allclose(root, (0, 0), atol=1e-6)
    assert heading == pytest.approx(0, abs=1e-6)


def test_root_follows_a_turn_and_a_shift(rng):
    identity = np.tile(np.array((1.0, 0, 0, 0)), (S.J, 1))
    for heading in rng.uniform(-3, 3, 10):
        local = identity.copy()
        local[0] = R.heading_quat(heading)
        root, found = S.root_of(S.forward_kinematics(np.array((2.0, -1.0, 0.9)), local)[0])
        np.testing.assert_allclose(root, (2, -1), atol=1e-9)
        assert found == pytest.approx(heading, abs=1e-6)


def test_mirror_reflects_positions_and_is_its_own_inverse(rng):
    local, hips = quats(rng, 4, S.J), rng.normal(size=(4, 3))
    positions, _ = S.forward_kinematics(hips, local)
    mirrored, _ = S.forward_kinematics(*S.mirror(hips, local))
    np.testing.assert_allclose(mirrored, positions[:, list(S.MIRROR)] * (-1, 1, 1), atol=1e-6)
    again_hips, again = S.mirror(*S.mirror(hips, local))
    np.testing.assert_allclose(again, local)
    np.testing.assert_allclose(again_hips, hips)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_products_of_few_and_of_many_agree_and_keep_their_type(rng, dtype):
    a, b = quats(rng, N).astype(dtype), quats(rng, N).astype(dtype)
    v, w = rng.normal(size=(N, 3)).astype(dtype), rng.normal(size=(N, 3)).astype(dtype)
    for product, one, other in ((R.quat_mul, a, b), (R.quat_rotate, a, v), (R.cross, v, w)):
        many = product(one, other)
        few = np.stack([product(one[n], other[n]) for n in range(N)])
        assert many.dtype == few.dtype == dtype
        assert np.abs(many - few).max() < 100 * np.finfo(dtype).eps  # of values of a few units
    assert np.allclose(R.cross(v, w), np.cross(v, w), atol=1e-5)
    # One turn of many vectors.
    assert np.allclose(R.quat_rotate(a[0], v), R.quat_rotate(np.tile(a[0], (N, 1)), v), atol=1e-5)
