"""How long scenes take to be read: a room, the same in centimetres, a chair of 1.2 million triangles, 8,000
copies.

``python nsm_blender/bench_reading.py`` under the bpy wheel, or
``blender --background --python nsm_blender/bench_reading.py``.  For each scene: seconds until a take could
begin, the longest time in which the window could not have been drawn, the same for the next take in the same
scene, milliseconds of one reading of the environment sensor, and memory.  Blender's own evaluation of the
scene is done before.  Ratios to the room hold on other machines.
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path

if not __package__:  # run as a script: make the repository importable and this file part of its package
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    __package__ = "nsm_blender"

import bpy
import numpy as np
from mathutils import Matrix

from nsm_core.world.scene.furniture import make
from nsm_core.world.sensors.environment import environment_sensor

from .demo import build_scene, goals_in
from .goals.spec import GoalSpec
from .prepare import TakeSpec, prepare
from .rigs.character import add_character
from .world import colliders
from .world.solids import READINGS

_COPIES = 8000


def main() -> int:
    """Print the table; the exit code."""
    columns = f"{'first':>8}{'longest':>10}{'again':>8}{'longest':>10}{'sensor':>9}{'memory':>9}{'x room':>8}"
    print(f"{'':34}{columns}")
    room = None
    for name, build in (
        ("room", _room),
        ("room in centimetres", _room_in_centimetres),
        ("chair of 1.2 million triangles", _dense_chair),
        (f"{_COPIES} blades of grass", lambda: _scatter(0.06)),
        (f"{_COPIES} stones, turned and scaled", lambda: _scatter(0.3)),
    ):
        spec = _fresh(build)
        first, longest, sensor = _read(spec)
        again, longest_again, _ = _read(spec)
        room = room or first
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{name:34}{first:6.2f} s{1e3 * longest:7.0f} ms{again:6.2f} s{1e3 * longest_again:7.0f} "
            f"ms{1e3 * sensor:6.2f} ms"
            f"{peak:6.0f} MB{first / room:8.1f}",
            flush=True,
        )
    return 0


def _fresh(build: Callable[[], TakeSpec]) -> TakeSpec:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    READINGS.clear()
    colliders.forget()
    spec = build()
    bpy.context.view_layer.update()
    # Some modifiers are evaluated when first looked at.
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.object.type == "MESH":
            len(instance.object.data.vertices)
    return spec


def _read(spec: TakeSpec) -> tuple[float, float, float]:
    """Seconds in all, seconds of the longest slice, and seconds of a reading of the environment sensor."""
    begun = last = time.perf_counter()
    longest, steps = 0.0, prepare(spec, bpy.context.scene)
    while True:
        try:
            next(steps)
        except StopIteration as stop:
            request = stop.value[0]
            break
        finally:
            now = time.perf_counter()
            longest, last = max(longest, now - last), now
    whole, rng = time.perf_counter() - begun, np.random.default_rng(0)
    places = request.start_position + rng.uniform(-1.5, 1.5, (100, 2))
    environment_sensor(request.environment, places[0], 0.0)
    begun = time.perf_counter()
    for place in places:
        environment_sensor(request.environment, place, 0.0)
    return whole, longest, (time.perf_counter() - begun) / len(places)


def _room() -> TakeSpec:
    room, character = build_scene(None, True)
    return TakeSpec(character, goals_in(room))


def _room_in_centimetres() -> TakeSpec:
    spec = _room()
    scene = bpy.context.scene
    scene.unit_settings.scale_length = 0.01
    for thing in scene.objects:
        if thing.parent is None:
            thing.location, thing.scale = [100 * x for x in thing.location], [100 * x for x in thing.scale]
    return spec


def _chair() -> tuple[bpy.types.Object, bpy.types.Object]:
    piece = make("chair", np.random.default_rng(0))
    mesh = bpy.data.meshes.new("Chair")
    mesh.from_pydata(piece.vertices.tolist(), [], piece.triangles.tolist())
    chair = bpy.data.objects.new("Chair", mesh)
    bpy.context.scene.collection.objects.link(chair)
    return chair, add_character((1.5, -2.0, 0.0))


def _dense_chair() -> TakeSpec:
    chair, character = _chair()
    dense = chair.modifiers.new("Dense", "SUBSURF")
    dense.subdivision_type = "SIMPLE"
    # Three quads of each triangle, then four.
    dense.levels = int(np.ceil(np.log(1.2e6 / len(chair.data.polygons) / 6) / np.log(4))) + 1
    return TakeSpec(character, [GoalSpec("sit", chair)])


def _scatter(height: float) -> TakeSpec:
    """Copies of a small box on a lawn, turned and scaled by geometry nodes; stones lie beside the way."""
    chair, character = _chair()
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0, -5))
    small = bpy.context.object
    small.data.transform(Matrix.Diagonal((0.3 * height, 0.3 * height, height, 1.0)))
    bpy.ops.mesh.primitive_plane_add(size=20, location=(0.0 if height < 0.1 else 12.5, 0, 0))
    lawn = bpy.context.object
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    new = tree.nodes.new
    start, end = new("NodeGroupInput"), new("NodeGroupOutput")
    points, copies = new("GeometryNodeDistributePointsOnFaces"), new("GeometryNodeInstanceOnPoints")
    source, size = new("GeometryNodeObjectInfo"), new("FunctionNodeRandomValue")
    source.inputs["Object"].default_value, source.inputs["As Instance"].default_value = small, True
    points.inputs["Density"].default_value = _COPIES / 400
    size.inputs[2].default_value, size.inputs[3].default_value = 0.5, 1.5
    for a, b in (
        (start.outputs[0], points.inputs["Mesh"]),
        (points.outputs["Points"], copies.inputs["Points"]),
        (points.outputs["Rotation"], copies.inputs["Rotation"]),
        (source.outputs["Geometry"], copies.inputs["Instance"]),
        (size.outputs[1], copies.inputs["Scale"]),
        (copies.outputs[0], end.inputs[0]),
    ):
        tree.links.new(a, b)
    lawn.modifiers.new("Scatter", "NODES").node_group = tree
    return TakeSpec(character, [GoalSpec("sit", chair)])


if __name__ == "__main__":
    sys.exit(main())
