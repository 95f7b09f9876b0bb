"""What a part of an evaluation is made of."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from .rollout import Report
from .together import Trying

Row = tuple[str, str, str, str]

# What is left out at run time: the switches of the stepper, and sensors that read nothing.  Nothing is
# trained again.
ABLATIONS = {
    "no bi-directional control": "goal-centric trajectory and future pose not used at run time",
    "interaction sensor zeroed": "reads nothing at run time; the network was trained with it",
    "environment sensor zeroed": "reads nothing at run time; the network was trained with it",
}


@dataclass(frozen=True)
class TrialPart:
    """One part: its trials (starts, pool), one trial's take and figures, the summary over trials and the
    lines of its table.

    ``judges`` are the keys of the actions that it is about; ``beside`` the part that it is another condition
    of, and that it is run with.  ``ablations`` are run with the paper's PE in cm
    and RE in degrees, whose sensor ablations are networks trained without the sensor; ``alone`` begins the
    names of the network's own figures of that.
    """

    title: str
    trials: Callable[[int, Any], list[Any]]
    run: Callable[..., Trying[tuple[Any, Report]]]
    summarise: Callable[[Sequence[Report]], Report]
    rows: Callable[[Report], list[Row]]
    request: Callable[..., Any] | None = None
    judges: tuple[str, ...] = ()
    ablations: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    alone: str = "network"
    travels: bool = True
    beside: str = ""
    done: str = "reached"  # the figure that tells whether a trial went well
