"""Which bone of an armature stands for which of the 23 joints: as the animator has it, by our own names, or
found.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import bpy
import numpy as np

from nsm_core.body.skeleton import JOINTS
from nsm_core.data.captures.joint_map import REQUIRED
from nsm_core.errors import SkeletonError
from nsm_core.rotations import Array

from ..animation.identity import identity

NEEDED = (*REQUIRED, "Chest4")  # joints without which no performance can be put on a rig
OWN = "the bundled character"


@dataclass(frozen=True)
class LimbControls:
    """The IK controls of a hand or a foot: the bone ``control`` that pulls it, its ``pole`` and the control
    of its ``toe`` ("" for none), bones that must be ``still``, and ``properties`` as of a BoneMap that have
    the limb obey them.
    """

    control: str
    pole: str = ""
    toe: str = ""
    still: tuple[str, ...] = ()
    properties: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def bones(self) -> list[str]:
        """All bones that are named."""
        return [name for name in (self.control, self.pole, self.toe, *self.still, *self.properties) if name]


@dataclass(frozen=True)
class BoneMap:
    """The bones of one rig.

    ``joints``: joint of the 23 -> bone that gets the keys; joints without one follow the joint above them.
    ``shown``: joint -> bone that shows the result, where controls move other bones.  ``properties``: bone ->
    custom property -> value, keyed with a take (switches from IK to FK).  ``limbs``: wrist or ankle -> its IK
    controls, which get the keys of the limb where ``use_ik`` says so.  ``fingers``: name, which begins with
    Left or Right -> bones from the palm outwards, where they are not simply found under the hand.  ``family``
    tells where the map is from, ``score`` (0..1) how well it fits, ``remarks`` what is odd about it.
    """

    joints: Mapping[str, str]
    shown: Mapping[str, str] = field(default_factory=dict)
    properties: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    limbs: Mapping[str, LimbControls] = field(default_factory=dict)
    use_ik: bool = False
    fingers: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    family: str = ""
    score: float = 1.0
    remarks: tuple[str, ...] = ()

    @property
    def pulled(self) -> Mapping[str, LimbControls]:
        """The limbs whose IK controls get the keys."""
        return self.limbs if self.use_ik else {}

    @property
    def switches(self) -> dict[str, dict[str, float]]:
        """The custom properties that are keyed: ``properties``, over them those of limbs that are pulled."""
        merged = {bone: dict(values) for bone, values in self.properties.items()}
        for controls in self.pulled.values():
            for bone, values in controls.properties.items():
                merged.setdefault(bone, {}).update(values)
        return merged

    @property
    def hips(self) -> str:
        """The bone that carries the whole body."""
        return self.joints["Hips"]

    def seen(self, joint: str) -> str:
        """The bone on which a joint with a bone is seen."""
        return self.shown.get(joint, self.joints[joint])

    def lacking(self, bones: Mapping[str, Any]) -> tuple[list[str], list[str]]:
        """Needed joints without a bone, and bones of the map that are not among ``bones``."""
        controls = (bone for limb in self.limbs.values() for bone in limb.bones)
        named = (*self.joints.values(), *self.shown.values(), *self.properties, *controls)
        return [joint for joint in NEEDED if joint not in self.joints], [b for b in named if b not in bones]

    def problem(self, name: str, bones: Mapping[str, Any]) -> str:
        """Why the armature ``name`` cannot act by this map, as a sentence with what to do; empty where it
        can.
        """
        missing, gone = self.lacking(bones)
        if gone:
            return (
                f"{name} has no bone {', '.join(dict.fromkeys(gone))}, which its bone list names; choose "
                "another one under Bones, or press Detect."
            )
        if missing:
            more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
            return (
                f"No bone of {name} was found for {', '.join(missing[:3])}{more}; choose the bones under "
                "Bones in the sidebar, or add the bundled character."
            )
        twice = sorted({b for b in self.joints.values() if list(self.joints.values()).count(b) > 1})
        if twice:
            return f"The bone {twice[0]} of {name} stands for two joints; give each a bone of its own."
        return ""


_OWN_MAP = BoneMap({name: name for name in JOINTS}, family=OWN)


def bone_map_of(armature: bpy.types.Object) -> BoneMap:
    """The map of an armature: the list that it carries, else our own names, else what is found.  It may lack
    bones: see ``BoneMap.problem``.
    """
    data = armature.data
    known = stored_map(data) or (_OWN_MAP if set(JOINTS) <= set(data.bones.keys()) else found_map(data))
    rig = getattr(data, "nsm_rig", None)
    return replace(known, use_ik=rig is not None and rig.limbs == "IK" and bool(known.limbs))


_told: dict[tuple[int | str, tuple[str, ...]], BoneMap] = {}
_MOST_TOLD = 32


def told_map(armature: bpy.types.Object) -> BoneMap:
    """The map of an armature as panels tell of it: what was found is found anew only where bones have other
    names, so that drawing costs nothing.
    """
    data = armature.data
    known = stored_map(data)
    if known is None:
        key = identity(data), tuple(data.bones.keys())
        if key not in _told and len(_told) >= _MOST_TOLD:
            _told.clear()
        known = _told[key] = _told.get(key) or bone_map_of(armature)
    return known


def forget_told() -> None:
    """Have panels tell anew of what is found: presets have changed."""
    _told.clear()


def require_map(armature: bpy.types.Object) -> BoneMap:
    """The map of an armature; SkeletonError where it lacks bones."""
    bone_map = bone_map_of(armature)
    problem = bone_map.problem(armature.name, armature.data.bones)
    if problem:
        raise SkeletonError(problem)
    return bone_map


def found_map(data: bpy.types.Armature) -> BoneMap:
    """The map that fits an armature best by names, hierarchy and shape; one without needed bones where none
    does.
    """
    from .detect import detect
    from .presets import preset_files

    names, parents, heads = bones_of(data)
    return detect(names, parents, heads.tobytes(), preset_files())


def bones_of(data: bpy.types.Armature) -> tuple[tuple[str, ...], tuple[int, ...], Array]:
    """Names, parents (-1 for none) and heads (N, 3) float32 of an armature's bones at rest."""
    names = tuple(data.bones.keys())
    at = {name: i for i, name in enumerate(names)}
    parents = tuple(at[bone.parent.name] if bone.parent else -1 for bone in data.bones)
    heads = np.empty(3 * len(names), np.float32)
    data.bones.foreach_get("head_local", heads)
    return names, parents, heads.reshape(-1, 3)


