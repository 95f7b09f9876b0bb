"""What every rig is tried on for docs/rigs.md: furniture of its own size, one take an action, and what is
measured on the bones and the skin that the scene then shows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector

from nsm_blender.demo_scene import door_parts, room_props
from nsm_blender.demo_scene.room import palette, place
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.keys.keyed import discard_take
from nsm_blender.keys.keying import key_take
from nsm_blender.rigs.armature import Placement
from nsm_blender.rigs.bone_map import BoneMap
from nsm_blender.rigs.character import add_character
from nsm_blender.rigs.skin import skins
from nsm_blender.takes import Take, TakeSpec, finish, generate
from nsm_core.body.contacts import TOES
from nsm_core.body.skeleton import ARMS, FEET, INDEX, JOINTS, OFFSETS, PARENTS, J, forward_kinematics
from nsm_core.conventions import FPS
from nsm_core.rotations import heading_quat, quat_from_rotvec, quat_mul, quat_rotate
from nsm_core.world.scene.furniture import make

LIMBS = [
    (side + upper, side + lower)
    for side in ("Left", "Right")
    for upper, lower in (("Shoulder", "Elbow"), ("Elbow", "Wrist"), ("Hip", "Knee"), ("Knee", "Ankle"))
]
EVERY = 3  # frames between those whose skin is looked at


@dataclass
class Outcome:
    """How a goal went; lengths in the scene's centimetres, None where there is nothing to measure."""

    reached: bool
    hips: float | None  # from where they should be; of a carry the box
    hands: float | None  # from where they take hold
    feet: float  # a second, by which toe joints move while they are at their lowest
    under: float  # how deep the skin comes under the floor
    solids: float  # how deep the body is in anything


def perform(rig: bpy.types.Object, action: str) -> tuple[Take, Outcome]:
    """Let a rig that stands at the origin perform an action amid things of its own size."""
    scale = Placement.of(rig).scale
    goals = STAGES[action](scale)
    bpy.context.view_layer.update()
    take = finish(generate(TakeSpec(rig, goals, name=f"{rig.name} {action}"), bpy.context.scene))
    report, goal = take.report, take.report["goals"][-1]
    hands = goal.get("hand_error_cm")
    return take, Outcome(
        goal["reached"],
        None if goal["position_error_cm"] is None else goal["position_error_cm"] * scale,
        None if hands is None else hands * scale,
        100 * scale * standing_slide(take),
        100 * under_floor(take),
        report["penetration_cm"] * scale,
    )


def _walk(s: float) -> list[GoalSpec]:
    return [GoalSpec("walk", None, 0.5, (-1.2 * s, -2.4 * s, 0.0))]


def _sit(s: float) -> list[GoalSpec]:
    chair = place(
        make("chair", np.random.default_rng(90001)), "Chair", (1.1 * s, -1.6 * s), 0.6, "Oak", "Teal"
    )
    chair.scale = (s,) * 3
    return [GoalSpec("sit", chair, 1.5)]


def _carry(s: float) -> list[GoalSpec]:
    tones = palette()
    half = 0.19 * s
    box = room_props.box("Box", (-half, -half * 0.8, 0), (half, half * 0.8, 0.26 * s), tones["Cardboard"])
    box.location = (0.5 * s, -1.5 * s, 0)
    to = bpy.data.objects.new("There", None)
    to.location = (-1.2 * s, -2.2 * s, 0)
    bpy.context.scene.collection.objects.link(to)
    return [GoalSpec("carry", box, 0.5, to=to)]


def _open(s: float) -> list[GoalSpec]:
    tones, hinge = palette(), (-0.45 * s, -1.6 * s)
    wall, top = 0.1, door_parts.HEIGHT + door_parts.GAP + door_parts.LINING
    low, high = door_parts.OPENING
    made = [
        door_parts.add_leaf(tones, "Door", hinge, 0.0),
        door_parts.add_frame(tones, "Frame", hinge, 0.0, (-wall, 0.0)),
    ]
    wall_parts = (
        ((-1.5, -wall, 0), (low, 0, 2.4)),
        ((high, -wall, 0), (1.5 + high, 0, 2.4)),
        ((low, -wall, top), (high, 0, 2.4)),
    )
    for a, b in wall_parts:
        made.append(room_props.box("Wall", a, b, tones["Sage"]))
        made[-1].location = s * made[-1].location + Vector((*hinge, 0))
    for thing in made:
        thing.scale = (s,) * 3
    return [GoalSpec("open", made[0], 0.5)]


def _climb(s: float) -> list[GoalSpec]:
    podium = room_props.box(
        "Podium", (-0.5 * s, -0.5 * s, 0), (0.5 * s, 0.5 * s, 0.36 * s), palette()["Walnut"]
    )
    podium.location = (0.4 * s, -1.8 * s, 0)
    return [GoalSpec("climb", podium, 1.0)]


STAGES: dict[str, Callable[[float], list[GoalSpec]]] = {
    "walk": _walk,
    "sit": _sit,
    "carry": _carry,
    "open": _open,
    "climb": _climb,
}


