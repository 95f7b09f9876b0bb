"""Which joint of a capture file drives which of the 23, and how the file is read: mapping files."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from nsm_core.body.skeleton import JOINTS
from nsm_core.errors import CaptureError, SkeletonError
from nsm_core.validate import is_number, read_toml, shown, table

from .bvh_parser import FASTEST, SLOWEST

FOLDER = Path(__file__).parents[2] / "mappings"
SIDES = ("Right", "Left")
SPINE = ("Chest", "Chest2", "Chest3", "Chest4")
REQUIRED = (
    "Hips",
    "Head",
    *(s + n for s in SIDES for n in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle")),
)
_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
_UNIT_RANGE = (1e-6, 1e6)  # metres
_AXES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")


@dataclass(frozen=True)
class Mapping:
    """How a hierarchy is read onto the 23 joints.

    ``joints``: name of the 23 -> name in the file; joints that are absent follow their neighbours.
    ``spine``: the file's spine from the pelvis up, spread evenly over Chest to Chest4.  ``units``: metres a
    unit, or None to scale by the length of the legs.  ``up`` and ``forward``: axes such as "+Y", or "auto".
    ``rest``: "auto", "offsets" (all channels zero), "frame N", or "motion" (no rest pose: axes from the
    bending of knees and elbows).  ``rate``: frames a second where the file's own frame time is wrong, else
    None.
    """

    joints: dict[str, str]
    spine: tuple[str, ...] = ()
    units: float | None = None
    up: str = "auto"
    forward: str = "auto"
    rest: str = "auto"
    rate: float | None = None
    name: str = field(default="", compare=False)


def load_mapping(path: str | Path) -> Mapping:
    """Read a mapping file (TOML); CaptureError says which entry is wrong.

    A file without [joints] and [sides] says how files are read whose joints are found by their names.
    """
    path = Path(path)
    found = table_of(path)
    joints = {}
    for target, names in wanted_names(found, path.name).items():
        if len(names) != 1:
            raise CaptureError(f"{path.name}: {target} must name one joint of the file, in quotes.")
        joints[target] = names[0]
    for target, joint in joints.items():
        others = [other for other, same in joints.items() if same == joint and other != target]
        if others:
            raise CaptureError(
                f"{path.name}: {target} and {others[0]} both name {shown(joint, 80)}; give each its own, or "
                "leave one out."
            )
    missing = [n for n in REQUIRED if n not in joints]
    if missing and joints:
        raise SkeletonError(
            f"{path.name} names no joint for {', '.join(missing)}; add a line for each under [joints]."
        )
    units = found.get("units", "auto")
    if units not in ("auto", *_UNITS) and not is_number(units, *_UNIT_RANGE):
        raise CaptureError(
            f'{path.name}: units must be "auto", {", ".join(_UNITS)} or the metres of one unit, not '
            f"{shown(units)}."
        )
    for key in ("up", "forward"):
        value = found.get(key, "auto")
        if value != "auto" and value not in _AXES:
            raise CaptureError(
                f'{path.name}: {key} must be "auto" or one of {", ".join(_AXES)}, not {shown(value)}.'
            )
    if found.get("up", "auto")[1:] == found.get("forward", "auto")[1:] != "uto":
        raise CaptureError(
            f"{path.name}: up and forward are along one axis, {found['up'][1:]}; correct one of them, or "
            'say "auto".'
        )
    rest = found.get("rest", "auto")
    if not isinstance(rest, str) or not re.fullmatch(r"auto|offsets|motion|frame [0-9]{1,9}", rest):
        raise CaptureError(
            f'{path.name}: rest must be "auto", "offsets", "motion" or such as "frame 0", not {shown(rest)}.'
        )
    spine = found.get("spine", [])
    if not isinstance(spine, list) or not all(isinstance(s, str) for s in spine):
        raise CaptureError(f"{path.name}: spine must be a list of joint names, from the pelvis up.")
    rate = found.get("rate", "auto")
    if rate != "auto" and not is_number(rate, SLOWEST, FASTEST):
        raise CaptureError(
            f'{path.name}: rate must be "auto" or frames a second from {SLOWEST:g} to {FASTEST:g}, not '
            f"{shown(rate)}."
        )
    metres = None if units == "auto" else _UNITS[units] if isinstance(units, str) else float(units)
    up, forward = found.get("up", "auto"), found.get("forward", "auto")
    return Mapping(
        joints, tuple(spine), metres, up, forward, rest, None if rate == "auto" else float(rate), path.name
    )


def table_of(path: Path) -> dict[str, Any]:
    """The content of a mapping file, which may say more than is known of one file alone."""
    found = read_toml(path, CaptureError)
    for key in found:
        known = ("forward", "joints", "rate", "rest", "sides", "spine", "units", "up")
        if key not in known:
            raise CaptureError(
                f"{path.name}: {shown(key)} is not known in a mapping file; use {', '.join(known)}."
            )
    return found


def wanted_names(found: dict[str, Any], name: str) -> dict[str, list[str]]:
    """Names in the file, best first, for every one of the 23 that [joints] and [sides] speak of."""
    wanted: dict[str, list[str]] = {}
    for target, names in table(found.get("sides", {}), f"{name}: [sides]", CaptureError).items():
        for side in SIDES:
            wanted[side + target] = [n.replace("{side}", side) for n in _names(names, target, name)]
    for target, names in table(found.get("joints", {}), f"{name}: [joints]", CaptureError).items():
        wanted[target] = _names(names, target, name)
    for target in wanted:
        if target not in JOINTS:
            raise CaptureError(
                f"{name}: {shown(target)[1:-1]} is not one of the 23 joints; they are {', '.join(JOINTS)}."
            )
    return wanted


def _names(names: object, target: str, name: str) -> list[str]:
    names = [names] if isinstance(names, str) else names
    if (
        not isinstance(names, list)
        or not names
        or len(names) > 100
        or not all(isinstance(n, str) and n.strip() for n in names)
    ):
        raise CaptureError(
            f"{name}: {target} must name one joint of the file, in quotes, not {shown(names)}."
        )
    return names
