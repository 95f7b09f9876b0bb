"""A motion between two others that stay as they are: it leaves and reaches them without a pop, and its feet
stand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from nsm_core.body.capsules import BUNDLED, Figure
from nsm_core.body.contacts import ANKLES, LEGS, TOES, detect_foot_contacts
from nsm_core.body.inertialization import BLEND_FRAMES, soften_places, soften_seam, soften_turns
from nsm_core.rotations import Array
from nsm_core.world.scene.terrain import Terrain

from .clearance import PAD, Clearance, Obstacle
from .foot_clearance import keep_clear
from .footsteps import FootGround, footsteps
from .solver import Pose, Task, solved
from .stiffness import stiffness
from .two_bone import place_on

ENDS = 2  # frames on either side that are kept: where they are, and how fast
GLIDES = 0.8  # m/s of a toe that a network means to stand: where people's feet rest, its go on a little
SETTLED = 6  # frames over which what planting changes at the ends fades: for longer, feet that stand would go
Ground = Callable[[Array], Array]  # world places (N, 2) -> heights (N,), metres


class SensedGround(Terrain):
    """Ground of which every height is asked when it is needed."""

    def __init__(self, query: Ground) -> None:
        super().__init__()
        self.query = query

    def __bool__(self) -> bool:
        return True

    def height(self, points: Array) -> Array:
        """As ``Terrain.height``."""
        return np.asarray(self.query(np.asarray(points, dtype=np.float64)), dtype=np.float64)


def joined(hips: Array, local: Array, frames: int = BLEND_FRAMES) -> tuple[Array, Array]:
    """A motion, hips (T, 3) and local rotations (T, J, 4), with the jumps of pose and speed taken out behind
    its first ENDS frames and before its last ENDS, which stay; they fade over ``frames``.
    """
    hips, local = hips.copy(), local.copy()
    blend = _blend(len(hips), frames)
    soften_seam(hips, local, ENDS, blend)
    back_hips, back_local = hips[::-1].copy(), local[::-1].copy()
    soften_seam(back_hips, back_local, ENDS, blend)
    return back_hips[::-1], back_local[::-1]


def planted(
    hips: Array,
    local: Array,
    ground: Ground | None = None,
    figure: Figure = BUNDLED,
    solids: Sequence[Obstacle] = (),
    slow: float = GLIDES,
) -> tuple[Array, Array]:
    """The same motion of a ``figure`` with feet that stand from landing to lift-off, on the ``ground`` or,
    without, on the floor at z = 0, kept out of ``solids`` but for what touches them at either end; its first
    and last ENDS frames stay.  A foot stands where its toes are low and slower than ``slow`` m/s.
    """
    span = slice(ENDS - 1, len(hips) - ENDS + 1)  # one frame that stays at either end
    whole = Pose(figure.tree, hips.astype(np.float64), local.astype(np.float64))
    pose = whole.part(span)
    terrain = Terrain() if ground is None else SensedGround(ground)
    soil = FootGround(terrain, Terrain(), np.zeros(len(pose.hips)))
    over = whole.positions.copy()
    over[..., 2] -= soil.height(over[..., :2])
    labels = detect_foot_contacts(over, speed=slow)[span].astype(np.float64)
    first, last = ((pose.positions[k, TOES], pose.world[k, ANKLES]) for k in (0, -1))
    feet = footsteps(pose.positions[:, TOES], pose.world[:, ANKLES], labels, soil, figure.sole, first, last)
    limits: list[Task] = []
    if solids:
        for _ in keep_clear(feet, pose, solids, figure.spheres):
            pass
        limits.append(Clearance(_let_in(solids, pose, figure), figure.spheres.foot, figure.spheres))
    done = solved(pose, [*feet.tasks(), *limits], stiffness())

    def within(old: Array, new: Array) -> Array:
        return np.concatenate((old[:ENDS], new[1:-1], old[-ENDS:]))

    new_hips, new_local = joined(within(whole.hips, done.hips), within(whole.local, done.local), SETTLED)
    ankles = within(whole.positions[:, ANKLES], feet.ankles)
    turns = within(whole.world[:, ANKLES], feet.rotations)
    blend = _blend(len(hips), SETTLED)
    for _ in (0, 1):  # forth and back
        soften_places(ankles, ENDS, blend)
        soften_turns(turns, ENDS, blend)
        ankles, turns = ankles[::-1].copy(), turns[::-1].copy()
    placed = place_on(figure.tree, new_hips, new_local, LEGS, ankles, turns)
    return new_hips, within(whole.local, placed[ENDS - 1 : len(hips) - ENDS + 1])


def _let_in(solids: Sequence[Obstacle], pose: Pose, figure: Figure) -> list[Obstacle]:
    """The solids, of which spheres may be as deep inside as they are in the first frame and in the last: who
    rises from a seat leaves it, and is not pushed off.
    """
    ends = pose.part(np.array((0, -1)))
    centres, radii = figure.spheres.of(ends.positions, ends.world)
    share = np.linspace(0, 1, len(pose.hips))[:, None]
    out = []
    for solid in solids:
        deep = []
        for end, frame in enumerate((0, len(pose.hips) - 1)):
            frames = np.full(centres.shape[1], frame)
            distance = solid.distance(frames, centres[end], float(radii.max()) + PAD)
            deep.append(np.maximum(0.0, radii[end] + PAD - distance))
        out.append(Obstacle(solid.query, solid.poses, (1 - share) * deep[0] + share * deep[1]))
    return out


def _blend(count: int, frames: int) -> int:
    """Frames, ``frames`` at most, over which a jump fades in a motion of ``count``, ENDS at either side among
    them.
    """
    return min(frames, max(1, count - 2 * ENDS))


__all__ = ["ENDS", "GLIDES", "Ground", "joined", "planted"]
