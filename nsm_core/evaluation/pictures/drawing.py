"""What sheets are drawn with: projections, stick figures, canvases, and checks of what is given."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nsm_core.body.skeleton import HIPS, INDEX, JOINTS, PARENTS, root_of
from nsm_core.errors import GeometryError, OutputError
from nsm_core.files import output
from nsm_core.rotations import Array, heading_to_direction
from nsm_core.world.geometry.distance import Cuboids

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RIGHT, LEFT, TRUNK, WOOD, MOVED = "#d9381e", "#1f6fb4", "#3a3a3a", "#a3824f", "#7a3fa0"
PIXELS, _DPI, MARGIN = 1600, 100, 0.06

# Corners of a box as (x, y, z) picks of its minimum or maximum, and the pairs that are its edges.
_CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 1]


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


def figure_lines(lines: Any, pose: Array, uv: Array, depth: Array, weight: float) -> None:
    """Draw the bones of one pose, the farther limbs first and thinner."""
    for side in ("", "Right", "Left"):
        bones = [j for j, p in enumerate(PARENTS) if p >= 0 and _side(j) == side]
        color = {"": TRUNK, "Right": RIGHT, "Left": LEFT}[side]
        for part in (bones[:4], bones[4:]) if side else (bones,):  # arm, leg
            order = 3 + 0.5 * float(np.tanh(depth[part].mean() - depth[HIPS]))
            near = 1.0 if order >= 3 or not side else 0.75
            lines(
                [uv[[PARENTS[j], j]] for j in part], color, weight * near * (1.15 if not side else 1.0), order
            )


def _side(joint: int) -> str:
    return next((s for s in ("Right", "Left") if JOINTS[joint].startswith(s)), "")


def foot_outline(ankle: Array, toe: Array) -> Array:
    """Outline (N, 2) of a sole 25 cm long from the plan of ankle and toe joint."""
    d = toe - ankle
    d = d / max(float(np.linalg.norm(d)), 1e-6)
    n = np.array((-d[1], d[0]))
    t = np.linspace(0, 2 * np.pi, 24)
    along, across = np.cos(t) * 0.125 + 0.075, np.sin(t) * (0.042 + 0.008 * np.cos(t))
    return ankle + along[:, None] * d + across[:, None] * n


def project(points: Array, view: str, forward: float) -> Array:
    """Flatten (..., 3) world points to (..., 2) metres right and up, seen by a camera that stands square to
    ``forward``.
    """
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


def depth_of(points: Array, view: str, forward: float) -> Array:
    """Nearness (...) of points to the camera of ``project``."""
    ahead = heading_to_direction(np.asarray(forward))
    left = np.array((-ahead[1], ahead[0]))
    f, s = points[..., :2] @ ahead, points[..., :2] @ left
    if view == "front":
        return f
    if view == "top":
        return points[..., 2]
    return -s if view == "side" else np.sin(np.radians(40)) * f - np.cos(np.radians(40)) * s


def canvas(
    plt: Any, width: float, height: float, scale: float, title: str | None, origin: Array | None = None
) -> tuple[Figure, Axes]:
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


def save(plt: Any, fig: Figure, path: str | Path) -> Path:
    path = Path(path)
    try:
        with output(path, "The picture") as temporary:
            fig.savefig(temporary, dpi=_DPI, format=path.suffix[1:] or "png")
    finally:
        plt.close(fig)
    return path


def pyplot() -> Any:
    try:
        import matplotlib
    except ImportError as error:
        raise OutputError(
            "Pictures need matplotlib, which is not installed; install the project's training extra."
        ) from error
    matplotlib.use("Agg", force=False)
    import matplotlib.pyplot as plt

    return plt


# --- inputs ---


def checked(positions: Array) -> Array:
    positions = np.asarray(positions, dtype=np.float64)
    if positions.ndim != 3 or positions.shape[1:] != (len(PARENTS), 3) or not len(positions):
        raise GeometryError(
            f"A sheet needs joint positions of shape (T, {len(PARENTS)}, 3), but got {positions.shape}."
        )
    return positions


def frames_of(count: int, every: int | None, most: int) -> list[int]:
    step = every if every else max(1, -(-count // most))
    return list(range(0, count, step))


def roots_of(positions: Array, roots: tuple[Array, Array] | Array | None) -> tuple[Array, Array]:
    if roots is None:
        return root_of(positions)
    if isinstance(roots, tuple):
        return np.asarray(roots[0], dtype=np.float64), np.asarray(roots[1], dtype=np.float64)
    roots = np.asarray(roots, dtype=np.float64)
    return roots[:, :2], roots[:, 2]


def camera_headings(points: Array, headings: Array, camera: float | str) -> Array:
    if camera == "character":
        return headings
    if camera == "travel":
        way = points[-1] - points[0]
        camera = float(np.arctan2(way[0], -way[1])) if np.linalg.norm(way) > 0.5 else float(headings[0])
    return np.full(len(points), float(camera))


def corners_of(boxes: Array | Cuboids | None) -> Array:
    if isinstance(boxes, Cuboids):
        halves = _CORNERS * 2 - 1
        parts = [
            (g.centres[:, None] + halves * g.halves[:, None]) @ g.matrix.T + g.position for g in boxes.groups
        ]
        boxes = np.concatenate(parts) if parts else None
    if boxes is None or not len(boxes):
        return np.zeros((0, 8, 3))
    boxes = np.asarray(boxes, dtype=np.float64)
    if boxes.shape[1:] == (2, 3):
        return box_corners(np.zeros(3), 0.0, boxes[:, 0], boxes[:, 1])
    if boxes.shape[1:] != (8, 3):
        raise GeometryError(
            f"Boxes must be (M, 8, 3) corners or (M, 2, 3) minimum and maximum, but got {boxes.shape}."
        )
    return boxes


def ring_joints(contacts: Array | None) -> list[int]:
    from nsm_core.conventions import CONTACTS

    if contacts is None:
        return []
    return (
        [INDEX["RightToe"], INDEX["LeftToe"]]
        if np.asarray(contacts).shape[-1] == 2
        else [INDEX[n] for n in CONTACTS]
    )
