"""The body that a rig's skin shows: points on it, as they lie in the T-pose, and the figure fitted to them.

Points are read where the scene shows them and taken back through what their bones do at the moment, so that
neither the pose nor the rest position has to be touched.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import bpy
import numpy as np

from nsm_core.body.capsules import BUNDLED, Body, Figure, rest_joints
from nsm_core.body.contacts import Sole
from nsm_core.body.fitted import fitted
from nsm_core.body.skeleton import INDEX, JOINTS, OFFSETS
from nsm_core.rotations import Array, quat_rotate, quat_to_matrix

from .armature import Placement

_POINTS = 3000  # on the skin that are looked at
_FEWEST = 200  # that make a body
_FITS = 0.02  # metres out of the bundled body within which nearly all of a skin lies that it fits


@dataclass
class Skin:
    """Points (N, 3) spread evenly over a character's skin, in the T-pose, metres of the character, and the
    ``joints`` (N,) that carry them; ``offsets`` (23, 3) of its skeleton, ``toes`` whether it has any that
    bend.
    """

    points: Array
    joints: Array
    offsets: Array
    toes: bool

    @classmethod
    def reading(cls, armature: bpy.types.Object, placement: Placement) -> Generator[float, None, Skin]:
        """Read what a character's skin is now, in slices."""
        parts: list[tuple[Array, Array, float]] = []
        worn = skins(armature)
        for number, skin in enumerate(worn):
            depsgraph = bpy.context.evaluated_depsgraph_get()
            shown = armature.evaluated_get(depsgraph)
            sampled = _sampled(skin.evaluated_get(depsgraph), shown, _bones(shown, placement))
            parts += [sampled] if sampled is not None else []
            yield (number + 1) / len(worn)
        return cls._of(parts, armature, placement)

    @classmethod
    def _of(
        cls, parts: list[tuple[Array, Array, float]], armature: bpy.types.Object, placement: Placement
    ) -> Skin:
        toes = all(placement.seen.bones[INDEX[side + "Toe"]] for side in ("Left", "Right"))
        offsets = placement.own_offsets
        if not parts:
            return cls(np.zeros((0, 3)), np.zeros(0, int), offsets, toes)
        area = np.array([part[2] for part in parts])
        counts = np.ceil(_POINTS * area / area.sum()).astype(int)
        places, joints = (
            np.concatenate([part[k][:n] for part, n in zip(parts, counts, strict=True)]) for k in (0, 1)
        )
        return cls(_in_t_pose(places, joints, armature, placement), joints, offsets, toes)

    def figure(self) -> Figure:
        """The body that fills the skin; the bundled one where it is that, or where there is no skin.  It
        touches none of Blender's data.
        """
        known = self.offsets is OFFSETS
        if len(self.points) < _FEWEST:
            return BUNDLED if known else Figure(self.offsets, sole=Sole.of(self.offsets))
        if known and _fits(self.points):
            return BUNDLED
        return fitted(self.points, self.joints, self.offsets, self.toes)


def skins(armature: bpy.types.Object) -> list[bpy.types.Object]:
    """The meshes that an armature deforms and that are seen."""
    return [
        candidate
        for candidate in bpy.context.scene.objects
        if candidate.type == "MESH"
        and candidate.visible_get()
        and any(
            m.type == "ARMATURE" and m.object == armature and m.show_viewport for m in candidate.modifiers
        )
    ]


def _fits(points: Array) -> bool:
    """Whether a skin is that of the bundled body."""
    still = np.tile((1.0, 0.0, 0.0, 0.0), (1, len(JOINTS), 1))
    body = Body.of(OFFSETS[:1].astype(np.float64), still)
    away = np.linalg.norm(points[:, None] - body.centres[0], axis=-1) - body.radii[0]
    outside, middle = np.quantile(away.min(1), (0.98, 0.5))  # where limbs meet, skin lies inside other parts
    return bool(outside < _FITS and abs(middle) < _FITS / 2)


def _bones(shown: bpy.types.Object, placement: Placement) -> dict[str, tuple[int, Array]]:
    """Deforming bones by name: the joint that carries each, and by what (4, 4) it has moved from its rest
    pose.
    """
    seen = {name: j for j, name in enumerate(placement.seen.bones) if name is not None}
    data = shown.pose.bones
    segments = {
        j: (np.array(data[name].bone.head_local), np.array(data[name].bone.tail_local))
        for name, j in seen.items()
    }
    bones = {}
    for bone in data:
        if bone.bone.use_deform:
            line = [bone.name, *(over.name for over in bone.parent_recursive)]
            joint = next((seen[name] for name in line if name in seen), None)
            if joint is None:
                joint = _nearest(np.array(bone.bone.head_local), segments)
            move = bone.matrix @ bone.bone.matrix_local.inverted_safe()
            bones[bone.name] = joint, np.array(move, dtype=np.float64)
    return bones


