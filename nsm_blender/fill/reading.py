"""What stands on both sides of gaps and below them, read from the animation as the scene shows it.

Gaps of one stretch are filled in series: what was made in an earlier one is the past of the next (papers/001,
section 7.4), and a pose between two of them is passed at the pace from the one before it to the one behind.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from nsm_core.body import clip
from nsm_core.body.capsules import Figure
from nsm_core.body.clip import Clip
from nsm_core.control.inbetween import Filled, Gap, level_under
from nsm_core.conventions import FPS
from nsm_core.model.transitions.layout import PAST
from nsm_core.rotations import (
    Array,
    quat_conjugate,
    quat_from_rotvec,
    quat_mul,
    quat_normalize,
    quat_to_rotvec,
)

from ..prepare import figure_of
from ..progress import Progress, staged, waited
from ..rigs.armature import Placement, read_world_pose
from ..rigs.bone_map import told_map
from ..rigs.mount import go_to, over_frames
from ..world.below import Below, ground_below, solids_near
from ..world.bvh_query import BVHQuery
from ..world.colliders import solid_seen
from ..world.evaluated import Snapshot
from ..world.frame import WorldFrame
from .gap import AskedGap, Stretch

Pose = tuple[Array, Array]  # hips (3,), core frame, and local rotations (23, 4)


@dataclass(frozen=True)
class Made:
    """One gap that is filled."""

    stretch: Stretch
    gap: Gap
    filled: Filled

    def at(self, shares: Array) -> Pose:
        """Hips (N, 3), core frame, and rotations (N, 23, 4) at shares (N,) of the way from the pose before
        the gap to the one behind it.
        """
        past, made, target = self.gap.past, self.filled.clip, self.gap.target
        hips = np.concatenate((past.hips_position[-1:], made.hips_position, target.hips_position[:1]))
        local = np.concatenate((past.local_rotations[-1:], made.local_rotations, target.local_rotations[:1]))
        local = quat_normalize(local.astype(np.float64))
        return clip.resample(hips.astype(np.float64), local, shares * (len(hips) - 1), 1.0)


@dataclass(frozen=True)
class Sides:
    """The poses around all gaps by their frames, and the scene's meshes."""

    character: bpy.types.Object
    scene: bpy.types.Scene
    frame: WorldFrame
    asked: AskedGap
    fps: float
    poses: dict[float, Pose]
    snapshot: Snapshot
    figure: Figure
    solids: list[BVHQuery]

    def gap(self, number: int, made: Sequence[Made], seed: int) -> Gap:
        """Gap ``number`` with what was ``made`` in those before it."""
        stretch = self.asked.stretches[number]
        past = _clip([self._past(time, made) for time in _before(self.asked, stretch, self.fps)])
        target = _clip(self._target(number))
        ground = self._ground(stretch, past, target)
        return Gap(past, target, stretch.count(self.fps), ground, seed, self.figure, self.solids, self.fps)

    def _past(self, time: float, made: Sequence[Made]) -> Pose:
        for one in made:
            if one.stretch.start < time < one.stretch.end:
                share = (time - one.stretch.start) / (one.stretch.end - one.stretch.start)
                hips, local = one.at(np.array([share]))
                return hips[0], local[0]
        return self.poses[time]

    def _target(self, number: int) -> list[Pose]:
        stretches, stretch = self.asked.stretches, self.asked.stretches[number]
        here = self.poses[stretch.end]
        following = stretches[number + 1] if number + 1 < len(stretches) else None
        if following is None or following.start != stretch.end:
            times = _after(self.asked, stretch, self.fps)
            return [self.poses[time] for time in times]
        (hips, local), (next_hips, next_local) = self.poses[stretch.start], self.poses[following.end]
        share = self.fps / FPS / (following.end - stretch.start)
        turn = quat_mul(quat_conjugate(local), next_local)
        turn = quat_to_rotvec(np.where(turn[:, :1] < 0, -turn, turn)) * share
        return [here, (here[0] + (next_hips - hips) * share, quat_mul(here[1], quat_from_rotvec(turn)))]

    def _ground(self, stretch: Stretch, past: Clip, target: Clip) -> Below | None:
        share = np.linspace(0, 1, stretch.count(FPS) + 2)[:, None]
        between = past.hips_position[-1] + share * (target.hips_position[0] - past.hips_position[-1])
        way = np.concatenate((past.hips_position, between, target.hips_position))
        level = level_under(past, self.figure)
        return ground_below(self.snapshot, self.scene, _bodies(self.scene), self.frame, way, level)


def reading(
    character: bpy.types.Object, scene: bpy.types.Scene, frame: WorldFrame, asked: AskedGap, fps: float
) -> Generator[Progress, None, Sides]:
    """Read what the gaps asked for need of the scene, in slices; the current frame is put back."""
    placement = Placement.of(character)

    def read() -> Pose:
        _, hips, local = read_world_pose(character, placement)
        return frame.to_core(hips), local

    each = [(*_before(asked, s, fps), s.start, *_after(asked, s, fps)) for s in asked.stretches]
    times = sorted({time for some in each for time in some})
    rows = yield from staged("Reading the poses", over_frames(scene, times, read))

    def evaluated() -> bpy.types.Depsgraph:
        go_to(scene, asked.stretches[0].start)
        return bpy.context.evaluated_depsgraph_get()

    snapshot = yield from staged("Reading the ground", Snapshot.take(evaluated))
    figure = yield from figure_of(character)
    way = np.stack([hips for hips, _ in rows])
    seen = solid_seen(snapshot, scene, _bodies(scene))
    solids = yield from waited("Reading the scene", lambda _: solids_near(seen, frame, way))
    return Sides(
        character, scene, frame, asked, fps, dict(zip(times, rows, strict=True)), snapshot, figure, solids
    )


def _bodies(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Everybody in a scene: nobody is walked over."""
    armatures = [each for each in scene.objects if each.type == "ARMATURE"]
    return [each for each in armatures if not told_map(each).problem(each.name, each.data.bones)]


def _before(asked: AskedGap, stretch: Stretch, fps: float) -> list[float]:
    """Frames of the past of a gap, at the network's rate; those before the first key are left out."""
    times = stretch.start - fps / FPS * np.arange(PAST - 1, -1, -1)
    return times[times >= min(asked.first, stretch.start) - 1e-3].tolist()


def _after(asked: AskedGap, stretch: Stretch, fps: float) -> list[float]:
    """Frames of the target of a gap: one alone where it is the last with a key."""
    both = [stretch.end, stretch.end + fps / FPS]
    return both if stretch.end < asked.last - 1e-3 else both[:1]


def _clip(poses: Sequence[Pose]) -> Clip:
    hips, local = (np.stack(column) for column in zip(*poses, strict=True))
    return Clip("side", hips, local)
