"""What is asked of a take, and what has come of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from nsm_core.body.capsules import BUNDLED, Figure
from nsm_core.model.features.rollout_step import Blending
from nsm_core.rotations import Array
from nsm_core.world.geometry.distance import DistanceQuery
from nsm_core.world.scene.movers import Mover
from nsm_core.world.scene.stairs import Stairs
from nsm_core.world.scene.terrain import Terrain

from .goals import Goal, GoalResult
from .insight import Insight
from .start import Start


@dataclass
class TakeRequest:
    """What a take needs to know, world frame.

    ``start_position`` (2,) metres and ``start_heading`` of the root; ``environment`` everything solid that
    does not move (no floor, no character, none of the goals' props); ``ground`` the heights of what is walked
    over, such as rugs and thresholds, and is no part of it; ``time_limit`` seconds without any progress after
    which a goal is given up.  ``figure`` is the character's own body where it is another than the network's,
    its hips as high, since it acts in a world of that scale.  ``start`` is the motion that the take goes on
    from, on that body; None: it begins with a quiet stand.  ``movers`` are things that move by themselves.
    ``stairs`` are flights that are walked up and down, and part of the environment.  ``in_order``: goals are
    performed strictly one after the other as they are asked for, instead of as is quickest (``scheduling``).
    """

    start_position: Array
    start_heading: float
    goals: list[Goal]
    environment: DistanceQuery
    seed: int = 0
    contact_ik: bool = True
    time_limit: float = 20.0
    blending: Blending = field(default_factory=Blending)
    ground: Terrain = field(default_factory=Terrain)
    figure: Figure = BUNDLED
    start: Start | None = None
    movers: Sequence[Mover] = ()
    stairs: Stairs = field(default_factory=Stairs)
    in_order: bool = False


@dataclass
class TakeResult:
    """A finished take of T frames at 30 Hz.

    ``hips_position`` (T, 3) and ``local_rotations`` (T, 23, 4) as they are keyed, ``network_hips`` and
    ``network_rotations`` the same before the take is solved; ``contacts`` (T, 5), ``root`` (T, 3), ``action``
    labels (T, 7), ``experts`` (T, K) gating coefficients, K 0 for a network that blends none; ``stage_ms``
    mean milliseconds per frame by stage; ``props`` poses (T, 4) of every prop of the goals by its name: x, y,
    z and heading.
    """

    hips_position: Array
    local_rotations: Array
    network_hips: Array
    network_rotations: Array
    contacts: Array
    root: Array
    action: Array
    experts: Array
    goals: list[GoalResult]
    stage_ms: dict[str, float]
    props: dict[str, Array] = field(default_factory=dict)
    insights: dict[int, Insight] = field(default_factory=dict)
