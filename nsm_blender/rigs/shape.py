"""Find a body in bones by their shape alone: two legs down, two arms out, a head on top."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nsm_core.rotations import Array

_ASIDE = 0.02  # of the body's height that a limb's bone lies off its middle


def by_shape(parents: tuple[int, ...], heads: Array) -> tuple[dict[str, int], list[int]]:
    """Joint of the 23 -> bone, for bones with ``parents`` and ``heads`` (N, 3) in an armature with Z or Y
    up, and the bones of the spine from the pelvis up; both empty where no body is seen.
    """
    children: list[list[int]] = [[] for _ in parents]
    for bone, parent in enumerate(parents):
        if parent >= 0:
            children[parent].append(bone)
    size = np.ptp(heads, axis=0) if len(heads) else np.zeros(3)
    if len(parents) < 14 or size.max() <= 0:
        return {}, []
    up = 1 if size[1] > size[2] else 2
    places = heads if up == 2 else np.stack((heads[:, 0], -heads[:, 2], heads[:, 1]), axis=1)
    places = (places - np.array((np.median(places[:, 0]), 0, places[:, 2].min()))) / size[up]
    leaves = [bone for bone, below in enumerate(children) if not below]
    found: dict[str, int] = {}
    lines = {}
    for side, sign in (("Right", -1), ("Left", 1)):
        mine = [leaf for leaf in leaves if sign * places[leaf, 0] > _ASIDE]
        low = [leaf for leaf in mine if places[leaf, 2] < 0.25]
        high = [leaf for leaf in mine if places[leaf, 2] > 0.35]
        if not low or not high:
            return {}, []
        foot = min(low, key=lambda leaf: (round(places[leaf, 2], 2), places[leaf, 1]))
        hand = max(high, key=lambda leaf: sign * places[leaf, 0])
        lines[side] = (_line(parents, foot), _line(parents, hand))
    hips = _fork(lines["Right"][0], lines["Left"][0])
    chest = _fork(lines["Right"][1], lines["Left"][1])
    if hips is None or chest is None or hips not in _line(parents, chest):
        return {}, []
    found["Hips"] = hips
    for side in lines:
        leg = [b for b in _after(lines[side][0], hips) if abs(places[b, 0]) > _ASIDE]
        arm = [b for b in _after(lines[side][1], chest) if abs(places[b, 0]) > _ASIDE / 2]
        legs, arms = _leg(leg, places), _arm(arm, places, children)
        if not legs or not arms:
            return {}, []
        found |= {side + name: bone for name, bone in {**legs, **arms}.items()}
    tops = [leaf for leaf in leaves if abs(places[leaf, 0]) < _ASIDE and chest in _line(parents, leaf)[:-1]]
    if not tops:
        return {}, []
    over = _after(_line(parents, max(tops, key=lambda leaf: places[leaf, 2])), chest)
    forks = [bone for bone in over[1:] if len(children[bone]) > 1]  # a face hangs on a head
    found["Head"] = forks[0] if forks else over[min(1, len(over) - 1)]
    if len(over) > 1:
        found["Neck"] = over[0]
    spine = _after(_line(parents, chest), hips)
    toes = [places[found[s + "Toe"]] - places[found[s + "Ankle"]] for s in lines if s + "Toe" in found]
    if sum(float(toe[1]) for toe in toes) > 0:  # it faces the other way, so that left is right
        other = {"Right": "Left", "Left": "Right"}
        found = {
            next((other[s] + j[len(s) :] for s in other if j.startswith(s)), j): b for j, b in found.items()
        }
    return found, spine


def _line(parents: Sequence[int], bone: int) -> list[int]:
    """A bone and the bones over it, from the root down."""
    line = [bone]
    while parents[line[-1]] >= 0:
        line.append(parents[line[-1]])
    return line[::-1]


def _fork(one: list[int], other: list[int]) -> int | None:
    """The last bone that two lines share."""
    shared = [a for a, b in zip(one, other, strict=False) if a == b]
    return shared[-1] if shared else None


def _after(line: list[int], bone: int) -> list[int]:
    return line[line.index(bone) + 1 :]


def _leg(line: list[int], places: Array) -> dict[str, int]:
    """Hip, knee, ankle and toe of a leg's bones from the top."""
    if len(line) < 3:
        return {}
    floor = min(places[b, 2] for b in line)
    ankles = [b for b in line[2:] if places[b, 2] - floor < 0.25 * (places[line[0], 2] - floor)]
    if not ankles:
        return {}
    ankle = ankles[0]
    middle = (places[line[0], 2] + places[ankle, 2]) / 2
    between = line[1 : line.index(ankle)]
    knee = min(between, key=lambda b: abs(places[b, 2] - middle))
    below = _after(line, ankle)
    return {"Hip": line[0], "Knee": knee, "Ankle": ankle} | ({"Toe": below[0]} if below else {})


def _arm(line: list[int], places: Array, children: list[list[int]]) -> dict[str, int]:
    """Collar, shoulder, elbow and wrist of an arm's bones from the body outwards."""
    if len(line) < 3:
        return {}
    wrist = next((b for b in line[2:] if len(children[b]) >= 3), None)
    if wrist is None:
        wrist = line[3] if len(line) > 3 else line[2]
    upper = line[: line.index(wrist)]
    gaps = [float(np.linalg.norm(places[b] - places[a])) for a, b in zip(upper, line[1:], strict=False)]
    reach = np.cumsum(gaps[::-1])[::-1]  # from each bone to the wrist
    best = None
    for a in range(len(upper) - 1):
        for b in range(a + 1, len(upper)):
            odd = abs(reach[a] - 2 * reach[b]) / max(reach[a], 1e-9) - 0.5 * reach[a] / max(reach[0], 1e-9)
            if best is None or odd < best[0]:
                best = (odd, a, b)
    if best is None:
        return {}
    _, a, b = best
    return {"Shoulder": upper[a], "Elbow": upper[b], "Wrist": wrist} | ({"Collar": upper[0]} if a else {})
