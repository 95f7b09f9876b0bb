"""The list of takes as it was, to be put back exactly where a change of it is broken off."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import bpy

from .properties import settings_of


class KeptTakes:
    """The takes on a list, which of them is marked, the seed, and which actions are kept without users."""

    def __init__(self, scene: bpy.types.Scene) -> None:
        settings = settings_of(scene)
        self._scene, self._rows = scene, [_values_of(row) for row in settings.takes]
        self._active, self._seed = settings.active_take, settings.seed
        self._fake_users = [(action, action.use_fake_user) for action in bpy.data.actions]

    def restore(self) -> None:
        """Put the list back; references to what no longer exists are left empty."""
        from ..animation.kept import LOST

        settings = settings_of(self._scene)
        settings.takes.clear()
        for values in self._rows:
            _fill(settings.takes.add(), values)
        settings.active_take, settings.seed = self._active, self._seed
        for action, kept in self._fake_users:
            with suppress(*LOST):
                if action.use_fake_user != kept:
                    action.use_fake_user = kept


def _values_of(group: bpy.types.PropertyGroup) -> dict[str, Any]:
    return {
        prop.identifier: _plain(prop, getattr(group, prop.identifier))
        for prop in group.bl_rna.properties
        if prop.identifier != "rna_type"
    }


def _plain(prop: bpy.types.Property, value: Any) -> Any:
    if prop.type == "COLLECTION":
        return [_values_of(row) for row in value]
    if isinstance(value, bpy.types.PropertyGroup):
        return _values_of(value)
    return tuple(value) if getattr(prop, "is_array", False) else value


def _fill(group: bpy.types.PropertyGroup, values: dict[str, Any]) -> None:
    from ..animation.kept import LOST

    for name, value in values.items():
        with suppress(*LOST):
            if isinstance(value, dict):
                _fill(getattr(group, name), value)
            elif isinstance(value, list):
                for row in value:
                    _fill(getattr(group, name).add(), row)
            else:
                setattr(group, name, value)
