"""Keep hands and forearms out of furniture, frame by frame: arm rests, table tops, door frames."""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import ARMS, END_SITES, JOINTS
from nsm_core.rotations import Array, cross, quat_conjugate, quat_from_axis_angle, quat_mul, quat_rotate
from nsm_core.world.geometry.distance import DistanceQuery

from .two_bone import limb_frames, place_limbs

# Places on an arm that are kept out: share of the way from elbow to wrist (0..1) or from wrist to finger tips
# (1..2); radius, metres. On the hand they lie closer than a table top is thick.
_PROBES = ((0.5, 0.035), (0.8, 0.032), (1.0, 0.03), (1.25, 0.026), (1.5, 0.022), (1.75, 0.018), (2.0, 0.015))
_SHARES = np.array([p[0] for p in _PROBES])
_RADII = np.array([p[1] for p in _PROBES])
FURTHEST, EASE, SPEED = (
    0.12,
    0.3,
    0.02,
)  # metres a wrist is moved at most; share and metres per frame by which that changes
# Hands that hold: turned up at most, share and radians a frame by which that changes; places along the hand,
# and how thick it is. Those still on their way look ahead by so many metres.
MOST_TURN, TURN_EASE, TURN_SPEED, LOOK = np.radians(80), 0.5, np.radians(9), 0.04
STILL_TURNED = 20  # frames for which one that has let go stays turned up where there is something under it
_ALONG, _FINGERS = np.array((0.4, 0.6, 0.8, 1.0)), np.array((0.026, 0.023, 0.02, 0.017))
_STEP = 0.01  # metres between the samples of the distance's slope
_TIPS = np.array([END_SITES[JOINTS[arm[2]]] for arm in ARMS], dtype=np.float64)


