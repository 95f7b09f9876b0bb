"""Overlays of a take at one of its frames: what the sensors told the network, where its motion was led, what
it touched, and which experts were at work.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import JOINTS
from nsm_core.conventions import CONTACTS, FPS
from nsm_core.rotations import heading_to_direction
from nsm_core.world.sensors.environment import SPHERE_RADIUS
from nsm_core.world.sensors.interaction import RESOLUTION, UNIT_CELLS

from . import colours
from .kept import RememberedTake
from .scene_layers import turned
from .shapes import Shapes, box_corners

_EMPTY = 0.012  # metres: the dot of a sphere that touches nothing
_PLANTED = 0.5  # a contact over this holds
_AROUND = 2 * FPS  # frames of the graph before and after the present one
_MAGNIFIED = 2.0  # bars reach the top at half of all: experts seldom have more
_BAR, _GAP, _HIGH, _WIDE = 13, 3, 88, 220  # pixels of the gating's plate


def environment(take: RememberedTake, t: int) -> Shapes:
    """The spheres of the environment sensor: the larger and the redder, the fuller; dots where there is
    nothing.
    """
    shapes, seen = Shapes(), take.insight_at(t)
    if seen is None:
        return shapes
    values = seen.environment / 255.0
    centres = take.frame.to_world(seen.spheres_world())
    radii = take.frame.scale * np.where(values > 0, (0.25 + 0.25 * values) * SPHERE_RADIUS, _EMPTY)
    dots = colours.occupied(values)
    dots[values == 0] = colours.NOTHING
    shapes.add_balls(centres, radii, dots)
    return shapes


def interaction(take: RememberedTake, t: int) -> Shapes:
    """The cells of the interaction sensor on the object that the character is after: those that are filled,
    and the box around all.
    """
    shapes, seen = Shapes(), take.insight_at(t)
    if seen is None or seen.volume is None:
        return shapes
    volume, turn = seen.volume, turned(seen.volume.heading)
    to_world, values = take.frame.to_world, seen.volume.occupancy / 255.0
    shapes.add_boxes(to_world(box_corners(volume.size, volume.centre, turn))[None], None, colours.VOLUME_EDGE)
    filled = values > 0.05
    centres = (UNIT_CELLS[filled] * volume.size) @ turn.T.astype(np.float32) + volume.centre
    cells = box_corners(0.6 * np.asarray(volume.size) / RESOLUTION, np.zeros(3), turn)
    if filled.any():
        shapes.add_boxes(
            to_world(centres[:, None] + cells[None]), colours.occupied(values[filled], 0.15), None
        )
    return shapes


def contacts(take: RememberedTake, t: int) -> Shapes:
    """Hips, hands and feet: green where they are in contact with something."""
    shapes, joints = Shapes(), take.joints_at(t)
    places = joints[[JOINTS.index(name) for name in CONTACTS]]
    held = take.result.contacts[t] > _PLANTED
    size = take.frame.scale * np.where(held, 0.06, 0.03)
    shapes.add_balls(places, size, np.where(held[:, None], colours.CONTACT, colours.FREE))
    return shapes


def trajectories(take: RememberedTake, t: int) -> Shapes:
    """Both views of the second ahead, from the character (orange) and from its goal (blue), and the way that
    was gone.
    """
    shapes, seen, scale = Shapes(), take.insight_at(t), take.frame.scale
    root = take.result.root
    level = seen.level if seen is not None else 0.0
    for past, colour in ((root[: t + 1 : 3], colours.GONE),):
        shapes.add_way(
            take.frame.to_world(np.column_stack((past[:, :2], np.full(len(past), 0.01 + level)))), colour
        )
    if seen is None:
        return shapes
    for keys, colour, up in (
        (seen.goalward, colours.GOALWARD, 0.05), (seen.egocentric, colours.EGOCENTRIC, 0.03),
    ):  # fmt: skip
        points = take.frame.to_world(np.column_stack((keys[:, :2], np.full(len(keys), up + level))))
        shapes.add_way(points, colour)
        shapes.add_balls(points, np.full(len(points), 0.025 * scale), np.tile(colour, (len(points), 1)))
        facing = heading_to_direction(keys[:, 2].astype(np.float64))
        ends = points + 0.18 * scale * np.column_stack((facing, np.zeros(len(facing))))
        shapes.add_lines(np.stack((points, ends), 1), colour)
    goal = take.frame.to_world(np.array((*seen.goal[:2], 0.02 + level)))
    shapes.add_ring(goal, 0.1 * scale, colours.GOALWARD)
    return shapes


def gating(take: RememberedTake, t: int) -> Shapes:
    """A plate on the screen, in pixels from the lower left: a bar for each expert now, and their shares over
    two seconds before and after.
    """
    shapes, experts = Shapes(), take.result.experts
    count = experts.shape[1]
    if not count:
        return shapes
    bars = count * (_BAR + _GAP) - _GAP
    size = np.array((bars + 3 * 10 + _WIDE, _HIGH + 34))
    _rectangle(shapes, (0, 0), size, colours.PLATE)
    shapes.words.append((np.array((10, size[1] - 18, 0)), "Experts at work", colours.PLATE_TEXT))
    for k in range(count):
        tone = (*colours.EXPERTS[k % len(colours.EXPERTS)], 1.0)
        x = 10 + k * (_BAR + _GAP)
        high = np.clip(_MAGNIFIED * float(experts[t, k]), 0.01, 1.0) * _HIGH
        _rectangle(shapes, (x, 10), (x + _BAR, 10 + high), tone)
    frames = np.arange(t - _AROUND, t + _AROUND + 1)
    inside = (frames >= 0) & (frames < len(experts))
    shares = np.cumsum(np.where(inside[:, None], experts[np.clip(frames, 0, len(experts) - 1)], 0), axis=1)
    left = bars + 20
    across = left + _WIDE * np.arange(len(frames)) / (len(frames) - 1)
    for k in range(count):
        tone = (*colours.EXPERTS[k % len(colours.EXPERTS)], 0.9)
        low = 10 + _HIGH * (shares[:, k - 1] if k else np.zeros(len(frames)))
        high = 10 + _HIGH * shares[:, k]
        flat = np.zeros(len(frames))
        lower, upper = np.column_stack((across, low, flat)), np.column_stack((across, high, flat))
        strip = np.concatenate(
            (
                np.stack((lower[:-1], lower[1:], upper[:-1]), 1),
                np.stack((lower[1:], upper[1:], upper[:-1]), 1),
            )
        )
        shapes.add_triangles(strip, tone)
    now = left + _WIDE / 2
    shapes.add_lines(np.array(((now, 8, 0), (now, 12 + _HIGH, 0)))[None], colours.PLATE_TEXT)
    return shapes


def _rectangle(shapes: Shapes, low: tuple, high: tuple, colour: tuple) -> None:
    (x0, y0), (x1, y1) = low, high
    shapes.add_triangles(
        np.array((((x0, y0, 0), (x1, y0, 0), (x1, y1, 0)), ((x0, y0, 0), (x1, y1, 0), (x0, y1, 0)))), colour
    )
