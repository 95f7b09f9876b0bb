"""Goals by matching (papers/002 section 6.1): grasps of things in surroundings that are alike, and what they
are worth as the order in which grasps are tried.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count

import numpy as np

from nsm_core.data.reaches.library import WayLibrary
from nsm_core.data.reaches.ways import HandAt, quickest
from nsm_core.rotations import Array, rotate_planar

from .hand_layouts import judged_kitchen

Coder = Callable[[Array], Array]  # fields of obstacles (S, N, N, N), one over metres, to codes (S, 16)
NEAREST = (1, 5)  # keyframes that are asked
_TURN = 0.15  # metres that a radian between two ways of a hand counts


class GoalKeyframes:
    """Goals of ways that were learnt from: where wrists are and point there, by what is around them.

    A search tree over codes and the state of the hand, each number in its deviations.
    """

    def __init__(self, library: WayLibrary, rows: Array, coder: Coder) -> None:
        """Goals of ways ``rows`` (M,), each as it is and mirrored."""
        from scipy.spatial import cKDTree

        self._coder = coder
        found, goals = [], []
        for mirrored in (False, True):
            flags = np.full(len(rows), mirrored)
            condition, task = library.asked(rows, np.zeros(len(rows), bool), flags)
            fields = library.obstacles[rows]
            found.append(np.concatenate((coder(fields[:, ::-1] if mirrored else fields), condition), 1))
            goals.append(task[:, :6])
        features, self._goals = np.concatenate(found), np.concatenate(goals).astype(np.float64)
        self._scale = np.maximum(features.std(0), 1e-3)
        self._tree = cKDTree(features / self._scale)

    def alike(self, at: HandAt, laden: bool, nearest: int) -> Array:
        """Places and ways (2 * K, 6) of the wrists of the ``nearest`` keyframes of either hand, from the
        thing, in the frame of what it stands in.
        """
        code, height = self._coder(at.space.obstacles[None])[0], float(at.thing.middle[2])
        asked = [np.concatenate((code, (height, hand, 0.0, laden))) / self._scale for hand in (0.0, 1.0)]
        return self._goals[self._tree.query(asked, k=nearest)[1].ravel()]


class Choice:
    """The grasps of one thing in a kitchen, by score, and, once each is asked, whether it would do: somebody
    stands who reaches it, and the hand has a way, ``laden`` or not.
    """

    def __init__(self, at: HandAt, laden: bool) -> None:
        self.at, self.laden = at, laden
        back = np.float64(-at.heading)
        places = rotate_planar(np.array([w.place for w in at.wrists]) - at.thing.middle, back)
        self.goals = np.concatenate(
            (places, rotate_planar(np.array([w.towards for w in at.wrists]), back)), 1
        )
        self._known: dict[int, bool] = {}

    def __len__(self) -> int:
        return len(self.goals)

    def does(self, number: int) -> bool:
        """Whether the grasp of a number by score would do."""
        if number not in self._known:
            task = self.at.task(self.at.wrists[number], self.laden)
            self._known[number] = task is not None and quickest(task) is not None
        return self._known[number]


def unlike(choice: Choice, goals: Array) -> Array:
    """Metres (N,) from each grasp to the most alike of ``goals`` (K, 6), turns counted as well."""
    apart = np.linalg.norm(choice.goals[:, None, :3] - goals[:, :3], axis=-1)
    turned = np.arccos(np.clip(choice.goals[:, 3:] @ goals[:, 3:].T, -1, 1))
    return np.asarray((apart + _TURN * turned).min(1))


@dataclass(frozen=True)
class Tried:
    """Grasps of things in an order: the share of things whose ``first`` one does, and the mean of ``tries``
    until one does, all where none does.
    """

    first: float
    tries: float


def choices(many: int, reshaped: bool) -> list[Choice]:
    """A thing by chance in each of so many kitchens not learnt from, what shuts it away open."""
    found: list[Choice] = []
    for seed in count():
        if len(found) == many:
            return found
        kitchen, rng = judged_kitchen(seed, reshaped)
        name = str(rng.choice(list(kitchen.things)))
        for part in kitchen.shut_by(name):
            kitchen.open(kitchen.things[name].container, part, 1.0)
        if len((at := HandAt.thing_of(kitchen, name)).wrists) > 1:
            found.append(Choice(at, laden=seed % 2 == 1))
    return found


Order = Callable[[Choice], Array]  # what each grasp (N,) costs: the least is tried first


def tried(things: Sequence[Choice], order: Order) -> Tried:
    """Try the grasps of all things in an order."""
    tries = []
    for choice in things:
        numbers = np.argsort(order(choice), kind="stable")
        tries.append(next((n for n, k in enumerate(numbers, 1) if choice.does(int(k))), len(numbers)))
    first = [
        t == 1 and choice.does(int(np.argmin(order(choice)))) for t, choice in zip(tries, things, strict=True)
    ]
    return Tried(float(np.mean(first)), float(np.mean(tries)))


def orders(keyframes: GoalKeyframes) -> dict[str, Order]:
    """All orders that are compared, by name."""
    found: dict[str, Order] = {
        "by score, as takes do": lambda choice: np.arange(len(choice)),
        "by chance": lambda choice: np.random.default_rng(len(choice)).random(len(choice)),
    }
    for near in NEAREST:
        name = f"like the nearest {near}" if near > 1 else "like the nearest"
        found[name] = partial(_unlike_nearest, keyframes, near)
    return found


def _unlike_nearest(keyframes: GoalKeyframes, nearest: int, choice: Choice) -> Array:
    return unlike(choice, keyframes.alike(choice.at, choice.laden, nearest))


def match_table(keyframes: GoalKeyframes, many: int, tell: Callable[[str], None]) -> None:
    """Tell for each order how soon it finds a grasp that does, in kitchens not learnt from."""
    for reshaped in (False, True):
        things = choices(many, reshaped)
        tell(f"\n{len(things)} things, {'reshaped' if reshaped else 'plain'}\n")
        tell("| grasps are tried | the first does, % | tries |\n|---|---|---|")
        for name, order in orders(keyframes).items():
            got = tried(things, order)
            tell(f"| {name} | {100 * got.first:.1f} | {got.tries:.2f} |")


__all__ = ["Choice", "Coder", "GoalKeyframes", "Tried", "choices", "match_table", "orders", "tried", "unlike"]
