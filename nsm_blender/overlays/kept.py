"""Takes whose inner life can be shown: kept in memory while Blender runs, by the action that holds their
keys.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

import bpy
import numpy as np

from nsm_core.body.skeleton import forward_kinematics
from nsm_core.control.insight import Insight
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.conventions import FPS
from nsm_core.rotations import Array

from ..animation.identity import identity
from ..keys.keyed import KeyedTake
from ..world.frame import WorldFrame

_MOST = 24  # takes; a minute of one is some 4 MB

_kept: OrderedDict[int | str, RememberedTake] = OrderedDict()


@dataclass
class RememberedTake:
    """A take as overlays read it: what the core made, in the core's frame, and on which frames of the scene
    it lies.
    """

    result: TakeResult
    frame: WorldFrame
    offsets: Array  # (23, 3)
    first: float
    fps: float

    def frame_at(self, scene_frame: float) -> int | None:
        """Number of the take's own frame (30 Hz) at one of the scene's; None before and after the take."""
        t = round((scene_frame - self.first) * FPS / self.fps)
        return t if 0 <= t < len(self.result.root) else None

    def insight_at(self, t: int) -> Insight | None:
        """What the network saw at frame ``t``; of the first, where it was not asked, what it saw next."""
        told = self.result.insights
        return told.get(t) or told.get(t + 1)

    def joints_at(self, t: int) -> Array:
        """Joints (23, 3) at frame ``t`` in the world, Blender units."""
        positions = forward_kinematics(
            self.result.hips_position[t], self.result.local_rotations[t], self.offsets
        )[0]
        return self.frame.to_world(np.asarray(positions))


def remember_take(
    keyed: KeyedTake, first: float, request: TakeRequest, result: TakeResult, frame: WorldFrame
) -> None:
    """Keep a take whose first key is at frame ``first``, for as long as Blender runs, or until many newer
    ones have come.
    """
    _kept[identity(keyed.action)] = RememberedTake(
        result, frame, request.figure.offsets, float(first), keyed.fps
    )
    while len(_kept) > _MOST:
        _kept.popitem(last=False)


def take_over(old: bpy.types.Action, new: bpy.types.Action) -> None:
    """Keep what is remembered of a take under the action that its keys are in now."""
    known = _kept.pop(identity(old), None)
    if known is not None:
        _kept[identity(new)] = known


def remembered_take(character: bpy.types.Object | None) -> RememberedTake | None:
    """Return the take in the action that a character has now; None where it has none, or one of an earlier
    session.
    """
    action = character.animation_data.action if character is not None and character.animation_data else None
    return None if action is None else _kept.get(identity(action))


def forget() -> None:
    """Keep nothing any more."""
    _kept.clear()
