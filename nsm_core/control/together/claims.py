"""Things that one at a time can use: who has each, and who waits for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.rotations import Array
from nsm_core.world.actions import BY_KEY
from nsm_core.world.scene.props import Leaf

from .player import STEP, Player

SAME_SEAT = 0.45  # metres between two goals to sit that are one seat
SOON = 4.0  # seconds before it is reached within which a thing is claimed
LINES = {
    "open": 2.1,
    "sit": 1.6,
    "carry": 1.7,
    "climb": 1.9,
    "touch": 1.0,
    "place": 1.2,
}  # metres off a thing at which others wait
LEFT = {
    "open": 1.3,
    "sit": 1.0,
    "carry": 0.0,
    "climb": 1.2,
    "touch": 0.7,
    "place": 0.0,
}  # metres off it at which one has left it


@dataclass
class Claim:
    """A thing that is used by one at a time: its ``name`` and ``place`` (2,), common metres, what is done
    with it, who has it now, and who stands in line for it, the first one first.
    """

    name: str
    action: str
    place: Array
    holder: Player | None = None
    line: list[Player] = field(default_factory=list)


class Claims:
    """All such things of the players' goals."""

    def __init__(self, players: Sequence[Player]) -> None:
        self.players = players
        self._all: list[Claim] = []
        for player in players:
            for goal in player.runner.director.goals:
                if goal.action in LINES:
                    if self.of(player, goal) is None:
                        self._all.append(Claim(goal.name, goal.action, place_of(player, goal)))

    def of(self, player: Player, goal: Goal | None) -> Claim | None:
        """The thing that a goal needs for itself; None where it needs none."""
        if goal is None or goal.action not in LINES:
            return None
        place = place_of(player, goal)
        for claim in self._all:
            if claim.action != goal.action:
                continue
            if (
                goal.prop is not None
                and claim.name == goal.prop.name
                or (goal.prop is None and float(np.linalg.norm(claim.place - place)) < SAME_SEAT)
            ):
                return claim
        return None

    def taken(self) -> list[Claim]:
        """Those that somebody has."""
        return [claim for claim in self._all if claim.holder is not None]

    def update(self) -> list[tuple[Player, Claim, float]]:
        """Give things away and free; who has to wait for one now, and how far it may go on, metres."""
        wants = [(m, self.of(m, m.goal)) for m in self.players]
        for claim in self._all:
            asking = [m for m, wanted in wants if wanted is claim and self._asks(m, claim)]
            joining = sorted((m for m in asking if m not in claim.line), key=lambda m: (_eta(m), m.order))
            claim.line = [m for m in claim.line if self.of(m, m.goal) is claim] + joining
            if claim.holder is not None and self._left(claim):
                claim.holder = None
                for waiting in claim.line:  # the line has moved on: nobody waits in vain
                    waiting.patience[waiting.runner.director.index] = 0
            if claim.holder is None and claim.line:
                claim.holder = min(claim.line, key=lambda m: not m.at_work)
                goal = claim.holder.goal
                assert goal is not None
                claim.place = place_of(claim.holder, goal)
        return [
            (m, wanted, _room(m, wanted))
            for m, wanted in wants
            if wanted is not None and wanted.holder is not None and wanted.holder is not m and not m.at_work
        ]

    def before(self, one: Player, other: Player) -> Player | None:
        """Who of two that want one thing has it first; None where they do not, or neither is in line."""
        claim = self.of(one, one.goal)
        if claim is None or self.of(other, other.goal) is not claim:
            return None
        return next((m for m in (claim.holder, *claim.line) if m is one or m is other), None)

    def free_for(self, player: Player, goal: Goal) -> Claim | None:
        """The thing that another has, without which a goal cannot even be begun: a box; None where it can."""
        claim = self.of(player, goal)
        taken = claim is not None and claim.holder not in (None, player)
        return claim if taken and BY_KEY[goal.action].needs_destination else None

    def _left(self, claim: Claim) -> bool:
        """Whether who has a thing is done with it and away from it."""
        holder = claim.holder
        assert holder is not None
        if self.of(holder, holder.goal) is claim:
            return False
        if BY_KEY[claim.action].needs_destination:
            return all(g.prop is None or g.prop.name != claim.name for g in holder.runner.director.grasps)
        # Who is to stand beside it to the end needs it no more, and will not come farther off.
        off = 2 * holder.radius if holder.stays and not holder.at_work else LEFT[claim.action]
        return float(np.linalg.norm(holder.place - claim.place)) > off

    def _asks(self, player: Player, claim: Claim) -> bool:
        """Whether who wants a thing is at it, or comes to it soon, and so stands in line for it."""
        near = float(np.linalg.norm(player.place - claim.place)) < LINES[claim.action] + 0.5
        return player.at_work or near or float(player.ahead.times[-1]) < SOON


def place_of(player: Player, goal: Goal) -> Array:
    """Where (2,), common metres, the thing of a goal is now: a seat, the middle of a door, a box."""
    if isinstance(goal.prop, Leaf):
        leaf = goal.prop
        return player.frame.to_common(leaf.to_world((leaf.width / 2, 0, 0), leaf.pose_at(0.0))[:2])
    at = goal.position if goal.prop is None else goal.prop.pose
    return player.frame.to_common(np.asarray(at, dtype=np.float64)[:2])


def _eta(player: Player) -> float:
    return round(float(player.ahead.times[-1]) / 0.5)


def _room(player: Player, claim: Claim) -> float:
    """Metres of its way that a player may go before it comes to the line at which it waits."""
    off = np.linalg.norm(player.ahead.points - claim.place, axis=1)
    inside = np.flatnonzero(off < LINES[claim.action])
    return np.inf if not len(inside) else max(0.0, (int(inside[0]) - 2) * STEP)
