"""A furnished room by code: something to walk around, something to sit on, and nothing to download."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np

from nsm_core.rotations import Array
from nsm_core.world.scene import furniture
from nsm_core.world.scene.furniture import Furniture

from ..rigs.mannequin.build import material
from . import room_props
from .solids import boxes, link

# Linear RGB and roughness.
PALETTE = {
    "Oak": ((0.56, 0.36, 0.19), 0.5),
    "Walnut": ((0.20, 0.105, 0.055), 0.45),
    "Mustard": ((0.72, 0.40, 0.075), 0.9),
    "Teal": ((0.07, 0.235, 0.25), 0.9),
    "Wall": ((0.80, 0.78, 0.73), 0.9),
    "Sage": ((0.40, 0.50, 0.43), 0.9),
    "Skirting": ((0.90, 0.89, 0.86), 0.6),
    "Plank A": ((0.52, 0.43, 0.35), 0.6),
    "Plank B": ((0.48, 0.39, 0.31), 0.6),
    "Plank C": ((0.56, 0.47, 0.385), 0.6),
    "Rug": ((0.69, 0.66, 0.60), 1.0),
    "Rug Border": ((0.155, 0.22, 0.29), 1.0),
    "Leaf": ((0.075, 0.25, 0.085), 0.6),
    "Terracotta": ((0.50, 0.185, 0.10), 0.8),
    "Lamp Shade": ((0.93, 0.83, 0.60), 0.8),
    "Metal": ((0.075, 0.075, 0.08), 0.3),
    "China": ((0.87, 0.87, 0.85), 0.2),
    "Brick Red": ((0.43, 0.07, 0.05), 0.7),
    "Door": ((0.80, 0.79, 0.75), 0.4),
    "Brass": ((0.62, 0.42, 0.14), 0.3),
    "Cardboard": ((0.50, 0.33, 0.18), 0.9),
    "Tape": ((0.72, 0.58, 0.36), 0.5),
}
HALF_WIDTH, HALF_DEPTH, HEIGHT = 3.1, 2.6, 2.5  # metres


@dataclass
class DemoRoom:
    """What the demo needs to know of its room."""

    seats: list[str]
    start: tuple[float, float]  # where the character stands, metres
    start_heading: float
    objects: list[str] = field(default_factory=list)
    # From the room towards the camera, past its open sides.
    view: tuple[float, float, float] = (0.62, -1.0, 0.62)
    # What the camera of the whole room looks at, metres.
    middle: tuple[float, float, float] = (-0.1, 0.1, 0.7)
    distance: float = 8.0  # of that camera, metres


def build_room(seed: int = 7, second_seat: str = "armchair") -> DemoRoom:
    """Build floor, two walls and furniture; "Chair" stands 4 m from the start with the table between them.

    ``second_seat`` is the kind of furniture of the other seat, which bears that name with a capital letter.
    """
    rng = np.random.default_rng(seed)
    room = DemoRoom(
        seats=["Chair", second_seat.capitalize()], start=(1.75, -1.35), start_heading=np.radians(-55)
    )
    made = [floor(rng, (-HALF_WIDTH, -HALF_DEPTH), (HALF_WIDTH, HALF_DEPTH)), *_walls()]
    table = furniture.make("table", rng, width=1.35, depth=0.8, height=0.74, legs="posts")
    made.append(place(table, "Table", (0.1, -0.15), np.radians(8), "Oak", "Oak"))
    chair = ladder_chair(rng)
    made.append(place(chair, "Chair", (-1.72, 0.62), np.radians(63), "Walnut", "Mustard"))
    made.append(
        place(_second_seat(second_seat, rng), room.seats[1], (1.75, 1.72), np.radians(-18), "Walnut", "Teal")
    )
    cabinet = furniture.make("cabinet", rng, width=1.3, depth=0.42, height=0.8)
    made.append(place(cabinet, "Cabinet", (-0.35, HALF_DEPTH - 0.24), 0.0, "Oak", "Oak"))
    shelf = furniture.make("shelf", rng, width=0.9, depth=0.3, height=1.75)
    made.append(place(shelf, "Shelf", (-HALF_WIDTH + 0.18, -0.9), np.radians(90), "Walnut", "Walnut"))
    made += room_props.dress(
        palette(), rng, table_top=0.74, cabinet_top=0.8, half_width=HALF_WIDTH, half_depth=HALF_DEPTH
    )
    room.objects = [o.name for o in made]
    return room


def palette() -> dict[str, bpy.types.Material]:
    """The room's materials by name, made where they are missing."""
    return {name: material(f"NSM {name}", colour, roughness) for name, (colour, roughness) in PALETTE.items()}