def _nearest(point: Array, segments: dict[int, tuple[Array, Array]]) -> int:
    """The joint whose bone is nearest to a point."""

    def away(a: Array, b: Array) -> float:
        way = b - a
        along = np.clip((point - a) @ way / max(float(way @ way), 1e-12), 0, 1)
        return float(np.linalg.norm(point - a - along * way))

    return min(segments, key=lambda j: away(*segments[j]))


def _sampled(
    skin: bpy.types.Object, shown: bpy.types.Object, bones: dict[str, tuple[int, Array]]
) -> tuple[Array, Array, float] | None:
    """Points (N, 3) on an evaluated skin in the armature's rest pose, the joints (N,) that carry them, and
    how large the skin is; None where nothing of it hangs on bones.
    """
    mesh = skin.data
    mesh.calc_loop_triangles()
    if not len(mesh.loop_triangles):
        return None
    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", corners)
    corners = corners.reshape(-1, 3)
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    matrix = np.array(shown.matrix_world.inverted_safe() @ skin.matrix_world, dtype=np.float64)
    places = flat.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    a, b, c = (places[corners[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    if not area.sum() > 0:
        return None
    rng = np.random.default_rng(1)
    rows = rng.choice(len(corners), _POINTS, p=area / area.sum())
    share = rng.dirichlet((1.0, 1.0, 1.0), _POINTS)
    points = (share[..., None] * places[corners[rows]]).sum(1)
    main, each = np.unique(corners[rows, share.argmax(1)], return_inverse=True)
    joints, moves, held = _held(mesh, main, [bones.get(group.name) for group in skin.vertex_groups])
    kept = held[each.reshape(-1)]
    if not kept.any():
        return None
    each = each.reshape(-1)[kept]
    joints, moves = joints[each], moves[each]
    moves[np.abs(np.linalg.det(moves)) < 1e-9] = np.eye(4)
    back = np.linalg.inv(moves)
    points = np.einsum("nij,nj->ni", back[:, :3, :3], points[kept]) + back[:, :3, 3]
    return points, joints, float(area.sum())


def _held(
    mesh: bpy.types.Mesh, vertices: Array, groups: list[tuple[int, Array] | None]
) -> tuple[Array, Array, Array]:
    """The joints (N,) that carry vertices (N,) most, by what (N, 4, 4) their bones have moved them from the
    rest pose, and whether any bone does (N,).
    """
    places = mesh.vertices
    told = [(i, g.group, g.weight) for i, v in enumerate(vertices.tolist()) for g in places[v].groups]
    row, group, weight = (np.array(c) for c in zip(*told, strict=True)) if told else np.zeros((3, 0), int)
    bone = np.array([-1 if moved is None else moved[0] for moved in groups] or [-1])
    used = (weight > 0) & (group < len(groups)) & (bone[np.minimum(group, len(bone) - 1)] >= 0)
    row, group, weight = row[used], group[used], weight[used].astype(np.float64)
    joint, move = bone[group], np.array([np.eye(4) if moved is None else moved[1] for moved in groups])
    shape = len(vertices), len(JOINTS)
    share, first = np.zeros(shape), np.full(shape, len(row))
    sums, moves = np.zeros(shape[0]), np.zeros((shape[0], 4, 4))
    np.add.at(share, (row, joint), weight)
    np.minimum.at(first, (row, joint), np.arange(len(row)))
    if len(row):
        np.add.at(sums, row, weight)
        np.add.at(moves, row, weight[:, None, None] * move[group])
    held = sums > 0
    moves[held] /= sums[held, None, None]
    most = np.where(share == share.max(1, keepdims=True), first, len(row) + 1).argmin(1)
    return most, moves, held  # of joints that carry as much, the first


def _in_t_pose(points: Array, joints: Array, armature: bpy.types.Object, placement: Placement) -> Array:
    """Points (N, 3) of the armature's rest pose where they are in the T-pose."""
    rig = placement.seen
    rest = rest_joints(placement.own_offsets)
    heads = np.zeros((len(JOINTS), 3))
    for j, name in enumerate(rig.bones):
        if name is not None:
            heads[j] = armature.data.bones[name].head_local
    turned = quat_to_matrix(rig.turns.astype(np.float64))[joints]
    own = np.einsum("nji,nj->ni", turned, points - heads[joints]) / rig.size  # in the bone's own frame
    out = quat_rotate(rig.rest[joints], own) + rest[joints]
    out[joints == 0] += rig.hips_head
    return out


__all__ = ["Skin"]
