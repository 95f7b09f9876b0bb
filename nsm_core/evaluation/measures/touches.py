"""What a body, or what it holds, comes into too deep: which part of it, in what, when, and doing what.

A figure alone (``objects.all_depths``) tells that a take is not clean; these lines tell why.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from nsm_core.body.capsules import Body
from nsm_core.control.take import TakeResult
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.props import LightThing, Prop

from .objects import depths_by_sphere, depths_in_prop, thing_depths, wrists

_APART = 8  # frames between two touches of the same that count as one


@dataclass(frozen=True)
class Brush:
    """A ``part`` of the body, or a thing, ``depth`` metres in ``what`` at most, from frame ``first`` to
    ``last``, the deepest in ``frame`` at a ``height`` over the floor, metres; ``doing`` what hands did then.
    """

    part: str
    what: str
    depth: float
    first: int
    last: int
    frame: int
    height: float
    doing: str

    def __str__(self) -> str:
        return (
            f"{self.part} {100 * self.depth:.1f} cm in {self.what} at {self.height:.2f} m, "
            f"frames {self.first} to {self.last}, {self.doing}"
        )


def touches(
    take: TakeResult,
    solids: Mapping[str, DistanceQuery],
    props: Mapping[str, Prop],
    deep: float,
    sunk: float,
) -> list[Brush]:
    """Where the body of a take is over ``deep`` metres in ``solids``, by their names, or in ``props``, where
    they are, and a light thing over ``sunk`` metres in solids; the deepest first.
    """
    body, found = Body.of(take.hips_position, take.local_rotations), list[Brush]()
    hands = wrists(take.hips_position, take.local_rotations)
    deeps = {name: depths_by_sphere(body, body.centres, query) for name, query in solids.items()}
    deeps |= {name: depths_in_prop(body, hands, prop, take.props[name]) for name, prop in props.items()}
    for name, depth in deeps.items():
        for part in dict.fromkeys(body.names):
            own = np.flatnonzero([n == part for n in body.names])
            each = depth[:, own]
            heights = body.centres[np.arange(len(each)), own[each.argmax(1)], 2]
            found += _spans(take, _plain(part), name, each.max(1), heights, deep)
    for name, prop in props.items():
        if isinstance(prop, LightThing):
            for other, query in solids.items():
                depth = thing_depths(prop, take.props[name], query)
                found += _spans(take, name, other, depth, take.props[name][:, 2], sunk)
    return sorted(found, key=lambda touch: -touch.depth)


def told(found: Sequence[Brush], most: int = 4) -> str:
    """The deepest touches in words."""
    return "; ".join(str(touch) for touch in found[:most])


def _spans(take: TakeResult, part: str, what: str, depth: Array, heights: Array, deep: float) -> list[Brush]:
    """Touches of one part in one thing: runs of frames that are deep, with short gaps."""
    frames = np.flatnonzero(depth > deep)
    if not len(frames):
        return []
    found = []
    for run in np.split(frames, np.flatnonzero(np.diff(frames) > _APART) + 1):
        worst = int(run[depth[run].argmax()])
        doing = take.insights[worst].doing if worst in take.insights else ""
        found.append(
            Brush(
                part, what, float(depth[worst]), int(run[0]), int(run[-1]), worst, float(heights[worst]),
                doing or "on the way",
            )
        )  # fmt: skip
    return found


def _plain(name: str) -> str:
    """The name of a capsule as one says it: its joints without the second where it is the same."""
    first, second = name.split("-")
    return first if first == second else f"{first} to {second}"


__all__ = ["Brush", "told", "touches"]
