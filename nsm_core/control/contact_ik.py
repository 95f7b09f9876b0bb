"""Feet that stay where they land and hips that settle on a seat: detection, whole takes, frame by frame."""

from __future__ import annotations

import numpy as np

from ..conventions import FPS
from ..limbs import chain_frames, leg_reach, mul, place_limbs, rotate
from ..rotations import Array, direction_to_heading, heading_quat, wrap_angle
from ..skeleton import ANKLE_HEIGHT, FEET, OFFSETS, TOE_HEIGHT, forward_kinematics

ANKLES, TOES = [foot[2] for foot in FEET], [foot[3] for foot in FEET]
# The toe joint is never lower than this over the floor, metres (the reference code's clamp).
TOE_CLEARANCE = 0.02
MAX_PELVIS_DROP = 0.08
_LEGS = (FEET[0][:3], FEET[1][:3])
_TOE_OFFSET = OFFSETS[TOES[0]].astype(np.float64)
# Underside of the heel in the foot's rest frame, from the ankle joint, and seen from the toe joint.
HEEL_FROM_ANKLE = np.array((0, 0.05, -ANKLE_HEIGHT))
_HEEL_FROM_TOE = HEEL_FROM_ANKLE - _TOE_OFFSET
_HIP_OFFSETS = OFFSETS[[leg[0] for leg in _LEGS]].astype(np.float64)
_AHEAD = np.array((0.0, -1.0, 0.0))


def detect_foot_contacts(positions: Array, height: float = 0.045, speed: float = 0.3, window: int = 5, fps: float = FPS) -> Array:
    """Tell which feet stand: (T, 2) bool, right and left, from world joint positions (T, 23, 3), metres.

    A foot stands where its toe joint is lower than ``height`` metres and horizontally slower than ``speed`` metres a second,
    after a majority vote over ``window`` frames that removes flicker.
    """
    toes = positions[:, TOES]
    velocity = np.zeros(toes.shape[:2] + (2,), dtype=np.float64)
    if len(toes) > 1:
        velocity = np.gradient(toes[..., :2].astype(np.float64), axis=0) * fps
    on = (toes[..., 2] < height) & (np.linalg.norm(velocity, axis=-1) < speed)
    half = window // 2
    padded = np.pad(on.astype(np.int32), ((half, half), (0, 0)), mode="edge")
    votes = np.stack([padded[i : i + len(on)] for i in range(2 * half + 1)]).sum(0)
    return votes > half


def lock_feet(
    hips_position: Array, local_rotations: Array, contacts: Array, blend: float = 0.25, place: str = "median", fps: float = FPS
) -> tuple[Array, Array]:
    """Hold the feet of a whole take where they stand; return new (T, 3) hips positions and (T, 23, 4) local rotations.

    In every interval of contact the toe joint keeps one place on the floor and the foot one heading (unless it plainly pivots);
    before and after, the correction fades over ``blend`` seconds.  The legs are solved again and the pelvis comes down, by at
    most 8 cm, where a place is out of reach.  Feet are lifted out of the floor in all frames.

    Args:
        hips_position: (T, 3) world, metres; local_rotations: (T, 23, 4).
        contacts: (T, 2) right and left foot, bool or 0..1.
        place: "median" of the toe's places in the interval, or its "first" or "last".
    """
    dtype = local_rotations.dtype
    hips, local = hips_position.astype(np.float64), local_rotations.astype(np.float64)
    positions, rotations = forward_kinematics(hips, local)
    on = np.asarray(contacts, dtype=np.float64) > 0.5
    fade = max(1, round(blend * fps))
    toes, feet = positions[:, TOES], rotations[:, ANKLES]
    shift, turn = np.zeros_like(toes), np.zeros(toes.shape[:2])
    for side in (0, 1):
        shift[:, side], turn[:, side] = _corrections(toes[:, side], _foot_heading(feet[:, side]), positions[:, ANKLES[side], 2], on[:, side], place, fade)
    feet = mul(heading_quat(turn), feet)
    toes = toes + shift
    toes[..., 2] += sole_depth(toes, feet)
    targets = toes - rotate(feet, _TOE_OFFSET)
    hips = hips - np.array((0, 0, 1.0)) * _pelvis_drop(positions, targets, on, fade)[:, None]
    return hips.astype(hips_position.dtype), place_limbs(hips, local, _LEGS, targets, feet).astype(dtype)


