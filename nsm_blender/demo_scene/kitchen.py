"""A kitchen of ``nsm_core.world.assets.kitchen`` as objects: what opens is an object of its own, whose origin
lies on its axis, under the furniture that it belongs to; light things stand free.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from nsm_core.rotations import Array
from nsm_core.world.assets.kitchen import Kitchen, make_kitchen
from nsm_core.world.assets.tea_kitchen import TEA, tea_kitchen
from nsm_core.world.scene.containers import Container, MovingPart
from nsm_core.world.scene.furniture import box_mesh
from nsm_core.world.scene.small_things import SmallThing

from ..goals.container_points import axis_frame
from ..goals.furniture_parts import OPENS
from .room import DemoRoom, floor, palette
from .solids import link

_BEFORE = 3.2  # metres of floor before the row
_BEVEL = 0.003
# Materials of the palette by the kind of what is made of it.
_BODIES = {
    "fridge": "China",
    "oven": "Metal",
    "worktop": "Walnut",
    "rack": "Oak",
    "table": "Oak",
    "bin": "Oak",
}
_FRONTS = {"fridge": "China", "oven": "Metal", "bin": "Oak", "drawers": "Sage"}
_THINGS = ("Terracotta", "China", "Teal", "Mustard", "Brick Red", "Leaf", "Lamp Shade", "Rug Border")


def build_kitchen(seed: int = 0) -> tuple[DemoRoom, Kitchen]:
    """Build the kitchen of a seed with its floor and wall in the open scene.

    Objects bear the names of the kitchen's containers and things; a moving part bears its container's name
    and its own, "Drawers drawer 2", and tells in ``nsm_opens`` how far (radians or metres) it goes about or
    along its local Z.
    """
    kitchen = tea_kitchen() if seed == TEA else make_kitchen(seed)
    length = max(c.pose[0] + float(c.piece.size[0]) / 2 for c in kitchen.containers.values())
    made = [floor(np.random.default_rng(seed), (-0.6, -_BEFORE), (length + 0.6, 0.0))]
    made.append(_object("Kitchen wall", *box_mesh(kitchen.walls.mins, kitchen.walls.maxs), "Wall"))
    for container in kitchen.containers.values():
        made += _furniture(container)
    for number, standing in enumerate(kitchen.things.values()):
        made.append(_thing(standing.thing, _THINGS[number % len(_THINGS)]))
    room = DemoRoom(
        seats=[],
        start=(length / 2, -1.6),
        start_heading=np.pi,
        objects=[o.name for o in made],
        view=(-0.25, -1.0, 0.38),
        middle=(length / 2, -0.3, 0.95),
        distance=1.25 * length + 0.6,
    )
    return room, kitchen


def _furniture(container: Container) -> list[bpy.types.Object]:
    """What stands of a container, and its moving parts as children."""
    body = _object(
        titled(container.name),
        container.piece.vertices,
        container.piece.triangles,
        _BODIES.get(container.kind, "Skirting"),
    )
    body.matrix_world = _matrix(container.pose)
    _soften(body)
    tone = _FRONTS.get(container.kind, "Door")
    return [body, *(_part(body, container, part, tone) for part in container.parts)]


def _part(body: bpy.types.Object, container: Container, part: MovingPart, tone: str) -> bpy.types.Object:
    """A moving part whose origin lies on its axis and whose Z is the axis, so that one channel opens it."""
    boxes = part.query.groups[0]
    vertices, triangles = box_mesh(boxes.centres - boxes.halves, boxes.centres + boxes.halves)
    frame = axis_frame(part)
    local = (vertices.astype(np.float64) - frame[:3, 3]) @ frame[:3, :3]
    made = _object(f"{titled(container.name)} {part.name}", local, triangles, tone)
    made.parent = body
    made.matrix_basis = Matrix(frame.tolist())
    made[OPENS] = float(part.travel)
    _soften(made)
    return made


def _thing(thing: SmallThing, tone: str) -> bpy.types.Object:
    made = _object(titled(thing.name), *thing.mesh(), tone)
    made.matrix_world = _matrix(thing.pose)
    return made


def _object(name: str, vertices: Array, triangles: Array, tone: str) -> bpy.types.Object:
    """Add a mesh of vertices (V, 3), metres, and triangles (F, 3)."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(vertices).tolist(), [], np.asarray(triangles).tolist())
    mesh.materials.append(palette()[tone])
    mesh.update()
    return link(bpy.data.objects.new(name, mesh))


def _soften(made: bpy.types.Object) -> None:
    bevel = made.modifiers.new("Rounded Edges", "BEVEL")
    bevel.width, bevel.segments, bevel.limit_method = _BEVEL, 2, "ANGLE"


def _matrix(pose: Array) -> Matrix:
    """World matrix of a pose (4,): x, y, z and heading."""
    return Matrix.Translation(pose[:3].tolist()) @ Matrix.Rotation(float(pose[3]), 4, "Z")


def titled(name: str) -> str:
    return name[0].upper() + name[1:]
