"""What all trials share: fixed starts, one roll-out, and the figures that every take is judged by."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from nsm_core.body.skeleton import forward_kinematics
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.errors import GoalError
from nsm_core.evaluation.measures.motion import travel_report
from nsm_core.evaluation.measures.objects import all_depths, deep_frames, slide_by_action
from nsm_core.rotations import Array, heading_to_direction
from nsm_core.world.assets.pool import Pool
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.planning.floor_plan import FloorPlan
from nsm_core.world.scene import furniture
from nsm_core.world.scene.furniture import Furniture
from nsm_core.world.scene.props import Prop

SEED = 990_000  # of all trials; training draws its furniture and starts from other streams
NEAREST, FURTHEST = 0.9, 3.0  # metres from the object to a start
ROOM = 0.35  # metres from a start to the nearest solid
Report = dict[str, float]


def start_about(
    rng: np.random.Generator,
    middle: Array,
    free: Callable[[Array], bool],
    nearest: float = NEAREST,
    furthest: float = FURTHEST,
) -> tuple[Array, float]:
    """Draw a start (2,) in any direction about ``middle`` (2,) that is ``free``, and any facing; GoalError
    where there is none.
    """
    for _ in range(400):
        away = rng.uniform(nearest, furthest) * heading_to_direction(np.array(rng.uniform(-np.pi, np.pi)))
        start, heading = np.asarray(middle, dtype=np.float64)[:2] + away, float(rng.uniform(-np.pi, np.pi))
        if free(start):
            return start, heading
    raise GoalError("There is no free place to start from about the object; make the scene less crowded.")


def draw_piece(pool: Pool | None, kind: str, rng: np.random.Generator) -> tuple[Furniture, bool]:
    """A piece of a kind from a pool of meshes, or a parametric one where it has none; and whether the pool
    has some.
    """
    if pool is not None and pool.of_kind(kind):
        return pool.draw(kind, rng), True
    return furniture.make(kind, rng), False


def clear_of(still: DistanceQuery, props: Sequence[Prop] = (), room: float = ROOM) -> Callable[[Array], bool]:
    """Tell of floor places (2,) whether a body can stand there with ``room`` metres to everything solid."""

    def free(place: Array) -> bool:
        points = np.array([(*place, z) for z in (0.1, 0.3, 0.5, 0.8, 1.1, 1.4)], dtype=np.float32)
        return all(float(q.signed_distance(points, room + 0.1).min()) >= room for q in (still, *props))

    return free


def props_of(asked: TakeRequest) -> dict[str, Prop]:
    """The props of all parts of a take's goals by name, where they stand at the start."""
    return {one.prop.name: one.prop for g in asked.goals for one in g.parts if one.prop is not None}


def shortest_way(asked: TakeRequest, place: Array) -> float | None:
    """Length in metres of the planned way from the start to ``place`` (2,), None where there is none."""
    ends = np.stack(
        (np.asarray(asked.start_position, dtype=np.float64)[:2], np.asarray(place, dtype=np.float64)[:2])
    )
    try:
        way = FloorPlan(asked.environment, (ends.min(0) - 3, ends.max(0) + 3)).find(*ends)
    except GoalError:
        return None
    return float(np.linalg.norm(np.diff(way, axis=0), axis=-1).sum())


