"""Pictures to judge motion by: sheets of stick figures and plans of the path walked.

Needs matplotlib, which only development and training install; nothing here runs in Blender.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from nsm_core.body.skeleton import FEET, HIPS, INDEX
from nsm_core.errors import GeometryError
from nsm_core.rotations import Array, heading_to_direction
from nsm_core.world.geometry.distance import Cuboids

from .drawing import (
    EDGES,
    LEFT,
    MARGIN,
    MOVED,
    PIXELS,
    RIGHT,
    TRUNK,
    WOOD,
    box_corners,
    camera_headings,
    canvas,
    checked,
    corners_of,
    depth_of,
    figure_lines,
    foot_outline,
    frames_of,
    project,
    pyplot,
    ring_joints,
    roots_of,
    save,
)

VIEWS = ("side", "front", "three_quarter", "top")


def figure_sheet(
    positions: Array,
    path: str | Path,
    every: int | None = None,
    view: str = "side",
    boxes: Array | Cuboids | None = None,
    roots: tuple[Array, Array] | Array | None = None,
    title: str | None = None,
    tiles: int = 12,
    rows: int = 4,
    follow: bool = True,
    camera: float | str = "travel",
    contacts: Array | None = None,
    fps: float = 30.0,
    moving: Array | None = None,
) -> Path:
    """Draw a motion as a grid of stick figures in one PNG 1600 pixels wide and return its path.

    Right limbs are red, left limbs blue; a joint in contact has a ring.  Each tile is one pose, with frame
    and time.

    Args:
        positions: (T, 23, 3) world joint positions, metres.
        every: frames between tiles; None fills at most ``rows`` rows.
        view: "side" (camera's right is forward), "front", "three_quarter" or "top".
        boxes: furniture as (M, 8, 3) corners (see ``box_corners``), (M, 2, 3) world minimum and maximum, or
        ``Cuboids``. roots: (T, 3) x, y, heading, or a pair of (T, 2) and (T,), drawn as an arrow on the
        floor; None takes the pose's own. tiles: poses in a row. follow: True keeps the hips in the middle of
        every tile; False shows the whole scene in every tile. camera: what "forward" means: "travel" (start
        to end, or the first heading if the take stays in place),
            "character" (the heading of each frame) or a heading in radians.
        contacts: (T, 2) right and left foot, or (T, 5) in the order of ``conventions.CONTACTS``.
        moving: corners (T, M, 8, 3) of the boxes of what moves, drawn where they are in each pictured frame.

    Raises:
        GeometryError: ``positions`` or ``moving`` has another shape or ``view`` is unknown.
        OutputError: matplotlib is absent or the file cannot be written.
    """
    positions = checked(positions)
    if view not in VIEWS:
        raise GeometryError(f"Unknown view '{view}'; choose one of {', '.join(VIEWS)}.")
    plt = pyplot()
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Rectangle

    frames = frames_of(len(positions), every, tiles * rows)
    points, headings = roots_of(positions, roots)
    forward = camera_headings(points, headings, camera)
    corners = corners_of(boxes)
    rings = ring_joints(contacts)
    if moving is not None and (
        np.ndim(moving) != 4 or np.shape(moving)[0] != len(positions) or np.shape(moving)[2:] != (8, 3)
    ):
        raise GeometryError(
            f"What moves must be corners of shape ({len(positions)}, M, 8, 3), but got {np.shape(moving)}."
        )

    # The window of one tile, metres right and up of its centre.
    drawn = [project(positions[f], view, forward[f]) for f in frames]
    if follow:
        under = positions[:, HIPS] * np.array((1, 1, 0))
        centres = [project(under[f], view, forward[f]) for f in frames]
    else:
        everything = np.concatenate(
            drawn + [project(corners, view, forward[f]).reshape(-1, 2) for f in frames[:1]]
        )
        middle = (everything.min(0) + everything.max(0)) / 2
        centres = [np.array((middle[0], 0.0 if view != "top" else middle[1]))] * len(frames)
    local = np.concatenate([uv - c for uv, c in zip(drawn, centres, strict=True)])
    low, high = local.min(0) - MARGIN, local.max(0) + MARGIN + np.array((0.0, 0.12))  # room for the head
    if not follow and len(corners):
        scene = np.concatenate(
            [
                project(corners, view, forward[f]).reshape(-1, 2) - c
                for f, c in zip(frames, centres, strict=True)
            ]
        )
        low, high = np.minimum(low, scene.min(0) - MARGIN), np.maximum(high, scene.max(0) + MARGIN)
    half = max(0.4 if moving is None else 0.62, -low[0], high[0])  # room for what is in the hands
    if view == "top":
        half = max(half, -low[1], high[1])
        low, high = np.array((-half, -half)), np.array((half, half))
    else:
        low, high = np.array((-half, min(-0.1, low[1]))), np.array((half, max(1.0, high[1])))
    label = 0.16 * (2 * half) / 1.3
    cell = high - low + np.array((0.0, label))

    per_row = min(tiles, len(frames))
    n_rows = -(-len(frames) // per_row)
    scale = PIXELS / (per_row * cell[0])
    fig, ax = canvas(plt, per_row * cell[0], n_rows * cell[1], scale, title)
    weight = float(np.clip(scale / 60, 0.8, 2.6))
    for i, f in enumerate(frames):
        corner = np.array(((i % per_row) * cell[0], (n_rows - 1 - i // per_row) * cell[1]))
        shift = corner - low - centres[i]
        shade = "#fbfaf7" if (i + i // per_row) % 2 else "#f1efe9"
        window = Rectangle(tuple(corner), cell[0], cell[1] - label, facecolor=shade, zorder=0)
        ax.add_patch(window)
        x, y = corner + np.array((cell[0] / 2, cell[1] - label / 2))
        ax.text(x, y, f"{f}   {f / fps:.2f} s", ha="center", va="center", fontsize=7, color="#555")

        def lines(
            segments: list[Array],
            color: str,
            width: float,
            order: float,
            clip: Rectangle = window,
            **extra: object,
        ) -> None:
            drawing = LineCollection(
                segments, colors=color, linewidths=width, zorder=order, capstyle="round", **extra
            )
            ax.add_collection(drawing).set_clip_path(clip)

        if view != "top":
            ground = corner[1] - low[1]
            lines([np.array(((corner[0], ground), (corner[0] + cell[0], ground)))], "#8c8c8c", 0.9, 1)
        if len(corners):
            uv = project(corners, view, forward[f]) + shift
            lines([uv[m, list(e)] for m in range(len(uv)) for e in EDGES], WOOD, 0.8, 1.5)
        if moving is not None:
            uv = project(np.asarray(moving[f], dtype=np.float64), view, forward[f]) + shift
            lines([uv[m, list(e)] for m in range(len(uv)) for e in EDGES], MOVED, 1.5, 1.6)
        arrow = np.zeros((2, 3))
        arrow[:, :2] = points[f], points[f] + 0.3 * heading_to_direction(np.asarray(headings[f]))
        lines([project(arrow, view, forward[f]) + shift], "#2c9c4b", 1.6, 1.8)
        figure_lines(lines, positions[f], drawn[i] + shift, depth_of(positions[f], view, forward[f]), weight)
        up = drawn[i][INDEX["Head"]] - drawn[i][INDEX["Neck"]]
        middle = drawn[i][INDEX["Head"]] + 0.6 * up + shift
        head = plt.Circle(
            tuple(middle), 0.09, facecolor="white", edgecolor=TRUNK, linewidth=weight * 0.7, zorder=5
        )
        ax.add_patch(head).set_clip_path(window)
        if contacts is not None:
            held = [j for j, on in zip(rings, np.asarray(contacts)[f] > 0.5, strict=True) if on]
            if held:
                ax.plot(
                    *(drawn[i][held] + shift).T,
                    "o",
                    mfc="none",
                    mec="#111",
                    ms=5.5,
                    mew=1.0,
                    zorder=7,
                    clip_path=window,
                )
    return save(plt, fig, path)


def path_sheet(
    positions: Array,
    path: str | Path,
    contacts: Array | None = None,
    roots: tuple[Array, Array] | Array | None = None,
    boxes: Array | Cuboids | None = None,
    every: int = 10,
    goals: Array | None = None,
    title: str | None = None,
) -> Path:
    """Draw the plan of a take: root path with headings, foot prints where feet are in contact, furniture from
    above.

    ``contacts`` is (T, 2) right and left foot or (T, 5); None detects them.  ``every`` is the number of
    frames between heading arrows; ``goals`` (G, 3) are x, y, heading.  Colour runs from the start (dark) to
    the end (light) of the path.  Errors as in ``figure_sheet``.
    """
    positions = checked(positions)
    plt = pyplot()
    from matplotlib.collections import LineCollection
    from matplotlib.colors import to_rgba

    from nsm_core.body.contacts import detect_foot_contacts
    from nsm_core.signals import intervals

    points, headings = roots_of(positions, roots)
    contacts = detect_foot_contacts(positions) if contacts is None else np.asarray(contacts)[:, -2:] > 0.5
    corners = corners_of(boxes)
    parts = [points, positions[:, [f[3] for f in FEET], :2].reshape(-1, 2), corners[..., :2].reshape(-1, 2)]
    if goals is not None:
        parts.append(np.atleast_2d(goals)[:, :2])
    everything = np.concatenate(parts)
    low, high = everything.min(0) - 0.4, everything.max(0) + 0.4
    size = np.maximum(high - low, 1.5)
    low = (low + high - size) / 2
    scale = min(PIXELS / size[0], 1300 / size[1])
    fig, ax = canvas(plt, size[0], size[1], scale, title, low)
    for line in np.arange(np.ceil(low.min() * 2) / 2, (low + size).max(), 0.5):
        strong = abs(line - round(line)) < 1e-6
        for draw in (ax.axvline, ax.axhline):
            draw(line, color="#dedbd3" if strong else "#efede7", lw=0.9, zorder=0)
    for x in range(int(np.ceil(low[0])), int(np.floor(low[0] + size[0])) + 1):
        ax.text(x, low[1] + 6 / scale, f"{x} m", fontsize=8, color="#888", ha="center", va="bottom")
    for y in range(int(np.ceil(low[1])), int(np.floor(low[1] + size[1])) + 1):
        ax.text(low[0] + 6 / scale, y, f"{y} m", fontsize=8, color="#888", ha="left", va="center")
    for box in corners:
        outline = box[[0, 2, 6, 4], :2]
        ax.fill(*outline.T, facecolor=WOOD, alpha=0.13, edgecolor=WOOD, lw=1.0, zorder=1)

    for (_, _, ankle, toe), on, color in zip(FEET, contacts.T, (RIGHT, LEFT), strict=True):
        for first, last in intervals(on):
            a, t = positions[first:last, ankle, :2], positions[first:last, toe, :2]
            outline = foot_outline(np.median(a, 0), np.median(t, 0))
            ax.fill(*outline.T, facecolor=to_rgba(color, 0.28), edgecolor=color, lw=1.0, zorder=3)
            ax.plot(*t.T, color=color, lw=1.3, zorder=4)  # the drift of the toe while planted

    steps = np.stack((points[:-1], points[1:]), axis=1)
    shade = LineCollection(list(steps), cmap="viridis", linewidths=2.4, zorder=5)
    shade.set_array(np.linspace(0, 0.9, max(len(steps), 1)))
    shade.set_clim(0, 1)
    ax.add_collection(shade)
    pick = np.arange(0, len(points), max(1, every))
    d = heading_to_direction(headings[pick]) * 0.16
    _arrows(ax, points[pick], d, width=2.0, color="#222", zorder=6)
    for f in pick[:: max(1, len(pick) // 12)]:
        ax.annotate(str(f), points[f], xytext=(7, 5), textcoords="offset points", fontsize=8, zorder=7)
    ax.plot(*points[0], "o", ms=9, mfc="#2c9c4b", mec="white", zorder=7)
    ax.plot(*points[-1], "s", ms=9, mfc="#111", mec="white", zorder=7)
    for goal in np.atleast_2d(goals) if goals is not None else ():
        ax.plot(*goal[:2], "*", ms=16, mfc="#f4b400", mec="#6b4e00", zorder=8)
        g = heading_to_direction(np.asarray(goal[2])) * 0.3
        _arrows(ax, np.asarray(goal[:2]), g, width=3.5, color="#b98500", zorder=8)
    return save(plt, fig, path)


def _arrows(ax: Any, at: Array, way: Array, **look: Any) -> None:
    """Arrows from places ``at`` (..., 2) by ``way`` (..., 2), metres, as long as they are."""
    ax.quiver(*at.T, *way.T, angles="xy", scale_units="xy", scale=1, units="dots", **look)


__all__ = ["VIEWS", "box_corners", "figure_sheet", "path_sheet"]
