"""How fast takes are in Blender, on one core: a room of 100,000 triangles in which things move.

``python nsm_blender/bench_takes.py [--json FILE]`` under the bpy wheel.  Printed, and added to the file: the
processor's time from the click to the keys, of the first take of a session and of the next, scaled to ten
seconds; milliseconds a frame by stage; sensing beside a loop over the spheres in Python, keying beside one
``keyframe_insert`` a bone and frame; memory beside Blender; and the command line's take, of which Blender's
own start is told apart.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

if not __package__:  # run as a script: make the repository importable and this file part of its package
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    __package__ = "nsm_blender"

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from nsm_core.conventions import DT
from nsm_core.evaluation.speed.clock import median_ms
from nsm_core.evaluation.speed.record import add
from nsm_core.rotations import Array
from nsm_core.world.sensors.environment import SPHERE_RADIUS, environment_points_world, environment_sensor

from .leaving import leave
from .world.bvh_query import BVHQuery

ROOT = Path(__file__).resolve().parents[1]
_TRIANGLES = 100_000
_TEN = 10.0  # seconds of motion that times are told for
_JOB = """scene = "room.blend"
[[take]]
name = "sit"
goals = [ { object = "Chair", action = "sit", hold = 1.0 } ]
out = "sit.blend"
"""
_START = "import bpy, sys; from nsm_blender.leaving import leave; leave(0)"


def main(arguments: Sequence[str]) -> int:
    """Print the figures and add them to a file; the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", help="file that the figures are added to")
    options = parser.parse_args(arguments)
    alone = resident_mb()
    character, chair = build(_TRIANGLES)
    scene = resident_mb()
    told, ratios = take_twice(character, chair)
    told["memory_mb"] = {"blender": alone, "scene": scene - alone, "with_two_takes": resident_mb() - scene}
    ratios["memory_beside_blender_mb"] = resident_mb() - scene
    with tempfile.TemporaryDirectory() as folder:
        whole, start = command_line(Path(folder), told["take"]["frames"] * DT)
    told["command_line_s"] = {"whole": whole, "of_which_blender_starts": start}
    ratios["command_line_10_s_take_s"] = whole
    print("\nin Blender, on one core")
    for name, value in told["take"].items():
        print(f"  {name:34s}{value:12.4g}")
    print(f"  {'command line, Blender alone, s':34s}{start:12.4g}")
    add(options.json, "blender", told, ratios)
    return 0


