"""Which network a weights file holds, and whether its arrays are that network's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self, TypeVar

from nsm_core.errors import WeightsError
from nsm_core.model.networks.config import NetworkConfig
from nsm_core.model.networks.protocol import Weights
from nsm_core.model.networks.registry import NetworkKind, kind_of
from nsm_core.model.networks.sizes import LARGEST
from nsm_core.validate import number, whole

from .weights_file import Layout, load_weights


class Sized(Protocol):
    """Sizes of a network that a weights file is read for."""

    network: ClassVar[str]

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """Read back what a file says of them; WeightsError on values that no network has."""
        ...

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of all parameters and statistics."""
        ...


_Sized = TypeVar("_Sized", bound=Sized)


def load_network(path: str | Path, layout: Layout, kind: type[_Sized], whose: str) -> tuple[_Sized, Weights]:
    """Sizes and arrays of a weights file that must hold a network of the sizes ``kind``; ``whose`` it is goes
    into the sentence.  WeightsError as of ``load_weights``, and where it holds another one.
    """

    def known(name: object, holder: object) -> None:
        if name != kind.network:
            raise WeightsError(f"{holder} holds another network than {whose}; choose other weights.")

    weights = load_weights(path, layout, known)
    config = kind.from_dict(weights.config)
    require_arrays(weights, config.shapes())
    return config, weights


def network_of(weights: Weights) -> tuple[NetworkKind, NetworkConfig]:
    """Kind and sizes of the network; WeightsError unless the kind is known and every array is there
    and fits.
    """
    kind = kind_of(weights.network)
    config = _sizes(kind, weights)
    require_arrays(weights, config.shapes())
    return kind, config


def require_arrays(weights: Weights, expected: Mapping[str, tuple[int, ...]]) -> None:
    """WeightsError unless every array of the shapes ``expected`` by name is there, and no other."""
    found = {**weights.parameters, **weights.statistics}
    for name, shape in expected.items():
        if name not in found or found[name].shape != shape:
            has = "is missing" if name not in found else f"has shape {found[name].shape}"
            raise WeightsError(
                f"The weights file is incomplete: {name} {has} where {shape} is needed; copy or train it "
                "again."
            )
    if len(found) > len(expected):
        odd = next(name for name in found if name not in expected)
        raise WeightsError(
            f"The weights file holds {odd}, which a network of its sizes has not; copy or train it again."
        )


def _sizes(kind: NetworkKind, weights: Weights) -> NetworkConfig:
    """Sizes that a weights file tells of its network, each one that a network can have."""
    told = weights.config
    try:
        for size in fields(kind.config):
            what = f"'{size.name}' of the network's sizes"
            if isinstance(size.default, float):
                number(told.get(size.name, size.default), what, WeightsError, 0, 1)
            elif size.name in told:
                whole(told[size.name], what, WeightsError, 1, LARGEST)
    except WeightsError as error:
        raise WeightsError(
            f"In the weights file, {str(error).removesuffix('.')}; copy or train it again."
        ) from error
    return kind.config.from_dict(told)
