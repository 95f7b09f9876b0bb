"""Which joint of a capture file drives which of the 23: mapping files, and guesses from the names of joints."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from .errors import CaptureError, SkeletonError
from .skeleton import JOINTS

if TYPE_CHECKING:
    from .bvh import Bvh

FOLDER = Path(__file__).parent / "mappings"
SIDES = ("Right", "Left")
SPINE = ("Chest", "Chest2", "Chest3", "Chest4")
REQUIRED = ("Hips", "Head", *(s + n for s in SIDES for n in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle")))
_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
_AXES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")


@dataclass(frozen=True)
class Mapping:
    """How a hierarchy is read onto the 23 joints.

    ``joints``: name of the 23 -> name in the file; joints that are absent follow their neighbours.  ``spine``: the file's
    spine from the pelvis up, spread evenly over Chest to Chest4.  ``units``: metres a unit, or None to scale by the length of
    the legs.  ``up`` and ``forward``: axes such as "+Y", or "auto".  ``rest``: "auto", "offsets" (all channels zero),
    "frame N", or "motion" (no rest pose: axes from the bending of knees and elbows).
    """

    joints: dict[str, str]
    spine: tuple[str, ...] = ()
    units: float | None = None
    up: str = "auto"
    forward: str = "auto"
    rest: str = "auto"
    name: str = field(default="", compare=False)


def load_mapping(path: str | Path) -> Mapping:
    """Read a mapping file (TOML); CaptureError says which entry is wrong."""
    path = Path(path)
    table = _toml(path)
    known = {"joints", "sides", "spine", "units", "up", "forward", "rest"}
    for key in table:
        if key not in known:
            raise CaptureError(f"{path.name}: '{key}' is not known in a mapping file; use {', '.join(sorted(known))}.")
    joints = {}
    for target, names in _wanted(table, path.name).items():
        if len(names) != 1:
            raise CaptureError(f"{path.name}: {target} must name one joint of the file, in quotes.")
        joints[target] = names[0]
    missing = [n for n in REQUIRED if n not in joints]
    if missing:
        raise SkeletonError(f"{path.name} names no joint for {', '.join(missing)}; add a line for each under [joints].")
    units = table.get("units", "auto")
    if units != "auto" and units not in _UNITS and not (isinstance(units, int | float) and units > 0):
        raise CaptureError(f'{path.name}: units must be "auto", {", ".join(_UNITS)} or the metres of one unit, not {units!r}.')
    for key in ("up", "forward"):
        value = table.get(key, "auto")
        if value != "auto" and value not in _AXES:
            raise CaptureError(f'{path.name}: {key} must be "auto" or one of {", ".join(_AXES)}, not {value!r}.')
    rest = table.get("rest", "auto")
    if not isinstance(rest, str) or not re.fullmatch(r"auto|offsets|motion|frame \d+", rest):
        raise CaptureError(f'{path.name}: rest must be "auto", "offsets", "motion" or such as "frame 0", not {rest!r}.')
    spine = table.get("spine", [])
    if not isinstance(spine, list) or not all(isinstance(s, str) for s in spine):
        raise CaptureError(f"{path.name}: spine must be a list of joint names, from the pelvis up.")
    metres = None if units == "auto" else _UNITS.get(units, units) if isinstance(units, str) else float(units)
    return Mapping(joints, tuple(spine), metres, table.get("up", "auto"), table.get("forward", "auto"), rest, path.name)


def guess_mapping(source: Bvh) -> Mapping:
    """Find the bundled mapping whose names the file has; SkeletonError lists the joints that no name stands for."""
    forms = _all_forms(source.joints)
    best: dict[str, str] = {}
    for path in sorted(FOLDER.glob("*.toml")):
        joints = {}
        for target, names in _wanted(_toml(path), path.name).items():
            found = next((forms[key] for name in names for key in _forms(name) if key in forms), None)
            if found is not None and found not in joints.values():
                joints[target] = found
        if len(set(REQUIRED) & set(joints)) > len(set(REQUIRED) & set(best)):
            best = joints
        if all(n in joints for n in REQUIRED) and _is_chained(source, joints):
            return Mapping(joints, spine_of(source, joints), name=path.name)
    missing = [n for n in (REQUIRED if best else JOINTS) if n not in best]
    if not missing:
        missing = [n for n in REQUIRED if n.endswith(("Knee", "Elbow"))]
    raise SkeletonError(
        f"{source.name}.bvh lacks the bones {', '.join(missing)}, and no joint stands for them by its name; write a mapping file "
        f'with a line for each of the 23 under [joints], such as {missing[0]} = "{source.joints[-1].removesuffix("_End")}" '
        "(the files in nsm_core/mappings are examples), and name it with --mapping."
    )


def spine_of(source: Bvh, joints: dict[str, str]) -> tuple[str, ...]:
    """The joints between the pelvis and the arms, from the pelvis up."""
    at = {n: source.joints.index(joints[n]) for n in ("Hips", "RightShoulder", "LeftShoulder")}
    right, left = (_ancestors(source, at[s + "Shoulder"])[1:] for s in SIDES)
    collars = {source.joints.index(joints[s + "Collar"]) for s in SIDES if s + "Collar" in joints}
    pelvis = set(_ancestors(source, at["Hips"]))
    shared = [j for j in right if j in left and j not in pelvis and j not in collars]
    return tuple(source.joints[j] for j in reversed(shared))


def _ancestors(source: Bvh, joint: int) -> list[int]:
    """A joint and what it hangs on, up to the root."""
    chain = [joint]
    while source.parents[chain[-1]] >= 0:
        chain.append(source.parents[chain[-1]])
    return chain


def _is_chained(source: Bvh, joints: dict[str, str]) -> bool:
    """Whether the joints of each limb hang on one another."""
    for side in SIDES:
        for limb in (("Shoulder", "Elbow", "Wrist"), ("Hip", "Knee", "Ankle")):
            upper, middle, end = (source.joints.index(joints[side + n]) for n in limb)
            if upper not in _ancestors(source, middle)[1:] or middle not in _ancestors(source, end)[1:]:
                return False
    return True


def _toml(path: Path) -> dict:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise CaptureError(f"{path.name} cannot be read ({error.strerror}); check the path.") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise CaptureError(f"{path.name} is not valid TOML: {error}.") from error


def _wanted(table: dict, name: str) -> dict[str, list[str]]:
    """Names in the file, best first, for every one of the 23 that [joints] and [sides] speak of."""
    wanted: dict[str, list[str]] = {}
    for target, names in table.get("sides", {}).items():
        for side in SIDES:
            wanted[side + target] = [n.replace("{side}", side) for n in _listed(names, target, name)]
    wanted.update({target: _listed(names, target, name) for target, names in table.get("joints", {}).items()})
    for target in wanted:
        if target not in JOINTS:
            raise CaptureError(f"{name}: {target} is not one of the 23 joints; they are {', '.join(JOINTS)}.")
    return wanted


def _listed(names: object, target: str, name: str) -> list[str]:
    names = [names] if isinstance(names, str) else names
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise CaptureError(f"{name}: {target} must name one joint of the file, in quotes.")
    return names


def _all_forms(names: tuple[str, ...]) -> dict[tuple[str, str], str]:
    """Plain spelling (side, rest) -> name, for every joint; the first joint of a spelling has it."""
    short = _without_prefix(names)
    forms: dict[tuple[str, str], str] = {}
    for strict in (True, False):  # what is plainly said goes before what may be read so
        for name, plain in zip(names, short, strict=True):
            found = _forms(plain)
            for form in found[:1] if strict else found[1:]:
                forms.setdefault(form, name)
    return forms


def _without_prefix(names: tuple[str, ...]) -> list[str]:
    """Names without what is before a colon and without what most of them start with, such as "CC_Base_" or "Bip01 "."""
    plain = [n.rsplit(":", 1)[-1].rsplit("|", 1)[-1] for n in names]
    starts: dict[str, int] = {}
    for name in plain:
        for end in re.finditer(r"[_\-. ]", name):
            starts[name[: end.end()]] = starts.get(name[: end.end()], 0) + 1
    common = max((s for s, count in starts.items() if count >= 0.7 * len(plain)), key=len, default="")
    return [n.removeprefix(common) for n in plain]


_SIDED = (
    r"(?i:(?P<side>left|right))[ _.\-]*(?P<rest>.+)",
    r"(?P<rest>.+?)[ _.\-]*(?i:(?P<side>left|right))",
    r"(?P<side>[lrLR])[ _.\-]+(?P<rest>.+)",
    r"(?P<rest>.+?)[ _.\-]+(?P<side>[lrLR])",
    r"(?P<side>[lrLR])(?P<rest>[A-Z].*)",
    r"(?P<side>[lr])(?P<rest>[a-z]+)",
)


def _forms(name: str) -> list[tuple[str, str]]:
    """Readings (side, rest) of a name, the plainest first: "LeftArm", "l_arm" and "arm.L" are all ("l", "arm")."""
    forms = []
    for pattern in _SIDED:
        if match := re.fullmatch(pattern, name):
            forms.append((match["side"][0].lower(), _letters(match["rest"])))
    whole = ("", _letters(name))
    # A name of small letters may begin with l or r by chance.
    return [whole, *forms] if not forms or re.fullmatch(_SIDED[-1], name) else [*forms, whole]


def _letters(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())
