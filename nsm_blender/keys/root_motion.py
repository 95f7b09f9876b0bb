"""Root motion: which of a character's channels carry it through the world.

On the hips, as the take was made; on the object or on the bone above the hips, which then move with the body
over the floor and turn as it faces, the hips being keyed within them, so that nothing is seen to change; or
in place, where that way is left out.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

from nsm_core.body.skeleton import OFFSETS, forward_kinematics, root_of
from nsm_core.errors import NsmError
from nsm_core.rotations import Array, direction_to_heading, quat_conjugate, quat_mul, quat_rotate
from nsm_core.signals import gaussian_smooth

from ..rigs.armature import Placement
from ..rigs.bone_map import bone_map_of
from ..rigs.mount import Mount, over_frames
from .layers import may_move, require_bones_rule
from .objects import channel_values, delta_turn, own_turn, require_movable, space_of
from .style import BONE, IN_PLACE, KINDS, OBJECT
from .turns import continuous, rotation_channel, rotation_values

_SMOOTHING = 0.12  # seconds: the sway of a walking pelvis stays in the hips


def require_root(armature: bpy.types.Object, kind: str) -> None:
    """Raise an NsmError where a character cannot carry its root motion in this way."""
    if kind not in KINDS:
        raise NsmError(f"There is no root motion '{kind}'; choose {', '.join(KINDS[:-1])} or {KINDS[-1]}.")
    try:
        if kind == OBJECT:
            require_movable(armature, None)
        if kind == BONE:
            require_bones_rule(armature, [root_bone(armature)])
    except NsmError as error:
        raise NsmError(f"{error} Or set Root Motion to Hips.") from error


def root_bone(armature: bpy.types.Object) -> str:
    """The topmost bone above the hips; NsmError where there is none."""
    above = armature.data.bones[bone_map_of(armature).hips].parent_recursive
    if not above:
        raise NsmError(f"{armature.name} has no bone above its hips that could carry its root motion.")
    return above[-1].name


@dataclass(frozen=True)
class RootChannels:
    """Channels of what carries a root: ``places`` (N, 3) and ``turns`` (N, 3 or 4) in its rotation mode, and
    the ``axes`` (N or 1, 3, 3) that its location has in the world.
    """

    prefix: str  # of the paths
    group: str
    mode: str
    places: Array
    turns: Array
    axes: Array

    def now(self, armature: bpy.types.Object) -> dict[str, tuple[float, ...]]:
        """What these channels are set to, by path."""
        owner = armature.pose.bones[self.group] if self.prefix else armature
        names = (rotation_channel(self.mode), "location")
        return {f"{self.prefix}{name}": tuple(getattr(owner, name)) for name in names}


@dataclass(frozen=True)
class RootWay:
    """The way of a root over N frames.

    ``matrices``, N in the world: of the armature object, or with ``bone`` where it would have to be to carry
    that bone in its rest pose along.
    """

    armature: bpy.types.Object
    kind: str
    matrices: list[Matrix]
    world: Matrix  # of the object before
    bone: str = ""

    @classmethod
    def of(
        cls,
        armature: bpy.types.Object,
        kind: str,
        placement: Placement,
        hips: Array,
        local: Array,
        rate: float,
    ) -> RootWay:
        """The way of a take: hips (N, 3) in the world, Blender units, and rotations (N, 23, 4), at ``rate``
        frames a second.
        """
        positions = forward_kinematics(hips, local, OFFSETS.astype(np.float64) * placement.scale)[0]
        place, heading = root_of(positions)
        place = gaussian_smooth(place, _SMOOTHING * rate)
        heading = gaussian_smooth(np.unwrap(heading), _SMOOTHING * rate)
        world = Matrix(placement.matrix.tolist())
        bone = root_bone(armature) if kind == BONE else ""
        origin = world @ armature.data.bones[bone].head_local if bone else world.translation
        facing = _facing(placement)
        matrices = []
        for (x, y), angle in zip(place, heading, strict=True):
            turn = Matrix.Rotation(float(angle) - facing, 4, "Z")
            there = Matrix.Translation(Vector((x, y, origin.z)))
            matrices.append(there @ turn @ Matrix.Translation(-origin) @ world)
        return cls(armature, kind, matrices, world, bone)

    def mounted(self, mounts: dict[int, Mount]) -> dict[int, Mount]:
        """Where the channels of bones begin that are carried along, of where they would without."""
        if self.bone:
            return mounts
        matrix = np.array([np.array(m) for m in self.matrices])
        turn = np.array([m.to_quaternion() for m in self.matrices])
        return {j: Mount(matrix, turn, m.frame, m.turn, m.axes) for j, m in mounts.items()}

    def carrier(self, row: int, shown: bpy.types.Object) -> Matrix:
        """By which (4, 4), in the armature, the bone that carries the root is moved from where it is
        ``shown`` now to where it is to be in frame ``row``.
        """
        return self._pose(row, shown.matrix_world) @ shown.pose.bones[self.bone].matrix.inverted_safe()

    def aside(self) -> list[Matrix] | None:
        """By which (4, 4) the motion is seen off its place in each frame; None where it is in its place."""
        if self.kind != IN_PLACE:
            return None
        return [self.world @ matrix.inverted_safe() for matrix in self.matrices]

    def seen(self) -> tuple[Array, Array]:
        """Places (N, 3) and rotations (N, 4) in the world of what carries the root."""
        rest = self.armature.data.bones[self.bone].matrix_local if self.bone else Matrix()
        poses = [matrix @ rest for matrix in self.matrices]
        places = np.array([pose.translation for pose in poses], dtype=np.float64)
        return places, np.array([pose.to_quaternion() for pose in poses], dtype=np.float64)

    def channels(
        self, scene: bpy.types.Scene, frames: Array, mounts: dict[int, Mount]
    ) -> Generator[float, None, RootChannels | None]:
        """What is keyed for it; yields the share of the frames looked at.  ``mounts`` as ``mounted``."""
        if self.kind == IN_PLACE:
            return None
        if self.bone:
            return self._of_bone(np.broadcast_to(mounts[0].matrix, (len(frames), 4, 4)))
        target = self.armature
        spaces = [space_of(target)]
        if target.parent is not None and may_move(target):
            spaces = yield from over_frames(scene, list(frames), lambda: space_of(target))
        back = self.world.inverted_safe()
        places, turns = channel_values(
            target,
            self.world,
            space_of(target),
            delta_turn(target) @ own_turn(target),
            [matrix @ back for matrix in self.matrices],
            spaces,
        )
        axes = np.array([np.array(space.inverted_safe())[:3, :3] for space in spaces])
        return RootChannels("", "Object Transforms", target.rotation_mode, places, turns, axes)

    def _of_bone(self, worlds: Array) -> RootChannels:
        rest, bone = self.armature.data.bones[self.bone], self.armature.pose.bones[self.bone]
        poses = [self._pose(row, Matrix(world.tolist())) for row, world in enumerate(worlds)]
        basis = [rest.convert_local_to_pose(pose, rest.matrix_local, invert=True) for pose in poses]
        places = np.array([m.translation for m in basis])
        quats = continuous(np.array([m.to_quaternion() for m in basis]))
        own = [
            rest.convert_local_to_pose(Matrix.Translation(axis), rest.matrix_local).translation
            - rest.matrix_local.translation
            for axis in Matrix.Identity(3)
        ]
        axes = worlds[:, :3, :3] @ np.array(own).T
        prefix = f'pose.bones["{bpy.utils.escape_identifier(self.bone)}"].'
        mode = bone.rotation_mode
        return RootChannels(prefix, self.bone, mode, places, rotation_values(mode, quats), axes)

    def _pose(self, row: int, world: Matrix) -> Matrix:
        """Pose of the root bone in the armature, which stands at ``world``."""
        return world.inverted_safe() @ self.matrices[row] @ self.armature.data.bones[self.bone].matrix_local


def _facing(placement: Placement) -> float:
    """The heading of the rest pose where the armature stands."""
    hips = placement.keyed.turns[0], placement.keyed.rest[0]
    axes = quat_mul(hips[0], quat_conjugate(hips[1]))
    ahead = quat_rotate(quat_mul(placement.rotation, axes), np.array((0.0, -1.0, 0.0)))
    return float(direction_to_heading(ahead)) if np.linalg.norm(ahead[:2]) > 0.1 else 0.0
