"""Which joints of a file stand for the 23 by their names: the families of ``mappings``, read through
prefixes, sides and spellings.
"""

from __future__ import annotations

import difflib
import re
from dataclasses import replace
from functools import cache, lru_cache
from typing import Any, TypeAlias

from nsm_core.body.skeleton import JOINTS
from nsm_core.errors import SkeletonError

from .bvh_file import Bvh
from .joint_map import FOLDER, REQUIRED, SIDES, Mapping, table_of, wanted_names

Names: TypeAlias = tuple[str, ...]
Parents: TypeAlias = tuple[int, ...]
_LIMBS = (("Shoulder", "Elbow", "Wrist"), ("Hip", "Knee", "Ankle"))
_MOST_LEVELS = 8  # of nodes over the bodies of a file
_MOST_LETTERS = 100  # of a joint's name that are looked at
_LEAST_BODY = 6  # joints of a hierarchy whose loss is told: fewer are a prop


def bodies(source: Bvh, mapping: Mapping | None = None) -> list[tuple[Bvh, Mapping | None]]:
    """Part a file into its bodies, each with the mapping that fits it; None for one with the 23 names in no
    order of limbs.

    Every root of the file may be a body, and so may what hangs on a node over several.  A ``mapping`` that is
    given is believed.  The first body's notes tell of hierarchies that are left out.  SkeletonError lists the
    joints that no name stands for.
    """
    found: list[tuple[Bvh, Mapping | None]] = []
    left: list[str] = []
    for root in (j for j, p in enumerate(source.parents) if p < 0):
        parts = [(source.only(part), fit) for part, fit in _under(source, root, mapping)]
        found += parts
        if not parts and len(_tree(source.parents, root)) >= _LEAST_BODY:
            left.append(source.joints[root])
    if not found:
        own = mapping is None and set(JOINTS) <= set(source.joints)
        return [(source, None if own else mapping or guess_mapping(source))]
    if left:
        also = ", ".join(left[:5])
        told = f"{source.name}.bvh also holds {also}, whose joints no mapping names; they are left out."
        found[0] = (replace(found[0][0], notes=(*found[0][0].notes, told)), found[0][1])
    return found


def _under(source: Bvh, top: int, mapping: Mapping | None) -> list[tuple[list[int], Mapping]]:
    """Joints and mapping of the bodies from one joint down: several where several of its branches are bodies
    by themselves.
    """
    above: list[int] = []
    at = top
    for _ in range(_MOST_LEVELS):
        branches = [_tree(source.parents, k) for k, p in enumerate(source.parents) if p == at]
        fitting = [
            (b, fit) for b in branches if len(b) >= len(REQUIRED) and (fit := _fit(source, b, mapping))
        ]
        above.append(at)
        if len(fitting) > 1:
            return [([*above, *b], fit) for b, fit in fitting]
        if not fitting:
            break
        at = fitting[0][0][0]
    whole = _tree(source.parents, top)
    fit = _fit(source, whole, mapping)
    return [(whole, fit)] if fit else []


def _tree(parents: Parents, top: int) -> list[int]:
    """A joint and all that hangs on it, in the file's order."""
    inside = {top}
    for j in range(top + 1, len(parents)):
        if parents[j] in inside:
            inside.add(j)
    return sorted(inside)


def _fit(source: Bvh, part: list[int], mapping: Mapping | None) -> Mapping | None:
    """The mapping that fits some joints of a file, if any does."""
    at = {j: k for k, j in enumerate(part)}
    names, parents = tuple(source.joints[j] for j in part), tuple(at.get(source.parents[j], -1) for j in part)
    if mapping is not None:
        return mapping if set(mapping.joints.values()) <= set(names) else None
    return _mapping_of(names, parents)[0]


def guess_mapping(source: Bvh) -> Mapping:
    """Find the bundled mapping whose names the file has; SkeletonError lists the joints that no name stands
    for.
    """
    found, best = _mapping_of(source.joints, source.parents)
    if found:
        return found
    missing = [n for n in (REQUIRED if best else JOINTS) if n not in best]
    if not missing:
        missing = [n for n in REQUIRED if n.endswith(("Knee", "Elbow"))]
    likely = _likely(source, missing[0], best) or "its name in the file"
    raise SkeletonError(
        f"{source.name}.bvh lacks the bones {', '.join(missing)}, and no joint stands for them by its name; "
        "write a mapping file "
        f'with a line for each of the 23 under [joints], such as {missing[0]} = "{likely}" '
        "(the files in nsm_core/mappings are examples), and name it with --mapping."
    )


