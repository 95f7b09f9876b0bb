"""The kitchen in which tea is made: a mug behind a bowl in a wall cupboard, a jar in a drawer beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .kitchen import Kitchen, make_kitchen

TEA, MUG, JAR = 1418, "mug 5", "jar 2"  # a seed that has the mug so within reach, and drawers close by
_NEARER = {MUG: 0.047, "bowl 5": 0.03}  # metres by which they stand nearer to the front than drawn
_DRAWER, _BESIDE = "drawer 1", (0.1, -0.17)  # where the jar stands, metres from the middle of its furniture


def tea_kitchen() -> Kitchen:
    """Make the kitchen of the seed ``TEA`` with its mug and the bowl before it at the front of their board,
    so that one need not lean far under the cupboard for it, and its jar in the topmost drawer instead of the
    one below, at whose back no hand has room.
    """
    kitchen = make_kitchen(TEA)
    for name, nearer in _NEARER.items():
        kitchen.things[name].thing.pose[1] -= nearer
    standing = kitchen.things[JAR]
    holder = kitchen.containers[standing.container]
    number, board = next((k, b) for k, b in enumerate(holder.boards) if b.rides == _DRAWER)
    place = holder.to_world(np.array((*_BESIDE, board.height)))
    standing.thing.pose = np.append(place, standing.thing.pose[3])
    kitchen.things[JAR] = replace(standing, board=number)
    return kitchen


__all__ = ["JAR", "MUG", "TEA", "tea_kitchen"]
