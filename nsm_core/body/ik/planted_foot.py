"""One foot of contact IK: the lock that keeps it where it lands, and the way it is raised while it swings."""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import ANKLE_HEIGHT, TOE_HEIGHT
from nsm_core.components import clamp
from nsm_core.rotations import Array, wrap_angle
from nsm_core.signals import smooth_step

# Label thresholds with hysteresis, seconds, metres and radians of the frame-by-frame version.
LOCK, UNLOCK, SURE = 0.5, 0.3, 0.8
GLIDING, TORN = (
    0.7,
    1.0,
)  # m/s: a foot that moves faster is not locked; one that does is let go, whatever an unsure label says
LANDING_TIME, RELEASE_TIME = 0.1, 0.23
LOW_TOE, MAX_STRETCH, MAX_PIVOT = 0.08, 0.12, np.radians(25)
# A free foot clears the floor by CLEARANCE once it moves at full speed over it, m and m/s; rise and fall of
# that lift, m/s.
CLEARANCE, SLOW_FOOT, FAST_FOOT, LIFT_UP, LIFT_DOWN, LIFT_EASE = 0.028, 0.15, 0.5, 0.5, 0.35, 0.45
# One that is set anew is lifted by so many metres, up to this share of the step; the other waits for it so
# many metres longer.
STEP_LIFT, STEP_DOWN, STEP_PLAY, STEP_OVER = 0.045, 0.7, 0.12, 0.015
SETTLE, SETTLE_SPEED = (
    0.015,
    0.15,
)  # metres by which a foot that stands is raised or lowered onto the floor, m/s
# The same on top of things, where a network knows the height less well; the rise of a foot over an edge.
HIGH_TOE, HIGH_SETTLE, HIGH_SETTLE_SPEED, EDGE_UP, EDGE_DOWN, EDGE_EASE = 0.14, 0.1, 0.4, 2.2, 1.8, 0.6
# A foot that stands stays while the other is this high over its ground, up to where the pose has it, metres:
# one of them must bear a climber; and how fast it is drawn down, m/s.
BEARS, BEAR_TOE, BEAR_SPEED = 0.12, 0.3, 1.0
# A foot that nears a riser too low is held off it, and one that stands in it is drawn out: share of the way a
# frame, m/s, m/s2.
BACK_EASE, BACK_SPEED, BACK_LOCKED, BACK_GATHER = 0.5, 1.0, 0.3, 15.0
GATHER = 15.0  # m/s2 by which a foot gathers that speed, and loses it twice as fast: in one frame knees snap


