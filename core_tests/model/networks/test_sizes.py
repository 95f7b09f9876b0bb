"""Sizes that a weights file tells are whole numbers that a network can have, or one sentence says which is
not.
"""

from __future__ import annotations

import pytest

from nsm_core.errors import WeightsError
from nsm_core.model.networks.field_config import FieldConfig
from nsm_core.model.networks.handling_config import HandlingConfig
from nsm_core.model.networks.sizes import LARGEST


@pytest.mark.parametrize("config", [FieldConfig(), HandlingConfig(), HandlingConfig(goal_phase=0)])
def test_what_is_written_is_read_back_and_what_is_missing_is_as_ever(config):
    kind = type(config)
    assert kind.from_dict(config.to_dict() | {"of another version": 3}) == config
    assert kind.from_dict({}) == kind()


@pytest.mark.parametrize("kind", [FieldConfig, HandlingConfig])
@pytest.mark.parametrize("value", [0, -2, LARGEST + 1, 2.0, True, "8", None])
def test_what_no_network_has_is_named(kind, value):
    name = next(iter(kind().to_dict()))
    with pytest.raises(WeightsError, match=f"of '{name}', which no network has.*again\\.$"):
        kind.from_dict({name: value})
