"""Things put on boards by chance: upright, beside each other, and where asked for one before another."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.scene.containers import Container, Shelf
from nsm_core.world.scene.small_things import THINGS, SmallThing, make_thing

_APART = 0.012  # metres between things, and between them and the edge of a board
_HEADROOM = 0.02  # metres over a thing
_TRIES = 14  # places that are tried for a thing
_MOST = 6  # things on one board
_BACK = 0.02  # metres between a blocker and what is behind it
# What stands in a closed place before something else is picked over by hand: light and not wide.
_BLOCKERS = ("bowl", "tin", "jar", "carton", "canister", "mug", "tea caddy", "bottle", "cereal box")


@dataclass
class Filling:
    """Draws of what is put where; counts kinds so that every thing has a name of its own."""

    rng: np.random.Generator
    fill: float
    blocked: float
    made: dict[str, int] = field(default_factory=dict)

    def thing(self, kinds: tuple[str, ...], room: float) -> SmallThing | None:
        """A thing of one of the kinds that is no higher than ``room`` metres; None where chance has none."""
        for _ in range(4):
            kind = kinds[int(self.rng.integers(len(kinds)))]
            made = make_thing(kind, self.rng)
            if made.size[2] + _HEADROOM <= room:
                return made
        return None

    def name(self, thing: SmallThing) -> None:
        """Give it a name that no other has: "mug", "mug 2"."""
        self.made[thing.kind] = count = self.made.get(thing.kind, 0) + 1
        thing.name = thing.kind if count == 1 else f"{thing.kind} {count}"


def fill_board(
    filling: Filling, container: Container, board: Shelf
) -> list[tuple[SmallThing, tuple[str, ...]]]:
    """Put things on a board: each with the names of its blockers, in the world, where the container stands.

    On a share of the boards a thing stands at the back and a blocker before it, on the way out.
    """
    rng = filling.rng
    taken: list[Array] = []  # rectangles (2, 2) in the container's frame
    made: list[tuple[SmallThing, tuple[str, ...]]] = []
    if rng.random() > filling.fill + 0.2:
        return made
    low, high = board.low + _APART, board.high - _APART
    outwards = board.out[1] < -0.5 and board.room < 1.0
    if outwards and rng.random() < filling.blocked:
        made += _one_before_another(filling, container, board, low, high, taken)
    wanted = 1 + int(rng.integers(1 + round(filling.fill * (_MOST - 1))))
    for _ in range(max(wanted - len(made), 0)):
        thing = filling.thing(tuple(THINGS), board.room)
        if thing is None:
            continue
        for _ in range(_TRIES):
            heading = _heading(rng)
            half, off = _footprint(thing, heading)
            span = high - low - 2 * half
            if (span < 0).any():
                continue
            middle = low + half + rng.random(2) * span
            if _put(thing, container, board, middle, heading, half, off, taken):
                filling.name(thing)
                made.append((thing, ()))
                break
    return made


def _one_before_another(
    filling: Filling, container: Container, board: Shelf, low: Array, high: Array, taken: list[Array]
) -> list[tuple[SmallThing, tuple[str, ...]]]:
    """A thing at the back of a board and one before it; none where they do not fit."""
    rng = filling.rng
    behind, before = filling.thing(tuple(THINGS), board.room), filling.thing(_BLOCKERS, board.room)
    if behind is None or before is None:
        return []
    turns = [_heading(rng) for _ in range(2)]
    feet = [_footprint(t, h) for t, h in zip((behind, before), turns, strict=True)]
    (half, off), (half2, off2) = feet
    if 2 * (half + half2)[1] + _BACK > (high - low)[1] or 2 * max(half[0], half2[0]) > (high - low)[0]:
        return []
    spare = (high - low)[1] - 2 * (half + half2)[1] - _BACK
    y = high[1] - half[1] - spare * rng.random() * 0.4
    x = low[0] + half[0] + rng.random() * ((high - low)[0] - 2 * half[0])
    x2 = float(np.clip(x + rng.uniform(-0.03, 0.03), low[0] + half2[0], high[0] - half2[0]))
    y2 = y - half[1] - _BACK - half2[1] - rng.random() * 0.3 * spare
    _put(behind, container, board, np.array((x, y)), turns[0], half, off, taken)
    _put(before, container, board, np.array((x2, y2)), turns[1], half2, off2, taken)
    filling.name(before)
    filling.name(behind)
    return [(before, ()), (behind, (before.name,))]


def _heading(rng: np.random.Generator) -> float:
    """Mostly square to the board, turned a little."""
    return float(rng.integers(4) * np.pi / 2 + rng.normal(0, 0.12))


def _footprint(thing: SmallThing, heading: float) -> tuple[Array, Array]:
    """Half size (2,) and middle (2,), seen from its place, of the level rectangle around a turned thing."""
    corners = np.array([(x, y) for x in (thing.low[0], thing.high[0]) for y in (thing.low[1], thing.high[1])])
    turned = rotate_planar(corners, np.float64(heading))
    low, high = turned.min(0), turned.max(0)
    return (high - low) / 2, (high + low) / 2


def _put(
    thing: SmallThing,
    container: Container,
    board: Shelf,
    middle: Array,
    heading: float,
    half: Array,
    off: Array,
    taken: list[Array],
) -> bool:
    """Stand a thing with its footprint's middle at ``middle`` (2,), unless something is there already."""
    own = np.stack((middle - half - _APART / 2, middle + half + _APART / 2))
    if any((own[0] < other[1]).all() and (other[0] < own[1]).all() for other in taken):
        return False
    taken.append(own)
    place = container.to_world(np.array((*(middle - off), board.height)))
    thing.pose = np.array((*place, heading + container.pose[3]))
    return True