def sole_depth(toes: Array, feet: Array) -> Array:
    """How far (...) feet reach under the floor, metres, at least 0: toe joints (..., 3) world, ankle rotations (..., 4) world."""
    heel = rotate(feet, _HEEL_FROM_TOE)[..., 2]
    return np.maximum(0, np.maximum(TOE_CLEARANCE - toes[..., 2], -(toes[..., 2] + heel)))


def _corrections(toe: Array, heading: Array, ankle_height: Array, on: Array, place: str, fade: int) -> tuple[Array, Array]:
    """Shift (T, 3) of one toe and turn (T,) of its foot that pin it in every interval of ``on`` and fade between them."""
    count = len(toe)
    shift, turn, runs = np.zeros((count, 3)), np.zeros(count), intervals(on)
    for first, last in runs:
        inside = toe[first:last]
        pin = {"median": np.median(inside, axis=0), "first": inside[0], "last": inside[-1]}[place]
        shift[first:last, :2] = pin[:2] - inside[:, :2]
        shift[first:last, 2] = np.clip(TOE_HEIGHT - np.median(inside[:, 2]), -0.02, 0.02)
        # A foot that turns far while it stands pivots on its ball: that is a way to move, not a fault.
        flat = ankle_height[first:last] < ANKLE_HEIGHT + 0.025
        h = np.unwrap(heading[first:last])
        if flat.any():
            spread = np.ptp(h[flat])
            firm = np.clip((np.radians(40) - spread) / np.radians(20), 0, 1)
            turn[first:last] = firm * np.clip(np.median(h[flat]) - h, -spread, spread)
    # Between intervals the corrections at their ends fade out, or into one another where the gap is short.
    for (_, end), (start, _) in zip([(0, 0), *runs], [*runs, (count, count)], strict=True):
        gap = start - end
        if gap <= 0:
            continue
        steps = np.arange(1, gap + 1)
        n = min(fade, gap + 1)
        leave, arrive = _smooth(1 - steps / n), _smooth(1 - (gap + 1 - steps) / n)
        for values in (shift, turn):
            before = values[end - 1] if end > 0 else np.zeros_like(values[0])
            after = values[start] if start < count else np.zeros_like(values[0])
            values[end:start] = np.multiply.outer(leave, before) + np.multiply.outer(arrive, after)
    return shift, turn


