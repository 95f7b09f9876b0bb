"""Presets: bone maps as small TOML files, one a rig family; the add-on's own and those of the user's
folder.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from nsm_core.body.skeleton import JOINTS
from nsm_core.data.captures.joint_map import wanted_names
from nsm_core.errors import CaptureError, SkeletonError
from nsm_core.files import output
from nsm_core.validate import is_number, read_toml, shown, table

from ..user_folder import user_folder as folder_for
from .bone_map import NEEDED, BoneMap, LimbControls

Files = tuple[tuple[Path, int], ...]
FOLDER = Path(__file__).parent / "presets"
PRESET = "preset "  # begins the family of a map that is from a preset
_KEYS = (
    "joints",
    "sides",
    "shown",
    "shown_sides",
    "properties",
    "limbs",
    "limb_sides",
    "fingers",
    "finger_sides",
)
_LIMB_KEYS = ("control", "pole", "toe", "still", "properties")
LIMBS = ("RightWrist", "LeftWrist", "RightAnkle", "LeftAnkle")  # whose controls may pull them
_MOST = 200  # presets that are read from the user's folder


@dataclass(frozen=True)
class Preset:
    """A preset file: for every joint the bones that may stand for it, best first."""

    name: str
    joints: Mapping[str, list[str]]
    shown: Mapping[str, list[str]]
    properties: Mapping[str, Mapping[str, float]]
    limbs: Mapping[str, LimbControls]
    fingers: Mapping[str, tuple[str, ...]]

    def among(self, bones: Any) -> BoneMap | None:
        """The map of a rig that has ``bones``; None where it lacks one of the needed joints."""
        chosen = self.on(bones)
        return chosen if all(joint in chosen.joints for joint in NEEDED) else None

    def on(self, bones: Any) -> BoneMap:
        """The map of those of ``bones`` that the preset names."""
        joints, seen = (_chosen(names, bones) for names in (self.joints, self.shown))
        switches = {bone: values for bone, values in self.properties.items() if bone in bones}
        limbs = {joint: c for joint, c in self.limbs.items() if c.control in bones and joint in joints}
        limbs = {joint: _present(controls, bones) for joint, controls in limbs.items()}
        seen = {joint: bone for joint, bone in seen.items() if joint in joints}
        fingers = {name: each for name, each in self.fingers.items() if all(bone in bones for bone in each)}
        return BoneMap(joints, seen, switches, limbs, fingers=fingers, family=PRESET + self.name)


def _present(controls: LimbControls, bones: Any) -> LimbControls:
    """A limb's controls without bones that a rig lacks."""
    return LimbControls(
        controls.control,
        controls.pole if controls.pole in bones else "",
        controls.toe if controls.toe in bones else "",
        tuple(name for name in controls.still if name in bones),
        {bone: values for bone, values in controls.properties.items() if bone in bones},
    )


def _chosen(names: Mapping[str, list[str]], bones: Any) -> dict[str, str]:
    found = ((joint, next((s for s in each if s in bones), None)) for joint, each in names.items())
    return {joint: bone for joint, bone in found if bone is not None}


def user_folder() -> Path:
    """The folder of the user's own presets; it may not exist yet."""
    return folder_for("rigs")


def preset_files() -> Files:
    """The user's presets, then the add-on's: every file and when it was changed."""
    found = []
    for folder in (user_folder(), FOLDER):
        for path in sorted(folder.glob("*.toml"))[:_MOST]:
            with suppress(OSError):  # deleted a moment ago
                found.append((path, path.stat().st_mtime_ns))
    return tuple(found)


def readable(files: Files) -> list[Preset]:
    """The presets of some files; those that cannot be read are left out."""
    found = []
    for path, changed in files:
        with suppress(SkeletonError):
            found.append(_read(path, changed))
    return found


def load_preset(path: str | Path) -> Preset:
    """Read a preset; SkeletonError says which entry is wrong."""
    path = Path(path)
    return _read(path, path.stat().st_mtime_ns if path.exists() else 0)


def named_preset(name: str) -> Preset:
    """The preset of a name, the user's own before the add-on's; SkeletonError lists the names there are."""
    files = [path for path, _ in preset_files()]
    found = next((path for path in files if path.stem == name), None)
    if found is None:
        names = ", ".join(dict.fromkeys(path.stem for path in files))
        raise SkeletonError(f"There is no bone map '{name}'; take one of {names}, or name a file (.toml).")
    return load_preset(found)


@lru_cache(maxsize=64)
def _read(path: Path, _changed: int) -> Preset:
    try:
        found = read_toml(path, SkeletonError)
        unknown = next((key for key in found if key not in _KEYS), None)
        if unknown is not None:
            raise SkeletonError(
                f"{path.name}: {shown(unknown)} is not known in a bone map; use {', '.join(_KEYS)}."
            )
        joints = wanted_names(_sided(found, "joints", "sides"), path.name)
        seen = wanted_names(_sided(found, "shown", "shown_sides"), path.name)
    except CaptureError as error:  # the same files, read for another purpose
        raise SkeletonError(str(error)) from error
    properties = _switches(found.get("properties", {}), path.name)
    fingers = _fingers(found, path.name)
    return Preset(path.stem, joints, seen, properties, _limbs(found, path.name), fingers)