def stored_map(data: bpy.types.Armature) -> BoneMap | None:
    """The map that an armature carries; None where it has none, or where the add-on is switched off."""
    rig = getattr(data, "nsm_rig", None)
    if rig is None or not len(rig.joints):
        return None
    extras = json.loads(rig.extras or "{}")
    joints = {row.name: row.bone for row in rig.joints if row.bone and row.name in JOINTS}
    shown = {joint: bone for joint, bone in extras.get("shown", {}).items() if joint in joints}
    limbs = {
        joint: LimbControls(**{**each, "still": tuple(each["still"])})
        for joint, each in extras.get("limbs", {}).items()
    }
    fingers = {name: tuple(bones) for name, bones in extras.get("fingers", {}).items()}
    return BoneMap(
        joints,
        shown,
        extras.get("properties", {}),
        limbs,
        fingers=fingers,
        family=rig.family,
        score=rig.score,
    )


def store_map(data: bpy.types.Armature, bone_map: BoneMap) -> None:
    """Have an armature carry a map: one row for each of the 23."""
    rig = data.nsm_rig
    rig.joints.clear()
    for joint in JOINTS:
        row = rig.joints.add()
        row.name, row.bone = joint, bone_map.joints.get(joint, "")
    rig.family, rig.score, rig.remarks = bone_map.family, bone_map.score, "\n".join(bone_map.remarks)
    extras = {
        "shown": dict(bone_map.shown),
        "properties": dict(bone_map.properties),
        "limbs": {joint: asdict(controls) for joint, controls in bone_map.limbs.items()},
        "fingers": dict(bone_map.fingers),
    }
    rig.extras = json.dumps(extras)