def _pelvis_drop(positions: Array, targets: Array, on: Array, fade: int) -> Array:
    """Metres (T,) by which the hips come down, smoothly, so that standing feet meet their targets."""
    hip = positions[:, [leg[0] for leg in _LEGS]]
    was = np.linalg.norm(positions[:, ANKLES] - hip, axis=-1)
    reach = np.maximum(was, leg_reach())
    away = hip - targets
    down = away[..., 2] - np.sqrt(np.maximum(reach**2 - (away[..., :2] ** 2).sum(-1), 0))
    need = np.clip(np.where(on, down, 0), 0, MAX_PELVIS_DROP).max(-1)
    if not need.any():
        return need
    half = max(1, fade // 2)
    window = np.hanning(2 * half + 3)[1:-1]
    widest = np.lib.stride_tricks.sliding_window_view(np.pad(need, half, mode="edge"), 2 * half + 1).max(-1)
    return np.convolve(np.pad(widest, half, mode="edge"), window / window.sum(), mode="valid")


def intervals(on: Array) -> list[tuple[int, int]]:
    """Half-open intervals in which (T,) flags are set."""
    edges = np.flatnonzero(np.diff(np.concatenate(((False,), np.asarray(on, bool), (False,))).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _foot_heading(feet: Array) -> Array:
    """Heading (...) of feet from their ankles' world rotations (..., 4)."""
    return direction_to_heading(rotate(feet, _AHEAD))


def _smooth(t: Array) -> Array:
    t = np.clip(t, 0, 1)
    return t * t * (3 - 2 * t)


# Label thresholds with hysteresis, seconds, metres and radians of the frame-by-frame version.
LOCK, UNLOCK = 0.5, 0.3
LANDING_TIME, RELEASE_TIME, DRAW_TIME = 0.1, 0.23, 0.5
LOW_TOE, MAX_STRETCH, MAX_SHORTFALL, MAX_PIVOT = 0.08, 0.12, 0.03, np.radians(25)
MAX_DRAW, MAX_DRAW_TURN, HIP_PLAY, HIP_PLAY_TURN = 0.3, np.radians(45), 0.01, np.radians(1)
PELVIS_SPEED_DOWN, PELVIS_SPEED_UP, SETTLE_SPEED = 0.5, 0.25, 0.15


class _Foot:
    """Lock of one foot: where it holds, and the correction that it puts on the pose."""

    def __init__(self) -> None:
        self.locked = self.refused = False
        self.hold = 0.0  # 0 while the foot still lands, 1 when it is fast
        self.anchor, self.anchor_heading = np.zeros(2), 0.0
        self.shift, self.turn = np.zeros(3), 0.0  # what is added to the pose now
        self.left, self.left_turn, self.fading = np.zeros(3), 0.0, 1.0  # what was there at release; 0..1 faded out

    def release(self) -> None:
        if self.locked:
            self.left, self.left_turn, self.fading = self.shift.copy(), self.turn, 0.0
        self.locked, self.hold = False, 0.0

    def update(self, toe: Array, heading: float, label: float, dt: float) -> None:
        """Choose ``shift`` and ``turn`` for a pose whose toe joint is at ``toe`` (3,) with the foot turned to ``heading``."""
        if label < UNLOCK:
            self.refused = False
        if self.locked and (label < UNLOCK or toe[2] > LOW_TOE):
            self.release()
        if not self.locked:
            self.fading = min(1.0, self.fading + dt / RELEASE_TIME)
            rest = 1 - float(_smooth(self.fading))
            self.shift, self.turn = self.left * rest, self.left_turn * rest
            self.refused = self.refused and rest > 0
            if label > LOCK and toe[2] < LOW_TOE and not self.refused:
                self.locked = True
                self.anchor, self.anchor_heading = toe[:2] + self.shift[:2], heading + self.turn
        if self.locked:
            self.hold = min(1.0, self.hold + dt / LANDING_TIME)
            # While it lands, the place still follows the foot, less and less.
            follow = (1 - self.hold) ** 2
            self.anchor += follow * (toe[:2] + self.shift[:2] - self.anchor)
            # A pose that glides on drags the foot along in the end: to let go would flick it over the floor.
            stretch = toe[:2] - self.anchor
            self.anchor += stretch * max(0.0, 1 - MAX_STRETCH / max(float(np.hypot(*stretch)), 1e-9))
            turn = float(wrap_angle(self.anchor_heading - heading))
            self.turn = float(np.clip(turn, -MAX_PIVOT, MAX_PIVOT))  # past that the foot pivots on its ball
            self.anchor_heading += self.turn - turn
            self.shift[:2] = self.anchor - toe[:2]
            settle = float(np.clip(TOE_HEIGHT - toe[2], -0.015, 0.015))
            self.shift[2] += float(np.clip(settle - self.shift[2], -SETTLE_SPEED * dt, SETTLE_SPEED * dt))


class ContactIK:
    """Keep the feet of one character where they land and bring its hips onto the seat, frame by frame.

    Replaces the reference code's rule, target = lerp(last target, ankle, 1 - contact), which drags feet whenever a label is
    between 0 and 1.  Here a label switches a lock with hysteresis, the toe joint is the pivot, and what a lock added to the
    pose fades in about 0.2 s after release.  Feet stay above the floor.  The result may be fed back to the network or be
    used for display alone: the corrections are kept as offsets from the pose that comes in.
    """

    def __init__(self, fps: float = FPS) -> None:
        self.dt = 1.0 / fps
        self.reset()

    def reset(self) -> None:
        """Forget all locks, as for a new take or after a jump of the character."""
        self._feet = (_Foot(), _Foot())
        self._drop = 0.0
        self._seated, self._draw = False, 0.0
        self._goal: tuple[Array, float] | None = None

    def apply(
        self, hips_position: Array, local_rotations: Array, contacts: Array, hip_goal: tuple[Array, float] | None = None, heading: float | None = None
    ) -> tuple[Array, Array]:
        """Correct one frame; return new (3,) hips position and (23, 4) local rotations.

        Args:
            hips_position: (3,) world, metres; local_rotations: (23, 4).  Neither is changed.
            contacts: (5,) labels 0..1 in the order of ``conventions.CONTACTS``.
            hip_goal: world position (3,) of the hip joint and heading to sit at, or None.  While the hip label is high the
                hips are drawn there within half a second, in position and heading, and stay within 1 cm and 1 degree.
            heading: what counts as the body's heading now; None takes that of the hips joint.
        """
        dtype = local_rotations.dtype
        hips, local = hips_position.astype(np.float64), local_rotations.astype(np.float64)
        starts, parents = chain_frames(hips, local, (_LEGS[0][0], _LEGS[1][0]))
        toes, feet = self._feet_of(starts, parents, local)
        foot_headings = _foot_heading(feet)
        for side, foot in enumerate(self._feet):
            foot.update(toes[side], float(foot_headings[side]), float(contacts[3 + side]), self.dt)
        self._draw_hips(hips, local, float(contacts[0]), hip_goal, heading)
        turn = np.array([foot.turn for foot in self._feet])
        if turn.any():
            feet = mul(heading_quat(turn), feet)
        toes = toes + np.stack([foot.shift for foot in self._feet])
        lift = sole_depth(toes, feet)
        toes[:, 2] += lift
        targets = toes - rotate(feet, _TOE_OFFSET)
        starts = hips + rotate(local[0], _HIP_OFFSETS)
        self._lower_pelvis(hips, starts, targets)
        if not (self._draw or self._drop or turn.any() or lift.any() or any(foot.shift.any() for foot in self._feet)):
            return hips_position.copy(), local_rotations.copy()
        return hips.astype(hips_position.dtype), place_limbs(hips, local, _LEGS, targets, feet).astype(dtype)

    @property
    def locked(self) -> tuple[bool, bool]:
        """Whether the right and the left foot hold their places now."""
        return self._feet[0].locked, self._feet[1].locked

    def _feet_of(self, starts: Array, parents: Array, local: Array) -> tuple[Array, Array]:
        """Toe joints (2, 3) and ankle rotations (2, 4), world, of the pose that came in."""
        position, rotation = starts, parents
        for k in range(3):
            rotation = mul(rotation, local[[leg[k] for leg in FEET]])
            position = position + rotate(rotation, OFFSETS[FEET[0][k + 1]].astype(np.float64))
        return position, rotation

    def _draw_hips(self, hips: Array, local: Array, label: float, goal: tuple[Array, float] | None, heading: float | None) -> None:
        """Move ``hips`` and turn ``local[0]`` in place toward the goal by the weight reached so far."""
        if goal is not None:
            self._goal = (np.asarray(goal[0], dtype=np.float64), float(goal[1]))
        self._seated = goal is not None and label > (UNLOCK if self._seated else LOCK)
        self._draw = float(np.clip(self._draw + (1 if self._seated else -1) * self.dt / DRAW_TIME, 0, 1))
        if not self._draw:
            self._goal = None
            return
        weight = float(_smooth(self._draw))
        gap = self._goal[0] - hips
        far = np.linalg.norm(gap)
        # A little play keeps the sitter alive; far goals are not for this class to reach.
        if far > HIP_PLAY:
            hips += weight * gap * (min(far - HIP_PLAY, MAX_DRAW) / far)
        now = float(_foot_heading(local[0])) if heading is None else heading
        turn = float(wrap_angle(self._goal[1] - now))
        turn = np.sign(turn) * min(max(abs(turn) - HIP_PLAY_TURN, 0), MAX_DRAW_TURN)
        local[0] = mul(heading_quat(np.asarray(weight * turn)), local[0])

    def _lower_pelvis(self, hips: Array, starts: Array, targets: Array) -> None:
        """Bring ``hips`` down in place, slowly and a little, where a locked foot is out of reach; let go what stays out."""
        away = starts - targets
        reach = leg_reach()
        need = 0.0
        for foot, (x, y, z) in zip(self._feet, away, strict=True):
            if not foot.locked:
                continue
            down = z - np.sqrt(max(reach * reach - x * x - y * y, 0.0))
            if np.sqrt(x * x + y * y + (z - MAX_PELVIS_DROP) ** 2) > reach + MAX_SHORTFALL:
                foot.refused = True  # the foot goes home before it may hold again
                foot.release()
            elif np.abs(foot.shift).max() > 0.003:  # a leg that is straight of itself needs no help
                need = max(need, min(down, MAX_PELVIS_DROP))
        step = float(np.clip(need - self._drop, -PELVIS_SPEED_UP * self.dt, PELVIS_SPEED_DOWN * self.dt))
        self._drop = max(0.0, self._drop + step) if self._drop + step > 1e-5 else 0.0
        hips[2] -= self._drop
