"""Turn the queue of goals into the goal series the network is fed with (section 4.1), frame by frame.

Each goal is performed by a stage (``actions``) that says what is commanded now; the director hears the goals
one after the
other, lays the commands on the keys of the series, and judges.  Whatever changes is only a change of the
series.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nsm_core.conventions import FPS, GOAL_ACTIONS, INTERACTIONS
from nsm_core.distances import SEAT_MEMORY
from nsm_core.errors import GoalError
from nsm_core.model.features.state import FUTURE, KEY_OFFSETS, KEY_STEP, PIVOT, WINDOW
from nsm_core.rotations import Array, wrap_angle
from nsm_core.signals import smooth_step
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.props import Prop
from nsm_core.world.scene.solids import Scene
from nsm_core.world.sensors.interaction import InteractionVolume

from .actions.approach import Command, Ground
from .actions.base import Grasp, Stage
from .actions.registry import begin, check_reachable, standing_places
from .goals import Goal, GoalResult, Moment
from .start import Trail

SETTLE = 12  # frames of rest after which a transition has ended
# metres of its way that one has come nearer to a goal: it is given up where so much is not gained in time
STEP_ON = 0.25
# frames in which an interrupted goal gives way to the new one: switched in one, the network's pose would jump
TURNING = 8


class Director:
    """Leads one character through its goals; one call a frame.

    ``grasps`` are the hands at work on props: whoever makes the poses calls ``apply`` of each once a frame.
    """

    def __init__(
        self,
        goals: list[Goal],
        plan: FloorPlan | None,
        root: Array,
        rng: np.random.Generator,
        time_limit: float,
        scene: Scene | None = None,
        ik: bool = True,
    ) -> None:
        """``scene`` is what boxes may rest on and leaves may meet; ``ik`` False leaves the body as the
        network has it.

        A goal may take as long as its way needs; it is given up after ``time_limit`` seconds without
        progress.
        """
        self.goals, self.plan, self.rng, self.time_limit = goals, plan, rng, time_limit
        self.results = [GoalResult(g.name, g.action) for g in goals]
        self.index = -1
        self.done = False
        self.way = 0.0  # metres that the present goal's way had at first
        self.grasps: list[Grasp] = []
        self.stage: Stage | None = None
        self._scene, self._ik = scene or Scene(Cuboids()), ik
        self._ground = Ground(plan, rng, self._scene)
        self._command: Command | None = None
        self._thing: Prop | InteractionVolume | None = None
        self._frame, self._started, self._rest, self._hold = 0, 0, 0, -1
        self._part, self._since, self._left = (
            0,
            0,
            np.inf,
        )  # the stage's part; when and where on its way the last progress was made
        self._given: tuple[Array, Array, Array] | None = None
        self._given_up: tuple[Array, Array, Array] | None = (
            None  # what was commanded when the present goals broke in
        )
        self._turned = 1.0  # 0..1, how far that has given way
        here = np.append(root[:2], 0.0)
        self._past_position = np.repeat(here[None].astype(np.float32), WINDOW + 1, axis=0)
        self._past_heading = np.full(WINDOW + 1, root[2], np.float32)
        self._past_action = np.repeat(_hot("idle")[None], WINDOW + 1, axis=0)
        # Frames of standing before the first goal is heard.
        self._wait = int(rng.integers(4, 16)) + round(goals[0].wait * FPS if goals else 0)
        # Where others are about: whether a goal may begin now, and what is commanded while one gives way.
        self.gate: Callable[[Goal], bool] | None = None
        self.giving_way: Command | None = None
        self._resumes = False

    def go_on(self, trail: Trail, seat: Goal | None, moment: Moment) -> None:
        """Go on from what the character did before the take; ``seat`` is what it sits on now."""
        self._past_position, self._past_heading = trail.goal_position, trail.goal_heading
        self._past_action = trail.goal_action
        if trail.moving and not self.goals[0].wait:
            self._wait = 0
        if seat is not None:
            self.stage = begin(seat, self._ground, moment, self.grasps, self._scene, self._ik)
            self._command = self.stage.update(moment)

    def update(self, moment: Moment) -> tuple[Array, Array, Array, InteractionVolume | None]:
        """Return goal positions (13, 3), headings (13,) and actions (13, 6) for the next step, and the sensed
        object.
        """
        self.grasps = [g for g in self.grasps if g.active]
        if self.index < 0:
            if self._frame >= self._wait:
                self._begin(0, moment)
        elif not self.done:
            self._judge(moment)
            if not self.done:
                self._perform(moment)
        self._frame += 1
        position, heading, action = self._turn(*self._ahead(moment))
        self._past_position = np.concatenate((self._past_position[1:], position[:1]))
        self._past_heading = np.append(self._past_heading[1:], heading[0]).astype(np.float32)
        self._past_action = np.concatenate((self._past_action[1:], action[:1]))
        past = slice(0, WINDOW, KEY_STEP)
        keys = (
            np.concatenate((self._past_position[past], position)),
            np.concatenate((self._past_heading[past], heading)),
            np.concatenate((self._past_action[past], action)),
        )
        return *keys, self._sense(moment)

    def interrupt(self, goals: list[Goal], plan: FloorPlan | None = None) -> None:
        """Give up the goal in hand and all that follow, and go on with ``goals`` from the next frame on;
        ``plan`` replaces the floor.
        """
        if plan is not None:
            self.plan = plan
            self._ground = Ground(plan, self.rng, self._scene)
        now = self.index + 1
        self._break_off()
        self.goals = self.goals[:now] + goals
        self.results = self.results[:now] + [GoalResult(g.name, g.action) for g in goals]
        self.done = False
        self._given_up, self._turned = self._given, 0.0
        if self.index >= 0:
            self._hold = 1

    def stop(self) -> None:
        """Give up the goal in hand and all that follow, and end here."""
        self._break_off()
        now = self.index + 1
        self.goals, self.results, self.done = self.goals[:now], self.results[:now], True

    def _break_off(self) -> None:
        """Note how far the goal in hand has come, unless it has been judged."""
        if 0 <= self.index and self._hold < 0 and not self.done:
            result, stage = self.results[self.index], self.stage
            result.seconds, result.end_frame = (self._frame - self._started) / FPS, self._frame
            if stage is not None and stage.endless:
                result.reached, result.remarks = True, stage.line()[1]
            else:
                result.reason = f"It was broken off after {result.seconds:.1f} s."

    @property
    def ground(self) -> Ground:
        """The floor as it is planned on, with what stands about on it."""
        return self._ground

    @property
    def command(self) -> Command | None:
        """What is commanded now."""
        return self._command

    @property
    def holding(self) -> bool:
        """Whether the present goal has been judged, and is held or gives way to the next one."""
        return self._hold >= 0

    @property
    def resuming(self) -> bool:
        """Whether it goes on from the next frame on, and what is commanded is still how it gave way."""
        return self._resumes

    def resume(self) -> None:
        """Do what the goal asks for again from the next frame on, by a way that is looked for anew."""
        self.giving_way, self._resumes = None, True

    def give_up(self, error: GoalError) -> None:
        """Give the present goal up for a reason that the stage does not know."""
        self.giving_way = None
        self._give_up(error)

    def _sense(self, moment: Moment) -> InteractionVolume | None:
        """What is commanded is sensed, and after that until its label has faded; props where they are now."""
        if self._command is not None and self._command.thing is not None:
            self._thing = self._command.thing
        elif float(moment.style[INTERACTIONS].max()) <= SEAT_MEMORY:
            self._thing = None
        return self._thing.sensed() if isinstance(self._thing, Prop) else self._thing

    # --- goals one after the other
    # -----------------------------------------------------------------------------

    def _begin(self, index: int, moment: Moment) -> None:
        following = self.goals[index] if index < len(self.goals) else None
        if following is not None and self.gate is not None and not self.gate(following):
            self._hold = 1 if self.index >= 0 else -1
            return
        if self.stage is not None and self.index >= 0:
            result = self.results[self.index]
            left = self.stage.goal
            again = following is not None and (
                following.prop is not None
                and following.prop is left.prop
                or following.both is not None
                and following.both is left.both
            )
            self.stage.end(result.reached, again)
        if following is None:
            self.done = True
            return
        self.index, self._started, self._rest, self._hold = index, self._frame, 0, -1
        self._part, self._since, self._left = 0, self._frame, np.inf
        self.results[index].start_frame = self._frame
        before, self.stage = self.stage, None
        self._ground.pace = following.pace
        try:
            self.stage = begin(following, self._ground, moment, self.grasps, self._scene, self._ik, before)
            onward = self._onward(index)
            if onward is not None:
                self.stage.pass_on(onward)
        except GoalError as error:
            self._give_up(error)
        self._perform(moment)
        self.way = self.way_left(moment.root[:2])

    def _onward(self, index: int) -> Array | None:
        """Where (2,) the goal after this one leads first; None where one is to come to rest before it."""
        goal, following = self.goals[index], self.goals[index + 1 : index + 2]
        if not following or self.gate is not None or self.plan is None or goal.by is not None:
            return None
        if goal.hold + following[0].wait > 0 or (goal.prop is not None and goal.prop is following[0].prop):
            return None
        here = np.asarray(goal.position[:2], dtype=np.float64)
        try:
            places = standing_places(following[0], here, self.plan, {}, self._scene.environment)
        except GoalError:
            return None
        return places[0] if places else None

    def _perform(self, moment: Moment) -> None:
        """Let the stage command, and put the hands to work that it wants."""
        if self.stage is None:
            return
        if self.giving_way is not None:
            self._command, self._since = self.giving_way, self._frame
            return
        try:
            if self._resumes:
                self._take_up(moment)
            self._command = self.stage.update(moment)
        except GoalError as error:
            self._give_up(error)
            return
        for grasp in (getattr(self.stage, name, None) for name in ("grasp", "other")):
            if grasp is not None and grasp.active and grasp not in self.grasps:
                for other in self.grasps:
                    if other.prop is grasp.prop:
                        other.give_way()
                self.grasps.append(grasp)

    def _take_up(self, moment: Moment) -> None:
        """Go on with a goal after giving way: by another way, and with a thing as others have left it."""
        self._resumes, goal = False, self.goals[self.index]
        hands = [g for g in self.grasps if g.prop is not None and g.prop is goal.prop]
        if goal.prop is not None and all(getattr(g, "state", "") == "reach" for g in hands):
            if self.stage is not None:
                self.stage.end(False)  # hands that have not taken it reach for it anew
            self.stage = begin(goal, self._ground, moment, self.grasps, self._scene, self._ik)
        approach = getattr(self.stage, "approach", None)
        if approach is not None:
            approach.anew()

    def _give_up(self, error: GoalError) -> None:
        """Report the present goal as one that cannot be reached; the error itself where nothing has been
        performed yet.
        """
        if self.index == 0 and self._frame == self._started:
            raise error
        if self._hold >= 0:  # judged before; what was commanded goes on
            return
        result = self.results[self.index]
        result.reason, self._hold = str(error), 1
        result.seconds, result.end_frame = (self._frame - self._started) / FPS, self._frame

    def _judge(self, moment: Moment) -> None:
        """See whether the transition has ended, hold, and go on to the next goal."""
        result, stage = self.results[self.index], self.stage
        if self._hold >= 0:
            self._hold -= 1
            if self._hold <= 0:
                self._begin(self.index + 1, moment)
            return
        assert stage is not None
        if stage.part != self._part:
            self._part, self._since, self._left = stage.part, self._frame, np.inf
        left = self.way_left(moment.root[:2])
        if left < self._left - STEP_ON:
            self._since, self._left = self._frame, left
        there = stage.passed(moment) if stage.passing else stage.arrived(moment)
        self._rest = self._rest + 1 if there else 0
        settled = self._rest >= (1 if stage.passing else SETTLE)
        late = not stage.endless and (self._frame - self._since) / FPS > self.time_limit
        if settled or late:
            result.reached = settled
            result.seconds, result.end_frame = (self._frame - self._started) / FPS, self._frame
            following = self.goals[self.index + 1 : self.index + 2]
            stay = self.goals[self.index].hold + sum(goal.wait for goal in following)
            self._hold = max(1, round(stay * FPS)) if result.reached else 1
            result.remarks = stage.line()[1]
            for name, value in stage.errors.items():
                setattr(result, name, value)

    def way_left(self, here: Array) -> float:
        """Metres from ``here`` (2,) to where the present command leads."""
        command = self._command
        if command is None:
            return 0.0
        if command.course is not None:
            return command.course.length - command.course.progress
        return float(np.linalg.norm(np.asarray(command.position)[:2] - here))

    # --- the series
    # --------------------------------------------------------------------------------------------

    def _ahead(self, moment: Moment) -> tuple[Array, Array, Array]:
        """Goals (7, ...) of the pivot and the keys ahead."""
        n, command = FUTURE + 1, self._command
        if command is None:
            return (
                np.repeat(self._past_position[-1:], n, 0),
                np.repeat(self._past_heading[-1:], n),
                np.repeat(self._past_action[-1:], n, 0),
            )
        if command.course is not None:
            command.course.advance(moment.root[:2].astype(np.float64))
            speed = max(moment.speed, 0.3)
            position, heading, pace = command.course.preview(
                speed, tuple(int(f) + FPS for f in KEY_OFFSETS[PIVOT:])
            )
            action = np.where((pace > 0.3)[:, None], _hot(command.action), _hot(command.resting))
            return (
                np.pad(position, ((0, 0), (0, 1))).astype(np.float32),
                heading.astype(np.float32),
                action.astype(np.float32),
            )
        return (
            np.repeat(np.asarray(command.position, dtype=np.float32)[None], n, axis=0),
            np.full(n, command.heading, np.float32),
            np.repeat(_hot(command.action)[None], n, axis=0),
        )

    def _turn(self, position: Array, heading: Array, action: Array) -> tuple[Array, Array, Array]:
        """Fade the goals ahead over from the ones that were interrupted."""
        if self._given_up is not None:
            self._turned += 1 / TURNING
            share = np.float32(smooth_step(np.float64(self._turned)))
            before = self._given_up
            position = before[0] + share * (position - before[0])
            heading = (before[1] + share * wrap_angle(heading - before[1])).astype(np.float32)
            action = before[2] + share * (action - before[2])
            self._given_up = None if self._turned >= 1 else before
        self._given = position, heading, action
        return position, heading, action


def rotation_error(heading: float, goal: float) -> float:
    """Degrees between two headings."""
    return float(np.degrees(abs(wrap_angle(heading - goal))))


def _hot(action: str) -> Array:
    """The goal action, or several joined by plus signs, as (6,) ones and zeros."""
    return np.isin(GOAL_ACTIONS, action.split("+")).astype(np.float32)


__all__ = ["Director", "check_reachable", "rotation_error"]
