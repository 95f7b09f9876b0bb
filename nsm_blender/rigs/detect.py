"""Find the bones that stand for the 23 joints: by presets, by the names of known rig families, by shape; the
best by hierarchy and geometry is taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import bpy
import numpy as np

from nsm_core.body.skeleton import INDEX, JOINTS, PARENTS
from nsm_core.data.captures.joint_map import SIDES, SPINE
from nsm_core.data.captures.joint_names import by_family, hangs, in_place, spine_of
from nsm_core.rotations import Array

from .bone_map import NEEDED, BoneMap, bones_of
from .presets import PRESET, Files, readable
from .shape import by_shape

Names = tuple[str, ...]
Parents = tuple[int, ...]
_LIMBS = (("Shoulder", "Elbow"), ("Elbow", "Wrist"), ("Hip", "Knee"), ("Knee", "Ankle"))
_ODD = 2.5  # times as long as a limb's other bone that one is at most
_ALIKE = 0.85  # of a limb's length that the other side's has at least
_SHAPE = "its shape"
_EXACT = 0.02  # of the score by which a preset, made for a rig, goes before names that are merely known


@lru_cache(maxsize=64)
def detect(names: Names, parents: Parents, heads: bytes, files: Files) -> BoneMap:
    """The best map of bones with ``names``, ``parents`` (indices, -1 for none) and ``heads`` (N, 3) float32
    as bytes, by the presets in ``files`` and by what is known; one that lacks needed joints where none is
    whole.
    """
    places = np.frombuffer(heads, np.float32).reshape(-1, 3).astype(np.float64)
    found = [judged(each, names, parents, places) for each in _candidates(names, parents, places, files)]
    found = [each for each in found if each.family != _SHAPE or not each.remarks]  # a guess must fit
    return max(found, key=lambda each: each.score, default=BoneMap({}, score=0.0))


def _candidates(names: Names, parents: Parents, places: Array, files: Files) -> Iterator[BoneMap]:
    at = set(names)
    for preset in readable(files):
        chosen = preset.among(at)
        if chosen is not None:
            yield chosen
    for family, read in by_family(names).items():
        joints = _whole(names, parents, read)
        if len(joints) >= len(NEEDED) // 2:
            yield BoneMap(joints, family=family.removesuffix(".toml").replace("_", " "))
    bones, spine = by_shape(parents, places)
    if bones:
        joints = {joint: names[bone] for joint, bone in bones.items()}
        yield BoneMap(joints | spread(tuple(names[bone] for bone in spine)), family=_SHAPE)


def _whole(names: Names, parents: Parents, read: dict[str, str]) -> dict[str, str]:
    """What a family has read, with the hips over legs and arms and the spine spread over Chest to Chest4."""
    joints = {joint: bone for joint, bone in read.items() if joint not in SPINE}
    limbs = [joints.get(side + name) for name in ("Hip", "Shoulder") for side in SIDES]
    if None in limbs or "Head" not in joints:
        return read
    hips = joints.get("Hips")
    if hips is None or not all(hangs(names, parents, limb, hips) for limb in limbs):
        shared = _shared(names, parents, limbs)
        if shared is None:
            return read
        joints["Hips"] = shared
    joints = _hanging(names, parents, in_place(names, parents, joints))
    return joints | spread(spine_of(names, parents, joints))


def spread(spine: Names) -> dict[str, str]:
    """Bones of a spine, from the pelvis up, over Chest to Chest4: the last one, which carries the arms, is
    Chest4.  Of more than four some are left to ride along.
    """
    count, most = len(spine), len(SPINE)
    if count <= most:
        return {SPINE[round(k * most / count) - 1]: bone for k, bone in enumerate(spine, 1)}
    return {joint: spine[round(k * count / most) - 1] for k, joint in enumerate(SPINE, 1)}


def _shared(names: Names, parents: Parents, bones: list[str]) -> str | None:
    """The lowest bone over some bones."""
    over = reversed(_line(names, parents, bones[0]))
    return next((name for name in over if all(hangs(names, parents, bone, name) for bone in bones)), None)


def _line(names: Names, parents: Parents, bone: str) -> list[str]:
    """Bones over a bone, from the root down."""
    line, at = [], parents[names.index(bone)]
    while at >= 0:
        line.append(names[at])
        at = parents[at]
    return line[::-1]


def _hanging(names: Names, parents: Parents, joints: dict[str, str]) -> dict[str, str]:
    """Without what hangs on no part of its own limb, but for feet, which some rigs hang on their root."""
    kept = dict(joints)
    for side in SIDES:
        for upper, lower in _LIMBS[:3]:
            a, b = kept.get(side + upper), kept.get(side + lower)
            if a is not None and b is not None and not hangs(names, parents, b, a):
                del kept[side + lower]
    return kept


def judged_on(data: bpy.types.Armature, bone_map: BoneMap) -> BoneMap:
    """A map with its score and remarks on an armature; bones that it lacks do not count."""
    names, parents, heads = bones_of(data)
    here = {joint: bone for joint, bone in bone_map.joints.items() if bone in data.bones}
    return judged(replace(bone_map, joints=here), names, parents, heads.astype(np.float64))


def judged(candidate: BoneMap, names: Names, parents: Parents, places: Array) -> BoneMap:
    """A map with its score: the share of the joints that have bones, times that of the checks they pass."""
    index = {name: i for i, name in enumerate(names)}
    at = {joint: places[index[bone]] for joint, bone in candidate.joints.items()}
    needed = sum(joint in at for joint in NEEDED) / len(NEEDED)
    checks = _checks(at)
    if not candidate.properties:  # controls hang on what moves bones, not on each other
        checks |= {
            f"{joint} hangs on no bone of the joints above it": _hangs_right(candidate, names, parents, joint)
            for joint in at
            if joint != "Hips"
        }
    passed = (sum(checks.values()) / max(len(checks), 1)) ** 3  # one thing odd is much
    score = needed**2 * passed * (0.8 + 0.2 * len(at) / len(JOINTS)) * (1 - _EXACT)
    if candidate.family.startswith(PRESET):
        score += _EXACT * needed**2 * passed
    remarks = tuple(sentence for sentence, well in checks.items() if not well)
    return replace(candidate, score=float(score), remarks=remarks)


def _hangs_right(candidate: BoneMap, names: Names, parents: Parents, joint: str) -> bool:
    above = PARENTS[INDEX[joint]]
    while above >= 0 and JOINTS[above] not in candidate.joints:
        above = PARENTS[above]
    return above < 0 or hangs(names, parents, candidate.joints[joint], candidate.joints[JOINTS[above]])


def _checks(at: dict[str, Array]) -> dict[str, bool]:
    """What is true of a body's joints ``at`` their places, as sentences that say the opposite."""
    checks: dict[str, bool] = {}
    pairs = [
        (at["Right" + n], at["Left" + n], n)
        for n in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle")
        if "Right" + n in at and "Left" + n in at
    ]
    if not pairs or not {"Hips", "Head"} <= set(at):
        return {"hips, head or limbs are missing": False}
    across = sum(left - right for right, left, _ in pairs)
    up = at["Head"] - at["Hips"]
    for right, left, name in pairs:
        checks[f"the sides of {name} are exchanged"] = bool((left - right) @ across > 0)
    for side in SIDES:
        for a, b in _LIMBS:
            if side + a not in at or side + b not in at:
                continue
            own = np.linalg.norm(at[side + b] - at[side + a])
            others = [np.linalg.norm(at[s + b] - at[s + a]) for s in SIDES if s + a in at and s + b in at]
            checks[f"{side}{a} is far from as long as the other side's"] = bool(
                own >= _ALIKE * max(others) > 0
            )
        for a, b, c in (("Shoulder", "Elbow", "Wrist"), ("Hip", "Knee", "Ankle")):
            if {side + a, side + b, side + c} <= set(at):
                upper = float(np.linalg.norm(at[side + b] - at[side + a]))
                lower = float(np.linalg.norm(at[side + c] - at[side + b]))
                checks[f"{side}{b} is far from the middle of its limb"] = (
                    upper < _ODD * lower < _ODD**2 * upper
                )
        for low, high in (("Ankle", "Knee"), ("Knee", "Hip"), ("Ankle", "Shoulder")):
            if side + low in at and side + high in at:
                checks[f"{side}{low} is not under {side}{high}"] = bool(
                    (at[side + high] - at[side + low]) @ up > 0
                )
        if side + "Toe" in at and side + "Ankle" in at:
            ahead = np.cross(across, up)
            checks[f"{side}Toe is not ahead of {side}Ankle; are left and right exchanged?"] = bool(
                (at[side + "Toe"] - at[side + "Ankle"]) @ ahead > 0
            )
    return checks
