"""Every network by its name: a network is its files in this folder and one line here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from nsm_core.errors import WeightsError
from nsm_core.validate import shown

from .config import NetworkConfig
from .nsm_config import NsmConfig
from .nsm_numpy import NumpyNsm
from .protocol import Model, Weights

if TYPE_CHECKING:
    from .trainable import Trainable


@dataclass(frozen=True)
class NetworkKind:
    """A network in the three forms it has: sizes, stepped in numpy, and as the torch module that is trained.

    ``numpy`` makes a stepper of sizes and the weights that fit them; ``module`` makes the untrained module of
    sizes, and is the first to import torch.
    """

    config: type[NetworkConfig]
    numpy: Callable[[Any, Weights], Model]
    module: Callable[[Any], Trainable]


def _nsm(config: NsmConfig) -> Trainable:
    from .nsm import NSM

    return NSM(config)


KINDS = {kind.config.network: kind for kind in (NetworkKind(NsmConfig, NumpyNsm, _nsm),)}


def kind_of(name: Any, holder: object = "The weights file") -> NetworkKind:
    """Network of that name, which ``holder`` is said to hold; WeightsError on a name that is none."""
    if not isinstance(name, str) or name not in KINDS:
        raise WeightsError(
            f"{holder} holds a network called {shown(name)} and this program knows {', '.join(KINDS)}; "
            "update the program or choose other weights."
        )
    return KINDS[name]