def resident_mb() -> float:
    """Most memory that this process has held so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def build(triangles: int) -> tuple[bpy.types.Object, bpy.types.Object]:
    """The demo's room, its furniture subdivided to so many triangles in all, and a cart that rolls by; the
    character and the chair.
    """
    from .demo_scene.room import build_room
    from .rigs.character import add_character

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    room = build_room()
    character = add_character((*room.start, 0.0))
    character.rotation_euler.z = room.start_heading
    bpy.ops.mesh.primitive_cube_add(size=0.5, location=(-1.6, 1.2, 0.3))
    cart = bpy.context.object
    cart.name = "Cart"
    for frame, x in ((1, -1.6), (300, -0.6)):
        cart.location.x = x
        cart.keyframe_insert("location", frame=frame)
    seats = [bpy.data.objects[name] for name in room.seats]
    for seat in seats:
        dense = seat.modifiers.new("Dense", "SUBSURF")
        dense.subdivision_type = "SIMPLE"
        dense.levels, before = 0, triangles_in(bpy.context.scene)
        while triangles_in(bpy.context.scene) < before + triangles / len(seats) / 4:
            dense.levels += 1
    bpy.context.view_layer.update()
    return character, seats[0]


def take_twice(character: bpy.types.Object, chair: bpy.types.Object) -> tuple[dict, dict[str, float]]:
    """Figures of two takes one after the other, and the ratios that hold on other machines."""
    scene, begun = bpy.context.scene, time.process_time()
    from .goals.spec import GoalSpec
    from .keys.keying import discard_take, key_take
    from .prepare import TakeSpec, prepare
    from .progress import finish
    from .takes import generate, shipped_model

    spec = TakeSpec(character, [GoalSpec("sit", chair, hold=1.0)])
    seconds, takes = [], []
    for _ in range(2):
        takes.append(finish(generate(spec, scene)))
        seconds.append(time.process_time() - begun)
        begun = time.process_time()
        if len(takes) < 2:
            discard_take(takes[-1].keyed)
            begun = time.process_time()
    from nsm_core.evaluation.speed.takes import timed_take

    take = takes[-1]
    discard_take(take.keyed)
    count, length = len(take.result.root), len(take.result.root) * DT
    request, frame, _ = finish(prepare(spec, scene))
    with_solver = timed_take(shipped_model(), request)[1]
    hips = frame.to_world(take.result.hips_position)

    keying = []
    for _ in range(5):
        at = time.thread_time()
        keyed = key_take(character, hips, take.result.local_rotations)
        keying.append(1000 * (time.thread_time() - at) / count)
        discard_take(keyed)
    walked = key_take(character, hips, take.result.local_rotations)
    filling = fill_s(character)
    discard_take(walked)
    keying, inserted = float(np.median(keying)), keyframe_insert_ms(character, take.result.local_rotations)
    sensing, loop = sensing_ms(request.environment, take.result.root)
    frame_ms = sum(with_solver.values()) + keying
    told = {
        "triangles": float(triangles_in(scene)),
        "frames": float(count),
        "first_take_10_s_cpu_s": seconds[0] * _TEN / length,
        "next_take_10_s_cpu_s": seconds[1] * _TEN / length,
        **{f"{name}_ms": value for name, value in with_solver.items()},
        "keying_ms": keying,
        "keyframe_insert_ms": inserted,
        "frame_ms": frame_ms,
        "environment_sensor_ms": sensing,
        "environment_sensor_in_a_loop_ms": loop,
        "fill_of_60_frames_in_blender_s": filling,
    }
    return {"take": told}, {
        "sensing_ms": with_solver["sensing"],
        "real_time_over_frame_in_blender": 1000 * DT / frame_ms,
        "sensing_over_python_loop": sensing / loop,
        "keying_over_keyframe_insert": keying / inserted,
        "real_time_over_fill_in_blender": 60 * DT / filling,
        "first_take_over_second": seconds[0] / seconds[1],
        "ten_seconds_after_click_s": told["next_take_10_s_cpu_s"],
    }


def fill_s(character: bpy.types.Object) -> float:
    """The processor's seconds from Fill to the keys of two seconds in the middle of what a character plays,
    the network loaded and the file's meshes as they are.
    """
    from .fill.fill import fill_gap
    from .fill.spec import FillSpec
    from .keys.keying import discard_take
    from .progress import finish

    first, last = (round(frame) for frame in character.animation_data.action.frame_range)
    fps = bpy.context.scene.render.fps / bpy.context.scene.render.fps_base
    start = (first + last) // 2 - round(fps)
    spec, taken = FillSpec(character, start, start + round(61 * DT * fps), replace=True), []
    for _ in range(4):
        begun = time.process_time()
        done = finish(fill_gap(spec, bpy.context.scene))
        taken.append(time.process_time() - begun)
        discard_take(done.keyed)
    return float(np.median(taken[1:]))


def keyframe_insert_ms(character: bpy.types.Object, local: Array) -> float:
    """Milliseconds a frame of posing as many bones as there are joints, (T, 23, 4), and keying each by
    ``keyframe_insert``.
    """
    before = character.animation_data.action if character.animation_data else None
    character.animation_data_create().action = bpy.data.actions.new("Inserted")
    bones = list(character.pose.bones)[: local.shape[1]]
    begun = time.thread_time()
    for frame, turns in enumerate(local.tolist()):
        for bone, turn in zip(bones, turns, strict=False):
            bone.rotation_quaternion = turn
            bone.keyframe_insert("rotation_quaternion", frame=frame)
        bones[0].keyframe_insert("location", frame=frame)
    spent = time.thread_time() - begun
    bpy.data.actions.remove(character.animation_data.action)
    character.animation_data.action = before
    return 1000 * spent / len(local)


def sensing_ms(query: BVHQuery, root: Array) -> tuple[float, float]:
    """Milliseconds of one reading of the environment sensor along a way (T, 3), and of the same by a loop
    that asks a tree of all triangles for each sphere.
    """
    vertices = np.concatenate([s.vertices for s in query.solids])
    ends = np.cumsum([0, *(len(s.vertices) for s in query.solids)])
    faces = np.concatenate([s.reading.triangles + e for s, e in zip(query.solids, ends[:-1], strict=True)])
    tree = BVHTree.FromPolygons(vertices.tolist(), faces.tolist(), all_triangles=True)
    up = Vector((0.0, 0.0, 1.0))

    def looped(place: Array) -> Array:
        out = np.zeros(1408)
        for i, point in enumerate(environment_points_world(place[:2], float(place[2])).tolist()):
            distance = tree.find_nearest(point, SPHERE_RADIUS)[3]
            if distance is not None:
                _, normal, _, _ = tree.ray_cast(point, up)
                inside = normal is not None and normal.z > 0
                out[i] = 1.0 if inside else 1 - distance / SPHERE_RADIUS
        return out

    places = root[:: max(1, len(root) // 20)]
    return tuple(
        float(np.mean([median_ms(lambda p=p, read=read: read(p), 3) for p in places]))
        for read in (lambda p: environment_sensor(query, p[:2], float(p[2])), looped)
    )


def triangles_in(scene: bpy.types.Scene) -> int:
    """Triangles of what a scene shows, evaluated."""
    bpy.context.view_layer.update()
    depsgraph, total = bpy.context.evaluated_depsgraph_get(), 0
    for each in scene.objects:
        if each.type == "MESH":
            mesh = each.evaluated_get(depsgraph).data
            mesh.calc_loop_triangles()
            total += len(mesh.loop_triangles)
    return total


def command_line(folder: Path, length: float) -> tuple[float, float]:
    """Seconds of the processor of a take of ``length`` seconds by the command line, what is not Blender's
    start scaled to ten, and of that start alone.
    """
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "room.blend"), copy=True)
    (folder / "job.toml").write_text(_JOB, encoding="utf-8")
    batch = [sys.executable, str(ROOT / "nsm_blender" / "batch.py"), str(folder / "job.toml")]
    whole = spent(lambda: subprocess.run(batch, check=True, capture_output=True, cwd=ROOT))
    start = spent(lambda: subprocess.run([sys.executable, "-c", _START], check=True, cwd=ROOT))
    return start + (whole - start) * _TEN / length, start


def spent(work: Callable[[], object]) -> float:
    """Seconds of the processor that the processes which ``work`` starts and waits for have used."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    work()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    leave(main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]))
