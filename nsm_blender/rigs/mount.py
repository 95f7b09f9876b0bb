"""What carries a character's hips: the armature object and the bones above them, frame by frame, as the scene
evaluates them.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from nsm_core.errors import SkeletonError
from nsm_core.rotations import Array

from ..animation.kept import frame_kept


@dataclass(frozen=True)
class Mount:
    """Where the hips' channels begin, in N frames or, with N = 1, in all.

    ``matrix`` (N, 4, 4) armature to world and ``rotation`` (N, 4) its quaternion; ``frame`` (N, 4, 4) the
    hips bone in the armature with no pose on it and ``turn`` (N, 4) its rotation; ``axes`` (N, 3, 3): a
    location of the hips' channels, seen in the armature.
    """

    matrix: Array
    rotation: Array
    frame: Array
    turn: Array
    axes: Array

    @classmethod
    def of(cls, armature: bpy.types.Object, name: str, carrier: Matrix | None = None) -> Mount:
        """As the scene shows the armature now, for its bone ``name``, the hips or what hangs on none of the
        body's bones; SkeletonError where the bones above it are scaled unevenly.  ``carrier`` (4, 4) is what
        these will be moved by in the armature.
        """
        shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        bone, parent = armature.data.bones[name], shown.pose.bones[name].parent
        above = None if parent is None else parent.matrix if carrier is None else carrier @ parent.matrix

        def posed(basis: Matrix) -> Matrix:
            """The hips in the armature with ``basis`` on them: Blender's own rule, the bone's inheritance
            flags included.
            """
            if parent is None:
                return bone.convert_local_to_pose(basis, bone.matrix_local)
            return bone.convert_local_to_pose(
                basis,
                bone.matrix_local,
                parent_matrix=above,
                parent_matrix_local=parent.bone.matrix_local,
            )

        frame = posed(Matrix())
        axes = np.column_stack(
            [posed(Matrix.Translation(axis)).translation - frame.translation for axis in Matrix.Identity(3)]
        )
        lengths = np.linalg.norm(np.array(frame, dtype=np.float64)[:3, :3], axis=0)
        if lengths.min() < 1e-6 or lengths.max() / lengths.min() > 1.001 or abs(np.linalg.det(axes)) < 1e-12:
            named = parent.name if parent is not None else bone.name
            raise SkeletonError(
                f"The bone {named} of {armature.name} is scaled unevenly or to nothing; clear its scale "
                "(Alt+S)."
            )
        rotation, turn = (np.array(m.to_quaternion(), dtype=np.float64) for m in (shown.matrix_world, frame))
        matrix, frame = (np.array(m, dtype=np.float64) for m in (shown.matrix_world, frame))
        return cls(*(a[None] for a in (matrix, rotation, frame, turn, axes)))

    @classmethod
    def over(cls, each: Sequence[Mount]) -> Mount:
        """Several frames in one."""
        return cls(
            *(
                np.concatenate([getattr(m, k) for m in each])
                for k in ("matrix", "rotation", "frame", "turn", "axes")
            )
        )

    @property
    def scale(self) -> float:
        """By how much the bones above the hips scale them, in the first frame."""
        return float(np.cbrt(abs(np.linalg.det(self.frame[0, :3, :3]))))

    def require_one_size(self, name: str) -> None:
        """Raise SkeletonError where the armature ``name`` grows or shrinks over the frames: no keys of
        rotations make up for that.
        """
        sizes = np.cbrt(np.abs(np.linalg.det(self.matrix[:, :3, :3]) * np.linalg.det(self.frame[:, :3, :3])))
        if sizes.max() > 1.001 * sizes.min():
            raise SkeletonError(
                f"The armature {name} changes its size during the take, {sizes.max() / sizes.min():.2f} "
                "times as large at one frame as at "
                "another; find the scale that is animated on it, its root bone or its parents, or the "
                "constraint that copies one."
            )

    def location(self, hips: Array) -> Array:
        """Location channels (T, 3) of the hips bone that put the hips at world points (T, 3)."""
        inverse = np.linalg.inv(self.matrix)
        in_armature = (
            np.einsum("nij,nj->ni", np.broadcast_to(inverse[:, :3, :3], (len(hips), 3, 3)), hips)
            + inverse[:, :3, 3]
        )
        channels = np.linalg.inv(self.axes)
        return np.einsum(
            "nij,nj->ni", np.broadcast_to(channels, (len(hips), 3, 3)), in_armature - self.frame[:, :3, 3]
        )


def go_to(scene: bpy.types.Scene, frame: float) -> None:
    """Evaluate the scene where the keys of ``frame`` lie, whatever the scene's time stretching."""
    frame = frame * scene.render.frame_map_new / scene.render.frame_map_old
    whole = int(np.floor(frame))
    scene.frame_set(whole, subframe=frame - whole)


def over_frames(
    scene: bpy.types.Scene, frames: Sequence[float], read: Callable[[], Any]
) -> Generator[float, None, list[Any]]:
    """Go through ``frames`` and collect what ``read`` returns at each; yields the share done, and puts the
    frame back at the end.
    """
    found = []
    with frame_kept(scene):
        for i, frame in enumerate(frames):
            go_to(scene, frame)
            found.append(read())
            yield (i + 1) / len(frames)
    return found


def last(steps: Generator[Any, None, Any]) -> Any:
    """Run a generator to its end; its value."""
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            return stop.value
