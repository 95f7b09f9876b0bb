"""Where one stands to lift a box or to set it down: before it, or before the edge of what it stands on, and
how far one then leans.
"""

from __future__ import annotations

import numpy as np

from nsm_core.distances import BODY_TO_BOX, CRATE_SIDE
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.berth import ROOFED, Berth, depth, room_over
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.props import Box

BODY_TO_EDGE = 0.21  # metres from the root of who reaches over an edge to that edge: thighs stay out of it
FURTHEST = 0.32  # metres that a body leans over an edge beyond where it stands before a box at the edge
TOES_CLEAR = 0.06  # metres that one stands further from a box on the floor: toes are longer than knees
WIDEST_BOX, HEAVIEST_SIDE = 0.6, 0.6  # metres across and in depth that two hands hold
BEHIND_WALL = 0.6  # metres behind a low wall where one stands who has climbed over it
BENDING = (
    0.7  # metres over the floor of the wrists below which one bends over a box, and into what is over it
)
# Metres by which a place may touch other things; over a box that is moved under something, in or out.
GIVE, LEAST_ROOM = 0.02, 0.05
HANDS = 0.01  # metres from the wrists that hold a box to what stands beside it
FLOOR = 0.12  # metres under a box from which on toes go under what it stands on
ROOM = 0.2  # metres of room that a standing place should have
FACINGS = (0.0, np.pi / 2, np.pi, -np.pi / 2)
_ASIDE = (-0.15, 0.0, 0.15)  # metres to both sides in which an edge stops a body
_HEIGHTS = np.arange(0.2, 1.45, 0.1)
LOOK = 0.8  # metres from a box in which its edge is looked for
# Metres between places of a box on its way, and on its face; that count as meeting something.
_LANE, _GRID, _MEETS = 0.015, 0.06, 0.003
# Metres between samples, that count as touching, and of free floor before an edge.
_STEP, _TOUCH, _FREE = 0.04, 0.05, 0.2


class TooFar(GoalError):
    """What is to be reached lies ``edge`` metres behind the edge before it."""

    def __init__(self, edge: float, message: str) -> None:
        super().__init__(message)
        self.edge = edge


def standing_place(box: Box, facing: float, centre: Array, heading: float, further: float = 0.0) -> Array:
    """Where (2,) a carrier of ``heading`` and ``facing`` (in the box's frame) stands with the box centred at
    ``centre``.

    ``further`` metres off: see ``further_off``, which has how bulky the carrier is.
    """
    return np.asarray(centre, dtype=np.float64)[:2] - (
        box.stand_off(facing) + further
    ) * heading_to_direction(np.array(heading))


def edge_before_box(box: Box, facing: float, centre: Array, heading: float, solids: DistanceQuery) -> float:
    """Metres from the near face of a box at ``centre`` (3,) to the edge of what lies between it and its
    carrier; infinite over ``LOOK``.
    """
    centre = np.asarray(centre, dtype=np.float64)
    under = centre[2] - box.size[2] / 2 - 0.02
    heights = np.append(_HEIGHTS, under) if under > _HEIGHTS[0] else _HEIGHTS
    back = np.arange(0.0, LOOK + _FREE, _STEP)
    own = np.stack(np.meshgrid(back + box.across(facing)[1] / 2, _ASIDE, heights, indexing="ij"), -1).reshape(
        -1, 3
    )
    # Heading 0 faces -Y: +Y is behind.
    points = rotate_planar(own[:, [1, 0, 2]], np.float64(heading)) + (*centre[:2], 0.0)
    room = (
        solids.signed_distance(points.astype(np.float32), 2 * _TOUCH)
        .reshape(len(back), -1)
        .min(1)
        .astype(np.float64)
    )
    free = room >= _TOUCH
    need = round(_FREE / _STEP)
    for k in range(len(back) - need):
        if free[k : k + need].all():
            return max(0.0, back[k] - room[k]) if k else 0.0
    return np.inf


def further_off(
    box: Box,
    facing: float,
    centre: Array,
    heading: float,
    solids: DistanceQuery | None,
    of: str | None = None,
    scale: float = 1.0,
) -> float:
    """Metres by which the carrier of a box at ``centre`` (3,) stands further from it than one before a free
    box.

    Raises GoalError where arms do not reach as far, or where one would have to bend in between things; its
    sentence begins with
    ``of`` and tells lengths in units of ``scale`` metres.
    """
    low = float(centre[2]) - float(box.size[2]) / 2
    toes = TOES_CLEAR + max(0.0, box.across(facing)[1] - CRATE_SIDE[1]) if low < FLOOR else 0.0
    if solids is None:
        return toes + box.off
    what, edge = of or box.name, edge_before_box(box, facing, centre, heading, solids)
    further = max(toes, edge + BODY_TO_EDGE - BODY_TO_BOX)
    if further > FURTHEST:
        # Rounded apart, so that the two never read alike.
        how = (
            f"{np.ceil(100 * edge * scale) / 100:.2f} m"
            if np.isfinite(edge)
            else f"over {LOOK * scale:.2f} m"
        )
        most = np.floor(100 * (FURTHEST - BODY_TO_EDGE + BODY_TO_BOX) * scale) / 100
        raise TooFar(
            edge,
            f"{what} lies {how} behind the edge before it; a body leans {most:.2f} m over one: move it "
            "nearer to an edge.",
        )
    pose = np.append(centre, heading - facing)
    if float(pose[2]) + box.grip_height < BENDING and room_over(box, pose, solids) < ROOFED:
        raise GoalError(
            f"{what} lies low under something that nobody bends into; choose one that is open above, or "
            "higher."
        )
    if (
        float(solids.signed_distance(box.to_world(box.grasps(facing), pose).astype(np.float32), 0.1).min())
        < HANDS
    ):
        raise GoalError(
            f"{what} has no room beside it for the hands that hold it; clear its sides, or choose another."
        )
    if _shut_off(box, pose, facing, edge, solids):
        raise GoalError(
            f"{what} is shut off by something between it and who carries; clear the way, or choose another "
            "side."
        )
    return further + box.off


