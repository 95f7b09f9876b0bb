"""Try the add-on on a folder of rigs and write docs/rigs.md: what is found, and how a walk and a sit end.

    python docs/rigs.py FOLDER [NAME ...]

FOLDER holds .glb, .vrm and .blend files; with names only the files whose name holds one of them are tried.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from nsm_blender.demo_scene.room import place
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.keys.keying import discard_take, key_take
from nsm_blender.leaving import leave
from nsm_blender.prepare import own_objects
from nsm_blender.rigs.armature import Placement
from nsm_blender.rigs.bone_map import BoneMap, require_map
from nsm_blender.takes import Take, TakeSpec, finish, generate
from nsm_core.body.contacts import TOES
from nsm_core.body.skeleton import INDEX, OFFSETS, J, forward_kinematics
from nsm_core.conventions import FPS
from nsm_core.errors import NsmError
from nsm_core.rotations import heading_quat, quat_from_rotvec, quat_mul, quat_rotate
from nsm_core.world.scene.furniture import make

HERE = Path(__file__).resolve().parent
LIMBS = [
    (side + upper, side + lower)
    for side in ("Left", "Right")
    for upper, lower in (("Shoulder", "Elbow"), ("Elbow", "Wrist"), ("Hip", "Knee"), ("Knee", "Ankle"))
]
HEAD = """# Rigs

What `python docs/rigs.py FOLDER` made of a folder of rigs.

- *Size*: metres of the rig to a metre of the network's body, by the height of the hips.
- *Fit*: how well the bones that were found fit a body.
- *Limbs*: largest angle between a limb as evaluated and as in a motion through a wide range of poses.
- *Walk*, *Sit*: whether the goal was reached and by how much it was missed, as seen on the rig's own bones.
- *Slide*: how fast toe joints move that are within a centimetre of their lowest; *Under*: how deep the skin
  comes under the floor while walking.  Lengths are in the scene's centimetres.

| Rig | Bones by | Joints | Fit | Size | Limbs | Walk | Sit | Slide | Under |
|---|---|---|---|---|---|---|---|---|---|
"""


def load(path: Path, scratch: Path) -> list[bpy.types.Object]:
    """Open a file of its own; its armatures."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    if path.suffix == ".blend":
        bpy.ops.wm.open_mainfile(filepath=str(path))
    else:
        copied = scratch / f"{path.stem}.glb"  # a .vrm is a .glb by another name
        shutil.copy(path, copied)
        bpy.ops.import_scene.gltf(filepath=str(copied))
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = 30, 1.0
    for thing in list(bpy.data.objects):
        if thing.type in ("CAMERA", "LIGHT") or thing.name.startswith("Icosphere"):  # shapes of bones
            bpy.data.objects.remove(thing)
    return [thing for thing in bpy.data.objects if thing.type == "ARMATURE"]


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


def walk_and_sit(rig: bpy.types.Object, scale: float) -> Take:
    """A take of a walk and a sit on a chair as large as the rig."""
    chair = place(
        make("chair", np.random.default_rng(90001)), "Chair", (1.3 * scale, -1.6 * scale), 0.6, "Oak", "Teal"
    )
    chair.scale = (scale,) * 3
    bpy.context.view_layer.update()
    goals = [GoalSpec("walk", None, 0.0, (-0.8 * scale, -2.6 * scale, 0.0)), GoalSpec("sit", chair, 1.5)]
    return finish(generate(TakeSpec(rig, goals, name=rig.name), bpy.context.scene))


def under_floor(take: Take) -> float:
    """How deep the character's skin comes under the floor before it sits down, scene units."""
    deepest = 0.0
    for frame in range(take.keyed.frame_start, take.result.goals[0].end_frame, 4):
        bpy.context.scene.frame_set(frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        for own in own_objects(take.keyed.armature, bpy.context.scene):
            if own.type == "MESH":
                shown = own.evaluated_get(depsgraph)
                mesh = shown.to_mesh()
                places = np.empty(3 * len(mesh.vertices), np.float32)
                mesh.vertices.foreach_get("co", places)
                shown.to_mesh_clear()
                matrix = np.array(shown.matrix_world)
                heights = places.reshape(-1, 3) @ matrix[2, :3] + matrix[2, 3]
                deepest = max(deepest, -float(heights.min()))
    return deepest


def standing_slide(take: Take, placement: Placement) -> float:
    """How fast toe joints move over the floor while they are within a centimetre of their lowest, cm/s."""
    hips, local = take.result.hips_position.astype(np.float64), take.result.local_rotations.astype(np.float64)
    toes = forward_kinematics(hips, local, placement.own_offsets.astype(np.float64))[0][:, TOES]
    low = toes[..., 2] < toes[..., 2].min(0) + 0.01
    speed = 100 * FPS * np.linalg.norm(np.diff(toes[..., :2], axis=0), axis=-1)
    return float(speed[low[1:] & low[:-1]].mean())


def row(path: Path, rig: bpy.types.Object) -> str:
    """One line of the table."""
    try:
        bone_map, scale = require_map(rig), Placement.of(rig).scale
        found = f"{bone_map.family} | {len(bone_map.joints)} of {J} | {bone_map.score:.2f} | {scale:.2f}"
        limbs = worst_limb(rig, bone_map, scale)
        take = walk_and_sit(rig, scale)
        report, under = take.report, 100 * under_floor(take)
    except NsmError as error:
        return f"| {path.name} {rig.name} | {error} | | | | | | | | |"
    ends = [
        f"{'yes' if goal['reached'] else 'no'}, {goal['position_error_cm'] * scale:.1f} cm"
        for goal in report["goals"]
    ]
    slide = standing_slide(take, Placement.of(rig)) * scale
    return (
        f"| {path.name} {rig.name} | {found} | {limbs:.1f}° | {' | '.join(ends)} | {slide:.1f} cm/s | "
        f"{under:.1f} cm |"
    )


def main(folder: str, *names: str) -> None:
    """Try every rig and write the table."""
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        for path in sorted(Path(folder).iterdir()):
            if (
                path.suffix not in (".glb", ".vrm", ".blend")
                or names
                and not any(n in path.name for n in names)
            ):
                continue
            for number in range(len(load(path, Path(scratch)))):
                rigs = load(path, Path(scratch))
                for other in rigs[:number] + rigs[number + 1 :]:
                    bpy.data.objects.remove(other)
                rows.append(row(path, rigs[number]))
                print(rows[-1], flush=True)
    (HERE / "rigs.md").write_text(HEAD + "\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
    sys.stdout.flush()
    leave(0)