class HandClearance:
    """Moves wrists off solids, smoothly; stateful, one character, one call a frame."""

    def __init__(self, query: DistanceQuery) -> None:
        self.query = query
        self._push = np.zeros((2, 3))
        self._raised = np.zeros(2)  # radians by which hands that hold are turned up at the wrist
        self._axis, self._let_go = (
            np.zeros((2, 3)),
            np.full(2, STILL_TURNED),
        )  # about which, hand frame; frames since they let go

    def apply(
        self,
        hips_position: Array,
        local_rotations: Array,
        held: tuple[float, float] = (0.0, 0.0),
        queries: tuple[DistanceQuery, DistanceQuery] | None = None,
    ) -> Array:
        """Return new local rotations (23, 4); ``hips_position`` (3,) world metres, ``local_rotations`` (23,
        4).

        ``held`` 0..1 tells how far the right and the left hand hold something: such a hand stays where it is.
        ``queries`` are what each is kept out of, where that differs from the query given at first.
        """
        hips, local = hips_position.astype(np.float64), local_rotations.astype(np.float64)
        if max(held) > 0 or self._raised.any():
            local = self._turn_up(hips, local, held, queries or (self.query, self.query))
            local_rotations = local.astype(local_rotations.dtype)
        wrists, probes = self._probe(hips, local)
        wanted = np.zeros((2, 3))
        reach = float(_RADII.max()) + 0.01
        right, left = queries or (self.query, self.query)
        if right is left:
            distance = right.signed_distance(probes.reshape(-1, 3).astype(np.float32), reach).reshape(2, -1)
        else:
            distance = np.stack(
                [
                    q.signed_distance(p.astype(np.float32), reach)
                    for q, p in zip((right, left), probes, strict=True)
                ]
            )
        depth = _RADII - distance
        depth[np.array(held) > 0.5] = -1.0
        for side in np.flatnonzero(depth.max(axis=1) > 0):
            deepest = int(depth[side].argmax())
            around = probes[side, deepest] + _STEP * np.concatenate((np.eye(3), -np.eye(3)))
            # A wider reach than before: the slope must not be cut off where a sample leaves the near field.
            d = (
                (right, left)[side]
                .signed_distance(around.astype(np.float32), reach + 2 * _STEP)
                .astype(np.float64)
            )
            out = d[:3] - d[3:]
            length = np.linalg.norm(out)
            # Deep inside there is no slope to follow; up is where the rests and tops end.
            way = out / length if length > 1e-4 else np.array((0.0, 0, 1.0))
            wanted[side] = min(depth[side, deepest], FURTHEST) * way
        change = EASE * (wanted - self._push)
        # What still goes in although it is pushed needs more; what has come free may come back.
        still = depth.max(axis=1) > 0
        change[still] = EASE * wanted[still]
        size = np.linalg.norm(change, axis=1, keepdims=True)
        self._push += change * np.minimum(1, SPEED / np.maximum(size, 1e-9))
        size = np.linalg.norm(self._push, axis=1, keepdims=True)
        self._push *= np.minimum(1, FURTHEST / np.maximum(size, 1e-9))
        if np.abs(self._push).max() < 1e-4:
            return local_rotations.copy()
        push = self._push * (1 - np.array(held))[:, None]
        return place_limbs(hips, local, ARMS, wrists + push).astype(local_rotations.dtype)

    def _turn_up(
        self,
        hips: Array,
        local: Array,
        held: tuple[float, float],
        queries: tuple[DistanceQuery, DistanceQuery],
    ) -> Array:
        """New local rotations (23, 4): hands that hold, and so stay where they are, lift their fingers off
        what lies under them.
        """
        joints, rotations, _ = limb_frames(hips, local, ARMS)
        starts, position, rotation, hand = joints[:, 0], joints[:, 2], rotations[:, 1], rotations[:, 2]
        fingers, ahead = quat_rotate(hand, _TIPS), (position - starts) * (1, 1, 0)
        # A hand that hangs straight down is turned up forward.
        axis = cross(fingers, ahead * 0.3 + (0, 0, 1))
        axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-9)
        for side in (0, 1):
            wanted = -self._raised[side]
            self._let_go[side] = 0 if held[side] > 0 else self._let_go[side] + 1
            if self._let_go[side] == 0:
                self._axis[side] = quat_rotate(quat_conjugate(hand[side]), axis[side])
            else:  # seen from the hand, so that it does not turn over as the fingers swing past
                axis[side] = quat_rotate(hand[side], self._axis[side])
            if self._let_go[side] < STILL_TURNED:
                turned = quat_rotate(
                    quat_from_axis_angle(axis[side], np.asarray(self._raised[side]))[None],
                    fingers[side][None],
                )[0]
                points = position[side] + _ALONG[:, None] * turned
                distance = queries[side].signed_distance(points.astype(np.float32), 0.1).astype(np.float64)
                depth = _FINGERS + LOOK * (0 < held[side] < 1) - distance
                deepest = int(depth.argmax())
                wanted = float(depth[deepest]) / (_ALONG[deepest] * float(np.linalg.norm(fingers[side])))
            self._raised[side] = np.clip(
                self._raised[side] + np.clip(TURN_EASE * wanted, -TURN_SPEED, TURN_SPEED), 0, MOST_TURN
            )
        self._raised[self._raised < 1e-3] = 0
        turn = quat_from_axis_angle(axis, self._raised)
        local = local.copy()
        local[[arm[2] for arm in ARMS]] = quat_mul(quat_conjugate(rotation), quat_mul(turn, hand))
        return local

    def _probe(self, hips: Array, local: Array) -> tuple[Array, Array]:
        """Wrists (2, 3) and probe points (2, P, 3), world, of the pose moved by the present push."""
        joints, rotations, _ = limb_frames(hips, local, ARMS)
        elbow, wrist = joints[:, 1], joints[:, 2]
        moved = wrist + self._push
        tip = moved + quat_rotate(rotations[:, 2], _TIPS)
        forearm = elbow[:, None] + _SHARES[None, :, None] * (moved - elbow)[:, None]
        hand = moved[:, None] + (_SHARES[None, :, None] - 1) * (tip - moved)[:, None]
        return wrist, np.where(_SHARES[None, :, None] <= 1, forearm, hand)
