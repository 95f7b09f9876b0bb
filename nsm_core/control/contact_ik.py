"""Contact IK frame by frame: feet stay where they land, hips settle on the seat.  Whole takes: see ``foot_lock``."""

from __future__ import annotations

import numpy as np

from ..conventions import FOOT_CONTACTS, FPS, HIP_CONTACT
from ..limbs import chain_frames, leg_reach, mul, place_limbs, rotate
from ..rotations import Array, heading_quat, heading_to_direction, wrap_angle
from ..skeleton import ANKLE_HEIGHT, FEET, OFFSETS, TOE_HEIGHT
from .foot_lock import LEGS, TOE_OFFSET, detect_foot_contacts, foot_heading, lock_feet, smooth_step, sole_depth
from .footing import Footing
from .goals import Seat
from .terrain import Terrain

__all__ = ["ContactIK", "detect_foot_contacts", "lock_feet"]

# Label thresholds with hysteresis, seconds, metres and radians of the frame-by-frame version.
LOCK, UNLOCK, SURE = 0.5, 0.3, 0.8
GLIDING, TORN = 0.7, 1.0  # m/s: a foot that moves faster is not locked; one that does is let go, whatever an unsure label says
LANDING_TIME, RELEASE_TIME, DRAW_TIME = 0.1, 0.23, 0.5
LOW_TOE, MAX_STRETCH, MAX_SHORTFALL, MAX_PIVOT = 0.08, 0.12, 0.03, np.radians(25)
# A free foot clears the floor by CLEARANCE once it moves at full speed over it, m and m/s; rise and fall of that lift, m/s.
NEXT_SEAT = 0.05  # metres between goals of one and the same seat
CLEARANCE, SLOW_FOOT, FAST_FOOT, LIFT_UP, LIFT_DOWN, LIFT_EASE = 0.028, 0.15, 0.5, 0.5, 0.35, 0.45
MAX_DRAW, MAX_DRAW_TURN, HIP_PLAY, HIP_PLAY_TURN = 0.3, np.radians(45), 0.008, np.radians(0.4)
ASKEW = np.radians(20)  # from here to MAX_DRAW_TURN the draw fades: who still turns on the seat is not twisted round
PELVIS_SPEED_DOWN, PELVIS_SPEED_UP, SETTLE_SPEED, MAX_PELVIS_DROP = 0.5, 0.25, 0.15, 0.08
SETTLE = 0.015  # metres by which a foot that stands is raised or lowered onto the floor
# The same on top of things, where a network knows the height less well; the rise of a foot over an edge and of one that has
# gone into a step (m/s); the drop of the pelvis per metre between the feet.
HIGH_TOE, HIGH_SETTLE, HIGH_SETTLE_SPEED, EDGE_UP, EDGE_DOWN, EDGE_EASE, STEP_DROP = 0.14, 0.1, 0.4, 2.2, 1.0, 0.6, 0.3
# A foot that nears a riser too low is held off it, and one that stands in it is drawn out: share of the way a frame, m/s, m/s2.
BACK_EASE, BACK_SPEED, BACK_LOCKED, BACK_GATHER = 0.5, 1.0, 0.3, 15.0
GATHER = 15.0  # m/s2 by which a foot gathers that speed, and loses it twice as fast: in one frame knees snap
_HIP_OFFSETS = OFFSETS[[leg[0] for leg in LEGS]].astype(np.float64)