def judge(
    asked: TakeRequest,
    take: TakeResult,
    ground: Callable[[Array], Array] | None = None,
    shortest: float | None = None,
    goal: int = 0,
) -> tuple[Report, Array]:
    """Figures of a take and of its goal number ``goal``, and the body's depth in solids of each frame (T,),
    metres.

    ``ground`` and ``shortest`` as in ``motion.travel_report``.  Penetration counts what stands and what
    moves.
    """
    report = travel_report(
        take.hips_position, take.local_rotations, take.action, shortest_path=shortest, ground=ground
    )
    alone = travel_report(take.network_hips, take.network_rotations, take.action, ground=ground)
    depths = all_depths(
        take.hips_position, take.local_rotations, asked.environment, props_of(asked), take.props
    )
    outcome = take.goals[goal]
    report |= {
        "penetration_cm": float(100 * depths.max(initial=0.0)),
        "penetration_mean_cm": float(100 * depths.mean()),
        "penetration_share": deep_frames(depths)["deep_frames"] / len(depths),
        "penetration_end_cm": float(100 * depths[-1]),
        **deep_frames(depths),
        "reached": float(outcome.reached),
        "seconds": outcome.seconds,
        "pe_cm": outcome.position_error_cm,
        "re_deg": outcome.rotation_error_deg,
        "network_pe_cm": outcome.network_position_error_cm,
        "network_re_deg": outcome.network_rotation_error_deg,
        "hand_pe_cm": outcome.hand_error_cm,
        "hand_re_deg": outcome.hand_rotation_deg,
        "network_hand_pe_cm": outcome.network_hand_error_cm,
        "network_hand_re_deg": outcome.network_hand_rotation_deg,
        "network_slide_moving_cm_s": alone["slide_moving_cm_s"],
        "network_planted_share": alone["planted_share"],
        "ms_per_frame": sum(take.stage_ms.values()),
    }
    positions = forward_kinematics(take.hips_position, take.local_rotations)[0]
    for name, (total, count) in slide_by_action(positions, take.action, ground).items():
        report |= {f"slide_{name}_total": float(total), f"slide_{name}_count": float(count)}
    return report, depths


def slides(reports: Sequence[Report]) -> dict[str, float]:
    """Foot slide in cm/s by action over the takes of ``judge``."""
    counts = {k for r in reports for k in r if k.startswith("slide_") and k.endswith("_count")}
    names = sorted(k.removeprefix("slide_").removesuffix("_count") for k in counts)
    total = {n: sum(r.get(f"slide_{n}_total", 0.0) for r in reports) for n in names}
    count = {n: sum(r.get(f"slide_{n}_count", 0.0) for r in reports) for n in names}
    return {n: 100 * total[n] / count[n] for n in names if count[n] > 0}


def summarise(reports: Sequence[Report]) -> Report:
    """Medians, means and worst values over trials, and shares of all trials.

    Trials that broke off (``failed``) count as not reached and have no other figure.  ``worst`` is the
    largest value, of planted shares the smallest; ``deep_share`` is that of all frames of all trials.
    """
    keys = sorted(
        {
            k
            for r in reports
            for k in r
            if not isinstance(r[k], str) and (not k.startswith("slide_") or k.startswith("slide_moving"))
        }
    )
    summary: Report = {
        "trials": float(len(reports)),
        "failed": float(sum(r.get("failed", 0.0) for r in reports)),
    }
    summary["reached"] = float(np.mean([r.get("reached", 0.0) for r in reports])) if reports else float("nan")
    frames = sum(r.get("frames", 0.0) for r in reports)
    summary["deep_share"] = (
        sum(r.get("deep_frames", 0.0) for r in reports) / frames if frames else float("nan")
    )
    for k in keys:
        if k in ("reached", "failed", "frames", "deep_frames"):
            continue
        values = np.array([r.get(k, np.nan) for r in reports], dtype=float)
        good = values[np.isfinite(values)]
        if not len(good):
            summary |= {f"{k}_median": float("nan"), f"{k}_mean": float("nan"), f"{k}_worst": float("nan")}
            continue
        worst = good.min() if "planted" in k else good.max()
        summary |= {
            f"{k}_median": float(np.median(good)),
            f"{k}_mean": float(good.mean()),
            f"{k}_worst": float(worst),
        }
    summary |= {f"slide_{name}": value for name, value in slides(reports).items()}
    return summary


def share(reports: Sequence[Report], true: Callable[[Report], object]) -> float:
    """Share of trials of which ``true`` holds; one that broke off counts as false."""
    return (
        float(np.mean([not r.get("failed") and bool(true(r)) for r in reports])) if reports else float("nan")
    )