@cache
def families() -> dict[str, dict[str, list[str]]]:
    """Names by target, best first, of every bundled mapping file by its name."""
    return {path.name: wanted_names(table_of(path), path.name) for path in sorted(FOLDER.glob("*.toml"))}


def by_family(names: Names) -> dict[str, dict[str, str]]:
    """What every bundled family finds among some names: a name for each of the 23 that it knows there, by
    the name of its file.
    """
    forms = _all_forms(names)
    read: dict[str, dict[str, str]] = {}
    for family, wanted in families().items():
        joints: dict[str, str] = {}
        for target, spellings in wanted.items():
            found = next((forms[key] for s in spellings for key in _forms(s) if key in forms), None)
            if found is not None and found not in joints.values():
                joints[target] = found
        read[family] = joints
    return read


@lru_cache(maxsize=512)  # the clips of a folder share their skeleton
def _mapping_of(names: Names, parents: Parents) -> tuple[Mapping | None, dict[str, str]]:
    """The family that names most of the 23 of those that name every limb, and the most that any has found."""
    most: dict[Any, Any] = {}
    best: Mapping | None = None
    for name, joints in by_family(names).items():
        if len(set(REQUIRED) & set(joints)) > len(set(REQUIRED) & set(most)):
            most = joints
        if all(n in joints for n in REQUIRED) and _is_chained(names, parents, joints):
            joints = in_place(names, parents, joints)
            if best is None or len(joints) > len(best.joints):
                best = Mapping(joints, spine_of(names, parents, joints), name=name)
    return best, most


def _ancestors(parents: Parents, joint: int) -> list[int]:
    """A joint and what it hangs on, up to the root."""
    chain = [joint]
    while parents[chain[-1]] >= 0:
        chain.append(parents[chain[-1]])
    return chain


def hangs(names: Names, parents: Parents, lower: str, upper: str) -> bool:
    """Whether the joint ``lower`` lies somewhere under the joint ``upper``."""
    return names.index(upper) in _ancestors(parents, names.index(lower))[1:]


def _is_chained(names: Names, parents: Parents, joints: dict[str, str]) -> bool:
    """Whether the joints of each limb hang on one another."""
    pairs = [
        (joints[s + b], joints[s + a])
        for s in SIDES
        for limb in _LIMBS
        for a, b in zip(limb[:-1], limb[1:], strict=True)
    ]
    return all(hangs(names, parents, lower, upper) for lower, upper in pairs)


def in_place(names: Names, parents: Parents, joints: dict[str, str]) -> dict[str, str]:
    """The mapping without collars and toes that are no part of their limb, and without a neck that the head
    does not hang on.
    """
    pairs = {"Neck": ("Head", "Neck")}
    for s in SIDES:
        pairs |= {s + "Collar": (s + "Shoulder", s + "Collar"), s + "Toe": (s + "Toe", s + "Ankle")}
    wrong = {
        n for n, (a, b) in pairs.items() if n in joints and not hangs(names, parents, joints[a], joints[b])
    }
    return {k: v for k, v in joints.items() if k not in wrong}


def spine_of(names: Names, parents: Parents, joints: dict[str, str]) -> tuple[str, ...]:
    """The joints between the pelvis and the arms, from the pelvis up."""
    at = {n: names.index(joints[n]) for n in ("Hips", "RightShoulder", "LeftShoulder")}
    right, left = (_ancestors(parents, at[s + "Shoulder"])[1:] for s in SIDES)
    collars = {names.index(joints[s + "Collar"]) for s in SIDES if s + "Collar" in joints}
    pelvis = set(_ancestors(parents, at["Hips"]))
    shared = [j for j in right if j in left and j not in pelvis and j not in collars]
    return tuple(names[j] for j in reversed(shared))


