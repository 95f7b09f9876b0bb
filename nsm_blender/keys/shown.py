"""A keyed take as the scene shows it: evaluated bones and moved objects, frame by frame, beside the motion
that was made.

Whatever else plays in a scene, a report must tell of what is seen.  Evaluating costs as much as the scene is
heavy, so the first frame, the last, those at which goals were judged or things taken, and a dozen between are
looked at, then ever more between these, until all are seen or a tenth of the time that the take itself took
(``SHARE``) is spent.  Between frames looked at, the difference from the motion made is taken as linear.
"""

from __future__ import annotations

import time
from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from nsm_core.body.key_reduction import angles
from nsm_core.body.skeleton import HIPS, JOINTS, forward_kinematics
from nsm_core.control.take import TakeResult
from nsm_core.conventions import FPS
from nsm_core.rotations import Array, quat_conjugate, quat_mul, quat_normalize, wrap_angle

from ..animation.kept import frame_kept
from ..rigs.armature import Placement, read_world_pose
from ..rigs.mount import go_to
from ..world.frame import WorldFrame
from .keyed import KeyedTake
from .keying import resample_take
from .objects import MovedObject, resample_poses

SHARE = 0.1  # of the take's own time that looking at it may cost
OFF = 0.01  # metres of the character from which what is seen is not what was made
_FEWEST = 12  # frames looked at however heavy the scene is


@dataclass
class ShownTake:
    """What a scene shows of a take, core frame, at the 30 Hz of the motion made.

    ``hips`` (T, 3) and ``local`` (T, 23, 4) of the evaluated bones, ``offsets`` (23, 3) of the character's
    own joints, ``poses`` (T, 4) of the props by name as the moved objects are seen; ``looked_at`` counts the
    scene's frames evaluated.  ``off`` is the largest distance, metres, between a joint or a moved object and
    where its keys should put it, of ``off_name`` at the scene's frame ``off_frame``.
    """

    hips: Array
    local: Array
    offsets: Array
    poses: dict[str, Array]
    looked_at: int
    off: float = 0.0
    off_name: str = ""
    off_frame: int = 0
    allowed: float = OFF  # what is off by no more than this is as it was made
    turned: float = 0.0  # the largest angle, radians, by which a bone is seen turned from how it was made
    character: str = ""  # name of the armature


