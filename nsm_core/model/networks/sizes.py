"""Sizes of networks, as weights files tell them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import fields
from typing import Any

from nsm_core.errors import WeightsError
from nsm_core.validate import shown

LARGEST = 100_000  # size that a network of ours may have


def whole_sizes(kind: Any, values: Mapping[str, Any], from_zero: Collection[str] = ()) -> dict[str, int]:
    """What a weights file says of the fields of a dataclass ``kind`` of whole numbers, their defaults where
    it says nothing: 1 or more, those named in ``from_zero`` 0 or more; WeightsError on others.
    """
    known = {field.name: values.get(field.name, field.default) for field in fields(kind)}
    for name, value in known.items():
        if type(value) is not int or not (0 if name in from_zero else 1) <= value <= LARGEST:
            raise no_network_has(name, value)
    return known


def no_network_has(name: str, value: object) -> WeightsError:
    """The error on a size of a network that no network has."""
    return WeightsError(
        f"The weights file says {shown(value)} of '{name}', which no network has; copy or train it again."
    )


__all__ = ["LARGEST", "no_network_has", "whole_sizes"]