def _switches(found: Any, name: str) -> dict[str, dict[str, float]]:
    """Custom properties by bone, as numbers."""
    properties = {
        bone: table(values, f"{name}: properties of {bone}", SkeletonError)
        for bone, values in table(found, f"{name}: [properties]", SkeletonError).items()
    }
    for bone, values in properties.items():
        for key, value in values.items():
            if not is_number(value, -1e6, 1e6):
                raise SkeletonError(f"{name}: {key} of {bone} must be a number, not {shown(value)}.")
    return properties


def _limbs(found: dict[str, Any], name: str) -> dict[str, LimbControls]:
    """IK controls by the joint at the end of their limb."""
    each = dict(table(found.get("limbs", {}), f"{name}: [limbs]", SkeletonError))
    for part, values in table(found.get("limb_sides", {}), f"{name}: [limb_sides]", SkeletonError).items():
        for side in ("Right", "Left"):
            each[side + part] = _with_side(values, side[0])
    limbs = {}
    for joint, values in each.items():
        of = f"{name}: limb {joint}"
        if joint not in LIMBS:
            raise SkeletonError(f"{of} is not known; use {', '.join(LIMBS)}.")
        values = table(values, of, SkeletonError)
        unknown = next((key for key in values if key not in _LIMB_KEYS), None)
        names = [values.get(key, "") for key in ("control", "pole", "toe")]
        still = values.get("still", [])
        if unknown is not None:
            raise SkeletonError(f"{of}: {shown(unknown)} is not known; use {', '.join(_LIMB_KEYS)}.")
        if (
            not isinstance(still, list)
            or not all(isinstance(n, str) for n in (*names, *still))
            or not names[0]
        ):
            raise SkeletonError(
                f"{of} must name its control, in quotes, and may name a pole, a toe and still."
            )
        limbs[joint] = LimbControls(*names, tuple(still), _switches(values.get("properties", {}), of))
    return limbs


def _fingers(found: dict[str, Any], name: str) -> dict[str, tuple[str, ...]]:
    """Bones of fingers, from the palm outwards, by side and name."""
    each = dict(table(found.get("fingers", {}), f"{name}: [fingers]", SkeletonError))
    for finger, bones in table(
        found.get("finger_sides", {}), f"{name}: [finger_sides]", SkeletonError
    ).items():
        for side in ("Right", "Left"):
            each[side + finger] = _with_side(bones, side[0])
    for finger, bones in each.items():
        if not isinstance(bones, list) or not bones or not all(isinstance(bone, str) for bone in bones):
            raise SkeletonError(f"{name}: finger {finger} must be a list of bones, in quotes.")
        if not finger.startswith(("Right", "Left")):
            raise SkeletonError(f"{name}: finger {finger} must begin with Right or Left.")
    return {finger: tuple(bones) for finger, bones in each.items()}


def _with_side(value: Any, letter: str) -> Any:
    """What a file says of both sides, for one."""
    if isinstance(value, str):
        return value.replace("{side}", letter)
    if isinstance(value, list):
        return [_with_side(each, letter) for each in value]
    if isinstance(value, dict):
        return {_with_side(key, letter): _with_side(each, letter) for key, each in value.items()}
    return value


def _sided(found: dict[str, Any], plain: str, sides: str) -> dict[str, Any]:
    """The two tables of names with ``{side}`` as L and R, the letters that rigs in Blender end in."""
    joints = dict(table(found.get(plain, {}), plain, SkeletonError))
    for target, names in table(found.get(sides, {}), sides, SkeletonError).items():
        for side in ("Right", "Left"):
            each = [names] if isinstance(names, str) else names
            if not isinstance(each, list) or not all(isinstance(name, str) for name in each):
                raise SkeletonError(f"{sides}: {target} must name bones, in quotes, not {shown(names)}.")
            joints[side + target] = [name.replace("{side}", side[0]) for name in each]
    return {"joints": joints}


def save_preset(path: str | Path, bone_map: BoneMap) -> None:
    """Write a map as a preset, whole or not at all; OutputError where that fails."""
    lines = ["# A bone map: which bone of the rig stands for which joint.", "", "[joints]"]
    lines += [f"{joint} = {_quoted(bone_map.joints[joint])}" for joint in JOINTS if joint in bone_map.joints]
    if bone_map.shown:
        lines += ["", "[shown]", *(f"{joint} = {_quoted(bone)}" for joint, bone in bone_map.shown.items())]
    lines += _properties_lines("properties", bone_map.properties)
    for joint, controls in bone_map.limbs.items():
        lines += ["", f"[limbs.{joint}]", f"control = {_quoted(controls.control)}"]
        lines += [
            f"{key} = {_quoted(name)}"
            for key, name in (("pole", controls.pole), ("toe", controls.toe))
            if name
        ]
        lines += [f"still = [{', '.join(map(_quoted, controls.still))}]"] if controls.still else []
        lines += _properties_lines(f"limbs.{joint}.properties", controls.properties)
    if bone_map.fingers:
        lines += ["", "[fingers]"]
        for finger, bones in bone_map.fingers.items():
            lines.append(f"{finger} = [{', '.join(map(_quoted, bones))}]")
    with output(path, "The bone map") as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _properties_lines(title: str, properties: Mapping[str, Mapping[str, float]]) -> list[str]:
    """A table of custom properties by bone; nothing where there are none."""
    lines = ["", f"[{title}]"] if properties else []
    for bone, values in properties.items():
        each = ", ".join(f"{_quoted(key)} = {float(value)}" for key, value in values.items())
        lines.append(f"{_quoted(bone)} = {{ {each} }}")
    return lines


def _quoted(text: str) -> str:
    """A TOML basic string."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'
