"""The small things that make a room look lived in: plant, lamp, books, a bowl, pictures, a rug."""

from __future__ import annotations

import bpy
import numpy as np

from ..rigs.mannequin.loft import LoftPart, ball, loft
from .solids import add_parts, boxes, link

Materials = dict[str, bpy.types.Material]


PICTURES = (  # x, z, width, height, metres, and colour
    (-0.75, 1.58, 0.46, 0.60, "Brick Red"),
    (-0.12, 1.52, 0.36, 0.48, "Rug Border"),
    (1.75, 1.60, 0.80, 0.55, "Mustard"),
)


def dress(
    materials: Materials,
    rng: np.random.Generator,
    table_top: float,
    cabinet_top: float,
    half_width: float,
    half_depth: float,
) -> list[bpy.types.Object]:
    """Put plant, lamp, pictures and rug into the room and small things on table and cabinet; lengths in
    metres.
    """
    made = [
        rug(materials, (0.1, -0.15), (1.35, 0.95)),
        plant(materials, rng, (-half_width + 0.42, half_depth - 0.45)),
        lamp(materials, (half_width - 0.5, half_depth - 0.4)),
        vase(materials, rng, (0.32, -0.05, table_top)),
        bowl(materials, (-0.22, -0.16, table_top)),
        *books(materials, rng, (0.0, -0.42, table_top)),
        bowl(materials, (-0.75, half_depth - 0.24, cabinet_top)),
        *books(materials, rng, (0.0, half_depth - 0.22, cabinet_top)),
    ]
    for x, z, width, height, tone in PICTURES:
        made += picture(materials, x, half_depth, z, width, height, tone)
    return spare_shadows(made)


def spare_shadows(made: list[bpy.types.Object]) -> list[bpy.types.Object]:
    """Let small things cast no shadows: these are hardly seen, and a fifth of a picture's time without a
    graphics card.
    """
    for small in made:
        if small.name.split(".")[0] not in {"Plant", "Lamp"}:
            small.display.show_shadows = False
    return made


