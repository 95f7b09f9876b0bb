"""Triangles, lines and words in colours: what every overlay is made of, whoever draws it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from nsm_core.rotations import Array

Colour = Sequence[float]  # red, green, blue and opacity, 0..1, as the screen shows them

_OCTAHEDRON = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], np.float32)
_OCTAHEDRON_FACES = np.array(
    [(4, 0, 2), (4, 2, 1), (4, 1, 3), (4, 3, 0), (5, 2, 0), (5, 1, 2), (5, 3, 1), (5, 0, 3)]
)
_CUBE = np.array([(x, y, z) for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)], np.float32)
_CUBE_EDGES = np.array(
    [(0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (0, 4), (1, 5), (2, 6), (3, 7)]
)
_CUBE_FACES = np.array(
    [
        (0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4),
        (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5),
    ]
)  # fmt: skip


@dataclass
class Shapes:
    """What one overlay draws, in the world and Blender's units, or in pixels where it lies flat on the
    screen.

    ``triangles`` (3 T, 3) and ``lines`` (2 L, 3) float32 with a colour (.., 4) for each corner; ``words``
    places (3,), texts and colours; ``owners`` whose the corners are: names, and the numbers of corners of
    triangles and of lines at which theirs end.
    """

    triangles: Array = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    triangle_colours: Array = field(default_factory=lambda: np.zeros((0, 4), np.float32))
    lines: Array = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    line_colours: Array = field(default_factory=lambda: np.zeros((0, 4), np.float32))
    words: list[tuple[Array, str, Colour]] = field(default_factory=list)
    owners: list[tuple[str, int, int]] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(len(self.triangles) or len(self.lines) or self.words)

    def add_triangles(self, corners: Array, colours: Array | Colour) -> None:
        """Add triangles (T, 3, 3), each in its colour (T, 4) or all in one (4,)."""
        corners = np.asarray(corners, np.float32).reshape(-1, 3)
        self.triangles = np.concatenate((self.triangles, corners))
        self.triangle_colours = np.concatenate((self.triangle_colours, _spread(colours, len(corners), 3)))

    def add_lines(self, ends: Array, colours: Array | Colour) -> None:
        """Add lines (L, 2, 3), each in its colour (L, 4) or all in one (4,)."""
        ends = np.asarray(ends, np.float32).reshape(-1, 3)
        self.lines = np.concatenate((self.lines, ends))
        self.line_colours = np.concatenate((self.line_colours, _spread(colours, len(ends), 2)))

    def add_way(self, points: Array, colour: Colour) -> None:
        """Add a line through points (N, 3)."""
        if len(points) > 1:
            self.add_lines(np.stack((points[:-1], points[1:]), 1), colour)

    def add_balls(self, centres: Array, radii: Array, colours: Array | Colour) -> None:
        """Add balls of radius (N,) about centres (N, 3): as octahedra, which are cheap and read as dots."""
        corners = np.asarray(centres, np.float32)[:, None] + _OCTAHEDRON * np.asarray(radii)[:, None, None]
        colours = np.asarray(colours, np.float32)
        if colours.ndim == 2:
            # Lit from above: a flat octahedron is no ball.
            light = np.repeat((1.0, 0.6), 4).astype(np.float32)[None, :, None]
            shaded = np.repeat(colours[:, None], 8, 1)
            shaded[..., :3] *= light
            colours = shaded.reshape(-1, 4)
        self.add_triangles(corners[:, _OCTAHEDRON_FACES].reshape(-1, 3, 3), colours)

    def add_boxes(self, corners: Array, faces: Array | Colour | None, edges: Array | Colour | None) -> None:
        """Add boxes by their corners (N, 8, 3), as ``box_corners`` has them, with faces and edges in a colour
        each (N, 4) or in one.
        """
        if faces is not None:
            self.add_triangles(corners[:, _CUBE_FACES].reshape(-1, 3, 3), _each(faces, 12))
        if edges is not None:
            self.add_lines(corners[:, _CUBE_EDGES].reshape(-1, 2, 3), _each(edges, 12))

    def add_ring(self, centre: Array, radius: float, colour: Colour, count: int = 24) -> None:
        """Add a level circle about a centre (3,)."""
        angle = np.linspace(0, 2 * np.pi, count + 1)
        self.add_way(
            centre + radius * np.column_stack((np.cos(angle), np.sin(angle), np.zeros(count + 1))), colour
        )

    def add_arrow(self, start: Array, end: Array, colour: Colour) -> None:
        """Add an arrow that lies level, from ``start`` to ``end`` (3,)."""
        along = np.asarray(end, np.float64) - start
        across = np.array((-along[1], along[0], 0.0))
        tip = end - 0.3 * along
        self.add_lines(np.array(((start, end), (end, tip + 0.2 * across), (end, tip - 0.2 * across))), colour)

    def joined(self, others: Iterable[Shapes]) -> Shapes:
        """This and others as one."""
        every = [self, *others]
        return Shapes(
            *(
                np.concatenate([getattr(s, name) for s in every])
                for name in ("triangles", "triangle_colours", "lines", "line_colours")
            ),
            [word for s in every for word in s.words],
        )

    def moved(self, moves: Mapping[str, Array]) -> Shapes:
        """With what belongs to each owner moved by its matrix (4, 4), as far as it has one."""
        triangles, lines = self.triangles.copy(), self.lines.copy()
        begins = (0, 0)
        for name, *ends in self.owners:
            move = moves.get(name)
            if move is not None:
                for corners, begin, end in zip((triangles, lines), begins, ends, strict=True):
                    corners[begin:end] = corners[begin:end] @ move[:3, :3].T + move[:3, 3]
            begins = ends
        return replace(self, triangles=triangles, lines=lines)


def box_corners(size: Array, centre: Array, turn: Array | None = None) -> Array:
    """Corners (8, 3) of a box of ``size`` (3,) about ``centre`` (3,), turned by ``turn`` (3, 3)."""
    corners = _CUBE * np.asarray(size, np.float32)
    if turn is not None:
        corners = corners @ np.asarray(turn, np.float32).T
    return corners + np.asarray(centre, np.float32)


def _spread(colours: Array | Colour, corners: int, each: int) -> Array:
    colours = np.asarray(colours, np.float32)
    if colours.ndim == 1:
        return np.broadcast_to(colours, (corners, 4))
    return np.repeat(colours, each, axis=0)


def _each(colours: Array | Colour, count: int) -> Array:
    colours = np.asarray(colours, np.float32)
    return np.repeat(colours, count, axis=0) if colours.ndim == 2 else colours
