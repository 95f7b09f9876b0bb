"""Fit a climb to its object: in the manner that keeps the legs clear of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from nsm_core.body.skeleton import forward_kinematics
from nsm_core.conventions import CLIMB
from nsm_core.data.scenarios.motion import Motion
from nsm_core.data.scenarios.session import Session
from nsm_core.data.scenarios.take import Thing, TimedCommand
from nsm_core.rotations import Array, heading_to_direction
from nsm_core.world.assets.pool import scaled
from nsm_core.world.scene.furniture import Furniture

from .clearance import leg_depths
from .footholds import OFF_EDGE, Block, Crossing, draw_near, place_feet, pose_holds, set_off
from .warp import Ascent, climb

MARGIN = 90  # frames before and after an episode in which feet still come back to their own places
CLEAR, DEEPEST = 0.007, 0.03  # metres that legs may be in the block: with no change made for it, and at all
# Share of its height to which a block that is in the way is lowered, and how often.
LOWER, LOWERINGS = 0.92, 4
LEANS = (0, 9, 21, 28)  # degrees at most, onto steps of 0.15, 0.3, 0.45 and 0.6 m
OVER = 0.07  # metres by which hips come further over the foot on top of a high step while the other pushes
# What is tried of a manner, one after the other, until the legs are clear.
CHOICES = (
    ("before", (OFF_EDGE, 0.12, 0.2)),
    ("wait", (-0.1, -0.05, 0.0, 0.06, 0.12)),
    ("early", (0.0, 0.3)),
)
WALL_CHOICES = 2 * (
    ("rise", (0.12, 0.2)),
    ("before", (OFF_EDGE, 0.12, 0.2, 0.28)),
    ("beyond", (OFF_EDGE, 0.12, 0.2)),
    ("splay", (0.0, 0.35, 0.7)),
    *CHOICES[1:],
)


@dataclass(frozen=True)
class ClimbManner:
    """How an edge is crossed: what the feet keep off it ``before`` and ``beyond`` it, metres, how far the
    hips ``wait`` behind the foot that follows, metres, and how ``early`` they rise, as a share of what lies
    between the landings; how much they
    ``rise`` over a wall, as a share of its height, and how far knees ``splay`` in swings over it, radians.
    """  # fmt: skip

    before: float = OFF_EDGE
    beyond: float = OFF_EDGE
    wait: float = 0.0
    early: float = 0.0
    rise: float = 0.12
    splay: float = 0.0

    def effort(self) -> float:
        """How much the climb is changed, to weigh against metres in the block."""
        return 0.02 * (self.before + self.beyond - 2 * OFF_EDGE + abs(self.wait)) + 0.003 * (
            self.early + self.splay
        )


@dataclass
class ClimbEpisode:
    """One climb: its object, the command that asks for it, and its crossings of edges (up and down, or one
    over a wall).
    """

    piece: Furniture
    block: Block
    mark: int
    start: int
    up: Crossing
    down: Crossing | None = None
    stand: int = 0  # a frame of standing on top or behind
    end: int = 0
    places: list[tuple[Array, float]] = field(default_factory=list)

    def clear(self, session: Session) -> bool:
        """Whether the way walked keeps off the block but for the climb itself."""
        roots = np.array(session.tape.roots)
        inside = self.block.holds(roots, 0.25)
        inside[self.start : self.end] = False
        # On the way there and away one comes near only where one climbs; a wall is stepped over, not walked
        # around.
        on_way = self.block.holds(roots[self.start : self.up.lift], 0.0).any()
        return not inside.any() and not on_way

    def fit(self, motion: Motion) -> None:
        """Label the climb."""
        for crossing in (self.up, self.down):
            if crossing is not None:
                motion.ramp(
                    CLIMB,
                    crossing.lift - 6,
                    crossing.lift + 3,
                    max(crossing.both - 2, crossing.lift + 4),
                    crossing.both + 6,
                )

    def finish(self, motion: Motion) -> None:
        """Move the feet off the edges, raise them and the hips, and say where the climb ends."""
        first, last = max(self.start - MARGIN, 0), min(self.end + MARGIN, len(motion))
        span = slice(first, last)
        fitted, depth = self._clearest(motion, first, last)
        for _ in range(LOWERINGS):
            if depth < DEEPEST:
                break
            # Legs that find no way over it want a lower one.
            self.piece = scaled(self.piece, np.array((1.0, 1.0, LOWER)))
            self.block = replace(self.block, height=float(self.piece.size[2]))
            fitted, depth = self._clearest(motion, first, last)
        motion.hips[span], motion.rotations[span] = fitted
        at = slice(self.stand, self.stand + 8)
        place = np.append(
            motion.hips[at, :2].mean(0), 0.0 if self.down is None else self.block.height
        ).astype(np.float32)
        frame, heading = motion.commands[self.mark].frame, float(np.mean(motion.headings[at]))
        motion.commands[self.mark] = TimedCommand(frame, "idle+walk", place, heading, len(motion.things))
        motion.things.append(Thing.standing(self.piece, self.block.position, self.block.heading))

    def _clearest(self, motion: Motion, first: int, last: int) -> tuple[tuple[Array, Array], float]:
        """Hips and rotations of the frames, climbing in the manner that keeps the legs best out of the block;
        and how deep they are.
        """
        fits: dict[ClimbManner, tuple[float, tuple[Array, Array]]] = {}

        def depth(manner: ClimbManner) -> float:
            if manner not in fits:
                fitted = self._fitted(motion, first, last, manner)
                fits[manner] = (
                    float(leg_depths(*fitted, self.block)[self.start - first : self.end - first].max()),
                    fitted,
                )
            return fits[manner][0]

        best = ClimbManner()
        for name, values in WALL_CHOICES if self.down is None else CHOICES:
            if depth(best) < CLEAR:
                break
            best = min(
                (replace(best, **{name: v}) for v in values), key=lambda m: max(depth(m), CLEAR) + m.effort()
            )
        return fits[best][1], fits[best][0]

    def _fitted(self, motion: Motion, first: int, last: int, manner: ClimbManner) -> tuple[Array, Array]:
        """Hips and rotations of the frames ``first`` to ``last``, climbing in a ``manner``."""
        span = slice(first, last)
        positions, world = forward_kinematics(motion.hips[span], motion.rotations[span])
        holds = pose_holds(positions, world, motion.feet[span])
        h, a, b = self.block.height, self.up.less(first), self.down and self.down.less(first)
        top = np.zeros(len(holds), bool)
        early = manner.early * (a.both - a.landing)
        if b is None:
            ascents = [
                Ascent(a.lift, a.landing - early, manner.rise * h),
                Ascent(a.follows + 2 + 2 * early, a.both + 6, -manner.rise * h),
            ]
        else:
            top = np.array([a.landing - 2 <= x.first < b.landing - 2 for x in holds])
            ascents = [
                Ascent(a.landing - early, a.both + 2 - early, h),
                Ascent(b.lift + 0.2 * (b.landing - b.lift), b.landing + 4, -h),
            ]
        # The trunk leans over the foot on top while the other pushes off, over a wall a little.
        most = np.radians(np.interp(h, (0.15, 0.3, 0.45, 0.6), (0, 5, 11, 17) if b is None else LEANS))
        away = (np.arange(last - first) - (a.landing + a.follows) / 2) / (0.3 * max(a.both - a.lift, 16))
        lean = most * np.exp(-0.5 * away**2)
        shifts = place_feet(holds, top, self.block)
        lead = next((k for k, x in enumerate(holds) if x.first >= a.landing - 2), len(holds) - 1)
        trail = [k for k in range(lead) if holds[k].side != holds[lead].side][-1:]
        if b is None:
            # With the feet close to the wall the hips stay high, and the knees before it.
            draw_near(holds, shifts, [*trail, lead], self.block)
            set_off(holds, shifts, lead, self.block, manner.beyond)
        for k in trail:
            set_off(holds, shifts, k, self.block, manner.before)
        # Hips that wait behind the foot that follows keep its knee out of the edge.
        t = np.arange(last - first)
        way = heading_to_direction(np.array(float(motion.headings[self.up.landing])))
        wait = np.exp(-0.5 * ((t - a.follows - 1) / (0.25 * max(a.both - a.landing, 12))) ** 2)
        over = np.interp(h, (0.2, 0.45), (0.0, OVER)) * (b is not None)
        comes = np.exp(-0.5 * ((t - (a.landing + a.follows) / 2) / (0.3 * max(a.both - a.landing, 12))) ** 2)
        sway = (over * comes - manner.wait * wait)[:, None] * way
        within = (self.start - first, self.end - first)
        return climb(
            motion.hips[span],
            motion.rotations[span],
            motion.feet[span],
            self.block,
            holds,
            top,
            shifts,
            within,
            ascents,
            lean,
            sway,
            manner.splay,
        )
