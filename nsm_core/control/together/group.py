"""Several takes in one scene, generated together: one step of the network for all in every frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from nsm_core.body.ik.body_track import BodyTrack
from nsm_core.body.ik.clearance import Obstacle
from nsm_core.control.batch import step_together
from nsm_core.control.take import TakeRequest, TakeResult, TakeRunner
from nsm_core.errors import GoalError
from nsm_core.model.features.layout import Inputs
from nsm_core.model.inference.model import Model
from nsm_core.model.networks.config import Memory
from nsm_core.model.networks.protocol import Info
from nsm_core.rotations import Array

from .bodies import OtherBody, OtherProp, depths_between, in_world, track_of
from .frames import Frame
from .player import Player, Wait
from .traffic import Traffic

DEEP = 0.025  # metres by which two bodies may be in each other before they are solved once more
ROUNDS = 2  # times at most that takes are solved once more


@dataclass(frozen=True)
class Cast:
    """One of the characters: its ``name``, what its take needs to know, and where its world lies in the one
    that all share.
    """

    name: str
    request: TakeRequest
    frame: Frame = field(default_factory=Frame)


class GroupRunner:
    """Steps the takes of several characters together, frame by frame; in the order of their priority."""

    def __init__(self, model: Model, casts: Sequence[Cast]) -> None:
        """Prepare the takes; GoalError, with the character's name, where one cannot do a goal."""
        self.casts = list(casts)
        self.players: list[Player] = []
        for order, cast in enumerate(casts):
            with _told(cast.name):
                # Who goes first among several is told goal by goal.
                runner = TakeRunner(model, replace(cast.request, in_order=True))
                self.players.append(Player(cast.name, runner, cast.frame, order))
        self._bodies: dict[tuple[int, int], OtherBody] = {}
        self._things: dict[int, list[tuple[Player, OtherProp]]] = {}
        self._poses = {m.order: m.runner.prop_poses() for m in self.players}
        for player in self.players:
            self._introduce(player)
        self._traffic = Traffic(self.players, self._things)
        self._queue: list[Player] = list(self.players)  # that are still to be solved
        self._rounds = 0
        self.depths: dict[tuple[str, str], float] = {}  # metres, the deepest of each pair, when all is done

    @property
    def progress(self) -> float:
        """Estimate of the share that is done, 0..1."""
        return sum(m.runner.progress for m in self.players) / len(self.players)

    @property
    def frames(self) -> int:
        """Frames of the longest take so far."""
        return max(p.runner.frames for p in self.players)

    def step(self) -> bool:
        """Make one frame of every take that goes on; False when all are over and solved.

        Once the last frame is made, the takes are solved one after the other, a little at a call.
        """
        going = [m for m in self.players if not m.done]
        if not going:
            return self._mend()
        self._traffic.update()
        self._show()
        held = [_Named(m) for m in going]
        step_together(held)
        self._share()
        return True

    def results(self) -> list[TakeResult]:
        """Everything made, solved, in the order of the characters."""
        while self.step():
            pass
        return [m.runner.result() for m in self.players]

    def poses(self) -> list[tuple[Array, Array, dict[str, Array]]]:
        """The newest pose of each: hips (3,), rotations (23, 4), and the poses of its props by name."""
        return [(*p.runner.pose(), p.runner.prop_poses()) for p in self.players]

    def track_of(self, number: int, name: str) -> Array:
        """Poses (T, 4) of a prop over all the time that somebody may move it, as a character sees it."""
        who = [p for p in self.players if name in p.runner.props]
        longest = max(who, key=lambda p: p.runner.frames)
        return self.players[number].frame.pose_from(longest.frame, longest.runner.poses_of(name))

    def waits(self) -> list[list[Wait]]:
        """When each character gave way, and to whom."""
        return [m.waits for m in self.players]

    # --- who sees what

    def _introduce(self, player: Player) -> None:
        """Have a player see the others, and what they move."""
        scene, own = player.runner.scene, player.frame
        self._things[player.order] = []
        for other in self.players:
            if other is player:
                continue
            body = OtherBody(*self._seen(other, player))
            self._bodies[player.order, other.order] = body
            scene.others.append(body)
            for name, prop in other.runner.props.items():
                known = {thing.prop.name for _, thing in self._things[player.order]}
                if name not in player.runner.props and name not in known:
                    thing = OtherProp(prop, other.frame, own)
                    self._things[player.order].append((other, thing))
                    scene.others.append(thing)

    def _seen(self, other: Player, viewer: Player) -> tuple[Array, Array, Array, bool]:
        centres, radii = other.spheres()
        root = other.runner.state.root[0].astype(np.float64)
        pose = np.array((*viewer.frame.to_own(other.place), 0.0, root[2]))
        return viewer.frame.to_own(centres), radii / viewer.frame.scale, pose, other.settled

    def _show(self) -> None:
        for (viewer, other), body in self._bodies.items():
            if not self.players[viewer].done:
                body.show(*self._seen(self.players[other], self.players[viewer]))
        for things in self._things.values():
            for owner, thing in things:
                thing.held = any(g.prop is thing.prop for g in owner.runner.director.grasps)

    def _share(self) -> None:
        """Have a thing that one has moved in this frame be there for all who know it."""
        for player in self.players:
            for name, prop in player.runner.props.items():
                before = self._poses[player.order][name]
                if np.abs(prop.pose - before).max() > 1e-9:
                    for other in self.players:
                        if other is not player and not other.done and name in other.runner.props:
                            pose = other.frame.pose_from(player.frame, prop.pose)
                            other.runner.move_prop(name, pose)
                            # A copy: who moves it next moves the pose of its own prop in place.
                            self._poses[other.order][name] = pose.copy()
                    self._poses[player.order][name] = prop.pose.copy()

    # --- the whole takes

    def _mend(self) -> bool:
        """Go on solving; False when all takes are solved, and no pair is deeper in each other than may be."""
        if not self._queue:
            return self._again()
        player = self._queue[0]
        runner = player.runner
        if not runner.mending:
            runner.others = self._obstacles(player)
        if not runner.mend():
            self._queue.pop(0)
        return bool(self._queue) or self._again()

    def _again(self) -> bool:
        """Queue those who are too deep in each other, the later of each pair first; False where none is."""
        tracks = [self._track(m, self.players[0]) for m in self.players]
        again: list[Player] = []
        self.depths = {}
        for i, one in enumerate(self.players):
            for j in range(i + 1, len(self.players)):
                deep = (
                    float(depths_between(tracks[i], tracks[j]).max(initial=0.0)) * self.players[0].frame.scale
                )
                self.depths[one.name, self.players[j].name] = deep
                solved = one.runner.request.contact_ik
                if deep > DEEP and solved:
                    again += [m for m in (self.players[j], one) if m not in again]
        if not again or self._rounds >= ROUNDS:
            return False
        self._rounds += 1
        for player in again:
            player.runner.mend_anew()
        self._queue = again
        return True

    def _obstacles(self, player: Player) -> list[Obstacle]:
        """What others are and move during the take of one, as far as they are solved."""
        solved = [m for m in self.players if m is not player and (m not in self._queue or self._rounds)]
        out: list[Obstacle] = [self._track(m, player) for m in solved]
        for owner, thing in self._things[player.order]:
            poses = player.frame.pose_from(owner.frame, owner.runner.poses_of(thing.prop.name))
            rows = np.minimum(np.arange(player.runner.frames), len(poses) - 1)
            out.append(Obstacle(in_world(thing.prop.query, owner.frame, player.frame), poses[rows]))
        return out

    def _track(self, other: Player, viewer: Player) -> BodyTrack:
        hips, local = other.runner.motion()
        return track_of(hips, local, other.runner.request.figure, other.frame, viewer.frame)


class _Named:
    """A player's take whose errors name the character and the goal."""

    def __init__(self, player: Player) -> None:
        self._member, self._runner = player, player.runner
        self.model, self.memory = player.runner.model, player.runner.memory

    def sense(self) -> Inputs[Array] | None:
        with self._named():
            return self._runner.sense()

    def follow(self, outputs: Array, memory: Memory, info: Info, network_ms: float) -> None:
        with self._named():
            self._runner.follow(outputs, memory, info, network_ms)

    def mend(self) -> bool:
        return False  # all are solved when all are over

    def _named(self) -> _told:
        director = self._runner.director
        return _told(f"{self._member.name}, {director.goals[max(director.index, 0)].name}")


class _told:
    """Prefix a GoalError with whose it is."""

    def __init__(self, whose: str) -> None:
        self.whose = whose

    def __enter__(self) -> None:
        pass

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        if isinstance(error, GoalError):
            raise GoalError(f"{self.whose}: {error}") from error


__all__ = ["Cast", "GroupRunner"]
