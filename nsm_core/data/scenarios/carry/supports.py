"""What boxes rest on: the floor, tables, desks and blocks with room before one of their sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.data.scenarios.session import Session
from nsm_core.errors import GeometryError
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.world.scene import furniture
from nsm_core.world.scene.furniture import Furniture, top_of

from .draws import CARRIES

_SIDES = (0.0, np.pi / 2, np.pi, -np.pi / 2)  # headings of the outward normals of a piece's sides


@dataclass
class Support:
    """A piece with a level top at height ``top``, used from the side whose outward normal has the heading
    ``side``.

    ``reach`` metres from the piece's origin to the edge of its top on that side, ``along`` where along the
    edge a box rests, ``edge`` metres from the edge to the near face of the box, negative where it stands out
    over it.
    """

    piece: Furniture
    top: float
    side: float
    reach: float
    along: float
    edge: float

    @property
    def footprint(self) -> tuple[Array, Array]:
        """Least and greatest x, y, metres, own frame."""
        return self.piece.mins[:, :2].min(0), self.piece.maxs[:, :2].max(0)

    @property
    def radius(self) -> float:
        """Metres from its middle to its farthest corner."""
        return 0.5 * float(np.linalg.norm(self.piece.size[:2]))

    def place(self, centre: Array, facing: float, depth: float) -> tuple[Array, float]:
        """Position (2,) and heading of the piece under a box ``depth`` deep at ``centre`` (2,), whose carrier
        faces ``facing``.
        """
        heading = facing + np.pi - self.side
        normal = heading_to_direction(np.array(self.side))
        tangent = np.array((-normal[1], normal[0]))
        at = normal * (self.reach - self.edge - depth / 2) + tangent * self.along
        return centre - rotate_planar(at, np.float64(heading)), float(heading)

    def extent(self, box_ahead: float) -> tuple[float, float]:
        """Width and depth of the piece as seen from where one stands, with allowance for a box off its
        middle.
        """
        size = self.piece.size[:2] if abs(np.cos(self.side)) > 0.5 else self.piece.size[1::-1]
        return float(size[0] + 2 * abs(self.along)), float(size[1] + 0.2)


def draw_support(session: Session, across: tuple[float, float]) -> Support | None:
    """Draw what a box of width and depth ``across`` rests on; None for the floor."""
    rng = session.rng
    if rng.random() < CARRIES.floor:
        return None
    width, depth = across
    for _ in range(6):
        kind = str(rng.choice(CARRIES.supports))
        if kind == "crate":
            low, wide = rng.uniform(*CARRIES.top), rng.uniform(*CARRIES.wider)
            piece = furniture.make(
                "box", rng, width=width + wide + 0.04, depth=depth + rng.uniform(*CARRIES.deeper), height=low
            )
        else:
            piece = session.draw(kind)
        try:
            top, corners = top_of(piece)
        except GeometryError:
            continue
        if not 0.08 < top <= CARRIES.top[1] or piece.maxs[:, 2].max() > top + 0.02:
            continue
        for side in rng.permutation(_SIDES):
            normal = heading_to_direction(np.array(side))
            tangent = np.array((-normal[1], normal[0]))
            reach, back = (corners @ normal).max(), (corners @ normal).min()
            ends = np.sort(corners @ tangent)
            outline = np.array((piece.mins[:, :2].min(0), piece.maxs[:, :2].max(0)))
            room = ends[1] - ends[0] - width
            if (outline @ normal).max() - reach > 0.02 or reach - back < depth or room < 0:
                continue
            middle = (ends[0] + ends[1]) / 2
            along = middle + float(np.clip(rng.normal(0, CARRIES.off_middle), -room / 2, room / 2))
            edge = float(rng.uniform(-CARRIES.over_edge, min(CARRIES.inside_edge, reach - back - depth)))
            return Support(piece, float(top), float(side), float(reach), float(along), edge)
    return None


__all__ = ["Support", "draw_support"]
