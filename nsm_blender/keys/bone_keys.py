"""Keys of one bone: its moves, and what must not bend the skeleton meanwhile."""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np

from nsm_core.rotations import Array

from ..animation.channels import ActionChannels
from ..rigs.armature import Placement
from .fewer import ROOT, KeptKeys
from .root_motion import RootChannels
from .turns import rotation_channel

_NO_TURN = {"rotation_quaternion": (1.0, 0.0, 0.0, 0.0), "rotation_axis_angle": (0.0, 0.0, 1.0, 0.0)}


def key_bone(
    channels: ActionChannels,
    bone: bpy.types.PoseBone,
    frames: Array,
    turns: Array | None,
    location: Array | None,
    others: set[tuple[str, str]],
    kept: KeptKeys | None,
) -> None:
    prefix = f'pose.bones["{bpy.utils.escape_identifier(bone.name)}"].'
    key_moves(channels, prefix, bone.name, bone.rotation_mode, frames, turns, location, kept)
    key_still(channels, bone, frames, others, turned=turns is not None, moved=location is not None)


def key_still(
    channels: ActionChannels,
    bone: bpy.types.PoseBone,
    frames: Array,
    others: set[tuple[str, str]],
    turned: bool = False,
    moved: bool = False,
) -> None:
    """Put a bone that was moved, turned or scaled by hand, or by a strip (``others``), back by one key, in
    this action only.

    It would bend the skeleton the take was made for.  ``turned`` and ``moved``: these channels have keys.
    """
    rotation = rotation_channel(bone.rotation_mode)
    rest = {
        "location": (0.0, 0.0, 0.0),
        "scale": (1.0, 1.0, 1.0),
        rotation: _NO_TURN.get(rotation, (0.0, 0.0, 0.0)),
    }
    for channel, done in (("location", moved), (rotation, turned), ("scale", False)):
        bent = max(abs(a - b) for a, b in zip(getattr(bone, channel), rest[channel], strict=True)) > 1e-6
        if not done and (bent or (bone.name, channel) in others):
            path = f'pose.bones["{bpy.utils.escape_identifier(bone.name)}"].{channel}'
            channels.curves(path, bone.name, frames[:1], np.array([rest[channel]]))


def key_moves(
    channels: ActionChannels,
    prefix: str,
    group: str,
    mode: str,
    frames: Array,
    turns: Array | None,
    places: Array | None,
    kept: KeptKeys | None,
) -> None:
    """Key rotation (N, 3 or 4) and location (N, 3), each where there is one, of what the paths begin with
    ``prefix``; where fewer keys are kept, those.
    """
    width = 0 if turns is None else turns.shape[1]
    for path, values, part in (
        (rotation_channel(mode), turns, slice(width)),
        ("location", places, slice(width, None)),
    ):
        if values is None:
            continue
        if kept is None:
            channels.curves(prefix + path, group, frames, values)
        else:
            slopes = kept.slopes[:, part]
            channels.curves(prefix + path, group, frames[kept.rows], values[kept.rows], slopes)


def is_edited(bone: str, edited: Iterable[str]) -> bool:
    """Whether the animator has keys of a bone, of the paths of his keys."""
    return any(path.startswith(f'pose.bones["{bpy.utils.escape_identifier(bone)}"].') for path in edited)


def unedited(
    fewer: dict[int, KeptKeys], edited: set[str], placement: Placement, carrier: RootChannels | None
) -> dict[int, KeptKeys]:
    """Fewer keys only of what the animator has no keys of: to his a motion leads in every frame."""
    names = {
        j: f'pose.bones["{bpy.utils.escape_identifier(b)}"].'
        for j, b in enumerate(placement.keyed.bones)
        if b
    }
    if carrier is not None:
        names[ROOT] = carrier.prefix or "location"
    return {j: kept for j, kept in fewer.items() if not any(p.startswith(names[j]) for p in edited)}