def _likely(source: Bvh, target: str, known: dict[str, str]) -> str | None:
    """The joint of a file that most likely is ``target``: by its place between joints that are known, else by
    its spelling.
    """
    names = [n for n in source.joints if not n.endswith("_End") and n not in known.values()]
    side = next((s for s in SIDES if target.startswith(s)), "")
    for limb in _LIMBS:
        upper, middle, end = (known.get(side + n) for n in limb)
        if side and target == side + limb[1] and upper and end and middle is None:
            between = _ancestors(source.parents, source.joints.index(end))[1:]
            between = (
                between[: between.index(source.joints.index(upper))]
                if source.joints.index(upper) in between
                else []
            )
            return source.joints[between[len(between) // 2]] if between else None
    if target == "Hips":  # where legs and spine part: the first joint on which three branches hang
        counts = [source.parents.count(j) for j in range(len(source.joints))]
        return next(
            (n for n, c in zip(source.joints, counts, strict=True) if c >= 3 and n in names),
            names[0] if names else None,
        )
    plain = dict(zip(source.joints, _without_affixes(source.joints), strict=True))
    wanted = {_letters(s) for family in families().values() for s in family.get(target, [])} | {
        _letters(target)
    }

    def closeness(name: str) -> float:
        if side and side[0].lower() not in [s for s, _ in _forms(plain[name])]:
            return 0.0
        forms = {
            form if not side else (side + rest).lower()
            for s, rest in _forms(plain[name])
            for form in (s + rest,)
        }
        return max((difflib.SequenceMatcher(None, f, w).ratio() for f in forms for w in wanted), default=0.0)

    best = max(names[:500], key=closeness, default=None)
    return best if best is not None and closeness(best) > 0.6 else None


def _all_forms(names: Names) -> dict[tuple[str, str], str]:
    """Plain spelling (side, rest) -> name, for every joint; the first joint of a spelling has it."""
    short = _without_affixes(names)
    forms: dict[tuple[str, str], str] = {}
    # What is plainly said goes before what may be read so, and that before what is a copy's number.
    for level in range(3):
        for name, plain in zip(names, short, strict=True):
            found = _forms(plain if level < 2 else re.sub(r"[_.\- ]\d+$", "", plain))
            for form in (found[:1], found[1:], found)[level]:
                forms.setdefault(form, name)
    return forms


_BOUNDARY = re.compile(r"(?<=[_\-. ])(?=[^_\-. ])|(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Za-z])(?=\d)")


def _without_affixes(names: Names) -> list[str]:
    """Names without what is before a colon and without what most of them start or end with: "CC_Base_",
    "mixamorig", "_JNT".
    """
    plain = [n[:_MOST_LETTERS].rsplit(":", 1)[-1].rsplit("|", 1)[-1] for n in names]
    # The reader's own names of end sites, which have their joint's suffix inside.
    ended = [n.endswith("_End") for n in names]
    bare = [n[:-4] if e else n for n, e in zip(plain, ended, strict=True)]
    starts: dict[str, int] = {}
    ends: dict[str, int] = {}
    for name in bare:
        for at in _BOUNDARY.finditer(name):
            starts[name[: at.start()]] = starts.get(name[: at.start()], 0) + 1
        if match := re.search(r"[_\-. ][A-Za-z]{2,}$", name):
            ends[match[0]] = ends.get(match[0], 0) + 1
    start, end = (
        max((s for s, n in counts.items() if n >= 0.7 * len(bare)), key=len, default="")
        for counts in (starts, ends)
    )
    bare = [n.removeprefix(start).removesuffix(end) or n for n in bare]
    return [n + "_End" if e else n for n, e in zip(bare, ended, strict=True)]


_SIDED = (
    r"(?i:(?P<side>left|right))[ _.\-]*(?P<rest>.+)",
    r"(?P<rest>.+?)[ _.\-]*(?i:(?P<side>left|right))",
    r"(?P<side>[lrLR])[ _.\-]+(?P<rest>.+)",
    r"(?P<rest>.+?)[ _.\-]+(?P<side>[lrLR])",
    r"(?P<side>[lrLR])(?P<rest>[A-Z].*)",
    r".*[ _.\-](?P<side>[lrLR])[ _.\-](?P<rest>.+)",
    r"(?P<side>[lr])(?P<rest>[a-z]+)",
)


@lru_cache(maxsize=4096)
def _forms(name: str) -> list[tuple[str, str]]:
    """Readings (side, rest) of a name, the plainest first: "LeftArm", "l_arm" and "arm.L" are all ("l",
    "arm").
    """
    forms = []
    for pattern in _SIDED:
        if match := re.fullmatch(pattern, name):
            forms.append((match["side"][0].lower(), _letters(match["rest"])))
    whole = ("", _letters(name))
    # A name of small letters may begin with l or r by chance.
    return [whole, *forms] if not forms or re.fullmatch(_SIDED[-1], name) else [*forms, whole]


def _letters(name: str) -> str:
    """Letters, of any script, and digits of a name, small."""
    return re.sub(r"[\W_]", "", name.lower())
