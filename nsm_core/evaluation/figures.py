"""Pictures to judge motion by: sheets of stick figures and plans of the path walked.

Needs matplotlib, which only development and training install; nothing here runs in Blender.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import GeometryError, OutputError
from ..rotations import Array, heading_to_direction
from ..sensors.query import Cuboids
from ..skeleton import FEET, HIPS, INDEX, PARENTS, root_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RIGHT, LEFT, TRUNK, WOOD = "#d9381e", "#1f6fb4", "#3a3a3a", "#a3824f"
VIEWS = ("side", "front", "three_quarter", "top")
_PIXELS, _DPI, _MARGIN = 1600, 100, 0.06

# Corners of a box as (x, y, z) picks of its minimum or maximum, and the pairs that are its edges.
_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 1]


def box_corners(position: Array, heading: float, mins: Array, maxs: Array) -> Array:
    """Corners (M, 8, 3), world metres, of boxes in an object's frame.

    ``position`` (2 or 3,) and ``heading`` place the object; ``mins`` and ``maxs`` (M, 3) are in its frame.
    """
    mins, maxs = np.atleast_2d(mins), np.atleast_2d(maxs)
    corners = np.where(_CORNERS[None] == 0, mins[:, None], maxs[:, None]).astype(np.float64)
    c, s = np.cos(heading), np.sin(heading)
    x, y = corners[..., 0].copy(), corners[..., 1].copy()
    corners[..., 0], corners[..., 1] = c * x - s * y, s * x + c * y
    origin = np.zeros(3)
    origin[: len(position)] = position
    return corners + origin


def contact_sheet(
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
) -> Path:
    """Draw a motion as a grid of stick figures in one PNG 1600 pixels wide and return its path.

    Right limbs are red, left limbs blue; a joint in contact has a ring.  Each tile is one pose, with frame and time.

    Args:
        positions: (T, 23, 3) world joint positions, metres.
        every: frames between tiles; None fills at most ``rows`` rows.
        view: "side" (camera's right is forward), "front", "three_quarter" or "top".
        boxes: furniture as (M, 8, 3) corners (see ``box_corners``), (M, 2, 3) world minimum and maximum, or ``Cuboids``.
        roots: (T, 3) x, y, heading, or a pair of (T, 2) and (T,), drawn as an arrow on the floor; None takes the pose's own.
        tiles: poses in a row.
        follow: True keeps the hips in the middle of every tile; False shows the whole scene in every tile.
        camera: what "forward" means: "travel" (start to end, or the first heading if the take stays in place),
            "character" (the heading of each frame) or a heading in radians.
        contacts: (T, 2) right and left foot, or (T, 5) in the order of ``conventions.CONTACTS``.

    Raises:
        GeometryError: ``positions`` has another shape or ``view`` is unknown.
        OutputError: matplotlib is absent or the file cannot be written.
    """
    positions = _checked(positions)
    if view not in VIEWS:
        raise GeometryError(f"Unknown view '{view}'; choose one of {', '.join(VIEWS)}.")
    plt = _pyplot()
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Rectangle

    frames = _frames(len(positions), every, tiles * rows)
    points, headings = _roots(positions, roots)
    forward = _camera_headings(points, headings, camera)
    corners = _corners(boxes)
    rings = _ring_joints(contacts)

    # The window of one tile, metres right and up of its centre.
    drawn = [_project(positions[f], view, forward[f]) for f in frames]
    if follow:
        under = positions[:, HIPS] * np.array((1, 1, 0))
        centres = [_project(under[f], view, forward[f]) for f in frames]
    else:
        everything = np.concatenate(drawn + [_project(corners, view, forward[f]).reshape(-1, 2) for f in frames[:1]])
        middle = (everything.min(0) + everything.max(0)) / 2
        centres = [np.array((middle[0], 0.0 if view != "top" else middle[1]))] * len(frames)
    local = np.concatenate([uv - c for uv, c in zip(drawn, centres, strict=True)])
    low, high = local.min(0) - _MARGIN, local.max(0) + _MARGIN + np.array((0.0, 0.12))  # room for the head
    if not follow and len(corners):
        scene = np.concatenate([_project(corners, view, forward[f]).reshape(-1, 2) - c for f, c in zip(frames, centres, strict=True)])
        low, high = np.minimum(low, scene.min(0) - _MARGIN), np.maximum(high, scene.max(0) + _MARGIN)
    half = max(0.4, -low[0], high[0])
    if view == "top":
        half = max(half, -low[1], high[1])
        low, high = np.array((-half, -half)), np.array((half, half))
    else:
        low, high = np.array((-half, min(-0.1, low[1]))), np.array((half, max(1.0, high[1])))
    label = 0.16 * (2 * half) / 1.3
    cell = high - low + np.array((0.0, label))

    per_row = min(tiles, len(frames))
    n_rows = -(-len(frames) // per_row)
    scale = _PIXELS / (per_row * cell[0])
    fig, ax = _canvas(plt, per_row * cell[0], n_rows * cell[1], scale, title)
    weight = float(np.clip(scale / 60, 0.8, 2.6))
    for i, f in enumerate(frames):
        corner = np.array(((i % per_row) * cell[0], (n_rows - 1 - i // per_row) * cell[1]))
        shift = corner - low - centres[i]
        shade = "#fbfaf7" if (i + i // per_row) % 2 else "#f1efe9"
        window = Rectangle(tuple(corner), cell[0], cell[1] - label, facecolor=shade, zorder=0)
        ax.add_patch(window)
        name = corner + np.array((cell[0] / 2, cell[1] - label / 2))
        ax.text(*name, f"{f}   {f / fps:.2f} s", ha="center", va="center", fontsize=7, color="#555")

        def lines(segments: list[Array], color: str, width: float, order: float, clip: Rectangle = window, **extra: object) -> None:
            drawing = LineCollection(segments, colors=color, linewidths=width, zorder=order, capstyle="round", **extra)
            ax.add_collection(drawing).set_clip_path(clip)

        if view != "top":
            ground = corner[1] - low[1]
            lines([np.array(((corner[0], ground), (corner[0] + cell[0], ground)))], "#8c8c8c", 0.9, 1)
        if len(corners):
            uv = _project(corners, view, forward[f]) + shift
            lines([uv[m, list(e)] for m in range(len(uv)) for e in _EDGES], WOOD, 0.8, 1.5)
        arrow = np.zeros((2, 3))
        arrow[:, :2] = points[f], points[f] + 0.3 * heading_to_direction(np.asarray(headings[f]))
        lines([_project(arrow, view, forward[f]) + shift], "#2c9c4b", 1.6, 1.8)
        _figure_lines(lines, positions[f], drawn[i] + shift, _depth(positions[f], view, forward[f]), weight)
        up = drawn[i][INDEX["Head"]] - drawn[i][INDEX["Neck"]]
        middle = drawn[i][INDEX["Head"]] + 0.6 * up + shift
        head = plt.Circle(tuple(middle), 0.09, facecolor="white", edgecolor=TRUNK, linewidth=weight * 0.7, zorder=5)
        ax.add_patch(head).set_clip_path(window)
        if contacts is not None:
            held = [j for j, on in zip(rings, np.asarray(contacts)[f] > 0.5, strict=True) if on]
            if held:
                ax.plot(*(drawn[i][held] + shift).T, "o", mfc="none", mec="#111", ms=5.5, mew=1.0, zorder=7, clip_path=window)
    return _save(plt, fig, path)


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
    """Draw the plan of a take: root path with headings, foot prints where feet are in contact, furniture from above.

    ``contacts`` is (T, 2) right and left foot or (T, 5); None detects them.  ``every`` is the number of frames between
    heading arrows; ``goals`` (G, 3) are x, y, heading.  Colour runs from the start (dark) to the end (light) of the path.
    Errors as in ``contact_sheet``.
    """
    positions = _checked(positions)
    plt = _pyplot()
    from matplotlib.collections import LineCollection
    from matplotlib.colors import to_rgba

    from ..control.foot_lock import detect_foot_contacts, intervals

    points, headings = _roots(positions, roots)
    contacts = detect_foot_contacts(positions) if contacts is None else np.asarray(contacts)[:, -2:] > 0.5
    corners = _corners(boxes)
    parts = [points, positions[:, [f[3] for f in FEET], :2].reshape(-1, 2), corners[..., :2].reshape(-1, 2)]
    if goals is not None:
        parts.append(np.atleast_2d(goals)[:, :2])
    everything = np.concatenate(parts)
    low, high = everything.min(0) - 0.4, everything.max(0) + 0.4
    size = np.maximum(high - low, 1.5)
    low = (low + high - size) / 2
    scale = min(_PIXELS / size[0], 1300 / size[1])
    fig, ax = _canvas(plt, size[0], size[1], scale, title, low)
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
            outline = _foot_outline(np.median(a, 0), np.median(t, 0))
            ax.fill(*outline.T, facecolor=to_rgba(color, 0.28), edgecolor=color, lw=1.0, zorder=3)
            ax.plot(*t.T, color=color, lw=1.3, zorder=4)  # the drift of the toe while planted

    steps = np.stack((points[:-1], points[1:]), axis=1)
    shade = LineCollection(list(steps), cmap="viridis", linewidths=2.4, zorder=5)
    shade.set_array(np.linspace(0, 0.9, max(len(steps), 1)))
    shade.set_clim(0, 1)
    ax.add_collection(shade)
    pick = np.arange(0, len(points), max(1, every))
    d = heading_to_direction(headings[pick]) * 0.16
    ax.quiver(*points[pick].T, *d.T, angles="xy", scale_units="xy", scale=1, width=2.0, units="dots", color="#222", zorder=6)
    for f in pick[:: max(1, len(pick) // 12)]:
        ax.annotate(str(f), points[f], xytext=(7, 5), textcoords="offset points", fontsize=8, zorder=7)
    ax.plot(*points[0], "o", ms=9, mfc="#2c9c4b", mec="white", zorder=7)
    ax.plot(*points[-1], "s", ms=9, mfc="#111", mec="white", zorder=7)
    for goal in np.atleast_2d(goals) if goals is not None else ():
        ax.plot(*goal[:2], "*", ms=16, mfc="#f4b400", mec="#6b4e00", zorder=8)
        g = heading_to_direction(np.asarray(goal[2])) * 0.3
        ax.quiver(*goal[:2], *g, angles="xy", scale_units="xy", scale=1, width=3.5, units="dots", color="#b98500", zorder=8)
    return _save(plt, fig, path)


# --- drawing ---------------------------------------------------------------------------------------------------


def _figure_lines(lines, pose: Array, uv: Array, depth: Array, weight: float) -> None:
    """Draw the bones of one pose, the farther limbs first and thinner."""
    for side in ("", "Right", "Left"):
        bones = [j for j, p in enumerate(PARENTS) if p >= 0 and _side(j) == side]
        color = {"": TRUNK, "Right": RIGHT, "Left": LEFT}[side]
        for part in (bones[:4], bones[4:]) if side else (bones,):  # arm, leg
            order = 3 + 0.5 * float(np.tanh(depth[part].mean() - depth[HIPS]))
            near = 1.0 if order >= 3 or not side else 0.75
            lines([uv[[PARENTS[j], j]] for j in part], color, weight * near * (1.15 if not side else 1.0), order)


def _side(joint: int) -> str:
    from ..skeleton import JOINTS

    return next((s for s in ("Right", "Left") if JOINTS[joint].startswith(s)), "")


def _foot_outline(ankle: Array, toe: Array) -> Array:
    """Outline (N, 2) of a sole 25 cm long from the plan of ankle and toe joint."""
    d = toe - ankle
    d = d / max(float(np.linalg.norm(d)), 1e-6)
    n = np.array((-d[1], d[0]))
    t = np.linspace(0, 2 * np.pi, 24)
    along, across = np.cos(t) * 0.125 + 0.075, np.sin(t) * (0.042 + 0.008 * np.cos(t))
    return ankle + along[:, None] * d + across[:, None] * n


def _project(points: Array, view: str, forward: float) -> Array:
    """Flatten (..., 3) world points to (..., 2) metres right and up, seen by a camera that stands square to ``forward``."""
    ahead = heading_to_direction(np.asarray(forward))
    left = np.array((-ahead[1], ahead[0]))
    f, s, z = points[..., :2] @ ahead, points[..., :2] @ left, points[..., 2]
    if view == "side":
        return np.stack((f, z), -1)
    if view == "front":  # the character looks at us: its left is on our right
        return np.stack((s, z), -1)
    if view == "top":
        return np.stack((f, s), -1)
    turn, dip = np.radians(40), np.radians(18)
    right = np.cos(turn) * f + np.sin(turn) * s
    away = -np.sin(turn) * f + np.cos(turn) * s
    return np.stack((right, np.cos(dip) * z + np.sin(dip) * away), -1)


def _depth(points: Array, view: str, forward: float) -> Array:
    """Nearness (...) of points to the camera of ``_project``."""
    ahead = heading_to_direction(np.asarray(forward))
    left = np.array((-ahead[1], ahead[0]))
    f, s = points[..., :2] @ ahead, points[..., :2] @ left
    if view == "front":
        return f
    if view == "top":
        return points[..., 2]
    return -s if view == "side" else np.sin(np.radians(40)) * f - np.cos(np.radians(40)) * s


def _canvas(plt, width: float, height: float, scale: float, title: str | None, origin: Array | None = None) -> tuple[Figure, Axes]:
    """Make a figure whose axes show exactly ``width`` x ``height`` metres at ``scale`` pixels a metre."""
    top = 30 if title else 4
    w, h = width * scale, height * scale + top
    fig = plt.figure(figsize=(w / _DPI, h / _DPI), dpi=_DPI)
    ax = fig.add_axes((0, 0, 1, height * scale / h))
    o = np.zeros(2) if origin is None else origin
    ax.set_xlim(o[0], o[0] + width)
    ax.set_ylim(o[1], o[1] + height)
    ax.axis("off")
    if title:
        fig.text(8 / w, 1 - top / 2 / h, title, fontsize=11, va="center", ha="left")
    return fig, ax


def _save(plt, fig: Figure, path: str | Path) -> Path:
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        fig.savefig(path, dpi=_DPI)
    except OSError as error:
        raise OutputError(f"The picture cannot be written to {path} ({error.strerror}); choose a folder you may write to.") from error
    finally:
        plt.close(fig)
    return path


def _pyplot():
    try:
        import matplotlib
    except ImportError as error:
        raise OutputError("Pictures need matplotlib, which is not installed; install the project's training extra.") from error
    matplotlib.use("Agg", force=False)
    import matplotlib.pyplot as plt

    return plt


# --- inputs ----------------------------------------------------------------------------------------------------


def _checked(positions: Array) -> Array:
    positions = np.asarray(positions, dtype=np.float64)
    if positions.ndim != 3 or positions.shape[1:] != (len(PARENTS), 3) or not len(positions):
        raise GeometryError(f"A sheet needs joint positions of shape (T, {len(PARENTS)}, 3), but got {positions.shape}.")
    return positions


def _frames(count: int, every: int | None, most: int) -> list[int]:
    step = every if every else max(1, -(-count // most))
    return list(range(0, count, step))


def _roots(positions: Array, roots: tuple[Array, Array] | Array | None) -> tuple[Array, Array]:
    if roots is None:
        return root_of(positions)
    if isinstance(roots, tuple):
        return np.asarray(roots[0], dtype=np.float64), np.asarray(roots[1], dtype=np.float64)
    roots = np.asarray(roots, dtype=np.float64)
    return roots[:, :2], roots[:, 2]


def _camera_headings(points: Array, headings: Array, camera: float | str) -> Array:
    if camera == "character":
        return headings
    if camera == "travel":
        way = points[-1] - points[0]
        camera = float(np.arctan2(way[0], -way[1])) if np.linalg.norm(way) > 0.5 else float(headings[0])
    return np.full(len(points), float(camera))


def _corners(boxes: Array | Cuboids | None) -> Array:
    if isinstance(boxes, Cuboids):
        halves = _CORNERS * 2 - 1
        parts = [(g.centres[:, None] + halves * g.halves[:, None]) @ g.matrix.T + g.position for g in boxes.groups]
        boxes = np.concatenate(parts) if parts else None
    if boxes is None or not len(boxes):
        return np.zeros((0, 8, 3))
    boxes = np.asarray(boxes, dtype=np.float64)
    if boxes.shape[1:] == (2, 3):
        return box_corners(np.zeros(3), 0.0, boxes[:, 0], boxes[:, 1])
    if boxes.shape[1:] != (8, 3):
        raise GeometryError(f"Boxes must be (M, 8, 3) corners or (M, 2, 3) minimum and maximum, but got {boxes.shape}.")
    return boxes


def _ring_joints(contacts: Array | None) -> list[int]:
    from ..conventions import CONTACTS

    if contacts is None:
        return []
    return [INDEX["RightToe"], INDEX["LeftToe"]] if np.asarray(contacts).shape[-1] == 2 else [INDEX[n] for n in CONTACTS]
