"""What else moves a character or a thing than the keys of its own action: refused before a take where keys
could not rule.

An action rules what it keys unless something is evaluated after it (constraints, drivers), hides it or is
mixed with it (the
NLA).  What merely carries the character (parents, constraints and NLA strips of the armature object, bones
above the hips) is no reason to refuse: keys are made to follow it, see ``mount``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

import bpy

from nsm_core.errors import NsmError, SkeletonError

from ..animation.channels import strip_curves
from ..rigs.armature import Placement
from ..rigs.bone_map import bone_map_of
from ..rigs.mount import Mount
from .turns import rotation_channel

_STRING = r'\["((?:[^"\\]|\\.)*)"\]'
_BONE_PATH = re.compile(rf"pose\.bones{_STRING}\.(\w+)(?:{_STRING}\.(\w+))?$")
_FLAG_PATH = re.compile(
    rf"bones{_STRING}\.(use_inherit_rotation|use_local_location|use_inherit_scale|inherit_scale)$"
)
_SWITCHES = {"influence", "mute", "enabled"}
_SCALES = {"scale", "delta_scale"}


def bones_between(armature: bpy.types.Object) -> list[str]:
    """Bones that lie between two bones of the body."""
    keyed = set(bone_map_of(armature).joints.values())
    between: dict[str, None] = {}
    for name in keyed:
        line = [parent.name for parent in armature.data.bones[name].parent_recursive]
        carrier = next((i for i, over in enumerate(line) if over in keyed), 0)
        between |= dict.fromkeys(line[:carrier])
    return [bone.name for bone in armature.data.bones if bone.name in between]


def require_keyable(armature: bpy.types.Object) -> None:
    """Raise an NsmError that names what else would move the armature's 23 joints once they have keys, and
    what to do about it.

    ``armature`` has passed ``armature.require_skeleton``.
    """
    require_editable(armature)
    evaluated = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
    if not evaluated.is_evaluated:
        raise SkeletonError(
            f"The armature {armature.name} is switched off in the viewport, so that it does not move; "
            "show it and its collection (the screen icons in the Outliner) and generate again."
        )
    if armature.data.pose_position == "REST":
        raise SkeletonError(
            f"The armature {armature.name} is shown in its rest position, so that keys do not move it; "
            "choose Pose Position in its data properties and generate again."
        )
    require_action_rules(armature)
    bone_map = bone_map_of(armature)
    between = [] if bone_map.properties else bones_between(armature)  # controls have their own ways
    bones = [*bone_map.joints.values(), *between]
    loose = next((name for name in between if not armature.data.bones[name].use_inherit_rotation), None)
    if loose is not None:
        raise SkeletonError(
            f"The bone {loose} of {armature.name} lies between two joints and inherits no rotation, so that "
            "it bends the body; "
            "switch Inherit Rotation on in its bone properties."
        )
    Mount.of(armature, bone_map.hips)
    require_bones_rule(armature, bones)
    _require_flags_kept(armature, bones)
    _require_size_kept(armature)


def require_bones_rule(armature: bpy.types.Object, bones: list[str]) -> None:
    """Raise a SkeletonError where constraints or drivers move one of these bones whatever its keys say."""
    _require_no_constraints(armature, bones)
    _require_no_drivers(armature, bones)


def require_editable(target: bpy.types.Object) -> None:
    """Raise an NsmError where an object comes from another file and has no override that may be edited."""
    if target.library is not None:
        raise NsmError(
            f"{target.name} is linked from another file and cannot be animated; make a library override of "
            "it."
        )
    if target.override_library is not None and target.override_library.is_system_override:
        raise NsmError(
            f"{target.name} is a library override that is not editable; in the Outliner choose Library "
            "Override, Make, and generate again."
        )


def require_action_rules(target: bpy.types.Object) -> None:
    """Raise an NsmError where the NLA would hide the action of an object, or mix it with what lies below."""
    data = target.animation_data
    if data is None:
        return
    if data.use_tweak_mode:
        raise NsmError(
            f"{target.name} is in the NLA's tweak mode; leave it (Tab in the NLA editor) and generate again."
        )
    if not data.use_nla or not len(data.nla_tracks):
        return  # without tracks the action is played alone and in full
    solo = next((track.name for track in data.nla_tracks if track.is_solo), None)
    if solo is not None:
        raise NsmError(
            f"The NLA track {solo} of {target.name} is solo, so that nothing else is played; take its star "
            "off in the NLA editor."
        )
    if data.action_blend_type != "REPLACE" or data.action_influence < 1:
        blend = data.bl_rna.properties["action_blend_type"].enum_items[data.action_blend_type].name
        raise NsmError(
            f"The action of {target.name} is mixed with its NLA tracks ({blend}, influence "
            f"{data.action_influence:.2f}); "
            "set Blending to Replace and Influence to 1 in the NLA editor (Sidebar, Edited Action), or mute "
            "the NLA."
        )


def acts(constraint: bpy.types.Constraint, animated: Iterable[str] = ()) -> bool:
    """Whether a constraint moves its owner, or may: ``animated`` names those of its properties that drivers
    or strips set.
    """
    animated = set(animated)
    if constraint.mute and not animated & {"mute", "enabled"}:
        return False
    if constraint.influence <= 0 and "influence" not in animated:
        return False
    if constraint.type == "ARMATURE":
        return any(t.target is not None and t.weight > 0 for t in constraint.targets)
    if constraint.type == "PIVOT" or constraint.type == "ACTION" and constraint.use_eval_time:
        return True
    return not hasattr(constraint, "target") or constraint.target is not None


def animated_switches(owner: bpy.types.Object) -> dict[tuple[str, str], set[str]]:
    """Properties that turn constraints on and off and that drivers or NLA strips set, by (bone, constraint);
    bone "" is the object.
    """
    found: dict[tuple[str, str], set[str]] = {}
    for path in (*driven(owner), *_strip_paths(owner)):
        match = _BONE_PATH.match(path)
        own = re.match(rf"constraints{_STRING}\.(\w+)$", path)
        if match and match[2] == "constraints" and match[4] in _SWITCHES:
            found.setdefault((_plain(match[1]), _plain(match[3])), set()).add(match[4])
        elif own and own[2] in _SWITCHES:
            found.setdefault(("", _plain(own[1])), set()).add(own[2])
    return found


def channels_of_strips(armature: bpy.types.Object) -> set[tuple[str, str]]:
    """Channels (bone, property) that NLA strips of an armature set."""
    matches = (_BONE_PATH.match(path) for path in _strip_paths(armature))
    return {(_plain(m[1]), m[2]) for m in matches if m and m[3] is None}


def may_move(target: bpy.types.Object) -> bool:
    """Whether an object that is moved by no action of its own may still move: by parents, constraints,
    drivers or NLA strips.
    """
    data = target.animation_data
    if len(target.constraints) or data and (len(data.drivers) or len(data.nla_tracks)):
        return True
    return target.parent is not None and (target.parent_type != "OBJECT" or _moves(target.parent))


def carried(armature: bpy.types.Object) -> bool:
    """Whether the hips' channels may begin elsewhere from frame to frame: the object may move, or a bone
    above the hips.
    """
    apart = Placement.of(armature).keyed
    above = [
        bone
        for j in apart.apart
        for bone in armature.pose.bones[apart.bones[j]].parent_recursive
        if len(bone.constraints)
    ]
    return bool(above) or may_move(armature)


def _moves(target: bpy.types.Object) -> bool:
    data = target.animation_data
    return (
        bool(data and data.action)
        or target.type == "ARMATURE"
        or target.rigid_body is not None
        or may_move(target)
    )


def _require_no_constraints(armature: bpy.types.Object, bones: list[str]) -> None:
    switches = animated_switches(armature)
    for owner in armature.pose.bones:
        for constraint in owner.constraints:
            moved = next((name for name in _moved_by(owner, constraint) if name in bones), None)
            if moved is None or not acts(constraint, switches.get((owner.name, constraint.name), ())):
                continue
            on = (
                f"on its bone {owner.name} moves {moved}"
                if moved != owner.name
                else f"on its bone {owner.name} moves it"
            )
            raise SkeletonError(
                f"The constraint {constraint.name} {on} whatever its keys say; mute or remove it on "
                f"{armature.name} and generate again."
            )


def _moved_by(owner: bpy.types.PoseBone, constraint: bpy.types.Constraint) -> Iterator[str]:
    """Names of the bones that a constraint of ``owner`` moves itself, the owner first."""
    if constraint.type not in {"IK", "SPLINE_IK"}:
        yield owner.name
        return
    chain = [owner, *owner.parent_recursive]
    if constraint.type == "IK" and not constraint.use_tail:
        chain = chain[1:]
    for bone in chain[: constraint.chain_count or len(chain)]:
        yield bone.name


def _require_no_drivers(armature: bpy.types.Object, bones: list[str]) -> None:
    for path in driven(armature):
        match = _BONE_PATH.match(path)
        if not match or match[3] is not None or _plain(match[1]) not in bones:
            continue
        name, channel = _plain(match[1]), match[2]
        bone = armature.pose.bones[name]
        still = channel == "location" and bone.bone.use_connect  # a connected bone does not move by it
        if not still and channel in {
            "location",
            "scale",
            "rotation_mode",
            rotation_channel(bone.rotation_mode),
        }:
            raise SkeletonError(
                f"The bone {name} of {armature.name} is moved by a driver on its "
                f"{channel.replace('_', ' ')}, so that keys do not move it; "
                "remove or mute the driver and generate again."
            )


def _require_flags_kept(armature: bpy.types.Object, bones: list[str]) -> None:
    """Raise SkeletonError where what the armature's data says of its bones is animated: keys are made for
    what it says now.
    """
    data = armature.data
    for path in (
        *driven(data),
        *(curve.data_path for curve in strip_curves(data, own_action=True) if varies(curve)),
    ):
        match = _FLAG_PATH.match(path)
        if path == "pose_position" or match and _plain(match[1]) in bones:
            what = path if match is None else f"{match[2]} of its bone {_plain(match[1])}"
            raise SkeletonError(
                f"The armature data {data.name} of {armature.name} is animated ({what.replace('_', ' ')}), "
                "so that keys do not rule the "
                "pose; remove that driver or these keys and generate again."
            )


def _require_size_kept(armature: bpy.types.Object) -> None:
    """Raise SkeletonError where the size of the armature, or of what it is parented to, is animated."""
    above = {bone.name for bone in armature.data.bones[bone_map_of(armature).hips].parent_recursive}
    grown = [*driven(armature), *(curve.data_path for curve in strip_curves(armature) if varies(curve))]
    for match in filter(None, map(_BONE_PATH.match, grown)):
        if match[2] == "scale" and match[3] is None and _plain(match[1]) in above:
            raise SkeletonError(
                f"The armature {armature.name} changes its size during the take (the scale of its bone "
                f"{_plain(match[1])} is animated); "
                "remove these keys or drivers."
            )
    carrier: bpy.types.Object | None = armature
    while carrier is not None:
        data, curves = carrier.animation_data, list(strip_curves(carrier, own_action=carrier != armature))
        grows = any(c.data_path in _SCALES and varies(c) for c in curves)
        if data and (grows or any(path in _SCALES for path in driven(carrier))):
            what = "its scale" if carrier == armature else f"the scale of its parent {carrier.name}"
            raise SkeletonError(
                f"The armature {armature.name} changes its size during the take ({what} is animated); "
                "remove these keys or drivers."
            )
        carrier = carrier.parent


def varies(curve: bpy.types.FCurve) -> bool:
    """Whether the keys of a curve differ."""
    values = [] if curve.mute else [key.co.y for key in curve.keyframe_points]
    return bool(values) and max(values) - min(values) > 1e-4 * max(map(abs, values))


def driven(owner: bpy.types.Object) -> list[str]:
    """Paths that the drivers of an object set; muted and broken ones set nothing."""
    data = owner.animation_data
    return [d.data_path for d in data.drivers if not d.mute and d.driver.is_valid] if data else []


def _strip_paths(owner: bpy.types.Object) -> set[str]:
    return {curve.data_path for curve in strip_curves(owner)}


def _plain(escaped: str) -> str:
    return bpy.utils.unescape_identifier(escaped)
