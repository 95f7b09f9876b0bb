"""How one hand opens and shuts a front of furniture: where one stands, out of its way, so that the hand
reaches the handle from where that is to where it comes to, and the ways of the hand to and from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.errors import GoalError
from nsm_core.rotations import Array, direction_to_heading
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.hand_fields import hand_space
from nsm_core.world.planning.hand_way import way_into
from nsm_core.world.scene.containers import Front
from nsm_core.world.scene.wrist import WristPose

from .picking import LOWEST, Around
from .reach import KNEES, LEANS, LEFT, RIGHT, ROOM, Reach, has_room, strains
from .setting_out import before_body

HIGHEST = 1.9  # metres over the floor of a handle at most
ENDS = (1.0, 0.85, 0.7, 0.55)  # shares of what is asked for that are tried, the whole first
_SEEN, _SWEPT = 9, 25  # openings at which hand and body are looked at, and what the front itself sweeps
_AROUND, _STEP = 1.0, 0.08  # metres of floor about the handle on which one may stand, and between places
_BEARINGS = np.radians(np.arange(-75, 76, 25))  # of the handle from where the body faces
_GIVE = 0.015  # metres by which a front may come into something more than it is when it is as it stands
_FINE = 0.03  # metres between the points of a front that are looked at, at most
_AT_ONCE, _TRIED = 16, 8  # places looked at at once, and those for which ways of the hand are looked for
_CLEAR = (0.16, 0.0)  # metres more than it needs that a body keeps off what moves, where it can
_TELLS = 0.1  # metres up to which what stands about is looked at


@dataclass(frozen=True)
class Pulling:
    """A ``hand`` (0 right, 1 left) that takes the handle of a front at the opening ``begin``, 0..1, and
    leaves it at ``end``: where the body stands, and ways (K, 3) of the wrist ``to`` the one and ``off`` the
    other.
    """

    hand: int
    reach: Reach
    begin: float
    end: float
    to: Array
    off: Array


def plan_pulling(front: Front, opening: float, around: Around) -> Pulling:
    """Plan to bring a front to an ``opening``, 0..1, or as near to it as an arm can among ``around``, which
    are without the front.  Raises GoalError where there is no room for it, for the body or for the hand.
    """
    begin = front.opening
    _require_height(front, begin)
    free = _free(front, opening, around.hands)
    if abs(free - begin) < ENDS[-1] * abs(opening - begin):
        raise GoalError(
            f"{front.name} moves by only {_amount(front, free - begin)} before it meets what stands about "
            "it; make room for it to open."
        )
    told = within = False
    for share in ENDS:
        end = begin + share * (opening - begin)
        if abs(end - begin) > abs(free - begin) + 1e-6:
            continue
        rows = _strained(_wrists(front, begin, end))
        within |= len(rows) > 0
        for hand, reach in _standing(front, begin, end, rows, around):
            told = True
            ways = [_way(front, at, reach, around, at == begin) for at in (begin, end)]
            if ways[0] is not None and ways[1] is not None:
                return Pulling(hand, reach, begin, end, ways[0], ways[1])
    if told:
        raise GoalError(
            f"No way leads a hand to the handle of {front.name} past what stands there; move something away "
            "from before it."
        )
    if not within:
        raise GoalError(
            f"{front.name} is too wide, or goes too far, for a hand of one who stays where one stands; leave "
            "it open, or choose another object."
        )
    raise GoalError(
        f"There is no free floor from which one hand moves {front.name} without standing in its way; make "
        "room before it."
    )


def _require_height(front: Front, opening: float) -> None:
    height = float(front.grip(opening).held[2])
    if not LOWEST <= height <= HIGHEST:
        raise GoalError(
            f"The handle of {front.name} is {height:.2f} m over the floor, and one hand opens what it "
            f"reaches between {LOWEST:.1f} and {HIGHEST:.1f} m; choose another object, or leave it open."
        )


def _amount(front: Front, share: float) -> str:
    moved = abs(share) * front.part.travel
    return f"{np.degrees(moved):.0f} degrees" if front.part.turns else f"{100 * moved:.0f} cm"


def _free(front: Front, opening: float, solids: DistanceQuery) -> float:
    """The opening on the way to another one at which a front comes no deeper into ``solids`` than it is."""
    v = front.volume
    lines = [np.linspace(-s / 2, s / 2, int(np.ceil(s / _FINE)) + 1) for s in v.size]
    points = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 3) + v.centre
    points = points[front.query.signed_distance(points.astype(np.float32), _TELLS) < 0.005]
    begin = front.opening

    def deep(share: float) -> Array:
        world = front.to_world(points, front.pose_at(share)).astype(np.float32)
        return np.minimum(solids.signed_distance(world, _TELLS), 0.0)

    before, free = deep(begin), begin
    for share in np.linspace(begin, opening, _SWEPT)[1:]:
        if (deep(float(share)) < before - _GIVE).any():
            break
        free = float(share)
    return free


def _wrists(front: Front, begin: float, end: float) -> list[WristPose]:
    """The wrist at the handle all the way."""
    return [front.grip(float(share)) for share in np.linspace(begin, end, _SEEN)]


def _standing(front: Front, begin: float, end: float, rows: Array, around: Around) -> list[tuple[int, Reach]]:
    """Hands and where the body stands, of what an arm can do, ``rows`` (N, 7), clear of the front all the
    way, the least strained first.
    """
    openings = np.linspace(begin, end, _SEEN)
    down = max(float(np.max(rows[:, 4])), 0.0) if len(rows) else 0.0
    rows = rows[around.room(rows[:, :2]) > ROOM + KNEES * down]
    found: list[tuple[int, Reach]] = []
    for more in _CLEAR:
        for first in range(0, len(rows), _AT_ONCE):
            some = rows[first : first + _AT_ONCE]
            clear = has_room(some[:, :2], around.bodies)
            for share in openings:
                clear[clear] = has_room(some[clear, :2], front.at(float(share)), more)
            for row in some[clear]:
                place, (heading, side, *rest) = row[:2].copy(), (float(value) for value in row[2:])
                found.append(((RIGHT, LEFT).index(side), Reach(place, heading, side, *rest)))
            if len(found) >= _TRIED:
                return found[:_TRIED]
    return found


def _strained(wrists: list[WristPose]) -> Array:
    """Rows (N, 7) of ``Reach`` from which an arm brings a hand to all poses of its wrist, the least strained
    first; strain and lean are those of the pose that is hardest to reach.
    """
    middle = np.mean([wrist.held[:2] for wrist in wrists], axis=0)
    line = np.arange(-_AROUND, _AROUND + _STEP, _STEP)
    grid = np.stack(np.meshgrid(line, line, _BEARINGS, (RIGHT, LEFT), indexing="ij"), -1).reshape(-1, 4)
    place, side = middle + grid[:, :2], grid[:, 3]
    heading = direction_to_heading(middle - place) + grid[:, 2]
    most, down = np.zeros((len(LEANS), len(place))), 0.0
    worst, leans = np.zeros(len(place)), np.zeros(len(place))
    for wrist in wrists:
        for k, lean in enumerate(LEANS):
            most[k], low = strains(wrist, place, heading, side, np.full(len(place), lean))
            down = max(down, low)
        least = most.min(0)
        leans = np.where(least > worst, np.array(LEANS)[most.argmin(0)], leans)
        worst = np.maximum(worst, least)
    can = np.flatnonzero(np.isfinite(worst))
    can = can[np.argsort(worst[can], kind="stable")]
    rows = np.column_stack((place, heading, side, np.full(len(place), down), worst, leans))
    return np.asarray(rows[can])


def _way(front: Front, opening: float, reach: Reach, around: Around, whole: bool) -> Array | None:
    """The way (K, 3) of an empty hand to the handle at an opening, from before the body where it is wanted
    ``whole``, else from where it comes near; None where there is none.
    """
    there, wrist = front.at(opening), front.grip(opening)
    space = hand_space(there, around.hands, wrist.held)
    for begin in before_body(wrist, reach, around.hands):
        way = way_into(space, wrist, begin, whole=whole)
        if way is not None:
            return np.concatenate((begin[None], way)) if whole else way
    return None


__all__ = ["HIGHEST", "Pulling", "plan_pulling"]
