"""The five steps that make a captured interaction fit other objects (papers/000 section 5.2).

1. ``fit_template`` puts a template object at one frame in which the body rests on it.
2. ``embed`` finds where hips, hands and feet touch it, and keeps the joints as vectors from these contact
points. 3. ``switch`` draws another object by seed, ``align`` puts it where the template stood; the contact
points move to its surface. 4. and 5. ``transfer`` recomputes the trajectories of the key joints and then the
whole pose, for a take or some of its frames.

Whoever samples frame pairs calls ``transfer`` on the frames of the pair, with one seed for both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nsm_core.body.ik.reach import EXACT, into_reach, leaning, shifting
from nsm_core.body.ik.two_bone import SOFT_REACH, place_limbs
from nsm_core.body.skeleton import (
    ANKLE_HEIGHT,
    ARMS,
    FEET,
    HIP_OVER_SEAT,
    HIPS,
    OFFSETS,
    forward_kinematics,
    root_of,
)
from nsm_core.conventions import FOOT_CONTACTS, FPS, HAND_CONTACTS, HIP_CONTACT
from nsm_core.rotations import Array, heading_quat, quat_mul, rotate_planar, wrap_angle
from nsm_core.signals import intervals
from nsm_core.world.affordances.arm_rests import arm_rests
from nsm_core.world.assets.pool import Pool, scaled
from nsm_core.world.scene.furniture import Furniture, top_of

# In the order of the contacts: hips, right and left wrist, right and left ankle.
KEY_JOINTS = (HIPS, ARMS[0][2], ARMS[1][2], FEET[0][2], FEET[1][2])
# Metres from the joint down to the skin that touches.
_BELOW = np.array((HIP_OVER_SEAT, 0, 0, ANKLE_HEIGHT, ANKLE_HEIGHT))
NEAR = np.array((0.16, 0.12, 0.12, 0.07, 0.07))  # metres from the surface that still count as touching it
_SMOOTH = round(0.1 * FPS)  # frames to either side over which corrections are smoothed while touching
_SOLVED = 3 * round(sum(EXACT))  # frames by which those that are solved together matter to each other
_BLEND = FPS  # frames over which corrections fade where nothing is touched
# Metres that an ankle may stand over an edge; height of what is no floor any more.
_OVERHANG, _LOWEST_TOP = 0.06, 0.05
_UPRIGHT = 0.96  # of the greatest height of the hips, over which nobody has begun to sit down
_FOOT_ROOM = 0.08  # metres that a foot keeps from the edges of what it stands on
_SHIFTS = np.concatenate((np.arange(1, _SMOOTH + 1), -np.arange(1, _SMOOTH + 1)))


@dataclass(frozen=True)
class Embedded:
    """A motion and where it touches an object.

    ``hips`` (T, 3), ``rotations`` (T, J, 4); ``template`` at ``poses`` (T, 4): x, y, z and heading, world;
    ``touch`` (T, 5) bool: the key joint touches the template; ``points`` (T, 5, 3) the contact points, object
    frame; ``floor`` (T, 2) bool: the right and left foot stand on anything else, where they stay.
    """

    hips: Array
    rotations: Array
    template: Furniture
    poses: Array
    touch: Array
    points: Array
    floor: Array

    def __len__(self) -> int:
        return len(self.hips)

    def cut(self, frames: slice) -> Embedded:
        """Return some of the frames."""
        arrays = ("hips", "rotations", "poses", "touch", "points", "floor")
        return replace(self, **{name: getattr(self, name)[frames] for name in arrays})


def fit_template(hips: Array, rotations: Array, frame: int, piece: Furniture) -> tuple[Furniture, Array]:
    """Step 1: scale a seat to the sitter of ``frame`` and put it under the hips; returns the piece and its
    pose (4,).

    ``hips`` (T, 3) world, ``rotations`` (T, J, 4).  Raises GeometryError on a piece without a seat.
    """
    height = float(hips[frame, 2]) - HIP_OVER_SEAT
    piece = scaled(piece, (1, 1, height / piece.require_seat().height))
    seat = piece.require_seat()
    heading = float(root_of(forward_kinematics(hips[frame], rotations[frame])[0])[1]) - seat.heading
    place = hips[frame, :2] - rotate_planar(seat.point[:2].astype(np.float64), np.float64(heading))
    return piece, np.array((*place, 0.0, heading))


def embed(hips: Array, rotations: Array, contacts: Array, furniture: Furniture, pose: Array) -> Embedded:
    """Step 2: find the contact points of a motion on an object.

    ``hips`` (T, 3), ``rotations`` (T, J, 4), ``contacts`` (T, 5) labels 0..1; ``pose`` (4,) or (T, 4) of the
    object.  A key joint touches the object where its label is on and it is within ``NEAR`` of the surface.
    """
    poses = np.broadcast_to(np.asarray(pose, dtype=np.float64), (len(hips), 4))
    joints = forward_kinematics(hips.astype(np.float64), rotations.astype(np.float64))[0][:, KEY_JOINTS]
    skin = _to_local(joints - _BELOW[:, None] * (0, 0, 1), poses)
    points, distance = _nearest(skin, furniture)
    if furniture.seat is not None:
        # A sitter sinks into cushions and sits across their seams: straight down, not to whatever face is
        # nearest.
        points[:, HIP_CONTACT] = skin[:, HIP_CONTACT]
        points[:, HIP_CONTACT, 2] = furniture.seat.height
    on = np.asarray(contacts) > 0.5
    touch = on & (distance < NEAR)
    # Feet beside a chair's leg stand on the floor: they touch what is under them alone.
    under = np.linalg.norm((points - skin)[:, FOOT_CONTACTS, :2], axis=-1) < _OVERHANG
    touch[:, FOOT_CONTACTS] &= under & (points[:, FOOT_CONTACTS, 2] > _LOWEST_TOP)
    for k in FOOT_CONTACTS:
        # A heel that comes up before the foot leaves does not take it off the object.
        for a, b in intervals(on[:, k]):
            touch[a:b, k] = touch[a:b, k].mean() > 0.5
    return Embedded(
        hips, rotations, furniture, poses, touch, points, on[:, FOOT_CONTACTS] & ~touch[:, FOOT_CONTACTS]
    )


def switch(pool: Pool, kind: str, seed: int) -> Furniture:
    """Step 3: the object of ``kind`` that a frame pair with this seed is shown, at a random scale."""
    return pool.draw(kind, np.random.default_rng(seed))


def align(template: Furniture, pose: Array, other: Furniture) -> Array:
    """Pose (..., 4) at which another object stands for a template at ``pose`` (..., 4).

    Seats agree in the place and heading of the sitter, other things in the middle of their front edge.
    """
    a, b = template.seat, other.seat
    pose = np.array(pose, dtype=np.float64)
    if a is not None and b is not None:
        here, there, turn = a.point[:2], b.point[:2], a.heading - b.heading
    else:
        here, there = (np.array((0.0, f.mins[:, 1].min())) for f in (template, other))
        turn = 0.0
    place = (
        rotate_planar(np.broadcast_to(here.astype(np.float64), pose.shape[:-1] + (2,)), pose[..., 3])
        + pose[..., :2]
    )
    pose[..., 3] += turn
    pose[..., :2] = place - rotate_planar(
        np.broadcast_to(there.astype(np.float64), place.shape), pose[..., 3]
    )
    return pose


def transfer(
    embedded: Embedded, other: Furniture, pose: Array, frames: slice | None = None
) -> tuple[Array, Array]:
    """Steps 4 and 5: the motion on another object at ``pose`` (4,) or (T, 4): hips (N, 3) and rotations (N,
    J, 4).

    ``frames`` chooses those to compute, such as the two of a pair; they come out as they do in the whole
    take.  Where the other object has nothing for a hand to rest on, the hand moves with the body.  Raises
    GeometryError on a seat for someone who sits, or a top for someone who stands on it, that the other object
    lacks.
    """
    first, last, _ = (frames or slice(None)).indices(len(embedded))
    # Contacts further off than the blend and the smoothing do not matter.
    margin = _BLEND + _SMOOTH + _SOLVED + 1
    near = slice(max(first - margin, 0), last + margin)
    e = embedded.cut(near)
    poses = np.broadcast_to(np.asarray(pose, dtype=np.float64), (len(embedded), 4))[near]
    turn = wrap_angle(poses[:, 3] - e.poses[:, 3])
    hips, rotations = e.hips.astype(np.float64), e.rotations.astype(np.float64)
    before, world = forward_kinematics(hips, rotations)
    joints = before[:, KEY_JOINTS]
    goals, touch = np.zeros_like(joints), e.touch.copy()
    for k in range(len(KEY_JOINTS)):
        on = touch[:, k]
        moved = _on_other(k, e.points[on, k], e.template, other) if on.any() else None
        if moved is None:
            touch[:, k] = False
            continue
        vector = joints[on, k] - _to_world(e.points[on, k], e.poses[on])
        goals[on, k] = _to_world(moved, poses[on]) + rotate_planar(vector, turn[on])
    over = _over(e, joints[:, FOOT_CONTACTS], other)
    # The hips follow what they sit on, else what the feet stand on.
    sits = bool(embedded.touch[:, HIP_CONTACT].any())
    lowered = _lowered(embedded)
    feet = np.stack(
        [
            _spread(goals[:, k] - joints[:, k], touch[:, k], e.floor[:, s])
            for s, k in enumerate(FOOT_CONTACTS)
        ],
        axis=1,
    )
    hips = hips + (
        _spread(goals[:, HIP_CONTACT] - hips, touch[:, HIP_CONTACT]) * lowered[near, None]
        if sits
        else feet.mean(axis=1)
    )
    rotations[:, HIPS] = quat_mul(
        heading_quat(_spread(turn[:, None], touch[:, HIP_CONTACT])[:, 0]), rotations[:, HIPS]
    )
    wrists, ankles = [arm[2] for arm in ARMS], [leg[2] for leg in FEET]
    carried = forward_kinematics(hips, rotations)[0][:, wrists]
    hands = carried + np.stack(
        [_spread(goals[:, k] - carried[:, s], touch[:, k]) for s, k in enumerate(HAND_CONTACTS)], axis=1
    )
    used = [s for s, k in enumerate(HAND_CONTACTS) if touch[:, k].any()]

    hands, feet = hands[:, used], before[:, ankles] + feet
    feet[..., 2] += over
    chains = [leg[:3] for leg in FEET] + [ARMS[s] for s in used]
    places = np.concatenate((feet, hands), axis=1)
    gives = leaning() if sits else shifting()
    hips, rotations = into_reach(hips, rotations, chains, places, _reach(before, chains), gives, EXACT)
    ends = np.concatenate(
        (world[:, ankles], forward_kinematics(hips, rotations)[1][:, [wrists[s] for s in used]]), axis=1
    )
    rotations = place_limbs(hips, rotations, chains, places, ends)
    asked = slice(first - near.start, last - near.start)
    return hips[asked].astype(e.hips.dtype), rotations[asked].astype(e.rotations.dtype)


def _reach(joints: Array, chains: Sequence[Sequence[int]]) -> Array:
    """How far (N, L) limbs reach: as far as in poses with ``joints`` (N, J, 3), if that was further."""
    ends = np.array(chains)
    length = SOFT_REACH * np.linalg.norm(OFFSETS[ends[:, 1:]], axis=-1).sum(-1)
    return np.maximum(length, np.linalg.norm(joints[:, ends[:, 2]] - joints[:, ends[:, 0]], axis=-1) + 1e-4)


def _lowered(embedded: Embedded) -> Array:
    """How far (T,) 0..1 the hips are down towards a seat: who still stands has no bend in the legs to spare
    for a higher one.
    """
    on, height = embedded.touch[:, HIP_CONTACT], embedded.hips[:, 2].astype(np.float64)
    if not on.any():
        return on.astype(np.float64)
    low, top = float(height[on].mean()), _UPRIGHT * float(height.max())
    return np.where(on, 1.0, _eased((top - height) / max(top - low, 1e-3)))


def _on_other(k: int, points: Array, template: Furniture, other: Furniture) -> Array | None:
    """Contact points (N, 3) of key joint ``k`` on the other object, its frame; None where it offers this
    joint nothing.
    """
    if k == HIP_CONTACT and template.seat is not None:
        a, b = template.seat, other.require_seat()
        # Shares of the seat: in the sitter's frame, which aligned seats share.
        share = rotate_planar(points[:, :2] - a.point[:2], np.full(len(points), -a.heading)) / (
            a.width,
            a.depth,
        )
        there = rotate_planar(share * (b.width, b.depth), np.full(len(points), b.heading)) + b.point[:2]
        return np.concatenate((there, np.full((len(points), 1), b.height)), axis=1)
    if k in HAND_CONTACTS and template.seat is not None:
        side = HAND_CONTACTS.index(k)
        here, there = (arm_rests(f)[side] for f in (template, other))
        return None if here is None or there is None else points - here + there
    low, size = template.mins.min(0), template.size
    there = other.mins.min(0) + (points - low) / size * other.size
    if k in HAND_CONTACTS:
        # Along the side that it holds a hand keeps its distance from the middle.
        off = points - low - size / 2
        along = np.abs(off[:, :2] / size[:2]).argmin(1)
        rows = np.arange(len(points))
        middle = other.centre[along]
        there[rows, along] = np.clip(
            middle + off[rows, along], other.mins.min(0)[along], other.maxs.max(0)[along]
        )
    result = _nearest(there, other)[0]
    if k in FOOT_CONTACTS:
        (height, corners), (new_height, others) = top_of(template), top_of(other)
        # On the top a foot keeps its distance from the front edge and the middle, as far as there is room.
        room = np.clip(
            np.minimum(points[:, :2] - corners[0], corners[1] - points[:, :2]), -_OVERHANG, _FOOT_ROOM
        )
        room = np.minimum(room, np.ptp(others, axis=0) / 2)
        there = points[:, :2] + (others.mean(0)[0] - corners.mean(0)[0], others[0, 1] - corners[0, 1])
        there = np.clip(there, others[0] + room, others[1] - room)
        top = np.abs(points[:, 2] - height) < 0.02
        result[top] = np.concatenate((there, np.full((len(points), 1), new_height)), axis=1)[top]
    return result


def _spread(values: Array, touch: Array, fixed: Array | None = None) -> Array:
    """Step 4: corrections (T, D), known where a joint touches and zero where it is ``fixed``, for all frames.

    Smoothed over 0.1 s while touching, weights exp(-(i / (w / 2))^2); in between they go, without a jerk at
    either end, from one contact to the next or, within a second, to nothing.
    """
    fixed = np.zeros(len(values), bool) if fixed is None else fixed
    known = touch | fixed
    if not touch.any():
        return np.zeros_like(values)
    clean = np.where(touch[:, None], values, 0.0)
    total, weight = clean.copy(), np.ones(len(values))
    for shift in _SHIFTS:
        w = float(np.exp(-((shift / (0.5 * _SMOOTH)) ** 2)))
        here = np.arange(len(values)) + shift
        valid = (here >= 0) & (here < len(values))
        valid[valid] &= touch[here[valid]]
        total[valid] += w * clean[here[valid]]
        weight[valid] += w
    result = np.where(touch[:, None], total / weight[:, None], 0.0)
    edges = np.flatnonzero(np.diff(np.concatenate(([1], known.astype(int), [1]))))
    for first, last in zip(edges[::2], edges[1::2], strict=True):  # runs of frames without contact
        t = np.arange(first, last)
        inner = first > 0 and last < len(values)
        length = min(_BLEND, last - first + 1) if inner else _BLEND
        if first > 0:
            result[t] += _eased(1 - (t - first + 1) / length)[:, None] * result[first - 1]
        if last < len(values):
            result[t] += _eased(1 - (last - t) / length)[:, None] * result[last]
    return result


def _eased(x: Array) -> Array:
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)


def _over(e: Embedded, ankles: Array, other: Furniture) -> Array:
    """How much higher (T, 2) feet swing over another object that, as the template, they pass over and never
    touch.
    """
    raised = np.zeros((len(e), 2))
    if e.touch.any():
        return raised
    by = float(other.maxs[:, 2].max() - e.template.maxs[:, 2].max())
    local = _to_local(ankles, e.poses)[..., :2]
    low, high = e.template.mins[:, :2].min(0), e.template.maxs[:, :2].max(0)
    above = ((local > low) & (local < high)).all(-1)
    for side in (0, 1):
        for a, b in intervals(~e.floor[:, side]):
            if above[a:b, side].any():
                raised[a:b, side] = by * np.sin(np.pi * (np.arange(b - a) + 0.5) / (b - a)) ** 2
    return raised


def _nearest(points: Array, piece: Furniture) -> tuple[Array, Array]:
    """Nearest points (..., 3) of the surface of a piece's boxes, and signed distances (...), negative
    inside.
    """
    flat = points.reshape(-1, 1, 3)
    at = np.clip(flat, piece.mins, piece.maxs)
    outside = np.linalg.norm(flat - at, axis=-1)
    # Inside a box: out by the nearest of its six faces.
    gaps = np.concatenate((flat - piece.mins, piece.maxs - flat), axis=-1)
    face = gaps.argmin(-1)
    depth = np.maximum(gaps.min(-1), 0)
    signed = np.where(outside > 0, outside, -depth)
    best = signed.argmin(1)
    rows = np.arange(len(flat))
    result, face = at[rows, best].astype(np.float64), face[rows, best]
    inside = np.flatnonzero(signed[rows, best] < 0)
    axis = face[inside] % 3
    result[inside, axis] = np.where(
        face[inside] < 3, piece.mins[best[inside], axis], piece.maxs[best[inside], axis]
    )
    return result.reshape(points.shape), signed[rows, best].reshape(points.shape[:-1])


def _to_local(points: Array, poses: Array) -> Array:
    return rotate_planar(points - poses[:, None, :3], np.broadcast_to(-poses[:, 3:], points.shape[:-1]))


def _to_world(points: Array, poses: Array) -> Array:
    return rotate_planar(points, poses[:, 3]) + poses[:, :3]
