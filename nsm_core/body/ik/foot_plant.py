"""Contact IK frame by frame: feet stay where they land, hips settle on the seat.  Whole takes: see
``foot_lock``.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.contacts import LEGS, TOE_OFFSET, detect_foot_contacts, foot_heading, sole_depth
from nsm_core.body.skeleton import FEET, OFFSETS, TOE_HEIGHT
from nsm_core.conventions import FOOT_CONTACTS, FPS, HIP_CONTACT
from nsm_core.rotations import Array, heading_quat, heading_to_direction, quat_mul, quat_rotate, wrap_angle
from nsm_core.signals import smooth_step
from nsm_core.world.scene.terrain import Terrain

from .foot_lock import MAX_PELVIS_DROP, lock_feet
from .footing import Footing
from .planted_foot import BEARS, EDGE_UP, GATHER, LOCK, UNLOCK, Foot
from .two_bone import leg_reach, limb_frames, place_limbs

SeatTarget = tuple[
    Array, float | None
]  # where hips (3,) are to settle, metres, and the heading to sit at; None while one still turns

__all__ = ["ContactIK", "detect_foot_contacts", "lock_feet"]

# Metres, metres a second, seconds and radians.
DRAW_TIME, MAX_SHORTFALL = 0.5, 0.03
STEP_FROM = 0.06  # that the pose is off a foot that stands, until it is set anew
NEXT_SEAT = 0.05  # between goals of one and the same seat
MAX_DRAW, MAX_DRAW_TURN, HIP_PLAY, HIP_PLAY_TURN = 0.3, np.radians(45), 0.008, np.radians(0.4)
ASKEW = np.radians(
    20
)  # from here to MAX_DRAW_TURN the draw fades: who still turns on the seat is not twisted round
PELVIS_SPEED_DOWN, PELVIS_SPEED_UP = 0.5, 0.25
STEP_DROP = 0.3  # of the pelvis per metre between the feet on top of things
_HIP_OFFSETS = OFFSETS[[leg[0] for leg in LEGS]].astype(np.float64)


class ContactIK:
    """Keep the feet of one character where they land and bring its hips onto the seat, frame by frame.

    Replaces the reference code's rule, target = lerp(last target, ankle, 1 - contact), which drags feet
    whenever a label is
    between 0 and 1.  Here a label switches a lock with hysteresis, the toe joint is the pivot, and what a
    lock added to the pose fades in about 0.2 s after release.  Feet stay above the floor.  The result may be
    fed back to the network or be used for display alone: the corrections are kept as offsets from the pose
    that comes in.
    """

    def __init__(self, fps: float = FPS, terrain: Terrain | None = None, low: Terrain | None = None) -> None:
        """``terrain`` is what feet may stand on besides the floor, ``low`` that of it which poses come in
        without (see ``relief``).
        """
        self.dt, self.terrain, self.low = 1.0 / fps, terrain, low
        self.reset()

    def reset(self) -> None:
        """Forget all locks, as for a new take or after a jump of the character."""
        self._feet = (Foot(), Foot())
        self._footing, self._out, self._rise = Footing(self.terrain, self.low), np.zeros(2), np.zeros(2)
        self._drop = 0.0
        self._seated, self._draw, self._face = False, 0.0, 0.0
        self._goal: Array | None = None  # where the hips are drawn
        self._facing = 0.0  # and the heading that they turn to

    def apply(
        self,
        hips_position: Array,
        local_rotations: Array,
        contacts: Array,
        hip_goal: SeatTarget | None = None,
        heading: float | None = None,
        level: float = 0.0,
    ) -> tuple[Array, Array]:
        """Correct one frame; return new (3,) hips position and (23, 4) local rotations.

        Args:
            hips_position: (3,) world, metres; local_rotations: (23, 4).  Neither is changed.
            contacts: (5,) labels 0..1 in the order of ``conventions.CONTACTS``.
            hip_goal: world position (3,) of the hip joint and heading to sit at (None while it still turns),
            or None.  While the
                hip label is high the hips are drawn there within half a second and stay within 1 cm and 1
                degree.
            heading: what counts as the body's heading now; None takes that of the hips joint.
            level: height of the floor, metres, on which the pose that comes in stands.
        """
        dtype = local_rotations.dtype
        hips, local = hips_position.astype(np.float64), local_rotations.astype(np.float64)
        joints, rotations, _ = limb_frames(hips, local, FEET)
        toes, feet = joints[:, 3], rotations[:, 2]
        foot_headings = foot_heading(feet)
        own = self._footing.raise_to_low(level, self.dt)
        toes[:, 2] += own
        ankle_heights = (toes - quat_rotate(feet, TOE_OFFSET))[:, 2]
        ground = self._look(toes, foot_headings, ankle_heights)
        climbed = ground > self._footing.under
        self._step(toes, bool(climbed.any()))
        for side, foot in enumerate(self._feet):
            over, stay, high = (
                float(self._footing.over[side]),
                float(self._footing.stay[side]),
                bool(climbed[side]),
            )
            seen = toes[side] - (0, 0, ground[side])
            label, ankle = float(contacts[FOOT_CONTACTS[side]]), float(ankle_heights[side] - ground[side])
            other, fellow = toes[1 - side, 2] - ground[1 - side], self._feet[1 - side]
            bears = (
                self._footing.climbs
                and not fellow.locked
                and other + fellow.shift[2] + fellow.lift > BEARS + TOE_HEIGHT
            )
            foot.update(seen, ankle, float(foot_headings[side]), label, self.dt, high, over, stay, bears)
        self._draw_hips(hips, local, float(contacts[HIP_CONTACT]), hip_goal, heading)
        turn = np.array([foot.turn for foot in self._feet])
        if turn.any():
            feet = quat_mul(heading_quat(turn), feet)
        raised = np.array([foot.lift for foot in self._feet])
        toes = toes + np.stack([foot.shift for foot in self._feet])
        toes[:, 2] += raised
        lift = self._out_of_ground(toes, feet, ground)
        toes[:, 2] += lift
        targets: Array = toes - quat_rotate(feet, TOE_OFFSET)
        starts = hips + quat_rotate(local[0], _HIP_OFFSETS)
        self._lower_pelvis(hips, starts, targets)
        moved = (
            turn.any()
            or lift.any()
            or raised.any()
            or own.any()
            or any(foot.shift.any() for foot in self._feet)
        )
        if not (self._draw or self._drop or moved):
            return hips_position.copy(), local_rotations.copy()
        return hips.astype(hips_position.dtype), place_limbs(hips, local, LEGS, targets, feet).astype(dtype)

    @property
    def locked(self) -> tuple[bool, bool]:
        """Whether the right and the left foot hold their places now."""
        return self._feet[0].locked, self._feet[1].locked

    def _step(self, toes: Array, climbing: bool) -> None:
        """Let a foot step where both would be dragged along: a network that is not sure which foot moves lets
        both glide.
        """
        gaps = [
            float(np.hypot(*(toe[:2] + foot.back - foot.anchor)))
            for toe, foot in zip(toes, self._feet, strict=True)
        ]
        foot = self._feet[int(np.argmax(gaps))]
        if not climbing and max(gaps) > STEP_FROM and all(f.locked and f.hold >= 1 for f in self._feet):
            foot.step()
        for foot, other in zip(self._feet, self._feet[::-1], strict=True):
            foot.wait_for(other)

    def _look(self, toes: Array, headings: Array, ankle_heights: Array) -> Array:
        """Heights (2,) of the ground under the feet; feet that stand against a riser are brought off it."""
        footing = self._footing
        if not footing.terrain:
            return footing.ground
        shifts = np.stack([foot.shift for foot in self._feet])
        raised = shifts[:, 2] + [foot.lift for foot in self._feet] + self._out
        footing.look(toes + shifts * (1, 1, 0), headings, ankle_heights, raised, self.locked, self.dt)
        for side, foot in enumerate(self._feet):
            if foot.locked:
                off = footing.off_risers(side, foot.anchor, foot.anchor_heading)
                heading = foot.anchor_heading
            else:
                heading = float(headings[side]) + foot.turn
                # A foot that slows down will come down.
                sole = toes[side, 2] - TOE_HEIGHT + raised[side] - (1 - foot.swing) * foot.lift
                off = footing.off_risers(
                    side, toes[side, :2] + shifts[side, :2] - foot.back, heading, sole, footing.pace[side]
                )
            foot.hold_off(off * heading_to_direction(np.array(heading)), self.dt)
        return footing.ground

    def _out_of_ground(self, toes: Array, feet: Array, ground: Array) -> Array:
        """Metres (2,) by which feet must be raised out of the ground: at once out of the floor, swiftly out
        of a step.
        """
        if not self._footing.terrain:
            return sole_depth(toes, feet)
        deep = sole_depth(toes, feet, ground, self._footing.heel)
        up = np.minimum(EDGE_UP * self.dt, np.maximum(self._rise, 0) + GATHER * self.dt**2)
        self._rise = np.clip(deep - self._out, -EDGE_UP * self.dt, up)
        self._out += self._rise
        return np.maximum(sole_depth(toes, feet), self._out)

    def _draw_hips(
        self, hips: Array, local: Array, label: float, goal: SeatTarget | None, heading: float | None
    ) -> None:
        """Move ``hips`` and turn ``local[0]`` in place toward the goal by the weights reached so far."""
        if goal is not None and (not self._draw or self._goal is None):
            self._goal = np.asarray(goal[0], dtype=np.float64)
        # A sitter who is sent to the next seat is let go from this one first.
        same = (
            goal is not None and self._goal is not None and np.linalg.norm(self._goal - goal[0]) < NEXT_SEAT
        )
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
        local[0] = quat_mul(heading_quat(np.asarray(float(smooth_step(self._face)) * turn)), local[0])

    def _lower_pelvis(self, hips: Array, starts: Array, targets: Array) -> None:
        """Bring ``hips`` down in place, slowly and a little, where a locked foot is out of reach; let go what
        stays out.
        """
        away = starts - targets
        reach = leg_reach()
        need, most = 0.0, MAX_PELVIS_DROP + STEP_DROP * abs(float(np.diff(self._footing.ground)[0]))
        for foot, (x, y, z) in zip(self._feet, away, strict=True):
            if not foot.locked:
                continue
            down = z - np.sqrt(max(reach * reach - x * x - y * y, 0.0))
            if np.sqrt(x * x + y * y + (z - most) ** 2) > reach + MAX_SHORTFALL:
                foot.step()
            elif np.abs(foot.shift).max() > 0.003:  # a leg that is straight of itself needs no help
                need = max(need, min(down, most))
        step = float(np.clip(need - self._drop, -PELVIS_SPEED_UP * self.dt, PELVIS_SPEED_DOWN * self.dt))
        self._drop = max(0.0, self._drop + step) if self._drop + step > 1e-5 else 0.0
        hips[2] -= self._drop
