"""Two rooms with a door between them, by code: a place for every action, one after the other."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np

from nsm_core.world.scene import furniture

from ..goals.spec import GoalSpec
from . import door_parts, room_props
from .room import DemoRoom, floor, ladder_chair, palette, place

LEFT, RIGHT, HALF_DEPTH, HEIGHT = -4.3, 6.3, 2.6, 2.5  # metres; the wall with the door stands at x = 0
WALL = 0.12  # its thickness
PIER, PARAPET = 0.2, 0.85  # of it beside the door, and the height of the rest towards the front
HINGE = (WALL / 2, 0.43)  # the door opens into the right room
LOW_TABLE, SIDEBOARD = 0.44, 0.82  # heights
BOX = (0.38, 0.29, 0.25)


@dataclass
class House(DemoRoom):
    """A room with all that a take of every action needs; ``goals`` are what to do, in their order."""

    goals: list[GoalSpec] = field(default_factory=list)


def build_house(seed: int = 7) -> House:
    """Build a living room and, behind a door, a studio: a chair to sit on, a box to carry to a sideboard, a
    podium, and room to run.
    """
    rng = np.random.default_rng(seed)
    house = House(
        seats=["Chair"], start=(-1.2, -1.95), start_heading=np.radians(-60), view=(0.06, -1.0, 0.68)
    )
    house.middle, house.distance = (0.85, -0.15, 0.7), 11.0
    made = [floor(rng, (LEFT, -HALF_DEPTH), (RIGHT, HALF_DEPTH)), *_walls()]
    made += _living_room(rng)
    made += _studio(rng)
    bpy.context.view_layer.update()
    # A file that has a chair already gives this one another name.
    things = {o.name.split(".")[0]: o for o in reversed(made)}
    house.goals = [
        GoalSpec("sit", things["Chair"]),
        GoalSpec("open", things["Door"], hold=0.3),
        GoalSpec("carry", things["Box"], hold=0.5, to=things["Sideboard"]),
        GoalSpec("climb", things["Podium"], hold=1.5),
        GoalSpec("run", location=(0.95, -1.95, 0.0), hold=1.0),
    ]
    house.objects = [o.name for o in made]
    return house


def _living_room(rng: np.random.Generator) -> list[bpy.types.Object]:
    tones = palette()
    table = furniture.make("table", rng, width=1.25, depth=0.78, height=0.74, legs="posts")
    chair = ladder_chair(rng)
    cabinet = furniture.make("cabinet", rng, width=1.3, depth=0.42, height=0.8)
    shelf = furniture.make("shelf", rng, width=0.9, depth=0.3, height=1.75)
    made = [
        place(table, "Table", (-2.15, -0.35), np.radians(8), "Oak", "Oak"),
        place(chair, "Chair", (-3.25, 0.75), np.radians(58), "Walnut", "Mustard"),
        place(cabinet, "Cabinet", (-1.75, HALF_DEPTH - 0.24), 0.0, "Oak", "Oak"),
        place(shelf, "Shelf", (LEFT + 0.18, -0.9), np.radians(90), "Walnut", "Walnut"),
    ]
    small = [
        room_props.rug(tones, (-2.15, -0.35), (1.35, 0.95)),
        room_props.plant(tones, rng, (LEFT + 0.45, HALF_DEPTH - 0.5)),
        room_props.vase(tones, rng, (-1.95, -0.25, 0.74)),
        room_props.bowl(tones, (-2.5, -0.4, 0.74)),
        room_props.bowl(tones, (-2.15, HALF_DEPTH - 0.24, 0.8)),
        *room_props.books(tones, rng, (-1.4, HALF_DEPTH - 0.22, 0.8)),
        *room_props.picture(tones, -2.1, HALF_DEPTH, 1.58, 0.46, 0.60, "Brick Red"),
        *room_props.picture(tones, -1.45, HALF_DEPTH, 1.52, 0.36, 0.48, "Rug Border"),
    ]
    return made + room_props.spare_shadows(small)


def _studio(rng: np.random.Generator) -> list[bpy.types.Object]:
    tones = palette()
    low = furniture.make("table", rng, width=1.05, depth=0.46, height=LOW_TABLE, legs="posts")
    side = furniture.make("table", rng, width=1.5, depth=0.5, height=SIDEBOARD, legs="sides")
    bench = furniture.make("bench", rng, seat_height=0.44, width=1.2, depth=0.36, back=False, legs="sides")
    # Whoever takes the box from the left of the low table and brings it to the right wall is seen from the
    # side.
    low_x, low_y, side_y = 2.55, HALF_DEPTH - 0.57, 1.15
    edge = low_x - 0.23 + 0.03
    made = [
        place(low, "Low Table", (low_x, low_y), np.radians(-90), "Walnut", "Walnut"),
        place(side, "Sideboard", (RIGHT - 0.32, side_y), np.radians(-90), "Oak", "Oak"),
        place(bench, "Bench", (4.25, HALF_DEPTH - 0.3), 0.0, "Walnut", "Teal"),
        room_props.box("Podium", (4.05, -1.15, 0), (5.45, -0.35, 0.3), tones["Rug Border"], bevel=0.008),
        _box_to_carry(tones, (edge + BOX[1] / 2, low_y - 0.22, LOW_TABLE), np.radians(-88)),
    ]
    small = [
        room_props.box("Podium Edge", (4.045, -1.155, 0.262), (5.455, -0.345, 0.288), tones["Brass"]),
        room_props.box("Podium Foot", (4.044, -1.156, 0.0), (5.456, -0.344, 0.05), tones["Walnut"]),
        room_props.rug(tones, (3.3, -1.95), (2.5, 0.38)),
        room_props.lamp(tones, (3.25, HALF_DEPTH - 0.3)),
        room_props.plant(tones, rng, (RIGHT - 0.45, HALF_DEPTH - 0.4)),
        room_props.vase(tones, rng, (RIGHT - 0.2, side_y + 0.58, SIDEBOARD)),
        *room_props.books(tones, rng, (low_x + 0.02, low_y + 0.3, LOW_TABLE)),
        *room_props.picture(tones, 2.45, HALF_DEPTH, 1.55, 0.62, 0.78, "Sage"),
        *room_props.picture(tones, 4.0, HALF_DEPTH, 1.62, 0.40, 0.52, "Teal"),
        *room_props.picture(tones, 4.7, HALF_DEPTH, 1.62, 0.62, 0.46, "Mustard"),
    ]
    for trim in small[:2]:
        trim["nsm_collider"] = False  # a finger's breadth of moulding, which no foot needs to know of
    return made + room_props.spare_shadows(small)


def _box_to_carry(
    tones: dict[str, bpy.types.Material], base: tuple[float, float, float], turn: float
) -> bpy.types.Object:
    """A parcel with a strip of tape, its origin in the middle of its base."""
    half = np.array(BOX) / 2
    box = room_props.box(
        "Box", (-half[0], -half[1], 0), (half[0], half[1], BOX[2]), tones["Cardboard"], bevel=0.006
    )
    strips = (
        ((-0.025, -half[1] - 0.001, BOX[2] - 0.08), (0.025, half[1] + 0.001, BOX[2] + 0.001)),
        ((-0.025, -half[1] - 0.001, -0.0), (0.025, half[1] + 0.001, 0.06)),
    )
    for low, high in strips:
        tape = room_props.box("Tape", low, high, tones["Tape"])
        tape.parent = box
        tape.location = (0, 0, low[2])
    box.location, box.rotation_euler = base, (0, 0, turn)
    return box


def _walls() -> list[bpy.types.Object]:
    """Back and side wall, the wall between the rooms with its door, and skirting boards."""
    tones, d, h, t = palette(), HALF_DEPTH, HEIGHT, 0.1
    turn = np.radians(-90)  # the leaf lies along -Y and opens towards +X
    low, high = HINGE[1] - door_parts.OPENING[1], HINGE[1] - door_parts.OPENING[0]
    top = door_parts.HEIGHT + door_parts.GAP + door_parts.LINING
    x = WALL / 2
    # Its front part is no higher than a table, so that one sees both rooms.
    between = [((-x, -d, 0), (x, low - PIER, PARAPET)), ((-x, low - PIER, 0), (x, low, h))]
    between += [((-x, high, 0), (x, d, h)), ((-x, low, top), (x, high, h))]
    made = [
        room_props.box("Wall Back", (LEFT - t, d, 0), (RIGHT, d + t, h), tones["Wall"]),
        room_props.box("Wall Side", (LEFT - t, -d, 0), (LEFT, d, h), tones["Sage"]),
        *(room_props.box("Wall Between", *corners, tones["Sage"]) for corners in between),
        door_parts.add_frame(tones, "Door Frame", HINGE, turn, (-WALL, 0.0)),
        door_parts.add_leaf(tones, "Door", HINGE, turn),
    ]
    edge = door_parts.CASING
    boards = [
        ((LEFT, d - 0.015, 0), (-x, d, 0.09)),
        ((x, d - 0.015, 0), (RIGHT, d, 0.09)),
        ((LEFT, -d, 0), (LEFT + 0.015, d - 0.015, 0.09)),
    ]
    for x0, x1 in ((-x - 0.015, -x), (x, x + 0.015)):
        boards += [((x0, -d, 0), (x1, low - edge, 0.09)), ((x0, high + edge, 0), (x1, d - 0.015, 0.09))]
    return made + [room_props.box("Skirting", *corners, tones["Skirting"]) for corners in boards]
