"""Door trials: push and pull, hinge on the left and on the right, doors of different sizes in a long wall."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nsm_core.body.capsules import penetration_depths
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.conventions import FPS, HAND_CONTACTS
from nsm_core.evaluation.measures.objects import leaf_report, prop_depths
from nsm_core.model.inference.model import Model
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.world.affordances.passage import Passage, passage
from nsm_core.world.assets.pool import Pool
from nsm_core.world.scene import furniture
from nsm_core.world.scene.door import Door, make_door
from nsm_core.world.scene.props import Leaf

from . import rollout
from .part import TrialPart
from .rollout import SEED, Report
from .together import Trying, rolled

SETTINGS = (
    ("push, hinge left", True, False),
    ("push, hinge right", True, True),
    ("pull, hinge left", False, False),
    ("pull, hinge right", False, True),
)
WALL = 3.5  # metres of wall on either side, so that there is no way around
# Seconds in which, and metres beyond the wall's middle from which, the door counts as passed.
IN_TIME, BEYOND = 20.0, 0.3
DEEPEST = 5.0  # cm


@dataclass(frozen=True)
class DoorTrial:
    """One start before one door at ``pose`` (4,) of its frame."""

    setting: int
    name: str
    start: Array
    heading: float
    door: Door
    pose: Array
    swing: float


def trials(starts: int = 10, settings: int = len(SETTINGS), pool: Pool | None = None) -> list[DoorTrial]:
    """The same ``starts`` times ``settings`` trials at every call; doors are made, never drawn from a
    ``pool``.
    """
    result = []
    for n in range(settings):
        name, push, hinge_right = SETTINGS[n % len(SETTINGS)]
        rng = np.random.default_rng((SEED, 3, n))
        door = make_door(rng, near=WALL, far=WALL)
        pose = np.array((*rng.uniform(-1, 1, 2), 0.0, rng.uniform(-np.pi, np.pi)))
        # Who comes from the frame's -Y side has the hinge on the left; a leaf that swings to the other side
        # is pushed.
        side = 1.0 if hinge_right else -1.0
        swing = -side if push else side
        leaf = door.leaf(pose, swing)
        solid = rollout.clear_of(furniture.cuboids([(door.wall, pose[:3], pose[3])]), [leaf])
        middle = leaf.to_world((door.width / 2, 0.0, 0.0))[:2]

        def free(
            place: Array, leaf: Leaf = leaf, solid: Callable[[Array], bool] = solid, side: float = side
        ) -> bool:
            return bool(side * leaf.to_local(np.append(place, 0.0))[1] > 0.4) and solid(place)

        for _ in range(starts):
            start, heading = rollout.start_about(rng, middle, free)
            result.append(DoorTrial(n, name, start, heading, door, pose, swing))
    return result


def request(trial: DoorTrial, hold: float = 1.0, **more: Any) -> TakeRequest:
    """Set up one trial's take."""
    leaf = trial.door.leaf(trial.pose, trial.swing)
    way = passage(leaf, trial.start)
    goal = Goal("open", "Door", np.append(way.middle, 0.0), way.heading, hold, prop=leaf)
    still = furniture.cuboids([(trial.door.wall, trial.pose[:3], float(trial.pose[3]))])
    return TakeRequest(trial.start, trial.heading, [goal], still, **more)


def passed_at(root: Array, way: Passage, width: float, beyond: float = BEYOND) -> float:
    """Seconds until roots (T, 3) are ``beyond`` metres past the wall's middle, having gone through the
    opening; nan for never.
    """
    ahead = heading_to_direction(np.array(way.heading))
    seen = rotate_planar(root[:, :2] - way.middle, np.float64(-way.heading))  # x across, -y ahead
    through = (root[:, :2] - way.middle) @ ahead
    crossing = np.flatnonzero((through[:-1] < 0) & (through[1:] >= 0))
    if not len(crossing) or (np.abs(seen[crossing, 0]) > width / 2).any():
        return float("nan")
    past = np.flatnonzero(through >= beyond)
    return float(past[0] / FPS) if len(past) else float("nan")


def run_trial(model: Model, trial: DoorTrial, **more: Any) -> Trying[tuple[TakeResult, Report]]:
    """Roll one trial out; returns the take and its figures."""
    asked = request(trial, **more)
    take = yield from rolled(model, asked)
    report, _ = rollout.judge(asked, take)
    leaf = asked.goals[0].prop
    assert isinstance(leaf, Leaf)
    way, poses = passage(leaf, trial.start), take.props[leaf.name]
    report |= leaf_report(leaf, poses, way.side, way.hand, take.hips_position, take.local_rotations)
    inside = penetration_depths(take.hips_position, take.local_rotations, asked.environment)
    in_leaf = prop_depths(take.hips_position, take.local_rotations, leaf, poses)
    report |= {
        "pass_seconds": passed_at(take.root, way, leaf.width),
        "in_wall_cm": float(100 * inside.max()),
        "in_leaf_cm": float(100 * in_leaf.max()),
        "hand_contact": float(take.contacts[:, HAND_CONTACTS[way.hand]].max()),
    }
    clean = report["in_wall_cm"] <= DEEPEST and report["in_leaf_cm"] <= DEEPEST
    beyond = bool(np.isfinite(report["pass_seconds"]) and report["pass_seconds"] <= IN_TIME)
    report |= {"through": float(beyond), "passed": float(beyond and clean)}
    return take, report


def summarise(reports: Sequence[Report]) -> Report:
    """Figures over trials; see ``rollout.summarise``."""
    return rollout.summarise(reports) | {
        "passed": rollout.share(reports, lambda r: r["passed"] > 0),
        "through": rollout.share(reports, lambda r: r["through"] > 0),
    }


def rows(s: Report) -> list[tuple[str, str, str, str]]:
    """Lines of the table: what, ours, the paper's, the aim."""
    return [
        ("doors passed within 20 s, at most 5 cm inside wall or leaf", f"{s['passed']:.0%}", "", "95 %"),
        ("root beyond the opening within 20 s", f"{s['through']:.0%}", "", ""),
        (
            "hand at the end of the reach, network alone PE cm (mean)",
            f"{s['network_hand_pe_cm_mean']:.2f}",
            "",
            "",
        ),
        ("hand at the end of the reach, with contact IK PE cm (mean)", f"{s['hand_pe_cm_mean']:.2f}", "", ""),
        (
            "hand off the grip while it holds cm (median / worst)",
            f"{s['grip_off_cm_median']:.1f} / {s['grip_off_worst_cm_worst']:.1f}",
            "",
            "",
        ),
        (
            "leaf opens without the hand, share of its frames (mean)",
            f"{s['leaf_alone_share_mean']:.2f}",
            "",
            "0",
        ),
        ("fastest leaf deg per frame (worst)", f"{s['leaf_step_deg_worst']:.1f}", "", ""),
        (
            "body inside the wall cm (median / worst)",
            f"{s['in_wall_cm_median']:.1f} / {s['in_wall_cm_worst']:.1f}",
            "",
            "5",
        ),
        (
            "body inside the leaf cm (median / worst)",
            f"{s['in_leaf_cm_median']:.1f} / {s['in_leaf_cm_worst']:.1f}",
            "",
            "5",
        ),
        ("seconds to pass a door (median)", f"{s['pass_seconds_median']:.1f}", "", ""),
    ]


PART = TrialPart(
    "open",
    lambda starts, pool: trials(starts, pool=pool),
    run_trial,
    summarise,
    rows,
    request,
    ("open",),
    done="passed",
)
