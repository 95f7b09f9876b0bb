"""Capsules and soles fitted to a skin: the bundled body's capsules carried to a character's own measures.

Every end of a capsule is carried by comparing cross-sections of the two bodies, both in the T-pose: where the
bundled body's capsule ends a quarter of its width off the middle, so does the character's.  Then radii are
drawn to the skin.  Middles and halves are quantiles of points spread evenly over it, so that hair, straps and
buttons count little.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from nsm_core.rotations import Array

from .capsules import CAPSULES, LEFT, MIDDLE, Capsule, Figure, Spheres, mirrored, rest_joints
from .contacts import Sole
from .skeleton import ANKLE_HEIGHT, FEET, HIPS, INDEX, JOINTS, MIRROR

_SPINE = ("Chest", "Chest2", "Chest3", "Chest4")
# Parts of the body by what their joints' names hold, and the axis along which cross-sections follow each
# other; None where a part is taken whole.
_PARTS: dict[str, tuple[tuple[str, ...], int | None]] = {
    "pelvis": (("Hips",), None),
    "trunk": ((*_SPINE, "Collar"), 2),
    "head": (("Neck", "Head"), None),
    "upper arm": (("Shoulder",), 0),
    "forearm": (("Elbow",), 0),
    "hand": (("Wrist",), None),
    "thigh": (("Hip",), 2),
    "shin": (("Knee",), 2),
    "foot": (("Ankle", "Toe"), None),
}
_ON_BOTH = ("pelvis", "trunk", "head")  # parts that are on both sides
_WAIST = 0.15  # of the way from the hips to the neck over which the trunk begins
_QUANTILE = 0.06  # of the points that lie beyond a half width, on either side
_BAND = 0.05  # metres, half the length of the stretch of a part that a cross-section is taken from
_FEWEST = 25  # points that make a cross-section
_SKIN = 0.75  # quantile of the points under a capsule's surface
_LEAST, _MOST = 0.35, 8.0  # times as thick as the bundled body that a character is
_ROUNDS, _DRAWN = 3, (0.75, 1.3)  # of drawing radii to the skin, and the times by which that is done at most
_UNDER = 0.03  # of a foot's points that lie under its sole


def fitted(points: Array, joints: Array, offsets: Array, toes: bool = True) -> Figure:
    """The figure of a character with joint ``offsets`` (23, 3) and ``points`` (N, 3) on its skin in the
    T-pose, hips at the rest height, metres; ``joints`` (N,) that carry them.  ``toes``: whether it has any
    that bend.

    Both sides get the same body.  Parts without points are as thick as the bundled body's.
    """
    offsets = np.asarray(offsets, dtype=np.float64)
    rest, own = rest_joints(offsets), _both_sides(points, joints)
    skin = _by_part(*own, rest)
    carried = _drawn([_carried(c, skin, rest) for c in (*MIDDLE, *LEFT)], skin, rest)
    middle, left = carried[: len(MIDDLE)], carried[len(MIDDLE) :]
    capsules = (*middle, *left, *map(mirrored, left))
    return Figure(offsets, Spheres(capsules, offsets), fitted_sole(skin.get("foot"), offsets, toes))


def fitted_sole(foot: Array | None, offsets: Array, toes: bool) -> Sole:
    """The sole of a left ``foot`` with these points (N, 3) on it in the T-pose; without any, as the skeleton
    has it.
    """
    plain = Sole.of(offsets)
    if foot is None or len(foot) < _FEWEST:
        return plain
    rest = rest_joints(offsets)
    ankle, toe = rest[FEET[1][2]], rest[FEET[1][3]]
    heel_end, tip_end = np.quantile(foot[:, 1], (1 - _UNDER, _UNDER))
    length = heel_end - tip_end
    behind, ahead = foot[foot[:, 1] > heel_end - 0.3 * length], foot[foot[:, 1] < tip_end + 0.5 * length]
    heel, under = (float(np.quantile(part[:, 2], _UNDER)) for part in (behind, ahead))
    if not 0 < ankle[2] - heel < 3 * ANKLE_HEIGHT:  # no shoe is like that
        return plain
    tip = None if toes else np.array((0.0, tip_end, under)) - toe * (0, 1, 1)
    seat = np.array((0.0, min(float(heel_end), ankle[1] + 0.12), heel)) - toe * (0, 1, 1)
    return Sole(plain.toe, seat, float(toe[2] - under), tip)


def _both_sides(points: Array, joints: Array) -> tuple[Array, Array]:
    """The points and their mirror images: as if both sides were on the left, and the trunk on both."""
    other = np.array(MIRROR)
    return (
        np.concatenate((points, points * (-1.0, 1.0, 1.0))),
        np.concatenate((joints, other[joints])),
    )


def _part_of(joint: str) -> str:
    plain = joint.removeprefix("Left")
    return next(part for part, (names, _) in _PARTS.items() if plain in names)


def _by_part(points: Array, joints: Array, rest: Array) -> dict[str, Array]:
    """Points of every part, of limbs those on the left."""
    waist = rest[HIPS, 2] + _WAIST * (rest[INDEX["Neck"], 2] - rest[HIPS, 2])
    names = np.array(JOINTS)[joints]
    trunk = np.isin(names, ("Hips", *_PARTS["trunk"][0], "LeftCollar", "RightCollar"))
    found = {
        "pelvis": points[trunk & (points[:, 2] < waist)],
        "trunk": points[trunk & (points[:, 2] >= waist)],
    }
    for part, (each, _) in _PARTS.items():
        if part not in found:
            found[part] = points[np.isin(names, [*each, *("Left" + n for n in each)])]
    return found


@cache
def _bundled() -> dict[str, Array]:
    """Points on the bundled body's capsules by part."""
    rest = rest_joints()
    turn = np.pi * (1 + 5**0.5) * np.arange(24)
    z = 1 - (np.arange(24) + 0.5) / 12
    ways = np.stack((np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z), axis=1)
    points, joints, centres, radii = [], [], [], []
    for c in CAPSULES:
        a, b = rest[INDEX[c.a]] + c.from_a, rest[INDEX[c.b]] + c.from_b
        for t in np.linspace(0, 1, 7):
            centres.append((1 - t) * a + t * b)
            radii.append((1 - t) * c.radius_a + t * c.radius_b)
            points.append(centres[-1] + radii[-1] * ways)
            joints.append(np.full(len(ways), INDEX[c.a]))
    surface, solid, size = np.concatenate(points), np.array(centres), np.array(radii)
    inside = (np.linalg.norm(surface[:, None] - solid, axis=-1) - size).min(1) < -0.002
    return _by_part(*_both_sides(surface[~inside], np.concatenate(joints)[~inside]), rest)


