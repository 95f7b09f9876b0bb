"""Who goes and who waits, decided anew some ten times a second; see the rule of this package."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.conventions import FPS
from nsm_core.errors import GoalError
from nsm_core.rotations import Array

from .bodies import OtherBody, OtherProp
from .claims import Claim, Claims
from .crossing import PATIENCE, ROOM, Meeting, clear_of, first_of, in_place_of, meeting, room_before
from .player import STEP, Player

EVERY = 3  # frames between two decisions
KEPT = 9  # frames for which a decision about two ways is kept after they meet no longer
_SIGHT, _END = 3.0, 0.5  # metres of a way on which somebody who stands in it is seen; of its end
# Metres from the middle of a way to a body that stands in it, and to one that stands at its end.
_TOUCH, _TOUCH_END = 0.24, 0.12
_NEARER = 0.03  # metres nearer than now
_AGAIN = 24  # frames between two looks for another way
_DETOUR = (1.25, 0.8)  # times as long, and metres more, that a way around somebody who comes may be
# Frames of standing after which who waits has come to rest, and metres that it may lack to where it waits.
_STANDS, _THERE = 5, 0.3
_STUCK, _HOPELESS = 24, 150  # frames of standing after which two are parted, and after which they are not
_STAYING = 75  # frames that one waits for somebody who will not move any more
_RINGS, _TURNS, _TRIES = np.arange(0.7, 7.0, 0.35), 20, 10
_FRONT = 0.7  # metres before a seat that must be free to rise


class Traffic:
    """Looks at all players together and has them give way and go on."""

    def __init__(self, players: Sequence[Player], things: dict[int, list[tuple[Player, OtherProp]]]) -> None:
        """``things`` are, by the order of a player, what others move, and who does."""
        self.players, self._things = list(players), things
        self.claims = Claims(players)
        self._frame = 0
        self._pairs: dict[
            tuple[int, int], tuple[Player, int]
        ] = {}  # who goes first, and since when it is kept
        self._looked: dict[int, int] = {}
        self._veered: dict[int, int] = {}
        self._blocked: dict[int, int] = {}
        for player in self.players:
            player.runner.director.gate = lambda goal, player=player: self._may_begin(player, goal)

    def update(self) -> None:
        """Decide, once a frame."""
        for player in self.players:
            player.look()
        if self._frame % EVERY == 0:
            self._decide()
        self._frame += 1
        for player in self.players:
            for order, where in player.waits_for.items():
                player.note_wait(self.players[order].name, where)
                break

    def _decide(self) -> None:
        for player in self.players:
            player.look_ahead()
        stops: dict[int, float] = {}
        before = {m.order: m.waits_for for m in self.players}
        for player in self.players:
            player.waits_for = {}

        def stop(player: Player, far: float, whom: Player, where: str) -> None:
            stops[player.order] = min(far, stops.get(player.order, np.inf))
            player.waits_for.setdefault(whom.order, where)

        self._hand_on(before)
        for player, claim, far in self.claims.update():
            if far < np.inf:
                assert claim.holder is not None
                stop(player, far, claim.holder, claim.name)
        for i, one in enumerate(self.players):
            for other in self.players[i + 1 :]:
                self._meet(one, other, stop, stops)
        for player in self.players:
            self._look_out(player, stop)
        for player in self.players:
            self._have(player, stops.get(player.order), before[player.order])
        self._part()

    def _hand_on(self, before: dict[int, dict[int, str]]) -> None:
        """Let who stands in the way of somebody to a thing that both want have it first."""
        for claim in self.claims.taken():
            holder = claim.holder
            assert holder is not None
            for order in before[holder.order]:
                other = self.players[order]
                if holder.still > _STUCK and self.claims.of(other, other.goal) is claim:
                    claim.holder = other
                    self._pairs.pop((min(order, holder.order), max(order, holder.order)), None)
                    break

    # --- ways that cross

    def _meet(self, one: Player, other: Player, stop: object, stops: dict[int, float]) -> None:
        key, met = (one.order, other.order), meeting(one, other)
        kept = self._pairs.get(key)
        if met is not None:
            first = self._first(one, other, met)
            if first is None:
                return
            last = other if first is one else one
            if last.at_work:
                if first.at_work:
                    return
                first, last = last, first
            self._pairs[key] = first, self._frame
            if self._waits_there(first, stops) and any(order != last.order for order in first.waits_for):
                return  # who stands and waits for a third keeps nobody waiting: one goes by, or around it
        elif kept is not None and self._frame - kept[1] > KEPT:
            del self._pairs[key]
            return
        elif kept is not None:
            first, last = kept[0], other if kept[0] is one else one
        else:
            return
        if last.veering:
            if met is None:
                return
        elif met is not None and not last.giving_way and self._veer(last, first, met):
            return
        far = room_before(last, first)
        if far < np.inf or last.giving_way:
            stop(last, min(far, 20.0), first, self._where(last))  # type: ignore[operator]

    def _waits_there(self, player: Player, stops: dict[int, float]) -> bool:
        """Whether who gives way has come to where it waits, and is not only about to start for it."""
        there = player.aside or stops.get(player.order, np.inf) < _THERE * player.frame.scale
        return player.giving_way and player.still > _STANDS and there

    def _first(self, one: Player, other: Player, met: Meeting) -> Player | None:
        """Who of two goes first where their ways meet; None where neither can give way."""
        for a, b in ((one, other), (other, one)):
            if in_place_of(a, b) and not in_place_of(b, a):
                return a
        for a, b in ((one, other), (other, one)):
            if a.order in b.waits_for:  # for a thing that the one has: it goes first on the way, too
                return a
        kept = self._pairs.get((one.order, other.order))
        return self.claims.before(one, other) or (kept[0] if kept is not None else first_of(one, other, met))

    def _veer(self, player: Player, first: Player, met: Meeting) -> bool:
        """Go around ``first`` without stopping, where there is room for it; whether there is."""
        if self._frame - self._veered.get(player.order, -_AGAIN) < _AGAIN or met.behind >= 0:
            return False
        self._veered[player.order] = self._frame
        own, before = player.frame, player.ahead
        comes = own.to_own(np.concatenate((first.place[None], first.ahead.points[first.ahead.times < 4.0])))
        wide = (player.radius + first.radius + ROOM) / own.scale - player.runner.plan.radius
        tube = OtherBody(
            np.insert(comes, 2, 0.9, axis=1), np.full(len(comes), wide), np.append(comes[0], (0, 0)), True
        )
        ends = own.to_own(before.points[[0, -1]])
        floor = player.runner.director.ground.floor()
        assert floor is not None
        try:
            way = own.to_common(np.asarray(floor.besides(tube, comes, wide + 0.1).find(*ends)))
        except GoalError:
            return False
        length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
        if length > _DETOUR[0] * STEP * len(before.points) + _DETOUR[1]:
            return False
        player.veer(way, int((max(met.times) + 1.0) * FPS))
        player.look_ahead()
        if any(meeting(player, other) is not None for other in self.players if other is not player):
            player.go_on()
            player.ahead = before
            return False
        return True

    def _where(self, player: Player) -> str:
        d = player.runner.director
        goal = d.goals[max(d.index, 0)]
        return f"the way to {goal.name}"

    # --- who stands in the way

    def _look_out(self, player: Player, stop: object) -> None:
        """See whether somebody who stands, or a door that is shut, is in the way; look for another way, or
        wait.
        """
        if player.at_work or len(player.ahead.points) < 2 or player.aside:
            self._blocked.pop(player.order, None)
            return
        found = self._in_way(player)
        if found is None:
            self._blocked.pop(player.order, None)
            return
        whom, index, where = found
        since = self._blocked.setdefault(player.order, self._frame)
        # Whoever stands there may leave another way by now.
        looked = self._frame - self._looked.get(player.order, -2 * _AGAIN)
        if looked >= 2 * _AGAIN and player.still > _STANDS if player.giving_way else looked >= _AGAIN:
            self._looked[player.order] = self._frame
            player.go_on()
            return
        if self._frame == since or whom.giving_way and not whom.settled:
            return
        stop(player, max(0.0, (index - 5) * STEP), whom, where)  # type: ignore[operator]
        if player.still > _STANDS:
            self._make_room(whom)
        if whom.stays and self._frame - since > _STAYING and player.still > _STANDS:
            self._give_up(
                player,
                f"{whom.name} stands in the only way to it and has nothing more to do; give {whom.name} "
                "another goal, or this one another place.",
            )

    def _in_way(self, player: Player) -> tuple[Player, int, str] | None:
        points = player.ahead.points
        count = min(int(_SIGHT / STEP), len(points) - 1)
        points = points[1 : 1 + count]
        end = np.arange(1, 1 + count) >= len(player.ahead.points) - int(_END / STEP)
        touch = np.where(end, _TOUCH_END, _TOUCH) * player.frame.scale
        best: tuple[Player, int, str] | None = None
        for other in self.players:
            if other is player or not other.settled:
                continue
            centres, radii = other.spheres()
            gap = (np.linalg.norm(points[:, None] - centres[:, :2], axis=-1) - radii).min(1)
            now = float((np.linalg.norm(player.place - centres[:, :2], axis=-1) - radii).min())
            # Who stands beside somebody may go away from there.
            taken = np.flatnonzero(gap < np.minimum(touch, now - _NEARER))
            if len(taken) and (best is None or taken[0] < best[1]):
                best = other, int(taken[0]), self._where(player)
        for owner, thing in self._things[player.order]:
            if thing.held:
                continue
            own = np.insert(player.frame.to_own(points), 2, 0.9, axis=1).astype(np.float32)
            taken = np.flatnonzero((thing.signed_distance(own, 0.5) < 0.2) & ~end)
            if len(taken) and (best is None or taken[0] < best[1]):
                best = owner, int(taken[0]), thing.prop.name
        return best

    def _make_room(self, player: Player) -> None:
        """Have one who waits, and stands in somebody's way, wait beside it."""
        if player.giving_way and player.settled and not player.aside and not player.at_work:
            way = self._nook(player, [m for m in self.players if m is not player])
            if way is not None:
                player.step_aside(way)

    # --- what is decided

    def _have(self, player: Player, far: float | None, before: dict[int, str]) -> None:
        """Have a player give way or go on."""
        if player.at_work and not player.giving_way:
            player.waits_for = {}
            return
        if far is None or not player.waits_for:  # it has given its goal up by now
            if player.veering > player.runner.frames:
                return
            if player.giving_way and not (player.aside and before and player.still < 5):
                player.go_on()
            return
        if not player.aside:
            player.halt(far)
        d = player.runner.director
        whom = self.players[next(iter(player.waits_for))]
        if whom.stays and player.still > _STANDS:
            claim = self.claims.of(player, player.goal)
            if claim is not None and claim.holder is whom:
                self._give_up(
                    player,
                    f"{whom.name} stays at {claim.name} to the end; give {whom.name} a further goal, or "
                    f"{player.name} another one.",
                )
                return
        if player.patience.get(d.index, 0) > PATIENCE:
            self._give_up(
                player,
                f"It was waited for {whom.name} for {PATIENCE // FPS} s; have {player.name} come later, or "
                "choose another place.",
            )

    def _give_up(self, player: Player, sentence: str) -> None:
        player.waits_for, player.aside = {}, False
        player.starved += 1
        player.runner.director.give_up(GoalError(sentence))

    def _may_begin(self, player: Player, goal: Goal) -> bool:
        """Whether a goal may be begun: no other has its box, and nobody comes by where one rises."""
        d = player.runner.director
        next_goal = d.index + 1
        if player.patience.get(next_goal, 0) > PATIENCE:
            return True
        claim: Claim | None = self.claims.free_for(player, goal)
        whom = claim.holder if claim is not None else None
        where = claim.name if claim is not None else "the seat"
        if claim is not None and whom is not None and whom.stays:
            claim.holder = whom = None  # it was left in hands that will not set it down: as it is
        if whom is None and player.seated:
            heading = float(player.runner.state.root[0, 2])
            front = player.place + _FRONT * player.frame.scale * np.array((np.sin(heading), -np.cos(heading)))
            whom = next((o for o in self.players if o is not player and self._comes_by(o, front)), None)
        if whom is None:
            return True
        player.patience[next_goal] = player.patience.get(next_goal, 0) + 1
        player.note_wait(whom.name, where)
        return False

    def _comes_by(self, other: Player, place: Array) -> bool:
        near = np.linalg.norm(other.ahead.points - place, axis=1) < 2 * other.radius
        if len(other.ahead.points) < 2 or other.giving_way:
            return False
        return bool((near & (other.ahead.times < 2.0)).any())

    # --- who block each other

    def _part(self) -> None:
        """Part players that wait for each other: one steps aside, or gives its goal up."""
        for player in sorted(self.players, key=lambda m: -m.order):
            ring = self._ring(player)
            if not ring or any(m.still < _STUCK for m in ring if not m.aside) or any(m.aside for m in ring):
                continue
            for who in sorted(ring, key=lambda m: -m.order):
                way = self._nook(who, [m for m in self.players if m is not who])
                if way is not None:
                    who.step_aside(way)
                    return
            if min(m.still for m in ring) > _HOPELESS:
                others = " and ".join(m.name for m in ring if m is not player)
                self._give_up(
                    player,
                    f"{player.name} and {others} block each other and nobody can step aside; make room, or "
                    "give them goals on their own sides.",
                )
            return

    def _ring(self, player: Player) -> list[Player]:
        """The players that wait for each other, ``player`` among them; empty where it is in no such ring."""

        def follow(way: list[Player]) -> list[Player]:
            for order in way[-1].waits_for:
                other = self.players[order]
                if other is player:
                    return way
                if other not in way and (found := follow([*way, other])):
                    return found
            return []

        return follow([player])

    def _nook(self, player: Player, others: list[Player]) -> Array | None:
        """The way (N, 2), common metres, to the nearest place that is out of everybody's way."""
        angles = np.linspace(0, 2 * np.pi, _TURNS, endpoint=False)
        around = np.stack((np.cos(angles), np.sin(angles)), -1)
        here = player.runner.state.root[0, :2].astype(np.float64)
        places = (here + _RINGS[:, None, None] * around).reshape(-1, 2)
        plan = player.runner.plan
        inside = ((places > plan.bounds[0]) & (places < plan.bounds[1])).all(1)
        places = places[inside]
        places = places[plan.clearance(places) > plan.radius + 0.05]
        places = places[clear_of(player.frame.to_common(places), others, player.radius)]
        ground = player.runner.director.ground
        for place in places[:_TRIES]:
            try:
                floor = ground.floor()
                assert floor is not None
                return player.frame.to_common(np.asarray(floor.find(here, place)))
            except GoalError:
                continue
        return None


__all__ = ["Meeting", "Traffic"]
