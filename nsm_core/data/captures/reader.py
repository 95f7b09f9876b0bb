"""Read BVH captures: files of the 23-joint skeleton as they are, any other hierarchy through a mapping onto
it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.body.skeleton import JOINTS, OFFSETS, PARENTS
from nsm_core.rotations import quat_normalize

from . import retarget
from .bvh_file import Bvh
from .bvh_parser import parse
from .gait import remark_on_rate
from .joint_map import SIDES, Mapping
from .joint_names import bodies, guess_mapping

__all__ = ["Bvh", "parse", "read_clip", "read_clips"]
# Metres that an offset may differ from the 23-joint skeleton's for the file to count as being on it.
_OWN_TOLERANCE = 0.015


def read_clip(path: str | Path, centimetres: bool = True, mapping: Mapping | None = None) -> Clip:
    """Read a BVH file as a Clip: metres, Z up, facing -Y, 30 Hz; of several bodies the first, which ``notes``
    of the clip tell.

    A file on the 23-joint skeleton (its names, its offsets, Y up, facing +Z) is taken as it is, in
    centimetres or else in metres.  Every other hierarchy is retargeted by ``mapping``, or by one guessed from
    the names of its joints.  Raises CaptureError with the line where the file breaks off or holds no numbers,
    and SkeletonError where joints stand for none of the 23.
    """
    return read_clips(path, centimetres, mapping)[0]


def read_clips(path: str | Path, centimetres: bool = True, mapping: Mapping | None = None) -> list[Clip]:
    """Read every body of a BVH file as ``read_clip`` does; the second's clip is named after the file with
    ".2" behind it.
    """
    source = parse(path, None if mapping is None else mapping.rate)
    parts = bodies(source, mapping if mapping is not None and mapping.joints else None)
    clips = [_clip(part, found, centimetres, mapping) for part, found in parts]
    if len(clips) > 1:
        roots = ", ".join("Hips" if found is None else found.joints["Hips"] for _, found in parts)
        told = (
            f"{source.name}.bvh holds {len(clips)} bodies ({roots}); this is the first, "
            f"the others go by {source.name}.2 and so on."
        )
        clips[0] = replace(clips[0], notes=(*clips[0].notes, told))
        clips[1:] = [replace(c, name=f"{source.name}.{n}") for n, c in enumerate(clips[1:], 2)]
    return clips


def _clip(source: Bvh, found: Mapping | None, centimetres: bool, mapping: Mapping | None) -> Clip:
    """One body as a clip; ``found`` is the mapping that fits it, None where names alone say that it is the
    23-joint skeleton.
    """
    plain = mapping is None or mapping == Mapping({}, rate=mapping.rate)
    if plain and _is_own(source, 0.01 if centimetres else 1.0):
        clip = _as_it_is(source.at_rate(), 0.01 if centimetres else 1.0)
    else:
        found = found or guess_mapping(source)
        if mapping is not None:  # what it says besides names
            found = replace(mapping, joints=found.joints, spine=mapping.spine or found.spine)
        clip = retarget.retarget(_needed(source, found), found)
    return replace(clip, notes=(*source.notes, *remark_on_rate(clip, 1 / source.interval)))


def _needed(source: Bvh, mapping: Mapping) -> Bvh:
    """The file without fingers, faces and whatever else a mapping does not name and nothing that it names
    hangs on.
    """
    names = {*mapping.joints.values(), *mapping.spine}
    if not names <= set(source.joints):
        return source  # which is told where it is retargeted
    names |= {f"{mapping.joints[side + 'Ankle']}_End" for side in SIDES}
    kept: set[int] = set()
    for j, name in enumerate(source.joints):
        while name in names and j >= 0 and j not in kept:
            kept.add(j)
            j = source.parents[j]
    return source.only(sorted(kept))


def _is_own(source: Bvh, unit: float) -> bool:
    """Whether the file is on the 23-joint skeleton: its names, and its offsets or none at all."""
    if not set(JOINTS) <= set(source.joints):
        return False
    found = [source.joints.index(n) for n in JOINTS[1:]]
    offsets = source.offsets[found][:, (0, 2, 1)] * (1, -1, 1) * unit
    if not offsets.any():
        return True
    own = [source.joints.index(JOINTS[p]) for p in PARENTS[1:]] == [source.parents[k] for k in found]
    return own and bool(np.abs(offsets - OFFSETS[1:]).max() < _OWN_TOLERANCE)


def _as_it_is(source: Bvh, unit: float) -> Clip:
    found = [source.joints.index(n) for n in JOINTS]
    # Y up, +Z forward to Z up, -Y forward: (x, y, z) -> (x, -z, y), for vectors and for rotation axes alike.
    hips = source.places[:, found[0]][:, (0, 2, 1)] * (1, -1, 1) * unit
    rotations = source.rotations[:, found][..., (0, 1, 3, 2)] * (1, 1, -1, 1)
    return Clip(source.name, hips.astype(np.float32), quat_normalize(rotations).astype(np.float32))
