"""Every network by its name: a network is its files in this folder and one line here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from nsm_core.errors import WeightsError
from nsm_core.validate import shown

from .config import NetworkConfig
from .gated_configs import ConcatenatedConfig, MannConfig, PfnnConfig
from .gated_numpy import NumpyConcatenated, NumpyMann, NumpyPfnn
from .lstm_config import AutoLstmConfig, LstmConfig
from .lstm_numpy import NumpyLstm
from .mlp_config import MlpConfig
from .mlp_numpy import NumpyMlp
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


def _torch(module: str, name: str) -> Callable[[Any], Trainable]:
    """Maker of a torch module that is imported when it is first asked for."""

    def make(config: Any) -> Trainable:
        return getattr(import_module(f"{__package__}.{module}"), name)(config)

    return make


KINDS = {
    kind.config.network: kind
    for kind in (
        NetworkKind(NsmConfig, NumpyNsm, _torch("nsm", "NSM")),
        NetworkKind(MlpConfig, NumpyMlp, _torch("mlp", "MLP")),
        NetworkKind(PfnnConfig, NumpyPfnn, _torch("gated", "PFNN")),
        NetworkKind(MannConfig, NumpyMann, _torch("gated", "MANN")),
        NetworkKind(LstmConfig, NumpyLstm, _torch("lstm", "LSTM")),
        NetworkKind(AutoLstmConfig, NumpyLstm, _torch("lstm", "LSTM")),
        NetworkKind(ConcatenatedConfig, NumpyConcatenated, _torch("gated", "Concatenated")),
    )
}


def kind_of(name: Any, holder: object = "The weights file") -> NetworkKind:
    """Network of that name, which ``holder`` is said to hold; WeightsError on a name that is none."""
    if not isinstance(name, str) or name not in KINDS:
        raise WeightsError(
            f"{holder} holds a network called {shown(name)} and this program knows {', '.join(KINDS)}; "
            "update the program or choose other weights."
        )
    return KINDS[name]
