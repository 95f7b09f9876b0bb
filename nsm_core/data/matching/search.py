"""Walk a desired course with captured frames: motion matching over the library.

The course says where the root should be and face in the coming second; every few frames the library is
searched for the frame whose pose continues the current one and whose own future follows the course.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.contacts import TOES
from nsm_core.body.skeleton import HIPS, INDEX
from nsm_core.conventions import DT
from nsm_core.rotations import Array, rotate_planar, wrap_angle
from nsm_core.world.planning.path import Course

from .database import Library
from .draws import MATCHING

# Cost of a square metre by which a foot that stands in both pieces is off by more than LOOSE metres.
STANDS, LOOSE = 400.0, 0.05
HORIZON = (10, 20, 30)  # frames ahead at which the trajectories are compared
_POSE_JOINTS = tuple(INDEX[n] for n in ("RightAnkle", "LeftAnkle"))
# Weight of each group after division by the group's standard deviation.
_WEIGHTS = {"ankles": 1.0, "ankle_speed": 1.0, "hip_speed": 1.0, "upper": 0.35, "future": 2.2, "facing": 2.0}
# A better frame is only taken when it costs less than SWITCH times the current one, less MARGIN.
SWITCH, MARGIN = 0.6, 0.1
# How fast the root may be steered off what was captured while the feet move, rad/s and m/s.
MAX_TURN, MAX_DRIFT = 0.9, 0.15
_UPPER_JOINTS = tuple(INDEX[n] for n in ("RightWrist", "LeftWrist", "Head"))


@dataclass(frozen=True)
class FoundCourse:
    """A walked course: library ``frames`` (T,), the root placed in the world (T, 2) and (T,), frames of
    ``seams``.
    """

    frames: Array
    root: Array
    heading: Array
    seams: tuple[int, ...]


@dataclass(frozen=True)
class Arrival:
    """When a course has been walked: so ``near`` its end, metres, and ``turned``, radians, while hips and
    ankles move slower than ``hips`` and ``ankles``, m/s, for so many ``frames`` on end.
    """

    near: float
    turned: float
    hips: float
    ankles: float
    frames: int


AT_REST = Arrival(0.25, 0.35, 0.12, 0.25, 5)
# What is done there begins amid the last step, and the object is put where that leads.
ON_THE_MOVE = Arrival(0.35, 0.6, 0.4, 0.5, 1)


class Matcher:
    """Search structure over one library."""

    def __init__(self, library: Library, searchable: Array | None = None) -> None:
        """Index a library; frames outside the mask ``searchable`` (N,) can be started from but not found."""
        self.library = library
        n = np.arange(len(library))
        pos, facing = [], []
        for h in HORIZON:
            later = np.minimum(n + h, library.end - 1)
            pos.append(rotate_planar(library.root[later] - library.root, -library.heading))
            turn = library.heading[later] - library.heading
            facing.append(np.stack((np.sin(turn), np.cos(turn)), axis=1))
        groups = {
            "ankles": library.pose[:, _POSE_JOINTS].reshape(len(n), -1),
            "ankle_speed": library.velocity[:, _POSE_JOINTS].reshape(len(n), -1),
            "hip_speed": library.velocity[:, HIPS],
            "upper": library.pose[:, _UPPER_JOINTS].reshape(len(n), -1),
            "future": np.concatenate(pos, axis=1),
            "facing": np.concatenate(facing, axis=1),
        }
        among = slice(None) if searchable is None else searchable
        self._scale = {
            k: _WEIGHTS[k] / (v[among].std(axis=0).mean() * np.sqrt(v.shape[1])) for k, v in groups.items()
        }
        self._features = np.concatenate([v * self._scale[k] for k, v in groups.items()], axis=1).astype(
            np.float32
        )
        self._sizes = {k: v.shape[1] for k, v in groups.items()}
        self._norm = (self._features**2).sum(axis=1)
        remaining = library.end - n
        still = np.linalg.norm(library.velocity[:, HIPS, :2], axis=1) < 0.1
        self._allowed = (remaining > 30) | (still & (remaining > 12))
        if searchable is not None:
            self._allowed &= searchable
        self._feet = np.ascontiguousarray(library.pose[:, TOES, :2])
        self._trajectory = self._sizes["future"] + self._sizes["facing"]

    def query(self, frame: int, future: Array, facing: Array) -> Array:
        """Feature vector of a frame's pose with another desired future: (3, 2) and (3,) in its root frame."""
        q = self._features[frame].copy()
        turn = np.stack((np.sin(facing), np.cos(facing)), axis=1).ravel()
        q[-self._trajectory :] = np.concatenate(
            (future.ravel() * self._scale["future"], turn * self._scale["facing"])
        )
        return q

    def costs(self, q: Array) -> Array:
        """Squared distance (N,) of every library frame to ``q``; infinite where too little clip follows."""
        d = self._norm - 2 * (self._features @ q) + q @ q
        return np.where(self._allowed, d, np.inf)

    def gliding(self, frame: int) -> Array:
        """Cost (N,) of going on at every library frame: feet stand in it and in ``frame``, elsewhere."""
        lib = self.library
        off = np.linalg.norm(self._feet - self._feet[frame], axis=-1) - LOOSE
        stand = lib.contacts & lib.contacts[frame]
        return STANDS * (np.where(stand, off.clip(0), 0) ** 2).sum(axis=1)

    def follow(
        self,
        course: Course,
        start_frame: int,
        root: Array,
        heading: float,
        rng: np.random.Generator,
        arrival: Arrival = AT_REST,
        period: int = 10,
        limit: int = 450,
    ) -> FoundCourse | None:
        """Walk the course from a library frame placed at ``root`` (2,), ``heading`` until it stands at its
        end.

        The root is steered a little towards the course while the body moves; feet are set right afterwards.
        Returns None where the character does not come to rest at the end within ``limit`` frames.
        """
        lib = self.library
        f = start_frame
        root = np.array(root, dtype=np.float64)
        frames, roots, headings, seams = [f], [root.copy()], [heading], []
        since, resting = period, 0
        steer_heading, steer_root = 0.0, np.zeros(2)
        for _ in range(limit):
            speed = float(np.linalg.norm(lib.velocity[f, HIPS, :2]))
            course.advance(root)
            ending = f + 1 >= lib.end[f] - 1
            if ending or since >= period:
                future, facing, _ = course.preview(speed, HORIZON)
                q = self.query(
                    f, rotate_planar(future - root, np.full(3, -heading)), wrap_angle(facing - heading)
                )
                cost = self.costs(q) + self.gliding(f)
                best = int(np.argmin(cost * rng.uniform(*MATCHING.cost, size=len(cost)).astype(np.float32)))
                if ending or (abs(best - f) > 8 and cost[best] < SWITCH * cost[f] - MARGIN):
                    f = best
                    seams.append(len(frames))
                since = 0
                steer_heading, steer_root = self._steering(f, future, facing, root, heading)
            moving = min(float(np.linalg.norm(lib.velocity[f, list(_POSE_JOINTS)], axis=1).max()) / 0.8, 1.0)
            step = rotate_planar(lib.root[f + 1] - lib.root[f], -lib.heading[f])
            root = root + rotate_planar(step, heading) + moving * DT * steer_root
            heading = heading + lib.heading[f + 1] - lib.heading[f] + moving * DT * steer_heading
            f += 1
            since += 1
            frames.append(f)
            roots.append(root.copy())
            headings.append(heading)
            still = (
                np.linalg.norm(lib.velocity[f, HIPS, :2]) < arrival.hips
                and np.linalg.norm(lib.velocity[f, list(_POSE_JOINTS)], axis=1).max() < arrival.ankles
            )
            near = (
                course.length - course.progress < arrival.near
                and abs(wrap_angle(course.final_heading - heading)) < arrival.turned
            )
            resting = resting + 1 if still and near else 0
            if resting >= arrival.frames:
                return FoundCourse(np.array(frames), np.array(roots), np.array(headings), tuple(seams))
        return None

    def _steering(
        self, f: int, future: Array, facing: Array, root: Array, heading: float
    ) -> tuple[float, Array]:
        """Turn rate (rad/s) and drift (2,), m/s, that lead a frame's own future towards the desired one,
        limited.
        """
        lib, h = self.library, HORIZON[1]
        later = min(f + h, int(lib.end[f]) - 1)
        own = root + rotate_planar(rotate_planar(lib.root[later] - lib.root[f], -lib.heading[f]), heading)
        turn = wrap_angle(facing[1] - (heading + lib.heading[later] - lib.heading[f])) / (h * DT)
        drift = (future[1] - own) / (h * DT)
        speed = float(np.linalg.norm(drift))
        return float(np.clip(turn, -MAX_TURN, MAX_TURN)), drift * min(1.0, MAX_DRIFT / max(speed, 1e-6))
