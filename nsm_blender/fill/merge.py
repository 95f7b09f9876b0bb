"""What the NLA plays on a character as one action of its own, in which seams between strips can be filled."""

from __future__ import annotations

import bpy
import numpy as np

from nsm_core.errors import GapError

from ..animation.channels import assign, has_strips, new_action, strip_curves
from ..animation.kept import Kept, frame_kept, restored_on_failure
from ..animation.rate import scene_fps
from ..keys.keyed import KeyedTake, pose_of
from ..keys.layers import require_keyable
from ..prepare import require_character

_KINDS = (bool, int, float)


def merge_strips(character: bpy.types.Object, scene: bpy.types.Scene) -> KeyedTake:
    """Key what the NLA plays on a character, every whole frame from its first strip to its last, in a new
    action that plays over the strips; these stay as they are.

    Raises GapError where there are no strips to merge, and NsmError as ``fill_gap``; everything is then as it
    was.
    """
    require_character(character, scene)
    require_keyable(character)
    if not has_strips(character):
        raise GapError(
            f"The NLA plays no strips of {character.name}, or an action lies over them; there is nothing to "
            "merge."
        )
    data = character.animation_data
    strips = [s for track in data.nla_tracks if not track.mute for s in track.strips if not s.mute]
    first = int(np.floor(min(s.frame_start for s in strips)))
    last = int(np.ceil(max(s.frame_end for s in strips)))
    paths: dict[str, str] = {}
    for curve in strip_curves(character):
        if _values(character, curve.data_path) is not None:
            paths.setdefault(curve.data_path, curve.group.name if curve.group else character.name)
    frames = np.arange(first, last + 1)
    with restored_on_failure(Kept(scene, [character])):
        pose = pose_of(character, placed=True)
        each: dict[str, list[np.ndarray]] = {path: [] for path in paths}
        with frame_kept(scene):
            for frame in frames.tolist():
                scene.frame_set(frame)
                for path, values in each.items():
                    values.append(_values(character, path))
        channels = new_action(f"{character.name} merged", character.name)
        for path, values in each.items():
            channels.curves(path, paths[path], frames, np.stack(values))
        assign(character, channels.action, channels.slot)
        character.update_tag(refresh={"TIME"})
        bpy.context.view_layer.update()
    return KeyedTake(
        character, channels.action, channels.slot, first, last, scene_fps(scene), None, None, False, pose
    )


def _values(character: bpy.types.Object, path: str) -> np.ndarray | None:
    """The numbers of a property now; None where there is none, or it holds something else."""
    try:
        value = character.path_resolve(path)
    except ValueError:
        return None
    if isinstance(value, _KINDS):
        return np.array([value], dtype=np.float64)
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        return None