def _carried(c: Capsule, skin: dict[str, Array], rest: Array) -> Capsule:
    """A capsule of the bundled body on the character's."""
    a, end_a, times_a = _end(c.a, c.from_a, skin, rest)
    b, end_b, times_b = _end(c.b, c.from_b, skin, rest)
    if _part_of(c.a) != _part_of(c.b):  # a limb is as thick as its own skin says, to its end
        times_b = _thickness(_part_of(c.a), c.b, c.from_b, skin, rest)
    placed = c._replace(a=a, from_a=end_a, b=b, from_b=end_b)
    return _with(placed, c, c.radius_a * times_a, c.radius_b * times_b)


def _with(c: Capsule, like: Capsule, a: float, b: float) -> Capsule:
    """A capsule with these radii; what gives way under a sitter does so by as much, or less where it is
    thin.
    """
    if like.pressed is None:
        return c._replace(radius_a=a, radius_b=b)
    gives = ((like.radius_a, like.pressed[0], a), (like.radius_b, like.pressed[1], b))
    pressed = tuple(r - (full - thin) * min(1.0, r / full) for full, thin, r in gives)
    return c._replace(radius_a=a, radius_b=b, pressed=(pressed[0], pressed[1]))


def _end(
    joint: str, place: tuple[float, float, float], skin: dict[str, Array], rest: Array
) -> tuple[str, tuple[float, float, float], float]:
    """An end of a capsule of the bundled body on the character's: its joint, the place from that, and how
    thick it is there.
    """
    part = _part_of(joint)
    axis, ratio = _PARTS[part][1], _length_ratio(part, rest)
    sections, end, times = (
        _sections(part, joint, place, skin, rest),
        rest[INDEX[joint]] + ratio * np.array(place),
        ratio,
    )
    if sections is not None:
        (middle, half), (own_middle, own_half) = sections
        end = own_middle + own_half / half * (rest_joints()[INDEX[joint]] + place - middle)
        times = _times(half, own_half, axis)
    if axis is not None:
        end[axis] = _along(part, joint, place, rest)
    if part == "trunk" and joint in _SPINE:  # wherever the rig divides its spine
        joint = next((name for name in _SPINE[::-1] if rest[INDEX[name], 2] <= end[2]), "Hips")
    x, y, z = (end - rest[INDEX[joint]]).tolist()
    return joint, (x, y, z), times


def _along(part: str, joint: str, place: tuple[float, float, float], rest: Array) -> float:
    """Where on the axis of a part the character has what the bundled body has at a place from a joint."""
    axis, ratio = _PARTS[part][1] or 0, _length_ratio(part, rest)
    if part == "trunk":  # by its height between hips and neck
        theirs = rest_joints()
        return float(rest[HIPS, 2] + ratio * (theirs[INDEX[joint], 2] + place[2] - theirs[HIPS, 2]))
    return float(rest[INDEX[joint], axis] + ratio * place[axis])