def place(
    piece: Furniture,
    name: str,
    position: tuple[float, float],
    heading: float,
    wood: str,
    soft: str,
    bevel: float = 0.009,
) -> bpy.types.Object:
    """Add a piece of furniture as an object with rounded edges: ``position`` (2,) metres, ``heading``
    radians.
    """
    mesh = bpy.data.meshes.new(name)
    vertices, faces = boxes(piece.mins, piece.maxs)
    mesh.from_pydata(vertices.tolist(), [], faces)
    materials = palette()
    mesh.materials.append(materials[wood])
    mesh.materials.append(materials[soft])
    upholstered = [_is_soft(piece, low, high) for low, high in zip(piece.mins, piece.maxs, strict=True)]
    mesh.polygons.foreach_set("material_index", np.repeat(upholstered, 6).astype(np.intc))
    mesh.update()
    made = link(bpy.data.objects.new(name, mesh))
    made.location = (*position, 0)
    made.rotation_euler = (0, 0, heading)
    modifier = made.modifiers.new("Rounded Edges", "BEVEL")
    modifier.width = bevel
    modifier.segments = 3
    modifier.limit_method = "ANGLE"
    modifier.harden_normals = False
    return made


def _second_seat(kind: str, rng: np.random.Generator) -> Furniture:
    measures = {
        "armchair": {"seat_height": 0.42, "width": 0.58, "depth": 0.54, "back_height": 0.48},
        "sofa": {"seat_height": 0.42, "depth": 0.56},
        "bench": {"seat_height": 0.44, "width": 1.1, "depth": 0.4},
        "stool": {"seat_height": 0.5},
    }
    return furniture.make(kind, rng, **measures.get(kind, {}))


def _is_soft(piece: Furniture, low: Array, high: Array) -> bool:
    """Whether a box of a seat is its seat plate or its back rest."""
    if piece.seat is None:
        return False
    size = high - low
    seat = abs(high[2] - piece.seat.height) < 0.01 and size[0] * size[1] > 0.05
    back = low[2] > piece.seat.height - 0.02 and size[0] > 0.3 and size[1] < 0.3
    return bool(seat or back)


def ladder_chair(rng: np.random.Generator) -> furniture.Furniture:
    """The chair at the tables of both scenes."""
    return furniture.make(
        "chair",
        rng,
        seat_height=0.45,
        width=0.46,
        depth=0.44,
        back_height=0.46,
        thickness=0.035,
        legs="posts",
        back_style="ladder",
    )


def floor(rng: np.random.Generator, low: tuple[float, float], high: tuple[float, float]) -> bpy.types.Object:
    """Planks in three tones, along X, between two corners (2,), metres; the surface lies at z = 0."""
    vertices, faces, tones = [], [], []
    width = 0.13
    for row in range(int(np.ceil((high[1] - low[1]) / width))):
        y0 = low[1] + row * width
        y1 = min(y0 + width, high[1])
        x = low[0] - rng.uniform(0, 1.2)
        while x < high[0]:
            end = x + rng.uniform(1.0, 1.8)
            a, b = max(x, low[0]), min(end, high[0])
            if b > a:
                faces.append(tuple(range(len(vertices), len(vertices) + 4)))
                vertices += [(a, y0, 0), (b, y0, 0), (b, y1, 0), (a, y1, 0)]
                tones.append(int(rng.integers(3)))
            x = end
    mesh = bpy.data.meshes.new("Floor")
    mesh.from_pydata(vertices, [], faces)
    for name in ("Plank A", "Plank B", "Plank C"):
        mesh.materials.append(palette()[name])
    mesh.polygons.foreach_set("material_index", np.array(tones, np.intc))
    mesh.update()
    made = link(bpy.data.objects.new("Floor", mesh))
    made["nsm_collider"] = False  # one walks on it
    return made


def _walls() -> list[bpy.types.Object]:
    w, d, h, t = HALF_WIDTH, HALF_DEPTH, HEIGHT, 0.1
    back = room_props.box("Wall Back", (-w - t, d, 0), (w, d + t, h), palette()["Wall"])
    side = room_props.box("Wall Side", (-w - t, -d, 0), (-w, d, h), palette()["Sage"])
    skirting = palette()["Skirting"]
    return [
        back,
        side,
        room_props.box("Skirting Back", (-w, d - 0.015, 0), (w, d, 0.09), skirting),
        room_props.box("Skirting Side", (-w, -d, 0), (-w + 0.015, d - 0.015, 0.09), skirting),
    ]