def _shut_off(box: Box, pose: Array, facing: float, edge: float, solids: DistanceQuery) -> bool:
    """Whether a box at ``pose`` (4,), lifted as high as it can be, meets something on its way to an edge
    ``edge`` metres before it.
    """
    lift, (width, depth_) = Berth(box, pose, solids).lift, box.across(facing)
    back = np.arange(_LANE, edge + 2 * _LANE, _LANE)
    across = np.linspace(-width / 2, width / 2, 2 + int(width / _GRID))
    heights = np.linspace(-box.size[2] / 2, box.size[2] / 2, 2 + int(box.size[2] / _GRID)) + lift
    own = np.stack(np.meshgrid(across, depth_ / 2 + back, heights, indexing="ij"), -1).reshape(-1, 3)
    points = rotate_planar(own, np.float64(pose[3] + facing)) + pose[:3]  # heading 0 faces -Y: +Y is behind
    return bool(solids.signed_distance(points.astype(np.float32), 0.02).min() < -_MEETS)


def _edges(box: Box, pose: Array) -> Array:
    """Points (N, 3) float32 on the edges of a box at ``pose`` (4,) that is smaller by ``GIVE`` all round,
    world.
    """
    half = np.maximum(np.asarray(box.size, dtype=np.float64) / 2 - GIVE, 0.01)
    points = []
    for axis in range(3):
        along = np.arange(-half[axis], half[axis], 0.01)
        for a, b in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
            ends = np.insert(np.array((a, b)) * np.delete(half, axis), axis, 0.0)
            points.append(ends + along[:, None] * np.eye(3)[axis])
    return box.to_world(np.concatenate(points), pose).astype(np.float32)


def require_room(box: Box, pose: Array, solids: DistanceQuery | None, of: str) -> None:
    """Raise GoalError, in a sentence that begins with ``of``, where a box at ``pose`` (4,) would stand in
    things or cannot be moved in.
    """
    if solids is None:
        return
    # A board that is thinner than that crosses the edges of a box that is smaller by it.
    if (
        depth(box, pose + (0, 0, GIVE, 0), solids) > GIVE
        or (solids.signed_distance(_edges(box, pose), 0.02) < -_MEETS).any()
    ):
        raise GoalError(f"{of} is taken by something that stands there; clear it, or choose another.")
    if room_over(box, pose, solids) < LEAST_ROOM:
        raise GoalError(
            f"{of} has too little room above to move it in; choose one that is open above, or a lower box."
        )


def choose_side(
    box: Box,
    plan: FloorPlan | None,
    start: Array,
    pose: Array | None = None,
    solids: DistanceQuery | None = None,
    scale: float = 1.0,
) -> tuple[float, Array, float]:
    """Choose from which side a box is taken: the carrier's heading in its frame, the standing place (2,) and
    how much further off it is.

    The nearest side with room to stand to which a way leads and from which hands reach the box; GoalError
    where there is none.
    ``solids`` are what may lie between; None: nothing does.  Sentences tell lengths in units of ``scale``
    metres.
    """
    pose = box.pose if pose is None else pose
    if solids is not None and (over := room_over(box, pose, solids)) < LEAST_ROOM:
        raise GoalError(
            f"There is {over * scale:.2f} m of room over {box.name}, too little to lift it out; set it "
            "where it is open above."
        )
    sides, problem = [], None
    for facing in FACINGS:
        try:
            further = further_off(box, facing, pose[:3], float(pose[3] + facing), solids, scale=scale)
        except GoalError as error:
            nearer = isinstance(error, TooFar) and isinstance(problem, TooFar) and error.edge < problem.edge
            problem = error if problem is None or nearer else problem
            continue
        stand = standing_place(box, facing, pose, float(pose[3] + facing), further)
        room = ROOM if plan is None else float(plan.clearance(stand[None])[0])
        wide = max(0.0, box.across(facing)[0] - WIDEST_BOX)
        price = float(np.linalg.norm(stand - start)) + 6 * max(0.0, ROOM - room) + 10 * wide + 4 * further
        sides.append((price, facing, stand, further))
    refused: GoalError | None = None
    for _, facing, stand, further in sorted(sides, key=lambda s: s[0]):
        try:
            if plan is not None and np.linalg.norm(stand - start) > 0.3:
                plan.require_way(start, stand)
            return facing, stand, further
        except GoalError as error:
            refused = refused or error
    raise refused or problem or GoalError("The box has no side to stand at.")


__all__ = [
    "BODY_TO_EDGE",
    "FURTHEST",
    "TOES_CLEAR",
    "choose_side",
    "edge_before_box",
    "further_off",
    "require_room",
    "standing_place",
]
