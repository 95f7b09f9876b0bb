"""Measures of what hands do with things, and of things that move: grasps, boxes, leaves, and a body inside
them.

Props have a pose (T, 4) per frame: x, y, z, metres, and a heading; motions are poses of the body as in
``measures.motion``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import singledispatch

import numpy as np

from nsm_core.body.capsules import BUNDLED, Body, Figure, penetration_depths
from nsm_core.body.contacts import ANKLES, TOES
from nsm_core.body.skeleton import ANKLE_HEIGHT, ARMS, OFFSETS, TOE_HEIGHT, forward_kinematics
from nsm_core.conventions import CARRY, CLIMB, FPS, OPEN, RUN, SIT, STYLES
from nsm_core.rotations import Array, rotate_planar, wrap_angle
from nsm_core.world.geometry.distance import Cuboids, DistanceQuery
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.props import Box, Leaf, LightThing, Prop

from .motion import DEEP, SKATE_HEIGHT, foot_sliding, over_ground

WRISTS = [arm[2] for arm in ARMS]  # right, left
MOVES, TURNS = 0.002, np.radians(0.15)  # a frame, from which a thing counts as moving: metres and radians
_GRASP = 0.15  # metres about a handle within which a hand of the bundled size is closed around it
_FINE = 0.01  # metres between the points that stand for a light thing
_GRID = 0.05  # metres between the points that stand for a box


def moving_frames(poses: Array) -> Array:
    """Frames (T,) in which a prop of ``poses`` (T, 4) moves: over 2 mm or 0.15 degrees since the frame
    before.
    """
    step = np.diff(np.asarray(poses, dtype=np.float64), axis=0)
    moved = (np.linalg.norm(step[:, :3], axis=1) > MOVES) | (np.abs(wrap_angle(step[:, 3])) > TURNS)
    return np.concatenate(([False], moved))


def prop_depths(
    hips_position: Array, local_rotations: Array, prop: Prop, poses: Array, figure: Figure = BUNDLED
) -> Array:
    """Depth (T,) in metres of the deepest point of the body inside a prop that has the pose ``poses`` (T, 4)
    in each frame.

    What holds it does not count, where it holds: of a leaf or a front, hands within 15 cm of its handle; of
    a box, that of a hand and its forearm within 15 cm of where that wrist holds it, in frames in which the
    wrist is there.  They are judged by their distance to the grip.
    """
    body = Body.of(hips_position, local_rotations, figure)
    hands = wrists(hips_position, local_rotations, figure.offsets)
    return depths_in_prop(body, hands, prop, poses).max(axis=1)


def depths_in_prop(body: Body, hands: Array, prop: Prop, poses: Array) -> Array:
    """Depths (T, S) in metres of a body's spheres in a prop, as ``prop_depths``; ``hands`` (T, 2, 3) are its
    wrists.
    """
    local = rotate_planar(body.centres - poses[:, None, :3], -poses[:, None, 3])
    depth = depths_by_sphere(body, local, prop.query)
    seen = rotate_planar(hands - poses[:, None, :3], -poses[:, None, 3])
    depth[_holding(prop, body, local, seen)] = 0
    return depth


def depths_by_sphere(body: Body, centres: Array, query: DistanceQuery) -> Array:
    """Depths (T, S) in metres of a body's spheres in solids; ``centres`` (T, S, 3) in their frame."""
    reach = float(body.radii.max(initial=0.0)) + 0.02
    distance = query.signed_distance(centres.reshape(-1, 3).astype(np.float32), reach)
    return np.asarray(np.maximum(0, body.radii - distance.reshape(body.radii.shape)))


@singledispatch
def _holding(prop: Prop, body: Body, local: Array, seen: Array) -> Array:
    """Which spheres (T, S), ``local`` (T, S, 3) in the prop's frame, are of a body's parts that hold it;
    ``seen`` (T, 2, 3) are the wrists in that frame.
    """
    return np.zeros(local.shape[:2], bool)


def _at_the_handle(leaf: Leaf, body: Body, local: Array, seen: Array) -> Array:
    away = np.linalg.norm(local - np.asarray(leaf.handle, dtype=np.float64), axis=-1)
    return (body.hand >= 0) & (away < _GRASP * body.hand_size)


def _at_its_handle(front: Front, body: Body, local: Array, seen: Array) -> Array:
    away = np.linalg.norm(local - np.asarray(front.part.handle, dtype=np.float64), axis=-1)
    return (body.hand >= 0) & (away < _GRASP * body.hand_size)


