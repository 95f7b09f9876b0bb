"""Who goes and who waits, decided anew some ten times a second; see the rule of this package."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nsm_core.control.goals import Goal
from nsm_core.conventions import FPS
from nsm_core.errors import GoalError
from nsm_core.rotations import Array

from .bodies import OtherProp
from .claims import Claim, Claims
from .crossing import PATIENCE, Meeting, clear_of, first_of, meeting, room_before
from .member import STEP, Member

EVERY = 3  # frames between two decisions
KEPT = 9  # frames for which a decision about two ways is kept after they meet no longer
_SIGHT, _END = 3.0, 0.5  # metres of a way on which somebody who stands in it is seen; at its end nobody is
_TOUCH = 0.24  # metres from the middle of a way to a body that stands in it
_AGAIN = 24  # frames between two looks for another way
_STUCK, _HOPELESS = 24, 150  # frames of standing after which two are parted, and after which they are not
_STAYING = 75  # frames that one waits for somebody who will not move any more
_RINGS, _TURNS, _TRIES = np.arange(0.7, 7.0, 0.35), 20, 10
_FRONT = 0.7  # metres before a seat that must be free to rise


class Traffic:
    """Looks at all members together and has them give way and go on."""

    def __init__(self, members: Sequence[Member], things: dict[int, list[tuple[Member, OtherProp]]]) -> None:
        """``things`` are, by the order of a member, what others move, and who does."""
        self.members, self._things = list(members), things
        self.claims = Claims(members)
        self._frame = 0
        self._pairs: dict[
            tuple[int, int], tuple[Member, int]
        ] = {}  # who goes first, and since when it is kept
        self._looked: dict[int, int] = {}
        self._blocked: dict[int, int] = {}
        for member in self.members:
            member.runner.director.gate = lambda goal, member=member: self._may_begin(member, goal)

    def update(self) -> None:
        """Decide, once a frame."""
        for member in self.members:
            member.look()
        if self._frame % EVERY == 0:
            self._decide()
        self._frame += 1
        for member in self.members:
            for order, where in member.waits_for.items():
                member.note_wait(self.members[order].name, where)
                break

    def _decide(self) -> None:
        for member in self.members:
            member.look_ahead()
        stops: dict[int, float] = {}
        before = {m.order: m.waits_for for m in self.members}
        for member in self.members:
            member.waits_for = {}

        def stop(member: Member, far: float, whom: Member, where: str) -> None:
            stops[member.order] = min(far, stops.get(member.order, np.inf))
            member.waits_for.setdefault(whom.order, where)

        for member, claim, far in self.claims.update():
            if far < np.inf:
                assert claim.holder is not None
                stop(member, far, claim.holder, claim.name)
        for i, one in enumerate(self.members):
            for other in self.members[i + 1 :]:
                self._meet(one, other, stop)
        for member in self.members:
            self._look_out(member, stop)
        for member in self.members:
            self._have(member, stops.get(member.order), before[member.order])
        self._part()

    # --- ways that cross

    def _meet(self, one: Member, other: Member, stop: object) -> None:
        key, met = (one.order, other.order), meeting(one, other)
        kept = self._pairs.get(key)
        if met is not None:
            first = kept[0] if kept is not None else first_of(one, other, met)
            if first is None:
                return
            last = other if first is one else one
            if last.at_work:
                if first.at_work:
                    return
                first, last = last, first
            self._pairs[key] = first, self._frame
        elif kept is not None and self._frame - kept[1] > KEPT:
            del self._pairs[key]
            return
        elif kept is not None:
            first, last = kept[0], other if kept[0] is one else one
        else:
            return
        far = room_before(last, first)
        if far < np.inf or last.giving_way:
            stop(last, min(far, 20.0), first, self._where(last))  # type: ignore[operator]

    def _where(self, member: Member) -> str:
        d = member.runner.director
        goal = d.goals[max(d.index, 0)]
        return f"the way to {goal.name}"

    # --- who stands in the way

    def _look_out(self, member: Member, stop: object) -> None:
        """See whether somebody who stands, or a door that is shut, is in the way; look for another way, or
        wait.
        """
        if member.at_work or len(member.ahead.points) < 2 or member.aside:
            self._blocked.pop(member.order, None)
            return
        found = self._in_way(member)
        if found is None:
            self._blocked.pop(member.order, None)
            return
        whom, index, where = found
        since = self._blocked.setdefault(member.order, self._frame)
        if self._frame - self._looked.get(member.order, -_AGAIN) >= _AGAIN and not member.giving_way:
            self._looked[member.order] = self._frame
            member.go_on()
            return
        if self._frame == since or whom.giving_way and not whom.settled:
            return
        stop(member, max(0.0, (index - 5) * STEP), whom, where)  # type: ignore[operator]
        if self._frame - self._looked.get(member.order, 0) >= 2 * _AGAIN and member.still > 5:
            self._looked[member.order] = self._frame
            member.go_on()  # whoever stands there may leave another way by now
        if whom.stays and self._frame - since > _STAYING and member.still > 5:
            self._give_up(
                member,
                f"{whom.name} stands in the only way to it and has nothing more to do; give {whom.name} "
                "another goal, or this one another place.",
            )

    def _in_way(self, member: Member) -> tuple[Member, int, str] | None:
        points = member.ahead.points
        count = min(int(_SIGHT / STEP), len(points) - 1 - int(_END / STEP))
        if count < 1:
            return None
        points = points[1 : 1 + count]
        best: tuple[Member, int, str] | None = None
        for other in self.members:
            if other is member or not other.settled:
                continue
            centres, radii = other.spheres()
            gap = np.linalg.norm(points[:, None] - centres[:, :2], axis=-1) - radii
            taken = np.flatnonzero(gap.min(1) < _TOUCH * member.frame.scale)
            if len(taken) and (best is None or taken[0] < best[1]):
                best = other, int(taken[0]), self._where(member)
        for owner, thing in self._things[member.order]:
            if thing.held:
                continue
            own = np.insert(member.frame.to_own(points), 2, 0.9, axis=1).astype(np.float32)
            taken = np.flatnonzero(thing.signed_distance(own, 0.5) < 0.2)
            if len(taken) and (best is None or taken[0] < best[1]):
                best = owner, int(taken[0]), thing.prop.name
        return best

    # --- what is decided

    def _have(self, member: Member, far: float | None, before: dict[int, str]) -> None:
        """Have a member give way or go on."""
        if member.at_work and not member.giving_way:
            member.waits_for = {}
            return
        if far is None:
            if member.giving_way and not (member.aside and before and member.still < 5):
                member.go_on()
            return
        if not member.aside:
            member.halt(far)
        d = member.runner.director
        whom = self.members[next(iter(member.waits_for))]
        if whom.stays and member.still > 5:
            claim = self.claims.of(member, member.goal)
            if claim is not None and claim.holder is whom:
                self._give_up(
                    member,
                    f"{whom.name} stays at {claim.name} to the end; give {whom.name} a further goal, or "
                    f"{member.name} another one.",
                )
                return
        if member.patience.get(d.index, 0) > PATIENCE:
            self._give_up(
                member,
                f"It was waited for {whom.name} for {PATIENCE // FPS} s; have {member.name} come later, or "
                "choose another place.",
            )

    def _give_up(self, member: Member, sentence: str) -> None:
        member.waits_for, member.aside = {}, False
        member.runner.director.give_up(GoalError(sentence))

    def _may_begin(self, member: Member, goal: Goal) -> bool:
        """Whether a goal may be begun: no other has its box, and nobody comes by where one rises."""
        d = member.runner.director
        next_goal = d.index + 1
        if member.patience.get(next_goal, 0) > PATIENCE:
            return True
        claim: Claim | None = self.claims.free_for(member, goal)
        whom = claim.holder if claim is not None else None
        where = claim.name if claim is not None else "the seat"
        if claim is not None and whom is not None and whom.stays:
            claim.holder = whom = None  # it was left in hands that will not set it down: as it is
        if whom is None and member.seated:
            heading = float(member.runner.state.root[0, 2])
            front = member.place + _FRONT * member.frame.scale * np.array((np.sin(heading), -np.cos(heading)))
            whom = next((o for o in self.members if o is not member and self._comes_by(o, front)), None)
        if whom is None:
            return True
        member.patience[next_goal] = member.patience.get(next_goal, 0) + 1
        member.note_wait(whom.name, where)
        return False

    def _comes_by(self, other: Member, place: Array) -> bool:
        near = np.linalg.norm(other.ahead.points - place, axis=1) < 2 * other.radius
        if len(other.ahead.points) < 2 or other.giving_way:
            return False
        return bool((near & (other.ahead.times < 2.0)).any())

    # --- who block each other

    def _part(self) -> None:
        """Part members that wait for each other: one steps aside, or gives its goal up."""
        for member in sorted(self.members, key=lambda m: -m.order):
            ring = self._ring(member)
            if not ring or any(m.still < _STUCK for m in ring if not m.aside) or any(m.aside for m in ring):
                continue
            for who in sorted(ring, key=lambda m: -m.order):
                way = self._nook(who, [m for m in self.members if m is not who])
                if way is not None:
                    who.step_aside(way)
                    return
            if min(m.still for m in ring) > _HOPELESS:
                others = " and ".join(m.name for m in ring if m is not member)
                self._give_up(
                    member,
                    f"{member.name} and {others} block each other and nobody can step aside; make room, or "
                    "give them goals on their own sides.",
                )
            return

    def _ring(self, member: Member) -> list[Member]:
        """The members that wait for each other, ``member`` among them; empty where it is in no such ring."""

        def follow(way: list[Member]) -> list[Member]:
            for order in way[-1].waits_for:
                other = self.members[order]
                if other is member:
                    return way
                if other not in way and (found := follow([*way, other])):
                    return found
            return []

        return follow([member])

    def _nook(self, member: Member, others: list[Member]) -> Array | None:
        """The way (N, 2), common metres, to the nearest place that is out of everybody's way."""
        angles = np.linspace(0, 2 * np.pi, _TURNS, endpoint=False)
        around = np.stack((np.cos(angles), np.sin(angles)), -1)
        here = member.runner.state.root[0, :2].astype(np.float64)
        places = (here + _RINGS[:, None, None] * around).reshape(-1, 2)
        plan = member.runner.plan
        inside = ((places > plan.bounds[0]) & (places < plan.bounds[1])).all(1)
        places = places[inside]
        places = places[plan.clearance(places) > plan.radius + 0.05]
        places = places[clear_of(member.frame.to_common(places), others, member.radius)]
        ground = member.runner.director.ground
        for place in places[:_TRIES]:
            try:
                floor = ground.floor()
                assert floor is not None
                return member.frame.to_common(np.asarray(floor.find(here, place)))
            except GoalError:
                continue
        return None


__all__ = ["Meeting", "Traffic"]