def look_at(
    keyed: KeyedTake,
    result: TakeResult,
    frame: WorldFrame,
    things: Mapping[str, MovedObject],
    scene: bpy.types.Scene,
) -> Generator[float, None, ShownTake]:
    """Evaluate a keyed take; yields the share done after every frame, and puts the scene's frame back at the
    end.

    ``result`` is the motion made, in the ``frame`` of the character; ``things`` are what it moves, by their
    names.
    """
    count = keyed.count
    budget = max(SHARE * sum(result.stage_ms.values()) / 1000 * len(result.hips_position), 0.2)
    moments = [goal.end_frame for goal in result.goals] + [
        goal.taken.frame for goal in result.goals if goal.taken is not None
    ]
    judged = set() if keyed.reduced is None else set(keyed.reduced.worst)
    judged |= {min(round(max(moment, 0) / FPS * keyed.fps), count - 1) for moment in moments}
    look = _Look(keyed, frame, things)
    spent, step = 0.0, max(1, count // _FEWEST)
    coarse = step
    rows: Iterable[int] = sorted({*range(0, count, step), count - 1, *judged})
    with frame_kept(scene):
        while True:
            for row in rows:
                begin = time.perf_counter()
                look.at(row, scene)
                spent += time.perf_counter() - begin  # what a window does between two slices is not counted
                yield len(look.seen) / count
                if spent > budget and step < coarse:
                    break
            if step == 1 or spent > budget:
                break
            step = (step + 1) // 2
            rows = [row for row in range(0, count, step) if row not in look.seen]
    return look.beside(result)


class _Look:
    """What was seen in the rows looked at: bones in the core's frame, and the objects' world matrices."""

    def __init__(self, keyed: KeyedTake, frame: WorldFrame, things: Mapping[str, MovedObject]) -> None:
        self.keyed, self.frame, self.things = keyed, frame, things
        self.placement = Placement.of(keyed.armature)
        self.seen: dict[int, tuple[Array, Array, dict[str, Matrix]]] = {}

    def at(self, row: int, scene: bpy.types.Scene) -> None:
        """Evaluate the scene at the take's frame number ``row``."""
        go_to(scene, self.keyed.frame_start + row)
        joints, _, local = read_world_pose(self.keyed.armature, self.placement)
        if self.keyed.aside is not None:  # it plays in place: judged where it was made
            back = self.keyed.aside[row].inverted_safe()
            matrix = np.array(back, dtype=np.float64)
            joints = joints @ matrix[:3, :3].T + matrix[:3, 3]
            local[HIPS] = quat_mul(np.array(back.to_quaternion(), dtype=np.float64), local[HIPS])
        depsgraph = bpy.context.evaluated_depsgraph_get()
        objects = {
            name: thing.object.evaluated_get(depsgraph).matrix_world.copy()
            for name, thing in self.things.items()
        }
        self.seen[row] = self.frame.to_core(joints), local, objects

    def beside(self, result: TakeResult) -> ShownTake:
        """Compare what was seen with the motion made."""
        rows = np.array(sorted(self.seen))
        joints, local = (np.array([self.seen[r][k] for r in rows]) for k in (0, 1))
        motion = (np.asarray(m, dtype=np.float64) for m in (result.hips_position, result.local_rotations))
        made_hips, made_local = (m[rows] for m in resample_take(*motion, FPS, self.keyed.fps))
        offsets = self.placement.own_offsets
        own, made_turns = forward_kinematics(made_hips, made_local, offsets.astype(np.float64))
        shown = ShownTake(
            np.empty(0), np.empty(0), offsets, {}, len(rows), character=self.keyed.armature.name
        )
        if self.keyed.reduced is not None:
            shown.allowed = max(OFF, 1.1 * self.keyed.reduced.mm / 1000)
        if self.keyed.kept.counts:  # bones are where the animator wants them
            shown.allowed = np.inf
        gap = np.linalg.norm(joints - own, axis=-1)
        self._note(shown, gap.max(1), rows, [JOINTS[j] for j in gap.argmax(1)])

        turns = forward_kinematics(joints[:, HIPS], local, offsets.astype(np.float64))[1]
        shown.turned = float(angles(quat_mul(quat_conjugate(made_turns), turns)).max())

        at = rows / self.keyed.fps * FPS
        shown.hips = result.hips_position + _between(
            at, joints[:, HIPS] - made_hips, len(result.hips_position)
        )
        turn = quat_mul(local, quat_conjugate(made_local))
        turn = np.where(turn[..., :1] < 0, -turn, turn)
        turn = quat_normalize(
            _between(at, turn.reshape(len(rows), -1), len(result.hips_position)).reshape(-1, len(JOINTS), 4)
        )
        shown.local = quat_mul(turn, np.asarray(result.local_rotations, dtype=np.float64))
        for name, poses in result.props.items():
            shown.poses[name] = np.asarray(poses, dtype=np.float64)
        for name, thing in self.things.items():
            self._thing(name, thing, rows, at, shown, result)
        return shown

    def _thing(
        self, name: str, thing: MovedObject, rows: Array, at: Array, shown: ShownTake, result: TakeResult
    ) -> None:
        """Note where a moved object is seen; its prop, where it has its name, is then there too."""
        poses = np.asarray(result.props[thing.prop], dtype=np.float64)
        made, change = resample_poses(poses, FPS, self.keyed.fps)[rows], np.zeros((len(rows), 4))
        for i, row in enumerate(rows):
            move = self.seen[row][2][name] @ thing.world_at(made[i]).inverted_safe()
            place = np.array(move @ Matrix.Translation(self.frame.to_world(made[i, :3])))[:3, 3]
            change[i, :3] = self.frame.to_core(place) - made[i, :3]
            change[i, 3] = wrap_angle(np.float64(move.to_euler().z))
        self._note(shown, np.linalg.norm(change[:, :3], axis=1), rows, [thing.object.name] * len(rows))
        if thing.prop == name:
            shown.poses[thing.prop] = poses + _between(at, change, len(poses))

    def _note(self, shown: ShownTake, gaps: Array, rows: Array, names: Sequence[str]) -> None:
        worst = int(gaps.argmax())
        if gaps[worst] > shown.off:
            shown.off, shown.off_name = float(gaps[worst]), names[worst]
            shown.off_frame = self.keyed.frame_start + int(rows[worst])


def _between(at: Array, values: Array, count: int) -> Array:
    """Values (N, K) known at moments ``at`` (N,), in frames of the motion, for each of its ``count`` frames,
    linear.
    """
    frames = np.arange(count)
    return np.column_stack([np.interp(frames, at, values[:, k]) for k in range(values.shape[1])])
