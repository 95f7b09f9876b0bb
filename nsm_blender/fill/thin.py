"""An animation kept as a pose and its pace a second, from which ``fill_gap`` makes the rest again
(papers/001, section 7.4).
"""

from __future__ import annotations

import bpy
import numpy as np

from nsm_core.errors import GapError

from ..animation.channels import assign, copied_channels
from ..animation.kept import Kept, restored_on_failure
from ..animation.rate import scene_fps
from ..keys.keyed import KeyedTake, pose_of
from ..keys.layers import require_keyable
from ..prepare import require_character
from .gap import body_curves, own_channels, pose_span
from .key_arrays import generated, merged, read_keys, taken, write_keys
from .keys import require_open

_SAME = 1e-3  # frames by which two keys are at one place


def thin_out(
    character: bpy.types.Object, scene: bpy.types.Scene, seconds: float = 1.0
) -> tuple[KeyedTake, tuple[int, int]]:
    """Key a copy of a character's action that has two frames every so many ``seconds`` of its body, a pose
    and the next for its pace, and the last; all else of it stays.  The copy plays then.

    The counts are of the body's keys before and after.  Raises GapError and SkeletonError as ``fill_gap``;
    everything is then as it was.
    """
    require_character(character, scene)
    require_keyable(character)
    playing = own_channels(character)
    span, rate = pose_span(character), scene_fps(scene)
    if span is None or span[1] - span[0] < seconds * rate:
        raise GapError(
            f"The animation of {character.name} is shorter than {seconds:g} s, so that no frame can be left "
            "out of it."
        )
    curves = body_curves(character, playing)
    for own in curves.values():
        require_open(own, character.name)
    first, last = span
    poses = first + np.arange(0, last - first, round(seconds * rate))
    frames = np.unique(np.concatenate((poses, poses + 1, [last - 1, last])).clip(first, last))
    before, after = 0, 0
    with restored_on_failure(Kept(scene, [character])):
        pose, fake_user = pose_of(character), playing.action.use_fake_user
        playing.action.use_fake_user = True  # or it would be lost with the file's next save
        channels = copied_channels(playing, f"{playing.action.name} thinned out")
        for own in body_curves(character, channels).values():
            for curve in own:
                keys = read_keys(curve)
                before += len(keys["co"])
                within = (keys["co"][:, 0] >= first - _SAME) & (keys["co"][:, 0] <= last + _SAME)
                there = (np.abs(keys["co"][:, :1] - frames) < _SAME).any(1)
                new = generated(frames, np.array([curve.evaluate(frame) for frame in frames]))
                keys, _ = merged(taken(keys, there | ~within), new)
                write_keys(curve, keys)
                after += len(keys["co"])
        assign(character, channels.action, channels.slot)
        character.update_tag(refresh={"TIME"})
        bpy.context.view_layer.update()
    keyed = KeyedTake(
        character,
        channels.action,
        channels.slot,
        int(np.ceil(first)),
        int(np.floor(last)),
        rate,
        playing.action,
        playing.slot,
        fake_user,
        pose,
    )
    return keyed, (before, after)
