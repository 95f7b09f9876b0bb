"""Doors made of boxes: a leaf that turns about its hinge, in a wall with an opening.

Door frame: origin on the floor under the hinge, +X along the closed leaf towards its free edge, Z up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array

from .furniture import Furniture, build
from .furniture.as_props import door_leaf
from .furniture.measures import pick
from .props import Leaf

_GAP = 0.012  # metres between the leaf and what is around it
_WIDEST_SWING = np.radians(100)  # what the post at the hinge leaves room for


@dataclass
class Door:
    """A door: what stands and what turns, both in the door frame.

    ``wall`` the parts of the wall left and right of the opening and the lintel; ``piece`` the leaf when shut,
    with its handles; ``width`` metres from hinge to free edge; ``handle`` (3,) on the leaf's middle plane;
    ``thickness`` metres between the grips on either side.
    """

    wall: Furniture
    piece: Furniture
    width: float
    handle: Array
    thickness: float

    def leaf(self, pose: ArrayLike = (0, 0, 0, 0), swing: float = 1.0, name: str = "Door") -> Leaf:
        """Return the shut leaf at ``pose`` (4,): x, y, 0 and heading of the door frame; ``swing`` as in
        ``props.Leaf``.
        """
        return door_leaf(
            self.piece,
            np.asarray(pose, dtype=np.float64),
            self.width,
            self.handle,
            self.thickness,
            swing,
            name,
        )


def make_door(rng: np.random.Generator, **overrides: float) -> Door:
    """Make a door; measures not given are drawn from ``rng``.

    ``overrides`` in metres: width and height of the leaf, panel (its thickness), grips (between the places to
    hold), handle_height, handle_edge (from the free edge), lever (its length), depth of the wall, near and
    far (lengths of wall at the hinge and at the free edge), over (wall above the leaf).  Raises GeometryError
    on an unknown or impossible measure.
    """
    o = dict(overrides)
    m = pick(
        rng,
        o,
        width=(0.75, 1.0),
        height=(2.0, 2.1),
        panel=(0.03, 0.05),
        grips=(0.1, 0.14),
        handle_height=(0.9, 1.1),
        handle_edge=(0.05, 0.09),
        lever=(0.03, 0.12),
        depth=(0.08, 0.2),
        near=(0.4, 2.0),
        far=(0.4, 2.0),
        over=(0.2, 0.5),
    )
    if o:
        raise GeometryError(f"A door has no measure {', '.join(sorted(o))}; leave it out.")
    w, h, t, g = m["width"], m["height"], m["panel"] / 2, m["grips"] / 2
    x, z = w - m["handle_edge"], m["handle_height"]
    near, far = sorted((t, g))
    levers = [
        (x - m["lever"], x + 0.015, a, b, z - 0.015, z + 0.015) for a, b in ((-far, -near), (near, far))
    ]
    piece = build("leaf", [(0, w, -t, t, 0.0, h), *levers], centred=False)
    # The leaf turns about the middle of its edge: the post stands back, so that it can open wider than
    # square.
    post = -(t + _GAP + max(m["depth"] / 2 - t, 0) * float(np.tan(_WIDEST_SWING - np.pi / 2)))
    y, top = m["depth"] / 2, h + _GAP
    left, right = post - m["near"], w + _GAP + m["far"]
    wall = build(
        "doorway",
        [
            (left, post, -y, y, 0, top),
            (w + _GAP, right, -y, y, 0, top),
            (left, right, -y, y, top, top + m["over"]),
        ],
        centred=False,
    )
    wall.opening = (post, w + _GAP, top)
    return Door(wall, piece, w, np.array((x, 0.0, z)), m["grips"])