def box(
    name: str,
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    tone: bpy.types.Material,
    bevel: float = 0.0,
) -> bpy.types.Object:
    """Add a box between two corners, metres; its origin lies at the centre of its base."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    base = np.array(((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]))
    vertices, faces = boxes(low, high)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata((vertices - base).tolist(), [], faces)
    mesh.materials.append(tone)
    made = link(bpy.data.objects.new(name, mesh))
    made.location = base
    if bevel:
        modifier = made.modifiers.new("Rounded Edges", "BEVEL")
        modifier.width, modifier.segments = bevel, 2
    return made


def _round(
    profile: list[tuple[float, float]],
    tone: int = 0,
    ring: int = 24,
    caps: tuple[float, float] = (0.002, 0.002),
) -> LoftPart:
    """A turned body from (height, radius) pairs."""
    return loft([(z, 0, 0, r, r, r) for z, r in profile], tone, caps=caps, spacing=0.02, ring=ring)


def rug(materials: Materials, centre: tuple[float, float], half: tuple[float, float]) -> bpy.types.Object:
    """An oval rug, its border in another tone; ``half`` its half axes, metres."""

    def oval(scale: float, height: float, tone: int) -> LoftPart:
        a, b = half[0] * scale, half[1] * scale
        return loft(
            [(0.0, 0, 0, a, b, b), (height, 0, 0, a, b, b)],
            tone,
            caps=(1e-4, 5e-4),
            roundness=(6, 6),
            ring=64,
        )

    return add_parts(
        "Rug",
        [oval(1, 0.004, 0), oval(0.94, 0.005, 1)],
        [materials["Rug Border"], materials["Rug"]],
        (*centre, 0),
    )


def plant(materials: Materials, rng: np.random.Generator, place: tuple[float, float]) -> bpy.types.Object:
    """A plant with long leaves in a pot, knee-high to hip-high."""
    parts = [
        _round([(0.002, 0.12), (0.15, 0.155), (0.30, 0.175), (0.33, 0.185)]),
        _round([(0.325, 0.165), (0.332, 0.165)], 2),
    ]
    for k in range(16):
        turn = k * 2.399 + rng.uniform(-0.2, 0.2)  # the golden angle spreads the leaves
        rise = rng.uniform(0.45, 0.95) * (1 - 0.4 * (k % 4) / 4) + 0.15
        parts.append(_leaf(turn, reach=rng.uniform(0.22, 0.36), rise=rise, width=rng.uniform(0.045, 0.07)))
    return add_parts(
        "Plant", parts, [materials["Terracotta"], materials["Leaf"], materials["Walnut"]], (*place, 0)
    )


def _leaf(turn: float, reach: float, rise: float, width: float) -> LoftPart:
    """A long leaf that grows up and bends outwards; slightly folded along its middle."""
    steps = 12
    t = np.linspace(0, 1, steps)
    out, up = reach * t**1.8, 0.30 + rise * (t - 0.28 * t**3)
    half = width * np.sin(np.pi * np.clip(t, 0.04, 1) ** 1.3) + 0.004
    direction, side = np.array((np.cos(turn), np.sin(turn), 0)), np.array((-np.sin(turn), np.cos(turn), 0))
    middle = out[:, None] * direction + up[:, None] * np.array((0, 0, 1))
    fold = np.array((0, 0, 0.25)) * half[:, None]
    vertices = np.concatenate(
        (middle - side * half[:, None] + fold, middle, middle + side * half[:, None] + fold)
    )
    faces = []
    for strip in (0, steps):
        faces += [
            (strip + i, strip + i + 1, strip + steps + i + 1, strip + steps + i) for i in range(steps - 1)
        ]
    return LoftPart(vertices, faces, 1)


def lamp(materials: Materials, place: tuple[float, float]) -> bpy.types.Object:
    """A standing lamp with a shade."""
    parts = [
        _round([(0.003, 0.15), (0.022, 0.15)], caps=(0.002, 0.008)),
        _round([(0.02, 0.012), (1.35, 0.012)], ring=12),
        _round([(1.28, 0.20), (1.58, 0.135)], 1, ring=40, caps=(0.002, 0.002)),
    ]
    return add_parts("Lamp", parts, [materials["Metal"], materials["Lamp Shade"]], (*place, 0))


def vase(
    materials: Materials, rng: np.random.Generator, place: tuple[float, float, float]
) -> bpy.types.Object:
    """A vase with five flowers."""
    parts = [_round([(0.002, 0.035), (0.05, 0.062), (0.11, 0.055), (0.16, 0.026), (0.19, 0.030)])]
    for k in range(5):
        turn, lean = k * 1.257 + rng.uniform(0, 0.5), rng.uniform(0.02, 0.07)
        tip = np.array((np.cos(turn) * lean, np.sin(turn) * lean, rng.uniform(0.27, 0.36)))
        stem = loft(
            [(0.16, 0, 0, 0.003, 0.003, 0.003), (tip[2], tip[0], tip[1], 0.002, 0.002, 0.002)], 1, ring=6
        )
        parts += [stem, ball(tip, (0.024, 0.024, 0.020), 2, ring=12)]
    return add_parts("Vase", parts, [materials["China"], materials["Leaf"], materials["Brick Red"]], place)


def bowl(materials: Materials, place: tuple[float, float, float]) -> bpy.types.Object:
    """A bowl with three fruits."""
    parts = [_round([(0.002, 0.045), (0.02, 0.085), (0.055, 0.115)], caps=(0.001, -0.035))]
    parts += [
        ball((x, y, 0.062), 0.034, 1, ring=16) for x, y in ((0.035, 0.02), (-0.035, 0.025), (0.002, -0.042))
    ]
    return add_parts("Bowl", parts, [materials["China"], materials["Mustard"]], place)


def books(
    materials: Materials, rng: np.random.Generator, place: tuple[float, float, float]
) -> list[bpy.types.Object]:
    """Three books on top of each other."""
    made, z = [], place[2]
    for k, tone in enumerate(("Rug Border", "Brick Red", "China")):
        size = np.array((0.22 - 0.02 * k, 0.15 - 0.015 * k, rng.uniform(0.018, 0.032)))
        low = (place[0] - size[0] / 2, place[1] - size[1] / 2, z)
        book = box(
            "Book", low, (low[0] + size[0], low[1] + size[1], z + size[2]), materials[tone], bevel=0.003
        )
        book.rotation_euler = (0, 0, rng.uniform(-0.3, 0.3))
        made.append(book)
        z += float(size[2])
    return made


def picture(
    materials: Materials, x: float, wall: float, z: float, width: float, height: float, tone: str
) -> list[bpy.types.Object]:
    """A framed picture on a wall at y ``wall`` that is seen from -Y; ``x``, ``z`` its middle, metres."""

    def panel(name: str, inset: float, depth: float, colour: str) -> bpy.types.Object:
        low = (x - width / 2 + inset, wall - depth, z - height / 2 + inset)
        return box(name, low, (x + width / 2 - inset, wall, z + height / 2 - inset), materials[colour])

    return [
        panel("Frame", 0, 0.022, "Walnut"),
        panel("Mount", 0.02, 0.024, "China"),
        panel("Picture", 0.07, 0.026, tone),
    ]
