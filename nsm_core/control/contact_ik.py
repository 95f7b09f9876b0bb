"""Contact IK frame by frame: feet stay where they land, hips settle on the seat.  Whole takes: see ``foot_lock``."""

from __future__ import annotations

import numpy as np

from ..conventions import FOOT_CONTACTS, FPS, HIP_CONTACT
from ..limbs import chain_frames, leg_reach, mul, place_limbs, rotate
from ..rotations import Array, heading_quat, wrap_angle
from ..skeleton import ANKLE_HEIGHT, FEET, OFFSETS, TOE_HEIGHT
from .foot_lock import LEGS, TOE_OFFSET, detect_foot_contacts, foot_heading, lock_feet, smooth_step, sole_depth

__all__ = ["ContactIK", "detect_foot_contacts", "lock_feet"]

# Label thresholds with hysteresis, seconds, metres and radians of the frame-by-frame version.
LOCK, UNLOCK, SURE = 0.5, 0.3, 0.8
GLIDING, TORN = 0.7, 1.0  # m/s: a foot that moves faster is not locked; one that does is let go, whatever an unsure label says
LANDING_TIME, RELEASE_TIME, DRAW_TIME = 0.1, 0.23, 0.5
LOW_TOE, MAX_STRETCH, MAX_SHORTFALL, MAX_PIVOT = 0.08, 0.12, 0.03, np.radians(25)
# A free foot clears the floor by CLEARANCE once it moves at full speed over it, m and m/s; rise and fall of that lift, m/s.
NEXT_SEAT = 0.05  # metres between goals of one and the same seat
CLEARANCE, SLOW_FOOT, FAST_FOOT, LIFT_UP, LIFT_DOWN, LIFT_EASE = 0.028, 0.15, 0.5, 0.5, 0.35, 0.45
MAX_DRAW, MAX_DRAW_TURN, HIP_PLAY, HIP_PLAY_TURN = 0.3, np.radians(45), 0.01, np.radians(1)
PELVIS_SPEED_DOWN, PELVIS_SPEED_UP, SETTLE_SPEED, MAX_PELVIS_DROP = 0.5, 0.25, 0.15, 0.08
_HIP_OFFSETS = OFFSETS[[leg[0] for leg in LEGS]].astype(np.float64)


class _Foot:
    """Lock of one foot: where it holds, and the correction that it puts on the pose."""

    def __init__(self) -> None:
        self.locked = self.refused = False
        self.hold = 0.0  # 0 while the foot still lands, 1 when it is fast
        self.anchor, self.anchor_heading = np.zeros(2), 0.0
        self.shift, self.turn = np.zeros(3), 0.0  # what is added to the pose now
        self.left, self.left_turn, self.fading = np.zeros(3), 0.0, 1.0  # what was there at release; 0..1 faded out
        self.lift = 0.0  # how much a swinging foot is raised
        self.came: Array | None = None  # where the toe came in and where it was put in the last frame, (2,)
        self.before: Array | None = None

    def release(self) -> None:
        if self.locked:
            self.left, self.left_turn, self.fading = self.shift.copy(), self.turn, 0.0
        self.locked, self.hold = False, 0.0

    def update(self, toe: Array, ankle_height: float, heading: float, label: float, dt: float) -> None:
        """Choose ``shift``, ``turn`` and ``lift`` for a pose whose toe joint is at ``toe`` (3,), the foot turned to ``heading``."""
        if label < UNLOCK:
            self.refused = False
        glide = 0.0 if self.came is None else float(np.hypot(*(toe[:2] - self.came))) / dt
        self.came = toe[:2].copy()
        if self.locked and (label < UNLOCK or toe[2] > LOW_TOE or (glide > TORN and label < SURE)):
            self.release()
        if not self.locked:
            self.fading = min(1.0, self.fading + dt / RELEASE_TIME)
            rest = 1 - float(smooth_step(self.fading))
            self.shift, self.turn = self.left * rest, self.left_turn * rest
            self.refused = self.refused and rest > 0
            if label > LOCK and toe[2] < LOW_TOE and not self.refused and (glide < GLIDING or label > SURE):
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
        self._clear_the_floor(toe, ankle_height, dt)

    def _clear_the_floor(self, toe: Array, ankle_height: float, dt: float) -> None:
        """Raise a foot that swings low: the network's mean of many steps drags it where a body would lift it."""
        now = toe[:2] + self.shift[:2]
        speed = 0.0 if self.before is None else float(np.hypot(*(now - self.before))) / dt
        self.before = now
        wanted = 0.0
        if not self.locked:
            share = float(smooth_step(np.clip((speed - SLOW_FOOT) / (FAST_FOOT - SLOW_FOOT), 0, 1)))
            low = max(TOE_HEIGHT - toe[2], ANKLE_HEIGHT - ankle_height)
            wanted = share * max(0.0, CLEARANCE + low - self.shift[2])
        self.lift += float(np.clip(LIFT_EASE * (wanted - self.lift), -LIFT_DOWN * dt, LIFT_UP * dt))
        self.lift = 0.0 if self.lift < 1e-5 else self.lift


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
        self,
        hips_position: Array,
        local_rotations: Array,
        contacts: Array,
        hip_goal: tuple[Array, float] | None = None,
        heading: float | None = None,
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
        starts, parents = chain_frames(hips, local, (LEGS[0][0], LEGS[1][0]))
        toes, feet = self._feet_of(starts, parents, local)
        foot_headings = foot_heading(feet)
        ankle_heights = (toes - rotate(feet, TOE_OFFSET))[:, 2]
        for side, foot in enumerate(self._feet):
            foot.update(toes[side], float(ankle_heights[side]), float(foot_headings[side]), float(contacts[FOOT_CONTACTS[side]]), self.dt)
        self._draw_hips(hips, local, float(contacts[HIP_CONTACT]), hip_goal, heading)
        turn = np.array([foot.turn for foot in self._feet])
        if turn.any():
            feet = mul(heading_quat(turn), feet)
        raised = np.array([foot.lift for foot in self._feet])
        toes = toes + np.stack([foot.shift for foot in self._feet])
        toes[:, 2] += raised
        lift = sole_depth(toes, feet)
        toes[:, 2] += lift
        targets = toes - rotate(feet, TOE_OFFSET)
        starts = hips + rotate(local[0], _HIP_OFFSETS)
        self._lower_pelvis(hips, starts, targets)
        if not (self._draw or self._drop or turn.any() or lift.any() or raised.any() or any(foot.shift.any() for foot in self._feet)):
            return hips_position.copy(), local_rotations.copy()
        return hips.astype(hips_position.dtype), place_limbs(hips, local, LEGS, targets, feet).astype(dtype)

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
        if goal is not None and (not self._draw or self._goal is None):
            self._goal = (np.asarray(goal[0], dtype=np.float64), float(goal[1]))
        # A sitter who is sent to the next seat is let go from this one first.
        same = goal is not None and self._goal is not None and np.linalg.norm(self._goal[0] - goal[0]) < NEXT_SEAT
        self._seated = same and label > (UNLOCK if self._seated else LOCK)
        self._draw = float(np.clip(self._draw + (1 if self._seated else -1) * self.dt / DRAW_TIME, 0, 1))
        if not self._draw:
            self._goal = None
            return
        weight = float(smooth_step(self._draw))
        gap = self._goal[0] - hips
        far = np.linalg.norm(gap)
        # A little play keeps the sitter alive; far goals are not for this class to reach.
        if far > HIP_PLAY:
            hips += weight * gap * (min(far - HIP_PLAY, MAX_DRAW) / far)
        now = float(foot_heading(local[0])) if heading is None else heading
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
