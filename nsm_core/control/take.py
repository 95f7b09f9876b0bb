"""One take: a character performs a queue of goals in a scene, one network step a frame.

Per frame: direct (goals), sense, feed, predict, read and blend; a take that is complete is solved as a whole
(``post_process``): feet planted, hips seated, hands on what they hold, the body out of solids.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from nsm_core.body.animated_body import obstacle_of
from nsm_core.body.ik.clearance import Obstacle
from nsm_core.body.skeleton import ARMS, HIPS
from nsm_core.conventions import CONTACTS, FOOT_CONTACTS, FPS, HAND_CONTACTS
from nsm_core.errors import GoalError
from nsm_core.model.features.codec import SensorReading, build_inputs, no_object, read_outputs
from nsm_core.model.features.layout import Inputs
from nsm_core.model.features.rollout_step import advance
from nsm_core.model.inference.model import Model
from nsm_core.model.networks.config import Memory
from nsm_core.model.networks.protocol import Info
from nsm_core.rotations import Array, wrap_angle
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.props import LightThing
from nsm_core.world.scene.solids import Scene
from nsm_core.world.scene.terrain import merged
from nsm_core.world.sensors.environment import DIAMETER, SPHERE_RADIUS, environment_sensor

from .actions.registry import check_reachable
from .batch import step_together
from .director import Director
from .goal_things import ground_of, own_props, places_of, with_props
from .goals import Goal, GoalResult, Moment
from .insight import Insight, doing_of
from .judging import judge_kept, judge_reached
from .posing import pose_of, stance_of, standing_start
from .post_process import PostProcess
from .relief import Relief
from .request import TakeRequest, TakeResult
from .scheduling import scheduled
from .standing import kept_at, kept_off
from .start import trail_of
from .yielding import Yielding

STAGES = ("goals", "sensors", "network", "blending", "ik")
_MARGIN = 4.0  # metres of floor planned on around start and goals
_SENSOR_REACH = DIAMETER / 2 + SPHERE_RADIUS
_WRISTS = [arm[2] for arm in ARMS]


class TakeRunner:
    """Steps one take frame by frame, so that a caller can show it grow, or stop it, at any frame."""

    def __init__(self, model: Model, request: TakeRequest) -> None:
        """Prepare a take; GoalError where there is nothing to do or a goal cannot be reached."""
        if not request.goals:
            raise GoalError("There is no goal; add an object and an action to the list.")
        self.model, self.request = model, request
        rng = np.random.default_rng(request.seed)
        root = np.array(
            [*np.asarray(request.start_position, dtype=np.float64)[:2], request.start_heading],
            dtype=np.float32,
        )
        if not np.isfinite(root).all():
            raise GoalError(
                "The character's place or heading is not a number; clear its transform and place it anew."
            )
        self.relief = Relief(request.ground, root[:2], request.stairs)
        self.state = standing_start(model, root, rng)
        trail = None
        if request.start is not None:
            trail = trail_of(request.start, stance_of(model)[1], self.relief.level)
            self.state, root = trail.state, trail.state.root[0]
        goals, self.props = own_props([goal.fitting(request.figure) for goal in request.goals])
        self.scene = Scene(request.environment, self.props.values())
        self.scene.others += request.movers
        self._yielding = Yielding(request.movers) if request.movers else None
        places = np.concatenate((root[None, :2], *places_of(goals, self.props.values())))
        bounds = places.min(0) - _MARGIN, places.max(0) + _MARGIN
        self.plan = FloorPlan(request.environment, bounds, stairs=request.stairs)
        self._asked = list(range(len(goals)))
        if not request.in_order and not request.movers:
            schedule = scheduled(goals, self.plan, root, request.environment)
            goals, self._asked = schedule.goals, schedule.asked
        check_reachable(goals, self.plan, root[:2], request.environment)
        self.director = Director(
            goals, self.plan, root, rng, request.time_limit, self.scene, request.contact_ik
        )
        climbed = ground_of(goals, request.environment, request.stairs)
        self.terrain = merged((request.ground, climbed, request.stairs.terrain))
        self._post = PostProcess(
            request.environment, self.terrain, request.ground, request.figure, request.start
        )
        self.spent_ms = dict.fromkeys(STAGES, 0.0)  # so far, by the clock
        self.clock: Callable[[], float] = time.perf_counter  # which is another one where speed is measured
        self._frames: list[tuple[Array, ...]] = []
        self._poses: dict[str, list[Array]] = {name: [] for name in self.props}
        self._insights: dict[int, Insight] = {}
        self.others: list[Obstacle] = []  # who else moves, and what they move, as the take is solved
        self._mending: Any = None
        self._mended = 0  # frames that are as they stay
        self._reached: dict[int, int] = {}  # frames in which goals were judged, by their number
        contact = np.zeros(len(CONTACTS), np.float32)
        contact[FOOT_CONTACTS] = 1
        if trail is not None and request.start is not None:
            contact = trail.contacts
            self.director.go_on(trail, request.start.seat, self._moment(contact))
        self.memory = model.start()
        self._keep(contact, np.zeros(model.config.info_sizes.get("experts", 0), np.float32))

    @property
    def frames(self) -> int:
        """Frames finished so far."""
        return len(self._frames)

    @property
    def progress(self) -> float:
        """Estimate of the share that is done, 0..1: goals finished, and the present one by its time."""
        d, count = self.director, len(self.request.goals)
        if d.done:
            return 1.0
        within = 0.0
        if d.index >= 0:
            spent = (self.frames - d.results[d.index].start_frame) / FPS
            within = min(0.95, spent / (5.0 + d.way + d.goals[d.index].hold))  # a metre takes about a second
        return min(0.99, (max(d.index, 0) + within) / count)

    def pose(self) -> tuple[Array, Array]:
        """Newest pose: hips position (3,) and local rotations (23, 4), as it will be keyed."""
        return self._frames[-1][0], self._frames[-1][1]

    def prop_poses(self) -> dict[str, Array]:
        """Newest pose (4,) of every prop by name: x, y, z (metres) and heading (radians) of its frame."""
        return {name: prop.pose.copy() for name, prop in self.props.items()}

    def step(self) -> bool:
        """Make one frame; False when the take is over (no frame was made then).

        Once the last frame is made, the whole take is solved, a little at a call.
        """
        return step_together((self,))[0]

    def sense(self) -> Inputs[Array] | None:
        """Direct and sense: what the network is given of the next frame (1, ...); None when all goals are
        done.
        """
        if self.director.done:
            return None
        self._mending = None
        state = self.state
        t0 = self.clock()
        moment = self._moment(self._frames[-1][4])
        if self._yielding is not None:
            self._yielding.update(self.director, moment, self.frames)
        position, heading, action, sensed = self.director.update(moment)
        if judge_reached(self.director, self._frames[-1][2], float(state.root[0, 2])):
            self._reached[self.director.index] = self.frames - 1
        relief = self.relief
        state.goal_position, state.goal_heading, state.goal_action = (
            relief.goals(position)[None],
            heading[None],
            action[None],
        )
        t1 = self.clock()
        root = state.root
        # A light thing in a hand is nothing that one steps aside for.
        held = [g.prop for g in self.director.grasps if g.bears and isinstance(g.prop, LightThing)]
        around = self.scene.near(root[0, :2], _SENSOR_REACH, *held)
        environment = environment_sensor(relief.seen(around), root[0, :2], float(root[0, 2]))
        cells, occupancy = no_object(root)
        if sensed is not None:
            cells, occupancy = relief.sensed(sensed).cells_world()[None], sensed.occupancy[None]
        t2 = self.clock()
        self._insights[self.frames] = Insight.of(
            root[0], relief.level, environment, sensed, position, doing_of(self.director.grasps)
        )
        inputs = build_inputs(state, SensorReading(environment[None], cells, occupancy))
        self._spend(goals=t1 - t0, sensors=t2 - t1, blending=self.clock() - t2)
        return inputs

    def follow(self, outputs: Array, memory: Memory, info: Info, network_ms: float) -> None:
        """Make the frame of what the network gave for ``sense`` (``Model.step``, a batch of one) in
        ``network_ms`` milliseconds.
        """
        t0 = self.clock()
        self.memory = memory
        predicted = read_outputs(outputs, self.state)
        self._insights[self.frames] = self._insights[self.frames].foreseeing(predicted)
        self.state = advance(self.state, predicted, self.request.blending)
        stage = self.director.stage
        if stage is not None and (place := stage.stays_at()) is not None:
            self.state = kept_at(self.state, *place)
        elif stage is not None and (way := stage.keeps_off()) is not None:
            self.state = kept_off(self.state, *way)
        self.relief.follow(self.state.root[0, :2])
        t1 = self.clock()
        self._keep(predicted.contact[0], info["experts"][0] if "experts" in info else np.zeros(0, np.float32))
        self._spend(network=network_ms / 1000, blending=t1 - t0, ik=self.clock() - t1)
        if not np.isfinite(self.state.joint_position).all():
            raise GoalError("The motion broke down; use another seed or another start, and report the scene.")

    def _spend(self, **seconds: float) -> None:
        for stage, spent in seconds.items():
            self.spent_ms[stage] += 1000 * spent

    def mend(self) -> bool:
        """Go on solving the whole take; False when that is done.

        A take without contact IK stays as it is.
        """
        if self._mended == self.frames:
            return False
        if not self.request.contact_ik:
            self._mended = self.frames
            self._measure_kept()
            return False
        if self._mending is None:
            props = [(prop, np.stack(self._poses[name])) for name, prop in self.props.items()]
            moving = [obstacle_of(mover, self.frames) for mover in self.request.movers]
            self._mending = self._post.solve(props, [*self.others, *moving])
        start = self.clock()
        try:
            next(self._mending)
            return True
        except StopIteration as done:
            hips, local = done.value
        finally:
            self._spend(ik=self.clock() - start)
        for t, frame in enumerate(self._frames):
            self._frames[t] = (hips[t].astype(frame[0].dtype), local[t].astype(frame[1].dtype), *frame[2:])
        self._mended = self.frames
        for taken in [r.taken for r in self.director.results]:
            if taken is not None and 0 <= taken.frame < self.frames:
                taken.beside = self._post.beside[taken.frame, taken.hands]
        self._measure_kept()
        return False

    @property
    def mending(self) -> bool:
        """Whether the whole take is being solved."""
        return self._mending is not None

    def motion(self) -> tuple[Array, Array]:
        """Hips (T, 3) and local rotations (T, 23, 4) of all frames so far, as they will be keyed."""
        return np.stack([f[0] for f in self._frames]), np.stack([f[1] for f in self._frames])

    def poses_of(self, name: str) -> Array:
        """Poses (T, 4) so far of a prop of the goals, by its name."""
        return np.stack(self._poses[name])

    def move_prop(self, name: str, pose: Array) -> None:
        """Have a prop be where another character has moved it to in the newest frame: ``pose`` (4,)."""
        self.props[name].pose = pose
        self._poses[name][-1] = pose.copy()

    def mend_anew(self) -> None:
        """Have the whole take solved once more, among ``others`` as they are by then."""
        self._mending, self._mended = None, 0

    def interrupt(self, goals: list[Goal]) -> None:
        """Drop the goal in hand and those that wait, and do ``goals`` from the next frame on.

        A prop that bears the name of one in the take is that one, where it is now.  Raises GoalError, and
        changes nothing, where there is no goal or one cannot be reached from here.
        """
        if not goals:
            raise GoalError("There is no goal to go on with; give at least one.")
        goals, props = own_props([goal.fitting(self.request.figure) for goal in goals])
        known = {name: self.props.get(name, prop) for name, prop in props.items()}
        goals = [with_props(goal, known) for goal in goals]
        here = self.state.root[0, :2].astype(np.float64)
        places = np.concatenate((here[None], *places_of(goals, known.values())))
        low, high = places.min(0) - _MARGIN / 2, places.max(0) + _MARGIN / 2
        plan = self.plan
        if (low < plan.bounds[0]).any() or (high > plan.bounds[1]).any():
            bounds = np.minimum(low, plan.bounds[0]), np.maximum(high, plan.bounds[1])
            plan = FloorPlan(self.request.environment, bounds, stairs=self.request.stairs)
        check_reachable(goals, plan, here, self.request.environment)
        for name, prop in known.items():
            if name not in self.props:
                self.props[name] = prop
                self.scene.props.append(prop)
                self._poses[name] = [prop.pose.copy()] * self.frames
        self.plan = plan
        self._asked = []  # what was broken off stays where it was performed
        self.director.interrupt(goals, plan)
        # The feet know this very ground.
        self.terrain.add(ground_of(goals, self.request.environment, self.request.stairs))

    @property
    def results(self) -> list[GoalResult]:
        """What became of the goals, in the order in which they were asked for."""
        found = self.director.results
        order = [*self._asked, *range(len(self._asked), len(found))]
        return [one for _, one in sorted(zip(order, found, strict=False), key=lambda pair: pair[0])]

    def result(self) -> TakeResult:
        """Everything made so far, solved."""
        while self.mend():
            pass
        columns = [np.stack(c) for c in zip(*self._frames, strict=True)]
        hips, rotations, network_hips, network_rotations, contacts, root, style, experts = columns
        steps = max(self.frames - 1, 1)
        return TakeResult(
            hips,
            rotations,
            network_hips,
            network_rotations,
            contacts,
            root,
            style,
            experts,
            self.results,
            {k: v / steps for k, v in self.spent_ms.items()},
            {name: np.stack(poses) for name, poses in self._poses.items()},
            self._insights,
        )

    def _moment(self, contacts: Array) -> Moment:
        s = self.state
        change = (s.root_past[0, -1] - s.root_past[0, -7]).astype(np.float64)
        speed, turning = np.linalg.norm(change[:2]) * FPS / 6, np.abs(wrap_angle(change[2])) * FPS / 6
        up = np.array((0, 0, self.relief.level), dtype=np.float32)
        wrists = (s.joint_position[0, _WRISTS] + up).astype(np.float64)
        hips, heading, style = s.joint_position[0, HIPS] + up, float(s.root[0, 2]), s.style_past[0, -1]
        return Moment(s.root[0], hips, heading, float(speed), style, wrists, contacts, float(turning))

    def _keep(self, contact: Array, experts: Array) -> None:
        """Turn the state into a pose, correct its contacts and store both."""
        s, d, level = self.state, self.director, self.relief.level
        hips, rotations = pose_of(s)
        hips = hips + np.array((0, 0, level), dtype=hips.dtype)
        seat, manner = (None, None) if d.stage is None else (d.stage.seat(), d.stage.manner)
        self._post.note(hips, rotations, self._moment(contact), seat, d.grasps, self.relief.low, manner)
        for grasp in d.grasps:
            taken = grasp.errors.get("taken")
            if taken is not None and taken.frame < 0:
                taken.frame = len(self._frames)
        contact = contact.copy()
        for lead in self._post.notes[-1].leads:
            if lead.closed:  # which the network knows nothing of
                contact[HAND_CONTACTS[lead.hand]] = 1
        for name, pose in self.prop_poses().items():
            self._poses[name].append(pose)
        self._frames.append(
            (
                hips,
                rotations,
                hips,
                rotations,
                contact,
                s.root[0].copy(),
                s.style_past[0, -1].copy(),
                experts,
            )
        )

    def _measure_kept(self) -> None:
        judge_kept(self.director, self._reached, *self.motion(), self._poses, self.request.figure)


def roll(
    model: Model, asked: TakeRequest, each: Callable[[TakeRunner], None] | None = None, limit: float = 300.0
) -> TakeResult:
    """Roll a take out to its end, at most ``limit`` seconds; ``each`` is called with the runner after every
    frame.
    """
    runner = TakeRunner(model, asked)
    while runner.frames < limit * FPS and runner.step():
        if each is not None:
            each(runner)
    return runner.result()


__all__ = ["STAGES", "TakeRequest", "TakeResult", "TakeRunner", "roll"]
