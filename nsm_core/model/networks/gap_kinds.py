"""All networks that fill gaps, by the name that weights files and commands say."""

from __future__ import annotations

from typing import Any

from nsm_core.errors import WeightsError
from nsm_core.validate import shown

from .delta_config import DeltaConfig
from .gap_config import GapConfig
from .rtn_config import ErdConfig, ResLstmConfig, TransitionConfig

_KINDS: tuple[type[GapConfig], ...] = (TransitionConfig, ResLstmConfig, ErdConfig, DeltaConfig)
TRANSITIONS = {kind.network: kind for kind in _KINDS}


def transition_config(name: Any, holder: object = "The weights file") -> type[GapConfig]:
    """Sizes of the network of that name; WeightsError on a name that is none."""
    if not isinstance(name, str) or name not in TRANSITIONS:
        raise WeightsError(
            f"{holder} holds a network called {shown(name)}, and transitions are filled by "
            f"{', '.join(TRANSITIONS)}; update the program or choose other weights."
        )
    return TRANSITIONS[name]


__all__ = ["TRANSITIONS", "transition_config"]
