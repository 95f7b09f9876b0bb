"""A scripted character for the tests of carrying and opening: it does what the goal series says, as a network
would.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import ANKLE_HEIGHT, ARMS, FEET, INDEX, J, forward_kinematics
from nsm_core.control.actions.hold import SeenBody
from nsm_core.control.director import Director
from nsm_core.control.goal_things import own_props
from nsm_core.control.goals import Goal, Moment
from nsm_core.control.post_process import PostProcess
from nsm_core.conventions import CARRY, FOOT_CONTACTS, GOAL_ACTIONS, HAND_CONTACTS, IDLE, OPEN, STYLES, WALK
from nsm_core.rotations import heading_quat, quat_from_rotvec, rotate_planar, wrap_angle
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene.solids import Scene
from nsm_core.world.scene.terrain import Terrain

ROOM = (np.array((-4.0, -7.0)), np.array((5.0, 3.0)))
LEGS = (FEET[0][:3], FEET[1][:3])
HANGING = np.array(((-0.24, -0.05, 0.78), (0.24, -0.05, 0.78)))


class Actor:
    """Walks at 1.2 m/s to where the series leads, reaches for what is commanded, holds it, and lets go when
    it is there.  As in a take its frames are noted while it acts; ``kept`` solves them when it is over.

    ``error`` (3,) metres by which its hands miss, ``skew`` radians by which the axis of its hands is turned,
    ``grips`` False for hands that never come near.
    """

    def __init__(
        self,
        goals: list[Goal],
        solids=None,
        root=(0.0, 0.0, 0.0),
        error=(0.0, 0.0, 0.0),
        skew=0.0,
        grips=True,
        **options,
    ):
        self.solids = Cuboids() if solids is None else solids
        self.goals, self.props = own_props(goals)
        self.scene = Scene(self.solids, self.props.values())
        self.root = np.array(root, dtype=np.float64)
        plan, rng = FloorPlan(self.solids, ROOM), np.random.default_rng(options.pop("seed", 0))
        self.ik = options.pop("ik", True)
        limit = options.pop("time_limit", 20.0)
        self.director = Director(
            self.goals, plan, self.root.astype(np.float32), rng, limit, self.scene, self.ik
        )
        self.post = PostProcess(self.solids, Terrain(), Terrain())
        self.error, self.skew, self.grips = np.array(error), skew, grips
        self.wrists, self.labels, self.crouch = self._world(HANGING), np.zeros(2), 0.0
        self.style, self.speed, self.distance = np.zeros(len(STYLES)), 0.0, 0.0
        self.frames: list[dict] = []
        self._keep()

    def _world(self, points: np.ndarray) -> np.ndarray:
        return rotate_planar(np.asarray(points), self.root[2]) + np.append(self.root[:2], 0)

    def run(self, frames: int = 1500):
        while len(self.frames) < frames and self.step():
            pass
        return self

    def step(self) -> bool:
        if self.director.done:
            return False
        series = self.director.update(self.moment())
        self._walk(*series[:3])
        self._hands(*series[:3])
        self._keep(series)
        return True

    def moment(self) -> Moment:
        contacts = np.zeros(5, np.float32)
        contacts[FOOT_CONTACTS] = 1
        contacts[HAND_CONTACTS] = self.labels
        hips = np.append(self.root[:2], 0.9)
        return Moment(
            self.root.astype(np.float32),
            hips,
            float(self.root[2]),
            self.speed,
            self.style.copy(),
            self.wrists.copy(),
            contacts,
        )

    def _walk(self, position, heading, action) -> None:
        hot = {name for k, name in enumerate(GOAL_ACTIONS) if action[6, k] > 0.5}
        target, facing = position[6, :2].astype(float), float(heading[6])
        grasp = getattr(self.director.stage, "grasp", None)
        if hot == {"carry"}:
            target = target - grasp.prop.stand_off(grasp.facing) * np.array((np.sin(facing), -np.cos(facing)))
        elif hot == {"idle", "carry"} and position[6, 2] > 0:
            target = target - grasp.prop.stand_off(grasp.facing) * np.array((np.sin(facing), -np.cos(facing)))
        elif hot == {"open"}:
            target = grasp.way.reach
        way = target - self.root[:2]
        far = float(np.linalg.norm(way))
        step = min(0.25 * far, 1.2 / 30, self.speed / 30 + 0.05 / 30)
        self.root[:2] += way / max(far, 1e-9) * step
        self.root[2] += np.clip(wrap_angle(facing - self.root[2]), -0.08, 0.08)
        self.speed, self.distance = 30 * step, far
        for label, on in ((CARRY, "carry" in hot), (OPEN, "open" in hot)):
            self.style[label] = np.clip(self.style[label] + (0.1 if on else -0.1), 0, 1)
        self.style[WALK] = min(1.0, self.speed)
        self.style[IDLE] = 1 - self.style[WALK]

    def _hands(self, position, heading, action) -> None:
        hot = {name for k, name in enumerate(GOAL_ACTIONS) if action[6, k] > 0.5}
        wanted, touch = self._world(HANGING), np.zeros(2)
        grasp = getattr(self.director.stage, "grasp", None)
        if hot & {"carry", "open"} and grasp is not None and self.grips:
            if "carry" in hot:
                wanted, touch = self._carry(hot, position, grasp)
            else:
                wanted, touch = self._open(hot, grasp, wanted)
        change = wanted - self.wrists
        size = np.linalg.norm(change, axis=1, keepdims=True)
        self.wrists += change * np.minimum(
            1, np.minimum(0.25, (1.4 / 30 + self.speed / 30) / np.maximum(size, 1e-9))
        )
        self.labels = np.clip(self.labels + np.where(touch > 0.5, 0.25, -0.25), 0, 1)

    def _missed(self, places: np.ndarray) -> np.ndarray:
        middle = places.mean(0)
        return rotate_planar(places - middle, self.skew) + middle + self.error

    def _carry(self, hot, position, grasp):
        box = grasp.prop
        local = box.grasps(grasp.facing)
        if hot == {"carry"}:
            wanted = self._missed(grasp.grasps() + box.shown - box.raised)
            near = self.distance < 0.1
            return (wanted if near else self._world(HANGING)), np.linalg.norm(
                self.wrists - wanted, axis=1
            ) < 0.03
        held = np.array((0.0, -(box.stand_off(grasp.facing) + 0.05), 1.0))
        turned = rotate_planar(local - (0, 0, local[0, 2]), -grasp.facing)
        wanted = self._world(turned + held)
        touch = np.ones(2)
        if hot == {"idle", "carry"} and position[6, 2] > 0 and self.distance < 0.1:
            wanted = self._missed(box.to_world(local, grasp.goal))
            touch = (np.linalg.norm(self.wrists - wanted, axis=1) > 0.02).astype(float)
        return wanted, touch

    def _open(self, hot, grasp, hanging):
        hand, wanted, touch = grasp.way.hand, hanging.copy(), np.zeros(2)
        grip = grasp.grip() + self.error
        if hot == {"open"} and self.distance < 0.1:
            wanted[hand] = grip
            touch[hand] = np.linalg.norm(self.wrists[hand] - grip) < 0.03
        elif hot != {"open"} and grasp.state == "held":
            # Ahead of the leaf by what a hand that swings it is, as far as the arm reaches.
            leaf, shoulder = grasp.prop, SeenBody(*self.frames[-1]["network"], self.wrists).shoulders[hand]
            places = [
                leaf.grip(grasp.way.side, leaf.angle + lead) + self.error for lead in (0.2, 0.12, 0.06, 0.0)
            ]
            wanted[hand] = next((p for p in places if np.linalg.norm(p - shoulder) < 0.52), places[-1])
            touch[hand] = 1
        return wanted, touch

    def _keep(self, series=None) -> None:
        hips, local = self.pose()
        director = self.director
        seat = director.stage.seat() if director.stage is not None else None
        self.post.note(hips, local, self.moment(), seat, director.grasps, 0.0)
        for grasp in director.grasps:
            taken = grasp.errors.get("taken")
            if taken is not None and taken.frame < 0:
                taken.frame = len(self.frames)
        self.frames.append(
            {
                "network": (hips, local),
                "root": self.root.copy(),
                "wrists": self.wrists.copy(),
                "props": {name: prop.pose.copy() for name, prop in self.props.items()},
                "series": series,
                "state": [g.state for g in director.grasps],
                "contacts": self.moment().contacts,
                "index": director.index,
            }
        )

    def pose(self) -> tuple[np.ndarray, np.ndarray]:
        """The network's pose: a body over its feet that bends down as far as its hands are low."""
        low = float(np.clip((0.75 - self.wrists[:, 2].min()) / 0.65, 0, 1))
        self.crouch += np.clip(low - self.crouch, -0.05, 0.05)
        hips = self._world(np.array((0, 0.12 * self.crouch, 0.9 - 0.5 * self.crouch)))
        local = np.zeros((J, 4))
        local[:, 0] = 1
        local[0] = heading_quat(np.array(self.root[2]))
        local[INDEX["Chest"]] = quat_from_rotvec(np.array((0.95 * self.crouch, 0, 0)))
        for side, sign in (("Right", -1.0), ("Left", 1.0)):
            local[INDEX[f"{side}Shoulder"]] = quat_from_rotvec(np.array((0, sign * 1.35, 0)))
            local[INDEX[f"{side}Elbow"]] = quat_from_rotvec(np.array((0, 0, sign * -0.3)))
        feet = self._world(np.array(((-0.1, 0.03, ANKLE_HEIGHT), (0.1, 0.03, ANKLE_HEIGHT))))
        local = place_limbs(hips, local, LEGS, feet, np.repeat(local[:1], 2, 0))
        return hips, place_limbs(hips, local, ARMS, self.wrists)

    def track(self, name: str) -> np.ndarray:
        """Poses (T, 4) of a prop."""
        return np.array([f["props"][name] for f in self.frames])

    @cached_property
    def kept(self) -> tuple[np.ndarray, np.ndarray]:
        """Hips (T, 3) and local rotations (T, 23, 4) that are kept: ask when it is over."""
        hips, local = (np.array(c) for c in zip(*(f["network"] for f in self.frames), strict=True))
        return (
            solved(self.post, [(p, self.track(n)) for n, p in self.props.items()])
            if self.ik
            else (hips, local)
        )

    @cached_property
    def joints(self) -> np.ndarray:
        """Joints (T, 23, 3) as they are kept."""
        return forward_kinematics(*self.kept)[0]

    def hand_errors(self, goal: int) -> tuple[float, float]:
        """Centimetres and degrees by which the kept hands miss what they take, when they do."""
        taken = self.director.results[goal].taken
        wrists = self.joints[taken.frame, [arm[2] for arm in ARMS]]
        if self.ik:
            taken.beside = self.post.beside[taken.frame, taken.hands]
        return taken.errors(wrists, self.frames[taken.frame]["props"][self.goals[goal].prop.name])


def solved(post: PostProcess, props=()) -> tuple[np.ndarray, np.ndarray]:
    """Hips and local rotations of a take, solved to its end."""
    solving = post.solve(props)
    while True:
        try:
            next(solving)
        except StopIteration as done:
            return done.value


def drive(goals: list[Goal], **options) -> Actor:
    """Run a scripted character to the end of its goals."""
    return Actor(goals, **options).run()