def _thickness(
    part: str, joint: str, place: tuple[float, float, float], skin: dict[str, Array], rest: Array
) -> float:
    """How thick a part is beside the bundled body's at a place (3,) from a joint."""
    sections = _sections(part, joint, place, skin, rest)
    if sections is None:
        return _length_ratio(part, rest)
    return _times(sections[0][1], sections[1][1], _PARTS[part][1])


def _times(half: Array, own: Array, axis: int | None) -> float:
    scale = own / half if axis is None else np.delete(own / half, axis)
    return float(np.clip(np.exp(np.log(scale).mean()), _LEAST, _MOST))


Section = tuple[Array, Array]  # middle (3,) and half width (3,) of a cross-section


def _sections(
    part: str, joint: str, place: tuple[float, float, float], skin: dict[str, Array], rest: Array
) -> tuple[Section, Section] | None:
    """Cross-sections of a part of the bundled body and of the character's at a place (3,) from a joint."""
    axis, theirs, own = _PARTS[part][1], _bundled()[part], skin[part]
    if axis is not None:
        ratio = _length_ratio(part, rest)
        theirs = theirs[np.abs(theirs[:, axis] - rest_joints()[INDEX[joint], axis] - place[axis]) < _BAND]
        near = own[np.abs(own[:, axis] - _along(part, joint, place, rest)) < _BAND * ratio]
        own = near if len(near) >= _FEWEST else own
    if min(len(theirs), len(own)) < _FEWEST:
        return None
    return _section(theirs), _section(own)


def _section(points: Array) -> Section:
    low, high = np.quantile(points, (_QUANTILE, 1 - _QUANTILE), axis=0)
    return (low + high) / 2, np.maximum((high - low) / 2, 1e-3)


def _length_ratio(part: str, rest: Array) -> float:
    """How long a part is beside the bundled body's."""
    ends = {
        "trunk": ("Hips", "Neck"), "pelvis": ("LeftHip", "RightHip"), "head": ("Neck", "Head"),
        "upper arm": ("LeftShoulder", "LeftElbow"), "forearm": ("LeftElbow", "LeftWrist"),
        "hand": ("LeftElbow", "LeftWrist"), "thigh": ("LeftHip", "LeftKnee"),
        "shin": ("LeftKnee", "LeftAnkle"), "foot": ("LeftAnkle", "LeftToe"),
    }  # fmt: skip
    a, b = (INDEX[name] for name in ends[part])
    theirs = rest_joints()
    ratio = np.linalg.norm(rest[b] - rest[a]) / np.linalg.norm(theirs[b] - theirs[a])
    return float(np.clip(ratio, _LEAST, _MOST))


def _drawn(capsules: list[Capsule], skin: dict[str, Array], rest: Array) -> list[Capsule]:
    """The capsules with radii that meet the skin's points nearest to them, each end by those on its half."""
    out = list(capsules)
    for _ in range(_ROUNDS):
        for part, both in skin.items():
            points = both[both[:, 0] >= 0] if part in _ON_BOTH else both
            mine = [k for k, c in enumerate(capsules) if _part_of(c.a) == part]
            away, along = (np.stack(a) for a in zip(*(_to(out[k], points, rest) for k in mine), strict=True))
            ends = np.array([(out[k].radius_a, out[k].radius_b) for k in mine])
            at = np.clip(along, 0, 1)
            radius = ends[:, :1] + at * (ends[:, 1:] - ends[:, :1])
            nearest = (away - radius).argmin(0)
            # What lies beyond the ends of a limb or the trunk is another part's.
            beside = (along == at) | (_PARTS[part][1] is None)
            for n, k in enumerate(mine):
                own = (nearest == n) & beside[n]
                ratio = away[n] / radius[n]
                halves = [own & half for half in (at[n] < 0.5, at[n] >= 0.5)]
                factors = [np.quantile(ratio[h], _SKIN) if h.sum() >= _FEWEST else 1.0 for h in halves]
                if capsules[k].from_a[0] < 0:  # the one that lies across: points are of its left half alone
                    factors[0] = factors[1]
                least, most = (share * np.array(_radii(capsules[k])) for share in _DRAWN)
                a, b = np.clip(ends[n] * factors, least, most)
                out[k] = _with(out[k], (*MIDDLE, *LEFT)[k], float(a), float(b))
    return out


def _radii(c: Capsule) -> tuple[float, float]:
    return c.radius_a, c.radius_b


def _to(c: Capsule, points: Array, rest: Array) -> tuple[Array, Array]:
    """Distances (N,) of points to a capsule's axis, and how far along it, 0..1 between its ends."""
    a, b = rest[INDEX[c.a]] + c.from_a, rest[INDEX[c.b]] + c.from_b
    way = b - a
    along = (points - a) @ way / max(float(way @ way), 1e-9)
    return np.linalg.norm(points - a - np.clip(along, 0, 1)[:, None] * way, axis=1), along


__all__ = ["fitted", "fitted_sole"]