class _Foot:
    """Lock of one foot: where it holds, and the correction that it puts on the pose."""

    def __init__(self) -> None:
        self.locked = self.refused = False
        self.hold = 0.0  # 0 while the foot still lands, 1 when it is fast
        self.anchor, self.anchor_heading = np.zeros(2), 0.0
        self.shift, self.turn = np.zeros(3), 0.0  # what is added to the pose now
        self.left, self.left_turn, self.fading = np.zeros(3), 0.0, 1.0  # what was there at release; 0..1 faded out
        self.swing = 0.0  # 0..1 how much it is raised for its speed
        self.lift, self.rise = 0.0, 0.0  # how much a swinging foot is raised; by how much that grew in the last frame
        self.back, self.backing = np.zeros(2), np.zeros(2)  # how a foot is held off a riser, in ``shift``; by how much that grew
        self.came: Array | None = None  # where the toe came in and where it was put in the last frame, (2,)
        self.before: Array | None = None

    def release(self) -> None:
        if self.locked:
            self.left, self.left_turn, self.fading = self.shift - (*self.back, 0.0), self.turn, 0.0
        self.locked, self.hold = False, 0.0

    def hold_off(self, back: Array, dt: float) -> None:
        """Bring a foot off a riser by ``back`` (2,), metres: swiftly, but without a jump; a foot that stands stays that far off."""
        if self.locked:
            step = back * min(1.0, BACK_LOCKED * dt / max(float(np.hypot(*back)), 1e-9))
            self.anchor, self.back, self.backing = self.anchor + step, self.back + step, np.zeros(2)
            return
        step = BACK_EASE * (back - self.back)
        step *= min(1.0, BACK_SPEED * dt / max(float(np.hypot(*step)), 1e-9))
        change = step - self.backing
        self.backing = self.backing + change * min(1.0, BACK_GATHER * dt * dt / max(float(np.hypot(*change)), 1e-9))
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
    ) -> None:
        """Choose ``shift``, ``turn`` and ``lift`` for a pose whose toe joint is at ``toe`` (3,), the foot turned to ``heading``.

        Heights are over the ground under the foot; ``high`` tells that this is not the floor, ``over`` by how much a
        swinging foot must be raised to clear an edge, and ``stay`` by how much one that is raised must stay so, metres.
        """
        low, play, speed = (HIGH_TOE, HIGH_SETTLE, HIGH_SETTLE_SPEED) if high else (LOW_TOE, SETTLE, SETTLE_SPEED)
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
            longest = MAX_STRETCH + float(np.hypot(*self.back))  # but not into a riser
            self.anchor += stretch * max(0.0, 1 - longest / max(float(np.hypot(*stretch)), 1e-9))
            turn = float(wrap_angle(self.anchor_heading - heading))
            self.turn = float(np.clip(turn, -MAX_PIVOT, MAX_PIVOT))  # past that the foot pivots on its ball
            self.anchor_heading += self.turn - turn
            self.shift[:2] = self.anchor - toe[:2]
            settle = float(np.clip(TOE_HEIGHT - toe[2], -play, play))
            self.shift[2] += float(np.clip(settle - self.shift[2], -speed * dt, speed * dt))
        self._clear_the_floor(toe, ankle_height, dt, over, stay)

    def _clear_the_floor(self, toe: Array, ankle_height: float, dt: float, over: float, stay: float) -> None:
        """Raise a foot that swings low: the network's mean of many steps drags it where a body would lift it."""
        now = toe[:2] + self.shift[:2]
        speed = 0.0 if self.before is None else float(np.hypot(*(now - self.before))) / dt
        self.before = now
        wanted, self.swing = 0.0, 0.0
        if not self.locked:
            self.swing = share = float(smooth_step(np.clip((speed - SLOW_FOOT) / (FAST_FOOT - SLOW_FOOT), 0, 1)))
            low = max(TOE_HEIGHT - toe[2], ANKLE_HEIGHT - ankle_height)
            wanted = share * max(0.0, CLEARANCE + low - self.shift[2], over - self.shift[2])
        wanted = max(wanted, min(stay - self.shift[2], self.lift))
        up, down, ease = (EDGE_UP, EDGE_DOWN, EDGE_EASE) if max(over, self.lift) > 2 * CLEARANCE else (LIFT_UP, LIFT_DOWN, LIFT_EASE)
        step = float(np.clip(ease * (wanted - self.lift), -down * dt, up * dt))
        self.rise = float(np.clip(step, self.rise - 2 * GATHER * dt * dt, max(self.rise, 0.0) + GATHER * dt * dt))
        self.lift += self.rise
        self.lift = 0.0 if self.lift < 1e-5 else self.lift


