"""From a take to the channels of a rig's bones, and a pose shown by them."""

from __future__ import annotations

from collections.abc import Generator

import bpy
from mathutils import Matrix, Quaternion, Vector

from nsm_core.body.skeleton import HIPS
from nsm_core.rotations import Array, quat_conjugate, quat_mul, quat_normalize

from ..rigs.armature import Placement
from ..rigs.bone_map import BoneMap, bone_map_of
from ..rigs.mount import Mount, over_frames
from .layers import carried
from .limb_controls import control_mounts, pole_turns
from .root_motion import RootWay
from .turns import continuous


def mounts_of(
    armature: bpy.types.Object, placement: Placement, carrier: Matrix | None = None
) -> dict[int, Mount]:
    """Where the channels of the bones begin that get locations, by their joint; ``carrier`` as for
    ``Mount.of``.
    """
    return {j: Mount.of(armature, placement.keyed.bones[j], carrier) for j in placement.keyed.apart}


def mounts_over(
    armature: bpy.types.Object,
    placement: Placement,
    root: RootWay | None,
    scene: bpy.types.Scene,
    frames: Array,
) -> Generator[float, None, dict[int | str, Mount]]:
    """The mounts of a take's frames, or of all in one where they stay: with what else carries the armature,
    and with its root as that will be keyed.
    """
    rows, bone_map = iter(range(len(frames))), bone_map_of(armature)

    def read() -> dict[int | str, Mount]:
        carrier = None
        if root is not None and root.bone:
            shown = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
            carrier = root.carrier(next(rows), shown)
        own = mounts_of(armature, placement, carrier)
        return {**own, **control_mounts(armature, bone_map, carrier)}

    if carried(armature):
        every = yield from over_frames(scene, frames, read)
    else:
        every = [read() for _ in range(len(frames) if root is not None and root.bone else 1)]
    mounts = {k: Mount.over([each[k] for each in every]) for k in every[0]}
    if root is not None:
        mounts = root.mounted(mounts)
    mounts[HIPS].require_one_size(armature.name)
    return mounts


def bone_channels(
    armature: bpy.types.Object, placement: Placement, mounts: dict[int, Mount], hips: Array, local: Array
) -> tuple[dict[int, Array], Array]:
    """Turn a take into pose channels: locations (T, 3) of the bones with mounts, by their joint, and basis
    rotations (T, 23, 4), sign-continuous.

    ``hips`` (T, 3) are in the world, Blender units.  A bone's basis is its rotation seen from its rest frame
    on the bone that carries it; that of a bone which does not inherit rotation, R its rest in the armature,
    is ``R^-1 A^-1 W C``.  For the hips what carries them comes off first.
    """
    rig = placement.keyed
    places, world = rig.to_bones(hips / placement.scale, local)
    basis = rig.basis(world)
    off = quat_conjugate(mounts[HIPS].rotation)  # (N, 4), A^-1
    loose = loose_joints(armature, placement)
    if loose:
        basis[:, loose] = quat_mul(quat_conjugate(rig.turns[loose]), quat_mul(off[:, None], world[:, loose]))
    for j, mount in mounts.items():
        basis[:, j] = quat_mul(quat_conjugate(mount.turn), quat_mul(off, world[:, j]))
    locations = {j: mount.location(places[j] * placement.scale) for j, mount in mounts.items()}
    return locations, continuous(quat_normalize(basis))


def show_pose(
    armature: bpy.types.Object, placement: Placement, places: dict[int, Array], basis: Array, row: int = 0
) -> None:
    """Pose a character by a row of its channels, without a key."""
    for j in placement.keyed.mapped:
        place = Matrix.Translation(Vector(places[j][row])) if j in places else Matrix()
        bone = armature.pose.bones[placement.keyed.bones[j]]
        bone.matrix_basis = place @ Quaternion(basis[row, j]).to_matrix().to_4x4()


def poles_of(
    armature: bpy.types.Object, placement: Placement, bone_map: BoneMap, hips: Array, local: Array
) -> dict[str, float]:
    """``pole_turns`` as the scene stands now."""
    if not bone_map.pulled:
        return {}
    places, basis = bone_channels(armature, placement, mounts_of(armature, placement), hips, local)
    return pole_turns(
        armature,
        placement,
        bone_map,
        control_mounts(armature, bone_map),
        hips,
        local,
        lambda row: show_pose(armature, placement, places, basis, row),
    )


def loose_joints(armature: bpy.types.Object, placement: Placement) -> list[int]:
    """Joints whose bones do not turn with the bone that carries them."""
    rig, bones = placement.keyed, armature.data.bones
    return [j for j in rig.mapped if j not in rig.apart and not bones[rig.bones[j]].use_inherit_rotation]
