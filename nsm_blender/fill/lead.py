"""A take that begins from any pose: the way from it to the take's quiet stand is filled in."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import replace
from typing import Any, Protocol, TypeVar

import bpy
import numpy as np

from nsm_core.rotations import Array

from ..animation.channels import remove_unused
from ..animation.kept import Kept, restored_on_failure
from ..animation.rate import scene_fps
from ..begin import STAND, others_of
from ..goals.resolve import moved_by
from ..keys.before import stand_before
from ..keys.edits import note_more_made, prints
from ..keys.keyed import KeyedTake
from ..overlays.kept import take_over
from ..prepare import TakeSpec
from ..progress import Progress
from .fill import fill_gap
from .gap import made_keys, own_channels
from .key_arrays import frames_of
from .spec import FillSpec
from .values import path_of

_LEAD = 1.0  # seconds from the pose to the stand


class Keyed(Protocol):
    """A take, as far as the way to it is concerned."""

    keyed: KeyedTake
    report: dict[str, Any]


_Take = TypeVar("_Take", bound=Keyed)


def led_in(
    spec: TakeSpec,
    scene: bpy.types.Scene,
    generated: Callable[[TakeSpec], Generator[Progress, None, _Take]],
) -> Generator[Progress, None, _Take]:
    """A take as ``generated`` makes it, which begins a second after ``spec.start_frame``, and what leads
    there from the pose at that frame.  All or nothing; raises as ``takes.generate`` and ``fill_gap``.
    """
    lead = round(_LEAD * scene_fps(scene))
    later = replace(spec, begin=STAND, start_frame=spec.start_frame + lead, lead=lead)
    moved = [*moved_by(spec.goals), *others_of(spec.character, scene)]
    with restored_on_failure(Kept(scene, [spec.character, *moved])):
        take = yield from generated(later)
        made = take.keyed
        _stand_still_before(made)
        gap = FillSpec(
            spec.character, spec.start_frame, later.start_frame, seed=spec.seed, replace=True,
            name=made.action.name,
        )  # fmt: skip
        filled = yield from fill_gap(gap, scene)
        channels = own_channels(spec.character)
        note_more_made(
            channels.action,
            np.concatenate(
                [
                    made_keys(channels),
                    *(_between(curve, spec.start_frame, made.frame_start) for curve in channels.bag.fcurves),
                ]
            ),
        )
        take_over(made.action, filled.keyed.action)
        made.action.use_fake_user = False
        name, old = made.action.name, made.action
        made.action, made.slot = filled.keyed.action, filled.keyed.slot
        remove_unused(old)
        made.action.name = name
        take.report["warnings"] += filled.report["notes"]
        return take


def _stand_still_before(take: KeyedTake) -> None:
    """Have bones that had no keys be as they were until the take begins."""
    values = {
        path_of(name, channel): numbers
        for name, transform in take.previous_pose
        if name in take.armature.pose.bones and isinstance(transform, dict)
        for channel, numbers in transform.items()
        if isinstance(numbers, tuple)
    }
    channels = own_channels(take.armature)
    stand_before(channels, take.previous_action, take.previous_slot, take.frame_start, values)
    take.armature.update_tag(refresh={"TIME"})
    bpy.context.view_layer.update()


def _between(curve: bpy.types.FCurve, start: float, end: float) -> Array:
    """Numbers of a curve's keys between two frames."""
    frames = frames_of(curve)
    return prints(curve)[(frames > start) & (frames < end)]
