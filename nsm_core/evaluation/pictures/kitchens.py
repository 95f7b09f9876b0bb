"""Kitchens in perspective: furniture and things as solids, fronts seen through, grasps as small frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nsm_core.evaluation.kitchens import Taking
from nsm_core.rotations import Array
from nsm_core.world.assets.kitchen import Kitchen
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.furniture import box_mesh
from nsm_core.world.scene.wrist import WristPose

from .drawing import LEFT, RIGHT, pyplot, save

_EYE_BACK, _EYE_UP, _ASIDE = 3.6, 1.9, -0.7  # metres of the camera before the row, over the floor, aside
_PATCH = 0.12  # metres: larger faces are parted, so that the order of drawing is right
_WOOD, _FRONT, _WALL, _HAND = (0.80, 0.72, 0.60), (0.55, 0.66, 0.72), (0.93, 0.93, 0.92), (0.1, 0.1, 0.1)
_LIGHT = np.array((-0.35, -0.6, 0.72))
_FINGER = 0.05  # metres of a grasp's drawn frame


def kitchen_picture(kitchen: Kitchen, taken: list[Taking], path: str | Path) -> Path:
    """Draw a kitchen as it is now, with the best grasp of each thing in ``taken``; returns the path.

    Orange is a thing that stands behind a blocker, red the hand's way at a grasp and blue its thumb.
    """
    plt = pyplot()
    width = max(c.pose[0] + c.piece.size[0] / 2 for c in kitchen.containers.values())
    eye = np.array((width / 2 + _ASIDE, -_EYE_BACK, _EYE_UP))
    aim = np.array((width / 2, -0.3, 0.95))
    walls, behind = kitchen.walls, []
    for t in _placed(*box_mesh(walls.mins, walls.maxs), lambda points: points):
        behind.append((t, _WALL, 1.0))
    faces: list[tuple[Array, tuple[float, float, float], float]] = []
    for container in kitchen.containers.values():
        if container.kind == "table":  # it stands before the row, in the way of the view
            continue
        p = container.piece
        mesh = _placed(*box_mesh(p.mins, p.maxs), container.to_world)
        faces += [(t, _WOOD, 1.0) for t in mesh]
        for part in container.parts:
            assert isinstance(part.query, Cuboids)
            g = part.query.groups[0]
            mesh = _placed(*box_mesh(g.centres - g.halves, g.centres + g.halves), part.to_world)
            faces += [(t, _FRONT, 0.3) for t in mesh]
    shown = [s for s in kitchen.things.values() if s.container != "table"]
    for k, standing in enumerate(shown):
        tint = plt.get_cmap("Set2")(k % 8)[:3]
        color = (0.95, 0.5, 0.1) if standing.blockers else tint
        faces += [(t, color, 1.0) for t in _placed(*standing.thing.mesh(), standing.thing.to_world)]
    fig = plt.figure(figsize=(17, 9.5), dpi=100)
    ax = fig.add_axes((0, 0, 1, 1))
    ax.axis("off")
    ax.set_aspect("equal")
    _solids(ax, behind, eye, aim)
    _solids(ax, faces, eye, aim)
    for taking in taken:
        if taking.grasp is not None and kitchen.things[taking.name].container != "table":
            _frame(ax, taking.grasp.at(kitchen.things[taking.name].thing.pose), eye, aim)
    ends = [c for c in kitchen.containers.values() if c.kind != "table"]
    corners = np.concatenate(
        [c.to_world(np.stack((c.piece.mins, c.piece.maxs))).reshape(-1, 3) for c in ends]
    )
    uv, _ = _seen(corners, eye, aim)
    ax.set_xlim(uv[:, 0].min() - 0.04, uv[:, 0].max() + 0.04)
    ax.set_ylim(uv[:, 1].min() - 0.04, uv[:, 1].max() + 0.04)
    blocked = sum(bool(s.blockers) for s in kitchen.things.values())
    fig.text(
        0.01, 0.97, f"kitchen {kitchen.seed}: {len(kitchen.things)} things, {blocked} blocked", fontsize=13
    )
    return save(plt, fig, path)


def _placed(vertices: Array, triangles: Array, to_world: object) -> Array:
    """Triangles (F, 3, 3) in the world, none with an edge much longer than ``_PATCH``."""
    corners = np.asarray(to_world(vertices), dtype=np.float64)[triangles]  # type: ignore[operator]
    for _ in range(6):
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        long = edges.max(1) > _PATCH
        if not long.any():
            break
        which = edges[long].argmax(1)
        some = np.take_along_axis(corners[long], ((np.arange(3) + which[:, None]) % 3)[..., None], 1)
        half = (some[:, 0] + some[:, 1]) / 2
        parted = np.concatenate(
            (np.stack((some[:, 0], half, some[:, 2]), 1), np.stack((half, some[:, 1], some[:, 2]), 1))
        )
        corners = np.concatenate((corners[~long], parted))
    return corners


def _seen(points: Array, eye: Array, aim: Array) -> tuple[Array, Array]:
    """Places on the picture (..., 2) and depth (...) of points (..., 3)."""
    ahead = (aim - eye) / np.linalg.norm(aim - eye)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    way = points - eye
    depth = np.maximum(way @ ahead, 0.1)
    return np.stack((way @ right / depth, way @ up / depth), -1), depth


def _solids(
    ax: object,
    faces: list[tuple[Array, tuple[float, float, float], float]],
    eye: Array,
    aim: Array,
) -> None:
    """Draw triangles from the back to the front, those that look away left out."""
    from matplotlib.collections import PolyCollection

    corners = np.array([f[0] for f in faces])
    color = np.array([(*f[1], f[2]) for f in faces])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    seen = ((corners.mean(1) - eye) * normal).sum(1) < 0
    uv, depth = _seen(corners, eye, aim)
    shade = 0.72 + 0.28 * np.clip(normal @ _LIGHT, -0.6, 1)
    color[:, :3] *= shade[:, None]
    order = np.flatnonzero(seen)[np.argsort(-depth.mean(1)[seen], kind="stable")]
    shown = np.clip(color[order], 0, 1)
    drawn = PolyCollection(uv[order], facecolors=shown, edgecolors=shown, linewidths=0.15)
    ax.add_collection(drawn)  # type: ignore[attr-defined]


def _frame(ax: object, wrist: WristPose, eye: Array, aim: Array) -> None:
    """The wrist as a dot, a line to what it holds and a short one to the thumb's side."""
    thumb = wrist.place + _FINGER * wrist.rotation[:, 2]
    aside = wrist.held + np.array((-0.5, 0.5))[:, None] * _FINGER * wrist.rotation[:, 0]
    lines = ((wrist.place, wrist.held, RIGHT), (wrist.place, thumb, LEFT), (aside[0], aside[1], _HAND))
    for a, b, color in lines:
        uv, _ = _seen(np.stack((a, b)), eye, aim)
        ax.plot(uv[:, 0], uv[:, 1], color=color, linewidth=2.0, solid_capstyle="round")  # type: ignore[attr-defined]