class ContactIK:
    """Keep the feet of one character where they land and bring its hips onto the seat, frame by frame.

    Replaces the reference code's rule, target = lerp(last target, ankle, 1 - contact), which drags feet whenever a label is
    between 0 and 1.  Here a label switches a lock with hysteresis, the toe joint is the pivot, and what a lock added to the
    pose fades in about 0.2 s after release.  Feet stay above the floor.  The result may be fed back to the network or be
    used for display alone: the corrections are kept as offsets from the pose that comes in.
    """

    def __init__(self, fps: float = FPS, terrain: Terrain | None = None) -> None:
        """``terrain`` is what feet may stand on besides the floor."""
        self.dt, self.terrain = 1.0 / fps, terrain
        self.reset()

    def reset(self) -> None:
        """Forget all locks, as for a new take or after a jump of the character."""
        self._feet = (_Foot(), _Foot())
        self._footing, self._out, self._rise = Footing(self.terrain), np.zeros(2), np.zeros(2)
        self._drop = 0.0
        self._seated, self._draw, self._face = False, 0.0, 0.0
        self._goal: Array | None = None  # where the hips are drawn
        self._facing = 0.0  # and the heading that they turn to

    def apply(
        self,
        hips_position: Array,
        local_rotations: Array,
        contacts: Array,
        hip_goal: Seat | None = None,
        heading: float | None = None,
    ) -> tuple[Array, Array]:
        """Correct one frame; return new (3,) hips position and (23, 4) local rotations.

        Args:
            hips_position: (3,) world, metres; local_rotations: (23, 4).  Neither is changed.
            contacts: (5,) labels 0..1 in the order of ``conventions.CONTACTS``.
            hip_goal: world position (3,) of the hip joint and heading to sit at (None while it still turns), or None.  While the
                hip label is high the hips are drawn there within half a second and stay within 1 cm and 1 degree.
            heading: what counts as the body's heading now; None takes that of the hips joint.
        """
        dtype = local_rotations.dtype
        hips, local = hips_position.astype(np.float64), local_rotations.astype(np.float64)
        starts, parents = chain_frames(hips, local, (LEGS[0][0], LEGS[1][0]))
        toes, feet = self._feet_of(starts, parents, local)
        foot_headings = foot_heading(feet)
        ankle_heights = (toes - rotate(feet, TOE_OFFSET))[:, 2]
        ground = self._look(toes, foot_headings, ankle_heights)
        for side, foot in enumerate(self._feet):
            over, stay, high = float(self._footing.over[side]), float(self._footing.stay[side]), ground[side] > 0
            seen = toes[side] - (0, 0, ground[side])
            label, ankle = float(contacts[FOOT_CONTACTS[side]]), float(ankle_heights[side] - ground[side])
            foot.update(seen, ankle, float(foot_headings[side]), label, self.dt, high, over, stay)
        self._draw_hips(hips, local, float(contacts[HIP_CONTACT]), hip_goal, heading)
        turn = np.array([foot.turn for foot in self._feet])
        if turn.any():
            feet = mul(heading_quat(turn), feet)
        raised = np.array([foot.lift for foot in self._feet])
        toes = toes + np.stack([foot.shift for foot in self._feet])
        toes[:, 2] += raised
        lift = self._out_of_ground(toes, feet, ground)
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

    def _look(self, toes: Array, headings: Array, ankle_heights: Array) -> Array:
        """Heights (2,) of the ground under the feet; feet that stand against a riser are brought back from it."""
        footing = self._footing
        if not footing.terrain:
            return footing.ground
        shifts = np.stack([foot.shift for foot in self._feet])
        raised = shifts[:, 2] + [foot.lift for foot in self._feet] + self._out
        footing.look(toes + shifts * (1, 1, 0), headings, ankle_heights, raised, self.locked, self.dt)
        for side, foot in enumerate(self._feet):
            if foot.locked:
                back = footing.back_off(side, foot.anchor, foot.anchor_heading)
                heading = foot.anchor_heading
            else:
                heading = float(headings[side]) + foot.turn
                # A foot that slows down will come down.
                sole = toes[side, 2] - TOE_HEIGHT + raised[side] - (1 - foot.swing) * foot.lift
                back = footing.back_off(side, toes[side, :2] + shifts[side, :2] - foot.back, heading, sole, footing.pace[side])
            foot.hold_off(-back * heading_to_direction(np.array(heading)), self.dt)
        return footing.ground

    def _out_of_ground(self, toes: Array, feet: Array, ground: Array) -> Array:
        """Metres (2,) by which feet must be raised out of the ground: at once out of the floor, swiftly out of a step."""
        if not self._footing.terrain:
            return sole_depth(toes, feet)
        deep = sole_depth(toes, feet, ground, self._footing.heel)
        up = np.minimum(EDGE_UP * self.dt, np.maximum(self._rise, 0) + GATHER * self.dt**2)
        self._rise = np.clip(deep - self._out, -EDGE_UP * self.dt, up)
        self._out += self._rise
        return np.maximum(sole_depth(toes, feet), self._out)

    def _draw_hips(self, hips: Array, local: Array, label: float, goal: Seat | None, heading: float | None) -> None:
        """Move ``hips`` and turn ``local[0]`` in place toward the goal by the weights reached so far."""
        if goal is not None and (not self._draw or self._goal is None):
            self._goal = np.asarray(goal[0], dtype=np.float64)
        # A sitter who is sent to the next seat is let go from this one first.
        same = goal is not None and self._goal is not None and np.linalg.norm(self._goal - goal[0]) < NEXT_SEAT
        self._seated = bool(same) and label > (UNLOCK if self._seated else LOCK)
        self._draw = float(np.clip(self._draw + (1 if self._seated else -1) * self.dt / DRAW_TIME, 0, 1))
        faces = self._seated and goal is not None and goal[1] is not None
        if faces and not self._face:
            self._facing = float(goal[1])  # type: ignore[index, arg-type]
        self._face = float(np.clip(self._face + (1 if faces else -1) * self.dt / DRAW_TIME, 0, 1))
        if not self._draw:
            self._goal = None
            return
        weight = float(smooth_step(self._draw))
        gap = self._goal - hips
        far = np.linalg.norm(gap)
        # A little play keeps the sitter alive; far goals are not for this class to reach.
        if far > HIP_PLAY:
            hips += weight * gap * (min(far - HIP_PLAY, MAX_DRAW) / far)
        now = float(foot_heading(local[0])) if heading is None else heading
        turn = float(wrap_angle(self._facing - now))
        share = float(smooth_step((MAX_DRAW_TURN - abs(turn)) / (MAX_DRAW_TURN - ASKEW)))
        turn = np.sign(turn) * max(abs(turn) - HIP_PLAY_TURN, 0) * share
        local[0] = mul(heading_quat(np.asarray(float(smooth_step(self._face)) * turn)), local[0])

    def _lower_pelvis(self, hips: Array, starts: Array, targets: Array) -> None:
        """Bring ``hips`` down in place, slowly and a little, where a locked foot is out of reach; let go what stays out."""
        away = starts - targets
        reach = leg_reach()
        need, most = 0.0, MAX_PELVIS_DROP + STEP_DROP * abs(float(np.diff(self._footing.ground)[0]))
        for foot, (x, y, z) in zip(self._feet, away, strict=True):
            if not foot.locked:
                continue
            down = z - np.sqrt(max(reach * reach - x * x - y * y, 0.0))
            if np.sqrt(x * x + y * y + (z - most) ** 2) > reach + MAX_SHORTFALL:
                foot.refused = True  # the foot goes home before it may hold again
                foot.release()
            elif np.abs(foot.shift).max() > 0.003:  # a leg that is straight of itself needs no help
                need = max(need, min(down, most))
        step = float(np.clip(need - self._drop, -PELVIS_SPEED_UP * self.dt, PELVIS_SPEED_DOWN * self.dt))
        self._drop = max(0.0, self._drop + step) if self._drop + step > 1e-5 else 0.0
        hips[2] -= self._drop