def _between_hands(box: Box, body: Body, local: Array, seen: Array) -> Array:
    held = np.zeros(local.shape[:2], bool)
    for quarter in range(4):
        for hand, grasp in enumerate(box.grasps(quarter * np.pi / 2)):
            there = np.linalg.norm(seen[:, hand] - grasp, axis=-1) < _GRASP
            near = np.linalg.norm(local - grasp, axis=-1) < _GRASP * body.hand_size
            mine = (body.hand == hand) | (body.forearm == hand)
            held |= there[:, None] & mine & near
    return held


def _by_hand(thing: LightThing, body: Body, local: Array, seen: Array) -> Array:
    """Of a light thing, a hand within its length of it."""
    reach = _GRASP * body.hand_size + float(np.linalg.norm(thing.size)) / 2
    near = np.linalg.norm(seen - (thing.low + thing.high) / 2, axis=-1) < reach
    held = np.zeros(local.shape[:2], bool)
    for hand in (0, 1):
        held |= near[:, hand, None] & (body.hand == hand)
    return held


_holding.register(Leaf, _at_the_handle)
_holding.register(Front, _at_its_handle)
_holding.register(Box, _between_hands)
_holding.register(LightThing, _by_hand)


def all_depths(
    hips_position: Array,
    local_rotations: Array,
    still: DistanceQuery,
    props: Mapping[str, Prop],
    poses: Mapping[str, Array],
    figure: Figure = BUNDLED,
) -> Array:
    """Depth (T,) in metres of the deepest point of the body in anything solid: what is ``still``, and props
    where they are.
    """
    depth = penetration_depths(hips_position, local_rotations, still, figure)
    for name, prop in props.items():
        if name in poses:
            depth = np.maximum(depth, prop_depths(hips_position, local_rotations, prop, poses[name], figure))
    return depth


def deep_frames(depths: Array) -> dict[str, float]:
    """Count of frames and of those deeper than 3 cm; summed over trials they give the share of all frames."""
    return {"frames": float(len(depths)), "deep_frames": float((np.asarray(depths) > DEEP).sum())}


def wrists(hips_position: Array, local_rotations: Array, offsets: Array = OFFSETS) -> Array:
    """World places (T, 2, 3) of the right and the left wrist."""
    return forward_kinematics(hips_position.astype(np.float64), local_rotations.astype(np.float64), offsets)[
        0
    ][:, WRISTS]


def box_report(
    box: Box, poses: Array, hips_position: Array, local_rotations: Array, still: DistanceQuery, goal: Array
) -> dict[str, float]:
    """Measure how a box was carried; lengths in cm, angles in degrees.

    ``poses`` (T, 4) of the box, ``goal`` (4,) the centre and heading asked for.  ``box_error`` and
    ``box_turn`` at the end; ``hands_off`` mean and worst distance of the wrists from the grasps while the box
    moves, by the grasp that fits best; ``hands_tilt`` the steepest line through both wrists while it is held,
    which is how far the box would tip if it were not kept upright; ``box_unheld`` the way it goes while a
    wrist is over 15 cm from its grasp; ``box_jolt`` the largest change of its step from frame to frame;
    ``box_in_solids`` how deep it reaches into what stands still; ``box_lifted`` how far over the higher of
    its first and last place it was.
    """
    poses = np.asarray(poses, dtype=np.float64)
    moving, hands = moving_frames(poses), wrists(hips_position, local_rotations)
    local = rotate_planar(hands - poses[:, None, :3], -poses[:, None, 3])
    # (4, T, 2): by side of the box, frame and hand.
    away = np.stack([np.linalg.norm(local - box.grasps(q * np.pi / 2), axis=-1) for q in range(4)])
    gap = away[int(away[:, moving].mean(axis=(1, 2)).argmin())] if moving.any() else away.min(0)
    held = moving & (gap.max(1) < 0.15)
    step = np.diff(poses[:, :3], axis=0)
    line = hands[:, 1] - hands[:, 0]
    tilt = np.degrees(np.abs(np.arctan2(line[:, 2], np.linalg.norm(line[:, :2], axis=-1))))
    turn = wrap_angle(poses[-1, 3] - goal[3])
    # Which of its sides faces the carrier is the carrier's choice.
    quarter = abs((np.degrees(turn) + 45) % 90 - 45)
    return {
        "box_moved": float(moving.any()),
        "box_error_cm": float(100 * np.linalg.norm(poses[-1, :3] - goal[:3])),
        "box_turn_deg": float(quarter),
        "hands_off_cm": float(100 * gap[moving].mean()) if moving.any() else float("nan"),
        "hands_off_worst_cm": float(100 * gap[moving].max()) if moving.any() else float("nan"),
        "hands_tilt_deg": float(tilt[held].max()) if held.any() else float("nan"),
        "box_unheld_cm": float(100 * np.linalg.norm(step[(moving & ~held)[1:]], axis=-1).sum()),
        "box_jolt_cm": float(100 * np.linalg.norm(np.diff(step, axis=0), axis=-1).max(initial=0.0)),
        "box_in_solids_cm": 100 * box_in_solids(box, poses, still),
        "box_lifted_cm": float(100 * (poses[:, 2].max() - max(poses[0, 2], poses[-1, 2]))),
    }


