"""The way through a door from one side, and which hand opens it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.distances import HANDLE_ASIDE, HANDLE_STAND, PASS_BEYOND, PULL_BACK
from nsm_core.rotations import Array, direction_to_heading, heading_to_direction, rotate_planar, wrap_angle
from nsm_core.world.scene.props import Leaf

TAKEN_AJAR = np.radians(40)  # angle of a leaf that is ajar up to which who pulls it goes round with it


@dataclass(frozen=True)
class Passage:
    """The way through a door from one side: planar places (2,), metres, and headings, world.

    ``heading`` the way to pass; ``push`` whether the leaf swings away; ``side`` +1 or -1, the leaf's side on
    which the handle is reached; ``hand`` 0 right, 1 left; ``reach`` where one stands to take the handle and
    ``facing`` the heading there; ``back`` where one stands once a leaf is pulled open (the same as ``reach``
    for a push); ``middle`` of the opening; ``beyond`` where one stands at the end.
    """

    heading: float
    push: bool
    side: float
    hand: int
    reach: Array
    facing: float
    back: Array
    middle: Array
    beyond: Array


def passage(leaf: Leaf, coming_from: Array, beyond: float = PASS_BEYOND) -> Passage:
    """Work out how to pass a door for someone who comes from ``coming_from`` (2,), world.

    The hand on the handle's side opens the door: its shoulder is nearly before the handle while the body is
    before the opening, and the leaf swings clear of the body.
    """
    along = heading_to_direction(np.array(leaf.closed + np.pi / 2))  # +X of the frame: heading 0 faces -Y
    through = np.array((-along[1], along[0]))  # +Y of the frame
    hinge = leaf.pose[:2]
    side = 1.0 if float((np.asarray(coming_from, dtype=np.float64)[:2] - hinge) @ through) > 0 else -1.0
    go = -side * through
    push = bool(leaf.swing * -side > 0)
    heading = float(direction_to_heading(go))
    # Which hand: with the eyes along ``go``, the hinge is on the right where -along points to the right.
    right = np.array((go[1], -go[0]))
    hinge_right = float(-along @ right) > 0
    hand = int(hinge_right)
    handle = hinge + along * float(leaf.handle[0])
    reach = handle - HANDLE_ASIDE * along - HANDLE_STAND * go
    middle = hinge + along * leaf.width / 2
    back = reach if push else reach - PULL_BACK * go
    # A leaf that stands ajar towards one is taken where it stands.
    turn = 0.0 if push else leaf.swing * float(np.clip(leaf.angle, 0.0, TAKEN_AJAR))
    reach = hinge + rotate_planar(reach - hinge, np.float64(turn))
    return Passage(
        heading,
        push,
        side,
        hand,
        reach,
        float(wrap_angle(heading + turn)),
        back,
        middle,
        middle + beyond * go,
    )
