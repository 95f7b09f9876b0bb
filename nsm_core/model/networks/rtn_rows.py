"""The networks that the tables of papers/001 compare, each with what it is trained by: one name a row."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from .delta_config import DeltaConfig
from .gap_config import GapConfig
from .rtn_config import ErdConfig, ResLstmConfig, TransitionConfig


@dataclass(frozen=True)
class TransitionSettings:
    """What a run depends on; stored in the weights.

    ``shortest`` to ``longest`` frames are missing, short gaps as often again as long ones; ``teacher``: share
    of true frames that the network reads of what is missing, falling from 1 to 0 over the run where it is
    ``scheduled``; ``world``: weight in the loss of how far joints are from where they should be in the world,
    in deviations of the offset vector, 0 in the paper; ``pace``: of how far off their speeds are, in those of
    the target's velocity and not squared: feet that most likely stand are told to; ``evened``: by how much
    all paces are drawn alike, 0 in the paper: few captures run; ``hasted``: share by which captures are
    played faster or slower at most, 0 in the paper.  A run ends after ``minutes``, or where ``steps`` is not
    0 after so many of them: networks that are compared on machines that do other work besides.
    """

    minutes: float = 50.0
    shortest: int = 30
    longest: int = 30
    batch: int = 32
    learning_rate: float = 5e-4
    teacher: float = 0.2
    scheduled: bool = False
    world: float = 0.0
    seed: int = 0
    steps: int = 0
    pace: float = 0.0
    evened: float = 0.0
    hasted: float = 0.0


@dataclass(frozen=True)
class Row:
    """A network as it is trained, and what the paper has for it (None where it has nothing)."""

    config: GapConfig
    settings: TransitionSettings
    mse: float | None = None
    aco: float | None = None


def _as_in_the_paper(config: TransitionConfig) -> TransitionConfig:
    return replace(config, arrival=False, homing=False, faced=False)


_RTN = _as_in_the_paper(TransitionConfig())
_AT_30 = TransitionSettings()
_AT_60 = replace(_AT_30, shortest=60, longest=60)
SHIPPED = "shipped"

ROWS: Mapping[str, Row] = {
    "rtn": Row(_RTN, _AT_30, 0.087, 4.751),
    "f_erd": Row(_as_in_the_paper(ErdConfig()), _AT_30, 0.092, 4.770),
    "f_reslstm": Row(_as_in_the_paper(ResLstmConfig()), _AT_30, 0.144, 7.709),
    "blind": Row(replace(_RTN, terrain=False), _AT_30, 0.086),
    "rtn_60": Row(_RTN, _AT_60, 0.268),
    "blind_60": Row(replace(_RTN, terrain=False), _AT_60, 0.274),
    "no_future": Row(replace(_RTN, future=0), _AT_30, 0.298),
    "scheduled": Row(_RTN, replace(_AT_30, scheduled=True), 0.151),
    "always_taught": Row(_RTN, replace(_AT_30, teacher=1.0), 0.147),
    "never_taught": Row(_RTN, replace(_AT_30, teacher=0.0), 0.109),
    "no_residual": Row(replace(_RTN, residual=False), _AT_30, 0.114),
    "zero_state": Row(replace(_RTN, initial="zero"), _AT_30, 0.095),
    "common_state": Row(replace(_RTN, initial="common"), _AT_30, 0.092),
    # Beyond the paper: what is shipped, and that without the way home.
    SHIPPED: Row(TransitionConfig(), replace(_AT_30, shortest=3, longest=90, world=1.0)),
    "not_homing": Row(TransitionConfig(homing=False), replace(_AT_30, shortest=3, longest=90, world=1.0)),
    # Not recurrent: all frames at once, as what is added to interpolation.
    "delta": Row(DeltaConfig(), replace(_AT_30, shortest=3, longest=90, world=1.0)),
}
# The rows of the tables, in the order of the paper.
TABLES: Mapping[str, tuple[str, ...]] = {
    "Table 2, 30 frames": ("f_reslstm", "f_erd", "rtn", "not_homing", "delta", SHIPPED),
    "Table 3, terrain at 30 frames": ("blind", "rtn"),
    "Table 3, terrain at 60 frames": ("blind_60", "rtn_60"),
    "Table 4, without a part": (
        "no_future", "scheduled", "always_taught", "never_taught", "no_residual", "zero_state",
        "common_state", "rtn",
    ),
}  # fmt: skip

__all__ = ["ROWS", "SHIPPED", "TABLES", "Row", "TransitionSettings"]