def box_in_solids(box: Box, poses: Array, still: DistanceQuery) -> float:
    """Depth in metres to which a box and solids, or the floor, are inside one another, the deepest over
    ``poses`` (T, 4).

    Points on the box are looked for in the solids, and points on the solids (of ``Cuboids``) in the box, so
    that a thin board that has sunk into the box counts in full.
    """
    half = np.asarray(box.size, dtype=np.float64) / 2
    points, change = _surface(half), np.concatenate(([True], np.abs(np.diff(poses, axis=0)).max(1) > 1e-4))
    others, deepest = _solid_points(still, poses[:, :3], float(np.linalg.norm(half))), 0.0
    for part in np.array_split(poses[change], max(1, int(change.sum()) // 32)):
        world = (
            rotate_planar(np.broadcast_to(points, (len(part), *points.shape)), part[:, None, 3])
            + part[:, None, :3]
        )
        distance = still.signed_distance(world.reshape(-1, 3).astype(np.float32), 0.1)
        deepest = max(deepest, -float(distance.min()), -float(world[..., 2].min()))
        if len(others):
            local = rotate_planar(others - part[:, None, :3], -part[:, None, 3])
            deepest = max(deepest, float((half - np.abs(local)).min(-1).max()))
    return deepest


def thing_in_solids(thing: LightThing, poses: Array, still: DistanceQuery) -> float:
    """Depth in metres to which a thing that has ``poses`` (T, 4) comes into solids, the deepest."""
    return float(thing_depths(thing, poses, still).max(initial=0.0))


def thing_depths(thing: LightThing, poses: Array, still: DistanceQuery) -> Array:
    """Depths (T,) in metres to which a thing that has ``poses`` (T, 4) comes into solids, in frames in which
    it moves, and the first: of points on it, a centimetre apart.
    """
    axes = [np.arange(a, b + _FINE, _FINE) for a, b in zip(thing.low, thing.high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    on_it = np.abs(thing.query.signed_distance(points.astype(np.float32), _FINE)) < _FINE / 2
    points, depths = points[on_it], np.zeros(len(poses))
    for t in np.flatnonzero(np.concatenate(([True], moving_frames(poses)[1:]))):
        world = thing.to_world(points, poses[t]).astype(np.float32)
        depths[t] = -float(still.signed_distance(world, _FINE).min(initial=0.0))
    return depths


def _surface(half: Array) -> Array:
    """Points (N, 3) on a box of half sides ``half`` (3,), at most 5 cm apart."""
    axes = [np.linspace(-h, h, max(2, 1 + int(np.ceil(2 * h / _GRID)))) for h in half]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    return points[(np.abs(points) > half - 1e-6).any(1)]


def _solid_points(still: DistanceQuery, way: Array, reach: float) -> Array:
    """Points (N, 3) on the boxes of ``still`` within ``reach`` metres of the box around a ``way`` (T, 3)."""
    if not isinstance(still, Cuboids):
        return np.zeros((0, 3))
    low, high = way.min(0) - reach, way.max(0) + reach
    found = [np.zeros((0, 3))]
    for group in still.groups:
        for centre, half in zip(
            group.centres.astype(np.float64), group.halves.astype(np.float64), strict=True
        ):
            points = (centre + _surface(half)) @ group.matrix.T + group.position
            found.append(points[((points > low) & (points < high)).all(1)])
    return np.concatenate(found)


def leaf_report(
    leaf: Leaf, poses: Array, side: float, hand: int, hips_position: Array, local_rotations: Array
) -> dict[str, float]:
    """Measure how a leaf was opened: widest angle, degrees, and the hand's distance from the grip, cm, in
    frames in which it holds.

    ``side`` and ``hand`` as in ``passage.Passage``.  The hand holds where the leaf moves and that wrist is
    within 20 cm of the grip; ``leaf_alone_share`` is the share of the leaf's moving frames, up to its widest
    angle, in which it does not.
    """
    poses = np.asarray(poses, dtype=np.float64)
    moving = moving_frames(poses)
    point = np.asarray(leaf.handle, dtype=np.float64) + (0.0, side * leaf.thickness / 2, 0.0)
    grip = rotate_planar(np.broadcast_to(point, (len(poses), 3)), poses[:, 3]) + poses[:, :3]
    gap = np.linalg.norm(wrists(hips_position, local_rotations)[:, hand] - grip, axis=-1)
    angle = np.degrees(leaf.swing * wrap_angle(poses[:, 3] - leaf.closed))
    held = moving & (gap < 0.2)
    opening = moving & (np.arange(len(poses)) <= int(angle.argmax()))
    return {
        "leaf_widest_deg": float(angle.max()),
        "leaf_end_deg": float(angle[-1]),
        "grip_off_cm": float(100 * gap[held].mean()) if held.any() else float("nan"),
        "grip_off_worst_cm": float(100 * gap[held].max()) if held.any() else float("nan"),
        "leaf_alone_share": float((opening & ~held).sum() / opening.sum()) if opening.any() else float("nan"),
        "leaf_step_deg": float(np.degrees(np.abs(wrap_angle(np.diff(poses[:, 3]))).max(initial=0.0))),
    }


def foot_heights(positions: Array, ground: Callable[[Array], Array]) -> Array:
    """How far (2,) the right and left foot of one pose (23, 3) stand over the ground under their toes,
    metres; 0 for a flat sole.
    """
    toes = positions[TOES]
    return toes[:, 2] - TOE_HEIGHT - np.asarray(ground(toes[:, :2]), dtype=np.float64)


def slide_by_action(
    positions: Array, style: Array, ground: Callable[[Array], Array] | None = None, fps: float = FPS
) -> dict[str, Array]:
    """Foot slide of a take, by action: sums (metres a second of low joints, low joints) whose ratio is the
    figure.

    ``positions`` (T, 23, 3) and labels ``style`` (T, 7).  A frame belongs to carry, open, sit or climb where
    that label is over 0.5, else to the highest of the others; "all" holds every frame.  Sums add up over
    takes; see ``slide_table``.
    """
    lead = leading_action(style)
    sums = {}
    for k, name in enumerate((*STYLES, "all")):
        mine = np.ones(len(lead), bool) if name == "all" else lead == k
        edges = np.flatnonzero(np.diff(np.concatenate(([0], mine.astype(int), [0]))))
        total, count = 0.0, 0.0
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            if b - a < 3:
                continue
            part = positions[a:b]
            low = _low_joints(part, ground)
            total, count = total + foot_sliding(part, fps, ground=ground) / 100 * low, count + low
        if count:
            sums[name] = np.array((total, count))
    return sums


def leading_action(style: Array) -> Array:
    """Index (T,) of the action that labels (T, 7) stand for: an action with an object wins over how one
    moves.
    """
    style = np.asarray(style)
    lead = style[:, : RUN + 1].argmax(axis=1)
    for k in (CARRY, OPEN, SIT, CLIMB):
        lead = np.where(style[:, k] > 0.5, k, lead)
    return lead


def slide_table(sums: list[dict[str, Array]]) -> dict[str, float]:
    """Slide in cm/s by action from the sums of many takes."""
    names = sorted({name for each in sums for name in each})
    added = {name: np.sum([each[name] for each in sums if name in each], axis=0) for name in names}
    return {name: float(100 * total / count) for name, (total, count) in added.items() if count}


def _low_joints(positions: Array, ground: Callable[[Array], Array] | None) -> float:
    """How many times an ankle or a toe counts in ``foot_sliding``."""
    height = over_ground(positions, ground)[:, ANKLES + TOES, 2] - np.array(
        [ANKLE_HEIGHT] * 2 + [TOE_HEIGHT] * 2
    )
    return float((np.maximum(height[1:], height[:-1]) < SKATE_HEIGHT).sum())