class Foot:
    """Lock of one foot: where it holds, and the correction that it puts on the pose."""

    def __init__(self) -> None:
        self.locked = self.refused = False
        self.hold, self.play = (
            0.0,
            0.0,
        )  # 0 while the foot still lands, 1 when it is fast; metres that it waits while the other steps
        self.anchor, self.anchor_heading = np.zeros(2), 0.0
        self.shift, self.turn = np.zeros(3), 0.0  # what is added to the pose now
        self.left, self.left_turn, self.fading = (
            np.zeros(3),
            0.0,
            1.0,
        )  # what was there at release; 0..1 faded out
        self.swing = 0.0  # 0..1 how much it is raised for its speed
        self.lift, self.rise = (
            0.0,
            0.0,
        )  # how much a swinging foot is raised; by how much that grew in the last frame
        self.back, self.backing = (
            np.zeros(2),
            np.zeros(2),
        )  # how a foot is held off a riser, in ``shift``; by how much that grew
        self.came: Array | None = None  # where the toe came in and where it was put in the last frame, (2,)
        self.before: Array | None = None

    def release(self) -> None:
        if self.locked:
            self.left, self.left_turn, self.fading = self.shift - (*self.back, 0.0), self.turn, 0.0
        self.locked, self.hold = False, 0.0

    def hold_off(self, back: Array, dt: float) -> None:
        """Bring a foot off a riser by ``back`` (2,), metres: swiftly, but without a jump; a foot that stands
        stays that far off.
        """
        if self.locked:
            step = back * min(1.0, BACK_LOCKED * dt / max(float(np.hypot(*back)), 1e-9))
            self.anchor, self.back, self.backing = self.anchor + step, self.back + step, np.zeros(2)
            return
        step = BACK_EASE * (back - self.back)
        step *= min(1.0, BACK_SPEED * dt / max(float(np.hypot(*step)), 1e-9))
        change = step - self.backing
        self.backing = self.backing + change * min(
            1.0, BACK_GATHER * dt * dt / max(float(np.hypot(*change)), 1e-9)
        )
        self.back = self.back + self.backing
        if not back.any() and np.abs(self.back).max() < 1e-4:
            self.back, self.backing = np.zeros(2), np.zeros(2)

    def update(
        self,
        toe: Array,
        ankle_height: float,
        heading: float,
        label: float,
        dt: float,
        high: bool = False,
        over: float = -np.inf,
        stay: float = -np.inf,
        bears: bool = False,
    ) -> None:
        """Choose ``shift``, ``turn`` and ``lift`` for a pose whose toe joint is at ``toe`` (3,), the foot
        turned to ``heading``.

        Heights are over the ground under the foot; ``high`` tells that this is not the floor, ``over`` by how
        much a swinging foot must be raised to clear an edge, and ``stay`` by how much one that is raised must
        stay so, metres;
        ``bears`` that the other foot is high up now.
        """
        low, play, speed = (
            (HIGH_TOE, HIGH_SETTLE, HIGH_SETTLE_SPEED) if high else (LOW_TOE, SETTLE, SETTLE_SPEED)
        )
        if bears and self.locked:
            label, low, play, speed = 1.0, BEAR_TOE, BEAR_TOE, BEAR_SPEED
        if label < UNLOCK:
            self.refused = False
        glide = 0.0 if self.came is None else float(np.hypot(*(toe[:2] - self.came))) / dt
        self.came = toe[:2].copy()
        if self.locked and (label < UNLOCK or toe[2] > low or (glide > TORN and label < SURE)):
            self.release()
        if not self.locked:
            self.fading = min(1.0, self.fading + dt / RELEASE_TIME)
            rest = 1 - float(smooth_step(self.fading))
            self.shift, self.turn = self.left * rest + (*self.back, 0.0), self.left_turn * rest
            self.refused = self.refused and rest > 0
            if label > LOCK and toe[2] < low and not self.refused and (glide < GLIDING or label > SURE):
                self.locked = True
                self.anchor, self.anchor_heading = toe[:2] + self.shift[:2], heading + self.turn
        if self.locked:
            self.hold = min(1.0, self.hold + dt / LANDING_TIME)
            # While it lands, the place still follows the foot, less and less.
            follow = (1 - self.hold) ** 2
            self.anchor += follow * (toe[:2] + self.shift[:2] - self.anchor)
            # A pose that glides on drags the foot along in the end: to let go would flick it over the floor.
            stretch = toe[:2] - self.anchor
            longest = MAX_STRETCH + self.play + float(np.hypot(*self.back))  # but not into a riser
            self.anchor += stretch * max(0.0, 1 - longest / max(float(np.hypot(*stretch)), 1e-9))
            turn = float(wrap_angle(self.anchor_heading - heading))
            self.turn = clamp(turn, -MAX_PIVOT, MAX_PIVOT)  # past that the foot pivots on its ball
            self.anchor_heading += self.turn - turn
            self.shift[:2] = self.anchor - toe[:2]
            settle = clamp(float(TOE_HEIGHT - toe[2]), -play, play)
            self.shift[2] += clamp(float(settle - self.shift[2]), -speed * dt, speed * dt)
        self._clear_the_floor(toe, ankle_height, dt, over, stay)

    def _clear_the_floor(self, toe: Array, ankle_height: float, dt: float, over: float, stay: float) -> None:
        """Raise a foot that swings low: the network's mean of many steps drags it where a body would
        lift it.
        """
        now = toe[:2] + self.shift[:2]
        speed = 0.0 if self.before is None else float(np.hypot(*(now - self.before))) / dt
        self.before = now
        wanted, self.swing = 0.0, 0.0
        if not self.locked:
            self.swing = share = float(smooth_step((speed - SLOW_FOOT) / (FAST_FOOT - SLOW_FOOT)))
            low = max(TOE_HEIGHT - toe[2], ANKLE_HEIGHT - ankle_height)
            wanted = share * max(0.0, CLEARANCE + low - self.shift[2], over - self.shift[2])
            if self.refused and self.fading < STEP_DOWN:
                wanted = max(wanted, STEP_LIFT + low - self.shift[2])
        wanted = max(wanted, min(stay - self.shift[2], self.lift))
        up, down, ease = (
            (EDGE_UP, EDGE_DOWN, EDGE_EASE)
            if max(over, self.lift) > 2 * CLEARANCE
            else (LIFT_UP, LIFT_DOWN, LIFT_EASE)
        )
        step = clamp(float(ease * (wanted - self.lift)), -down * dt, up * dt)
        self.rise = clamp(step, self.rise - 2 * GATHER * dt * dt, max(self.rise, 0.0) + GATHER * dt * dt)
        self.lift += self.rise
        self.lift = 0.0 if self.lift < 1e-5 else self.lift

    def step(self) -> None:
        """Be set anew: let go, and hold again once it has come to where the pose has it."""
        self.release()
        self.refused = True

    def wait_for(self, other: Foot) -> None:
        """Stand a little longer while the ``other`` steps."""
        self.play = STEP_PLAY if other.refused and not other.locked else max(0.0, self.play - STEP_OVER)
