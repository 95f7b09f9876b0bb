"""Overlays of what is known before a take: what is solid, the goals, and the ways to them."""

from __future__ import annotations

import bpy
import numpy as np

from nsm_core.rotations import Array, heading_to_direction
from nsm_core.world.actions import Aim, require_action

from ..goals.registry import FINDERS
from ..outlook import GoalOutlook, Outlook, placed_now
from ..world.ground import is_ground
from ..world.solids import Solid
from . import colours
from .shapes import Shapes, box_corners

_MOST_FACES = 120_000  # of one object that is drawn face by face, and of all together twice as many
_SHARP = np.cos(np.radians(30))  # edges between faces that turn by more are drawn
_STIRRED = 1e-5  # of a matrix: what has changed by more has moved
_OFF = 0.004  # metres by which faces are drawn off what they show, and lines over the floor


def colliders(seen: Outlook) -> Shapes:
    """What characters walk around, and what they step on; of very dense objects the box around them."""
    shapes, left = Shapes(), 2 * _MOST_FACES
    for solid in sorted(seen.around.solids, key=lambda s: len(s.triangles)):
        face, edge = (
            (colours.WALKED_ON, colours.WALKED_ON_EDGE)
            if is_ground(solid)
            else (colours.SOLID, colours.SOLID_EDGE)
        )
        count = len(solid.triangles)
        if count > min(_MOST_FACES, left):
            low, high = solid.reading.low, solid.reading.high
            corners = box_corners(
                solid.size * (high - low),
                solid.size * (solid.turn @ ((low + high) / 2)) + solid.origin,
                solid.turn,
            )
            shapes.add_boxes(seen.frame.to_world(corners)[None], None, edge)
        else:
            left -= count
            _add_mesh(shapes, solid, seen, face, edge)
        shapes.owners.append((solid.owner, len(shapes.triangles), len(shapes.lines)))
    return shapes


def followed(shapes: Shapes, seen: Outlook, scene: bpy.types.Scene) -> Shapes:
    """What was made of ``seen``, with what has been moved since where it is at the scene's frame."""
    now = placed_now(scene, {name for name, *_ in shapes.owners})
    moves = {
        name: now[name] @ np.linalg.inv(then)
        for name, then in seen.placed.items()
        if name in now and np.abs(now[name] - then).max() > _STIRRED and abs(np.linalg.det(then)) > 1e-12
    }
    return shapes.moved(moves) if moves else shapes


def goals(seen: Outlook, only: GoalOutlook | None = None) -> Shapes:
    """Where each goal was found, or ``only`` one, its number and its action; red on what cannot be done."""
    shapes = Shapes()
    for number, told in enumerate(seen.goals, 1):
        if only is not None and told is not only:
            continue
        goal, colour = told.goal, colours.LOST if told.problem else colours.GOAL
        action = require_action(told.spec.action)
        text = f"{number} {action.label}"
        if goal is None or told.problem:
            if told.place is not None:
                shapes.words.append((told.place, f"{text}: cannot be reached", colour))
            continue
        place = np.array(goal.position, dtype=np.float64)
        place[2] -= FINDERS[goal.action].under(goal)
        if goal.prop is not None:
            volume = goal.prop.sensed()
            turn = turned(volume.heading)
            shapes.add_boxes(
                seen.frame.to_world(box_corners(volume.size, volume.centre, turn))[None], None, colour
            )
        if action.aim is Aim.HERE:
            continue
        ahead = place + 0.35 * np.append(heading_to_direction(np.array(goal.heading)), 0.0)
        at, end = seen.frame.to_world(place + (0, 0, _OFF)), seen.frame.to_world(ahead + (0, 0, _OFF))
        shapes.add_ring(at, 0.12 * seen.frame.scale, colour)
        shapes.add_arrow(at, end, colour)
        shapes.words.append((at, text, colour))
    return shapes


def planned_way(seen: Outlook) -> Shapes:
    """The way over the floor from where the character stands to goal after goal."""
    shapes = Shapes()
    for told in seen.goals:
        for way in told.ways:
            heights = seen.around.ground.height(way) + 5 * _OFF
            points = seen.frame.to_world(np.column_stack((way, heights)))
            shapes.add_way(points, colours.WAY)
            for k in range(8, len(points) - 1, 16):  # which way it is gone
                along = points[min(k + 1, len(points) - 1)] - points[k - 1]
                step = along / max(np.linalg.norm(along), 1e-9) * 0.12 * seen.frame.scale
                shapes.add_arrow(points[k], points[k] + step, colours.WAY)
    return shapes


def _add_mesh(shapes: Shapes, solid: Solid, seen: Outlook, face: tuple, edge: tuple) -> None:
    corners = solid.vertices[solid.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    shapes.add_triangles(seen.frame.to_world(corners + _OFF * normals[:, None]), face)
    shapes.add_lines(
        seen.frame.to_world(_sharp_edges(solid.vertices, solid.triangles, normals)).astype(np.float32), edge
    )


def _sharp_edges(vertices: Array, triangles: Array, normals: Array) -> Array:
    """Ends (L, 2, 3) of the edges where faces turn, or end."""
    edges = np.sort(np.concatenate((triangles[:, (0, 1)], triangles[:, (1, 2)], triangles[:, (2, 0)])), 1)
    faces = np.tile(np.arange(len(triangles)), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, faces = edges[order], faces[order]
    same = (edges[1:] == edges[:-1]).all(1)
    flat = same & ((normals[faces[1:]] * normals[faces[:-1]]).sum(1) > _SHARP)
    drawn = np.ones(len(edges), bool)
    drawn[1:] &= ~same  # each edge once
    drawn[:-1] &= ~flat
    return vertices[edges[drawn]]


def turned(heading: float) -> Array:
    c, s = np.cos(heading), np.sin(heading)
    return np.array(((c, -s, 0), (s, c, 0), (0, 0, 1)))