def wide_motion(frames: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """Hips (T, 3) and rotations (T, 23, 4) through a wide range of poses."""
    rng = np.random.default_rng(3)
    t = np.arange(frames)[:, None, None] / 30
    turns = rng.normal(0, 0.6, (1, J, 3)) * np.sin(
        rng.uniform(1, 5, (1, J, 3)) * t + rng.uniform(0, 6, (1, J, 3))
    )
    local = quat_from_rotvec(turns)
    local[:, 0] = quat_mul(heading_quat(7 * t[:, 0, 0]), local[:, 0])
    return np.tile((0.0, 0.0, 0.95), (frames, 1)), local


def worst_limb(rig: bpy.types.Object, bone_map: BoneMap, scale: float) -> float:
    """Largest angle, degrees, between a limb as evaluated and as in the motion that was keyed."""
    hips, local = wide_motion()
    world = forward_kinematics(hips, local)[1]
    take, worst = key_take(rig, hips * scale, local), 0.0
    for frame in range(len(hips)):
        bpy.context.scene.frame_set(1 + frame)
        shown = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
        heads = {
            joint: np.array(shown.matrix_world @ shown.pose.bones[bone_map.seen(joint)].head)
            for joint in bone_map.joints
        }
        for upper, lower in LIMBS:
            theirs = heads[lower] - heads[upper]
            ours = quat_rotate(world[frame, INDEX[upper]], OFFSETS[INDEX[lower]].astype(float))
            cosine = theirs @ ours / np.linalg.norm(theirs) / np.linalg.norm(ours)
            worst = max(worst, float(np.degrees(np.arccos(np.clip(cosine, -1, 1)))))
    discard_take(take)
    return worst


def standing_slide(take: Take) -> float:
    """How fast toe joints move over the floor while they are within a centimetre of their lowest, metres of
    the character a second.
    """
    hips, local = (
        np.asarray(a, np.float64) for a in (take.result.hips_position, take.result.local_rotations)
    )
    offsets = Placement.of(take.keyed.armature).own_offsets.astype(np.float64)
    toes = forward_kinematics(hips, local, offsets)[0][:, TOES]
    low = toes[..., 2] < toes[..., 2].min(0) + 0.01
    speed = FPS * np.linalg.norm(np.diff(toes[..., :2], axis=0), axis=-1)
    standing = low[1:] & low[:-1]
    return float(speed[standing].mean()) if standing.any() else 0.0


def under_floor(take: Take) -> float:
    """How deep the character's skin comes under the floor, scene units."""
    deepest, worn = 0.0, skins(take.keyed.armature)
    for frame in range(take.keyed.frame_start, take.keyed.frame_end + 1, EVERY):
        bpy.context.scene.frame_set(frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        for skin in worn:
            shown = skin.evaluated_get(depsgraph)
            places = np.empty(3 * len(shown.data.vertices), np.float32)
            shown.data.vertices.foreach_get("co", places)
            matrix = np.array(shown.matrix_world)
            heights = places.reshape(-1, 3) @ matrix[2, :3] + matrix[2, 3]
            deepest = max(deepest, -float(heights.min()))
    return deepest


def bundled(height: float, arms: float = 1.0, legs: float = 1.0, bulk: float = 1.0) -> bpy.types.Object:
    """The bundled character at a height, metres, with arms and legs as many times as long and a trunk and
    thighs as many times as thick.
    """
    rig = add_character((0, 0, 0), "Character")
    skin = rig.children[0]
    if (arms, legs, bulk) != (1.0, 1.0, 1.0):
        _remade(rig, skin, arms, legs, bulk)
    rig.scale = (height / 1.75,) * 3
    bpy.context.view_layer.update()
    return rig


def _remade(rig: bpy.types.Object, skin: bpy.types.Object, arms: float, legs: float, bulk: float) -> None:
    """Bones and skin with limbs of other lengths, the soles on the floor."""
    times = np.ones((len(JOINTS), 3))
    for chain, axis, share in ((ARMS, 0, arms), (FEET, 2, legs)):
        for limb in chain:
            times[list(limb[:2]), axis] = share
    offsets, old, new = OFFSETS.astype(np.float64), np.zeros((len(JOINTS), 3)), np.zeros((len(JOINTS), 3))
    shorter = (legs - 1) * -offsets[[INDEX["LeftKnee"], INDEX["LeftAnkle"]], 2].sum()
    for j, parent in enumerate(PARENTS):
        if parent < 0:
            old[j], new[j] = offsets[j], offsets[j] + (0, 0, shorter)
        else:
            old[j], new[j] = old[parent] + offsets[j], new[parent] + offsets[j] * times[parent]
    thick = {name: bulk for name in JOINTS if name.startswith(("Hips", "Chest")) or name.endswith("Hip")}
    weights = np.zeros((len(skin.data.vertices), len(JOINTS)))
    for vertex in skin.data.vertices:
        for group in vertex.groups:
            weights[vertex.index, INDEX[skin.vertex_groups[group.group].name]] = group.weight
    places = np.array([v.co for v in skin.data.vertices])
    out = np.zeros_like(places)
    for j, name in enumerate(JOINTS):
        around = times[j] * ((thick.get(name, 1.0),) * 2 + (1.0,))
        out += weights[:, j, None] * (new[j] + around * (places - old[j]))
    skin.data.vertices.foreach_set("co", out.astype(np.float32).reshape(-1))
    skin.data.update()
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for j, name in enumerate(JOINTS):
        bone = rig.data.edit_bones[name]
        way = bone.tail - bone.head
        bone.head = new[j]
        bone.tail = new[j] + np.array(way) * times[j]
    bpy.ops.object.mode_set(mode="OBJECT")
